// Tests a block of 256 sorted spheres, one per thread, with a share of each one's candidates.

const GROUP: u32 = 256u;
// Candidates of one sphere in a share.
const SHARE: u32 = #{SHARE}u;
// Stretches that a walk has at most between two looks at the list of hits; more go on in the next round.
const STRETCHES: u32 = 4096u;
// Hits that the workgroup gathers before they are written.
const HITS: u32 = 1024u;

// One of the sorted spheres.
struct Row {
    sphere: vec4<f32>,
    position: u32,
    species: u32,
}

// Places of two spheres in the sorted order.
var<workgroup> hits: array<vec2<u32>, HITS>;
var<workgroup> hit_count: atomic<u32>;
// Whether some thread has candidates left.
var<workgroup> some_open: atomic<u32>;
// Hits gathered, where they go, and whether a further round follows.
var<workgroup> gathered: vec3<u32>;

// Whether a pair is among those asked for.
fn is_asked_for(a: u32, b: u32) -> bool {
    if (call.window_begin == 0u && call.window_end >= list.spheres && call.split == 0u) {
        return true;
    }
    let i = min(order[a], order[b]);
    let j = max(order[a], order[b]);
    return is_in_window(i) && (call.split == 0u || (i < call.split && j >= call.split));
}

// Tests candidates until all are done or the list of hits is full.
fn gather_hits(walk: ptr<function, Walk>, row: Row, cell: u32, radius: f32) {
    for (var turn = 0u; turn < SHARE + STRETCHES; turn++) {
        if ((*walk).at >= (*walk).end) {
            if (!walk_on(walk, row.position, cell, row.sphere, radius)) {
                (*walk).done = true;
                break;
            }
            let length = max((*walk).end, (*walk).at) - (*walk).at;
            let jump = min((*walk).skip, length);
            (*walk).at += jump;
            (*walk).skip -= jump;
            continue;
        }
        if ((*walk).left == 0u) {
            break;
        }
        let other = (*walk).at;
        if (is_candidate_pair(row, other) && is_asked_for(row.position, other)) {
            let hit = atomicAdd(&hit_count, 1u);
            if (hit >= HITS) {
                break;
            }
            hits[hit] = vec2(row.position, other);
        }
        (*walk).at += 1u;
        (*walk).left -= 1u;
    }
}

#ifdef SPECIES
fn row_of(position: u32) -> Row {
    return Row(sorted[position], position, sorted_species[position]);
}

fn is_candidate_pair(row: Row, other: u32) -> bool {
    return is_pair(row.sphere, sorted[other], row.species, sorted_species[other]);
}

fn radius_of(row: Row) -> f32 {
    let r = reach[row.species];
    return abs(select(r.y, max(r.y, row.sphere.w), r.x != 0.0));
}
#else
fn row_of(position: u32) -> Row {
    return Row(sorted[position], position, 0u);
}

fn is_candidate_pair(row: Row, other: u32) -> bool {
    if (list.ordinary != 0u) {
        return is_within_ordinary(row.sphere, sorted[other]);
    }
    return is_pair(row.sphere, sorted[other]);
}

fn radius_of(row: Row) -> f32 {
    return row.sphere.w;
}
#endif

// Finds the pairs of the block that starts here. Called by all threads of a workgroup. Returns how many candidates
// of this thread's sphere belong to later shares, where it is asked about the first.
fn search_share(block: u32, share: u32, lane: u32) -> u32 {
    let position = block + lane;
    var row: Row;
    var cell = 0u;
    var radius = 0.0;
    var walk: Walk;
    if (position < starts[list.cells + 1u]) {
        row = row_of(position);
        cell = cells[position];
        radius = radius_of(row);
        walk = walk_begin(cell);
        walk.skip = share * SHARE;
        walk.left = SHARE;
    } else {
        walk.done = true;
    }
    if (lane == 0u) {
        atomicStore(&hit_count, 0u);
        atomicStore(&some_open, 0u);
    }
    workgroupBarrier();
    // Each round but the last writes a full list.
    for (var round = 0u; round < SHARE * GROUP / HITS + SHARE; round++) {
        if (!walk.done && walk.left != 0u) {
            gather_hits(&walk, row, cell, radius);
        }
        if (!walk.done && walk.left != 0u) {
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
    if (share == 0u && !walk.done) {
        rest = max(walk.end, walk.at) - walk.at;
        for (var turn = 0u; turn < STRETCHES; turn++) {
            if (!walk_on(&walk, position, cell, row.sphere, radius)) {
                break;
            }
            rest += max(walk.end, walk.at) - walk.at;
        }
    }
    return rest;
}
