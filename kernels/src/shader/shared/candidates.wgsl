// Tests a block of 256 sorted spheres, one per thread, with a share of each one's candidates.

const GROUP: u32 = 256u;
// Candidates of one sphere in a share.
const SHARE: u32 = #{SHARE}u;
// Rows of cells that a sphere looks through between two looks at the list of hits, in all and at one level; it goes on
// with more of them in the next round.
const ROWS: u32 = 256u;
// Hits that the workgroup gathers before they are written.
const HITS: u32 = 1024u;

// One of the sorted spheres.
struct Row {
    sphere: vec4<f32>,
    // Its effective radius.
    radius: f32,
    position: u32,
    cell: u32,
    species: u32,
}

// Places of two spheres in the sorted order.
var<workgroup> hits: array<vec2<u32>, HITS>;
var<workgroup> hit_count: atomic<u32>;
// Whether some thread has candidates left.
var<workgroup> some_open: atomic<u32>;
// Hits gathered, where they go, and whether a further round follows.
var<workgroup> gathered: vec3<u32>;

#ifdef SPECIES
fn row_of(position: u32) -> Row {
    let sphere = sorted[position];
    let kind = sorted_species[position];
    let half = reach[kind];
    let radius = abs(select(half.y, max(half.y, sphere.w), half.x != 0.0));
    return Row(sphere, radius, position, cells[position], kind);
}

fn is_ordinary() -> bool {
    return false;
}

fn is_candidate_pair(row: Row, other: u32) -> bool {
    return is_pair(row.sphere, sorted[other], row.species, sorted_species[other]);
}
#else
fn row_of(position: u32) -> Row {
    let sphere = sorted[position];
    return Row(sphere, sphere.w, position, cells[position], 0u);
}

fn is_ordinary() -> bool {
    return list.ordinary != 0u;
}

fn is_candidate_pair(row: Row, other: u32) -> bool {
    return is_pair(row.sphere, sorted[other]);
}
#endif

// Whether a pair is among those asked for.
fn is_asked_for(a: u32, b: u32) -> bool {
    if (call.window_begin == 0u && call.window_end >= list.spheres && call.split == 0u) {
        return true;
    }
    let i = min(order[a], order[b]);
    let j = max(order[a], order[b]);
    return is_in_window(i) && (call.split == 0u || (i < call.split && j >= call.split));
}

// Which of the candidates from `begin` on pair with the row, one bit each; at most 32. Two loops, of which one has no
// turns, as some devices run both sides of a branch.
fn candidate_hits(row: Row, begin: u32, end: u32) -> u32 {
    var bits = 0u;
    let ordinary_end = select(begin, end, is_ordinary());
    for (var other = begin; other < ordinary_end; other++) {
        bits |= select(0u, 1u << (other - begin), is_within_ordinary(row.sphere, sorted[other]));
    }
    for (var other = ordinary_end; other < end; other++) {
        bits |= select(0u, 1u << (other - begin), is_candidate_pair(row, other));
    }
    return bits;
}

// Tests the candidates from `begin` on. Returns the first that it did not take, as the list of hits was full.
fn gather_stretch(row: Row, begin: u32, end: u32) -> u32 {
    let chunks = (end - begin + 31u) / 32u;
    for (var chunk = 0u; chunk < chunks; chunk++) {
        let first = begin + chunk * 32u;
        for (var bits = candidate_hits(row, first, min(first + 32u, end)); bits != 0u; bits &= bits - 1u) {
            let other = first + firstTrailingBit(bits);
            if (is_asked_for(row.position, other)) {
                let hit = atomicAdd(&hit_count, 1u);
                if (hit >= HITS) {
                    return other;
                }
                hits[hit] = vec2(row.position, other);
            }
        }
    }
    return end;
}

// Tests candidates until the walk or its share is at an end or the list of hits is full.
fn gather_hits(walk: ptr<function, Walk>, row: Row) {
    for (var turn = 0u; turn < ROWS; turn++) {
        for (var stretch = 0u; stretch < ROWS; stretch++) {
            if ((*walk).at == (*walk).end) {
                if ((*walk).rows + (*walk).beyond == 0u) {
                    break;
                }
                next_stretch(walk);
            }
            let skipped = min((*walk).skip, (*walk).end - (*walk).at);
            let begin = (*walk).at + skipped;
            let end = begin + min((*walk).left, (*walk).end - begin);
            let taken = gather_stretch(row, begin, end);
            (*walk).skip -= skipped;
            (*walk).left -= taken - begin;
            (*walk).at = taken;
            if (taken != (*walk).end) {
                return;
            }
        }
        if ((*walk).at == (*walk).end && (*walk).rows + (*walk).beyond == 0u) {
            walk_up(walk, row.sphere, row.radius);
        }
        if ((*walk).level == NOWHERE) {
            return;
        }
    }
}

// How many candidates are left on the way.
fn candidates_left(walk: ptr<function, Walk>, row: Row) -> u32 {
    var left = 0u;
    for (var turn = 0u; turn < ROWS; turn++) {
        if ((*walk).level == NOWHERE) {
            break;
        }
        for (var stretch = 0u; stretch < ROWS; stretch++) {
            left += (*walk).end - (*walk).at;
            (*walk).at = (*walk).end;
            if ((*walk).rows + (*walk).beyond == 0u) {
                break;
            }
            next_stretch(walk);
        }
        if ((*walk).rows + (*walk).beyond == 0u) {
            walk_up(walk, row.sphere, row.radius);
        }
    }
    return left;
}

// Finds the pairs of the block that starts here. Called by all threads of a workgroup. Returns how many candidates
// of this thread's sphere belong to later shares, where it is asked about the first.
fn search_share(block: u32, share: u32, lane: u32) -> u32 {
    var row: Row;
    var walk: Walk;
    walk.level = NOWHERE;
    if (block + lane < starts[list.cells + 1u]) {
        row = row_of(block + lane);
        walk = walk_begin(row.position, row.cell);
        walk.skip = share * SHARE;
        walk.left = SHARE;
    }
    if (lane == 0u) {
        atomicStore(&hit_count, 0u);
        atomicStore(&some_open, 0u);
    }
    workgroupBarrier();
    // A round ends with a full list of hits, or with many rows of cells behind some sphere.
    for (var round = 0u; round < 2u * SHARE * GROUP / HITS; round++) {
        if (walk.left != 0u) {
            gather_hits(&walk, row);
        }
        if (walk.left != 0u && walk.level != NOWHERE) {
            atomicStore(&some_open, 1u);
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
        if (written.y < call.pair_capacity) {
            for (var turn = 0u; turn < HITS / GROUP; turn++) {
                let hit = turn * GROUP + lane;
                if (hit < written.x) {
                    pair_write(written.y + hit, order[hits[hit].x], order[hits[hit].y]);
                }
            }
        }
        if (written.z == 0u) {
            break;
        }
        workgroupBarrier();
    }
    var rest = 0u;
    if (share == 0u) {
        rest = candidates_left(&walk, row);
    }
    return rest;
}
