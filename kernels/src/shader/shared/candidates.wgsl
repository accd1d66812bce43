// Tests a block of 256 sorted spheres, one per thread, with a share of each one's candidates.

const WORKGROUP_SIZE: u32 = 256u;
// Rows of cells that a sphere looks through between two looks at the list of hits, in all and at one level; it goes on
// with more of them in the next round.
const ROWS: u32 = 256u;
// Hits that the workgroup gathers before they are written.
const HITS: u32 = 1024u;

// One of the sorted spheres.
struct QuerySphere {
    sphere: vec4<f32>,
    position: u32,
    cell: u32,
    species: u32,
}

// Places of two spheres in the sorted order.
var<workgroup> hits: array<vec2<u32>, HITS>;
var<workgroup> hit_count: atomic<u32>;
// 1 if some thread has candidates left.
var<workgroup> some_open: atomic<u32>;
// Hits gathered, where they go, and whether a further round follows.
var<workgroup> gathered: vec3<u32>;

#ifdef SPECIES
fn query_sphere(position: u32) -> QuerySphere {
    return QuerySphere(sorted[position], position, cells[position], sorted_species[position]);
}

// No smaller than the effective radius: what is at home at its level.
fn radius_of(query: QuerySphere) -> f32 {
    return cell_list.level[level_of_cell(query.cell)].max_radius;
}

fn is_ordinary() -> bool {
    return cell_list.ordinary != 0u && params.interaction != BY_SPECIES;
}

// The distance at which a row pairs in the test without guards: the first component, and as much of the other radius as the
// second says. Without a branch per candidate, as that took a third more time for a burst on llvmpipe.
fn ordinary_reach(query: QuerySphere) -> vec2<f32> {
    return select(vec2(params.interaction, 0.0), vec2(query.sphere.w, 1.0), params.interaction == TOUCH);
}

fn is_candidate_pair(query: QuerySphere, other: u32) -> bool {
    return is_pair(query.sphere, sorted[other], query.species, sorted_species[other]);
}

// Returns `true` if hits may be of sides that do not meet: listed spheres are candidates of both sides, and the unguarded
// test does not look at species.
fn mixes_sides() -> bool {
    return params.side_pairs > 1u && is_ordinary() && starts[cell_list.cells] != starts[cell_list.cells + 1u];
}

fn species_pair(query: QuerySphere, other: u32) -> bool {
    return table[query.species * params.species + sorted_species[other]] != NEVER;
}
#else
fn query_sphere(position: u32) -> QuerySphere {
    return QuerySphere(sorted[position], position, cells[position], 0u);
}

// No smaller than the effective radius.
fn radius_of(query: QuerySphere) -> f32 {
    return query.sphere.w;
}

fn is_ordinary() -> bool {
    return cell_list.ordinary != 0u;
}

fn ordinary_reach(query: QuerySphere) -> vec2<f32> {
    return vec2(query.sphere.w, 1.0);
}

fn is_candidate_pair(query: QuerySphere, other: u32) -> bool {
    return is_pair(query.sphere, sorted[other]);
}

fn mixes_sides() -> bool {
    return false;
}

fn species_pair(query: QuerySphere, other: u32) -> bool {
    return true;
}
#endif

// The candidates of `begin..end` that pair with the row, one bit each; at most 32. One of the two loops has no turns.
fn candidate_hits(query: QuerySphere, ranges: CandidateRanges, begin: u32, end: u32) -> u32 {
    var bits = 0u;
    let ordinary_end = select(begin, end, is_ordinary());
    let reach = ordinary_reach(query);
    for (var number = begin; number < ordinary_end; number++) {
        let other = sorted[candidate_at(ranges, number)];
        let d = displacement(query.sphere.xyz, other.xyz);
        let s = reach.x + reach.y * other.w;
        let hit = dot(d, d) <= s * s;
        bits |= select(0u, 1u << (number - begin), hit);
    }
    for (var number = ordinary_end; number < end; number++) {
        let hit = is_candidate_pair(query, candidate_at(ranges, number));
        bits |= select(0u, 1u << (number - begin), hit);
    }
    return bits;
}

// The hits that the call asks for: within its window, across its split, and of sides that meet.
fn asked_for(query: QuerySphere, ranges: CandidateRanges, first: u32, found: u32) -> u32 {
    var bits = found;
    let all = asks_for_all(cell_list.spheres) && !mixes_sides();
    for (var left = select(found, 0u, all); left != 0u; left &= left - 1u) {
        let bit = firstTrailingBit(left);
        let other = candidate_at(ranges, first + bit);
        let hit = is_asked_for(order[query.position], order[other]) && species_pair(query, other);
        bits &= ~select(1u << bit, 0u, hit);
    }
    return bits;
}

// Tests the candidates `begin..end`. Returns the first that it did not take, as the list of hits was full.
fn gather_candidates(query: QuerySphere, ranges: CandidateRanges, begin: u32, end: u32) -> u32 {
    var reached = end;
    let chunks = (end - begin + 31u) / 32u;
    for (var chunk = 0u; chunk < chunks; chunk++) {
        let first = begin + chunk * 32u;
        let bits = asked_for(query, ranges, first, candidate_hits(query, ranges, first, min(first + 32u, end)));
        if (bits != 0u) {
            var hit = atomicAdd(&hit_count, countOneBits(bits));
            var open = bits;
            for (var left = bits; left != 0u; left &= left - 1u) {
                if (hit >= HITS) {
                    break;
                }
                hits[hit] = vec2(query.position, candidate_at(ranges, first + firstTrailingBit(left)));
                hit += 1u;
                open &= open - 1u;
            }
            if (open != 0u) {
                reached = first + firstTrailingBit(open);
                break;
            }
        }
    }
    return reached;
}

// Tests candidates until the walk or its share is at an end or the list of hits is full. The first share goes on to the
// end of the walk, to count the candidates that are left to others.
fn gather_hits(neighbors: ptr<function, NeighborCells>, query: QuerySphere, share: u32) {
    let share_begin = share * params.candidates_per_invocation;
    let share_end = share_begin + params.candidates_per_invocation;
    for (var turn = 0u; turn < ROWS; turn++) {
        for (var at_level = 0u; at_level < ROWS; at_level++) {
            let ranges = next_ranges(*neighbors, query.position, query.cell);
            let begin = min(max((*neighbors).tested, max(share_begin, (*neighbors).skipped) - (*neighbors).skipped), ranges.total);
            let end = clamp(max(share_end, (*neighbors).skipped) - (*neighbors).skipped, begin, ranges.total);
            (*neighbors).tested = gather_candidates(query, ranges, begin, end);
            if ((*neighbors).tested != end) {
                return;
            }
            skip_rows(neighbors, ranges);
            if (share != 0u && (*neighbors).skipped >= share_end) {
                (*neighbors).level = NO_LEVEL;
                return;
            }
            if ((*neighbors).row == (*neighbors).end) {
                break;
            }
        }
        if ((*neighbors).row == (*neighbors).end) {
            next_level(neighbors, query.sphere, radius_of(query));
        }
        if ((*neighbors).level == NO_LEVEL) {
            return;
        }
    }
}

// The name of the sphere at a place in a pair.
fn name_of(position: u32) -> u32 {
    var name = position;
    if (params.pairs_in_cell_order == 0u) {
        name = order[position];
    }
    return name;
}

// Finds the pairs of the block that starts here. Called by all threads of a workgroup. Returns how many candidates
// of this thread's sphere belong to later shares, where it is asked about the first.
fn search_candidates(block: u32, share: u32, lane: u32) -> u32 {
    var query: QuerySphere;
    var neighbors: NeighborCells;
    neighbors.level = NO_LEVEL;
    if (block + lane < starts[cell_list.cells + 1u]) {
        query = query_sphere(block + lane);
        neighbors = neighbor_cells_of(query.cell);
    }
    if (lane == 0u) {
        atomicStore(&hit_count, 0u);
        atomicStore(&some_open, 0u);
    }
    workgroupBarrier();
    // A round ends with a full list of hits, or with many rows of cells behind some sphere.
    for (var round = 0u; round < 2u * params.candidates_per_invocation * WORKGROUP_SIZE / HITS; round++) {
        if (neighbors.level != NO_LEVEL) {
            gather_hits(&neighbors, query, share);
            if (neighbors.level != NO_LEVEL) {
                atomicStore(&some_open, 1u);
            }
        }
        workgroupBarrier();
        if (lane == 0u) {
            let count = min(atomicLoad(&hit_count), HITS);
            var first = 0u;
            if (count != 0u) {
                first = found_reserve(count);
            }
            gathered = vec3(count, first, atomicLoad(&some_open));
            atomicStore(&hit_count, 0u);
            atomicStore(&some_open, 0u);
        }
        let written = workgroupUniformLoad(&gathered);
        if (written.y < params.pair_capacity) {
            for (var turn = 0u; turn < HITS / WORKGROUP_SIZE; turn++) {
                let hit = turn * WORKGROUP_SIZE + lane;
                if (hit < written.x) {
                    pair_write(written.y + hit, name_of(hits[hit].x), name_of(hits[hit].y));
                }
            }
        }
        if (written.z == 0u) {
            break;
        }
        workgroupBarrier();
    }
    return max(neighbors.skipped, params.candidates_per_invocation) - params.candidates_per_invocation;
}
