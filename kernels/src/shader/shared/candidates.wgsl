// Tests 256 sorted spheres, one per thread, with a chunk of each sphere's candidates.

const WORKGROUP_SIZE: u32 = 256u;
const ROWS: u32 = 256u;
const HITS: u32 = 1024u;

// A bit for each hit of a batch beyond the list. `number` is the first one's position in the list, later in the output.
struct HitOverflow {
    bits: u32,
    number: u32,
}

struct QuerySphere {
    sphere: vec4<f32>,
    position: u32,
    cell: u32,
    species: u32,
}

var<workgroup> hits: array<vec2<u32>, HITS>;
var<workgroup> hit_count: atomic<u32>;
var<workgroup> has_more: atomic<u32>;
// The number of hits, their output position, and 1 if a further round follows.
var<workgroup> gathered: vec3<u32>;

#ifdef SPECIES
fn query_sphere(position: u32) -> QuerySphere {
    return QuerySphere(sorted[position], position, cells[position], sorted_species[position]);
}

// Spheres of a narrow side pair with other sides within twice the larger radius.
fn cutoff_at(query: QuerySphere, level: u32) -> f32 {
    let levels = vec2(level_of_cell(query.cell), level);
    let radii = vec2(cell_list.level[levels.x].max_radius, cell_list.level[levels.y].max_radius);
    let sides = levels / params.levels_per_side;
    let is_narrow = (((params.narrow_sides >> sides.x) | (params.narrow_sides >> sides.y)) & 1u) != 0u;
    return select(radii.x + radii.y, 2.0 * max(radii.x, radii.y), is_narrow && sides.x != sides.y);
}

fn is_ordinary() -> bool {
    return cell_list.ordinary != 0u && params.interaction != BY_SPECIES;
}

// The cutoff of the unguarded test: the first component plus the second times the other radius. A branch per candidate
// slowed a burst on llvmpipe by a third.
fn ordinary_cutoff(query: QuerySphere) -> vec2<f32> {
    return select(vec2(params.interaction, 0.0), vec2(query.sphere.w, 1.0), params.interaction == TOUCH);
}

fn is_candidate_pair(query: QuerySphere, other: u32) -> bool {
    return is_pair(query.sphere, sorted[other], query.species, sorted_species[other]);
}

// Listed spheres are candidates of all sides, and the test without guards ignores species.
fn mixes_sides() -> bool {
    return params.sides > 1u && is_ordinary() && starts[cell_list.cells] != starts[cell_list.cells + 1u];
}

fn species_pair(query: QuerySphere, other: u32) -> bool {
    return table[query.species * params.species + sorted_species[other]] != NEVER;
}
#else
fn query_sphere(position: u32) -> QuerySphere {
    return QuerySphere(sorted[position], position, cells[position], 0u);
}

fn cutoff_at(query: QuerySphere, level: u32) -> f32 {
    return query.sphere.w + cell_list.level[level].max_radius;
}

fn is_ordinary() -> bool {
    return cell_list.ordinary != 0u;
}

fn ordinary_cutoff(query: QuerySphere) -> vec2<f32> {
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

// One of the two loops is empty.
fn candidate_hits(query: QuerySphere, ranges: CandidateRanges, begin: u32, end: u32) -> u32 {
    var bits = 0u;
    let ordinary_end = select(begin, end, is_ordinary());
    let cutoff = ordinary_cutoff(query);
    for (var number = begin; number < ordinary_end; number++) {
        let other = sorted[candidate_at(ranges, number)];
        let d = displacement(query.sphere.xyz, other.xyz);
        let s = cutoff.x + cutoff.y * other.w;
        let hit = dot(d, d) <= s * s;
        bits |= select(0u, 1u << (number - begin), hit);
    }
    for (var number = ordinary_end; number < end; number++) {
        let hit = is_candidate_pair(query, candidate_at(ranges, number));
        bits |= select(0u, 1u << (number - begin), hit);
    }
    return bits;
}

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

// Returns the first candidate whose hits overflow the list, or `end`.
fn gather_candidates(
    query: QuerySphere,
    ranges: CandidateRanges,
    begin: u32,
    end: u32,
    overflow: ptr<function, HitOverflow>,
) -> u32 {
    var reached = end;
    let batches = (end - begin + 31u) / 32u;
    for (var batch = 0u; batch < batches; batch++) {
        let first = begin + batch * 32u;
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
                *overflow = HitOverflow(open, hit);
                reached = first;
                break;
            }
        }
    }
    return reached;
}

fn write_overflow(query: QuerySphere, ranges: CandidateRanges, first: u32, overflow: HitOverflow) {
    var at_pair = overflow.number;
    for (var left = overflow.bits; left != 0u; left &= left - 1u) {
        let other = candidate_at(ranges, first + firstTrailingBit(left));
        pair_write(at_pair, index_in_pair(query.position), index_in_pair(other));
        at_pair += 1u;
    }
}

fn next_level(neighbors: ptr<function, NeighborCells>, query: QuerySphere) {
    let levels = (*neighbors).levels;
    (*neighbors).level = NO_LEVEL;
    if (levels != 0u) {
        let next = firstLeadingBit(levels);
        (*neighbors).levels = levels & ~(1u << next);
        enter_level(neighbors, next, query.sphere, cutoff_at(query, next));
    }
}

// Collects hits until the candidates, the chunk or the space in the list end. The first chunk continues, to count the
// remaining candidates.
fn gather_hits(
    neighbors: ptr<function, NeighborCells>,
    query: QuerySphere,
    chunk: u32,
    overflow: ptr<function, HitOverflow>,
) {
    let chunk_begin = chunk * params.candidates_per_invocation;
    let chunk_end = chunk_begin + params.candidates_per_invocation;
    for (var iteration = 0u; iteration < ROWS; iteration++) {
        for (var at_level = 0u; at_level < ROWS; at_level++) {
            let ranges = next_ranges(*neighbors, query.position, query.cell);
            if ((*overflow).bits != 0u) {
                write_overflow(query, ranges, (*neighbors).tested, *overflow);
                (*overflow).bits = 0u;
                (*neighbors).tested += 32u;
            }
            let begin = min(max((*neighbors).tested, max(chunk_begin, (*neighbors).skipped) - (*neighbors).skipped), ranges.total);
            let end = clamp(max(chunk_end, (*neighbors).skipped) - (*neighbors).skipped, begin, ranges.total);
            (*neighbors).tested = gather_candidates(query, ranges, begin, end, overflow);
            if ((*neighbors).tested != end) {
                return;
            }
            skip_rows(neighbors, ranges);
            if (chunk != 0u && (*neighbors).skipped >= chunk_end) {
                (*neighbors).level = NO_LEVEL;
                return;
            }
            if ((*neighbors).row == (*neighbors).end) {
                break;
            }
        }
        if ((*neighbors).row == (*neighbors).end) {
            next_level(neighbors, query);
        }
        if ((*neighbors).level == NO_LEVEL) {
            return;
        }
    }
}

fn index_in_pair(position: u32) -> u32 {
    var index = position;
    if (params.pairs_in_cell_order == 0u) {
        index = order[position];
    }
    return index;
}

// Stores the overflow flag and the dispatch arguments. Both only grow, so workgroups may run in any order, and the call
// needs no further dispatch.
fn finish_outcome(found: u32) {
    if (found > params.pair_capacity) {
        atomicOr(&outcome.overflow, 1u);
    }
    let groups = consumer_groups(min(found, params.pair_capacity));
    atomicMax(&outcome.dispatch_x, groups.x);
    atomicMax(&outcome.dispatch_y, groups.y);
}

// Whole workgroups must call it. For the first chunk, returns the number of later candidates.
fn search_candidates(block: u32, chunk: u32, local_index: u32) -> u32 {
    var query: QuerySphere;
    var neighbors: NeighborCells;
    neighbors.level = NO_LEVEL;
    var overflow: HitOverflow;
    if (block + local_index < starts[cell_list.cells + 1u] && !is_refused()) {
        query = query_sphere(block + local_index);
        neighbors = neighbor_cells_of(query.cell);
    }
    if (local_index == 0u) {
        atomicStore(&hit_count, 0u);
        atomicStore(&has_more, 0u);
    }
    workgroupBarrier();
    // A round ends with a full list, the last candidates or the most iterations.
    for (var round = 0u; round < 2u * params.candidates_per_invocation * WORKGROUP_SIZE / HITS; round++) {
        if (neighbors.level != NO_LEVEL) {
            gather_hits(&neighbors, query, chunk, &overflow);
            if (neighbors.level != NO_LEVEL) {
                atomicStore(&has_more, 1u);
            }
        }
        workgroupBarrier();
        if (local_index == 0u) {
            let count = atomicLoad(&hit_count);
            var first = 0u;
            if (count != 0u) {
                first = found_reserve(count);
                if (params.chunks_per_block != 0u) {
                    finish_outcome(first + count);
                }
            }
            gathered = vec3(count, first, atomicLoad(&has_more));
            atomicStore(&hit_count, 0u);
            atomicStore(&has_more, 0u);
        }
        let written = workgroupUniformLoad(&gathered);
        // A full output has no position for further hits. A sum could wrap.
        overflow.number = select(params.pair_capacity, written.y + overflow.number, written.y < params.pair_capacity);
        if (written.y < params.pair_capacity) {
            for (var iteration = 0u; iteration < HITS / WORKGROUP_SIZE; iteration++) {
                let hit = iteration * WORKGROUP_SIZE + local_index;
                if (hit < written.x) {
                    pair_write(written.y + hit, index_in_pair(hits[hit].x), index_in_pair(hits[hit].y));
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
