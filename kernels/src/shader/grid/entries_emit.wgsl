// Emits (cell, sphere) entries level by level. An object word has a bit per axis, set in the sphere's first cell. Keys
// mark passive entries: smaller spheres in a split cell, compared only with spheres that stay there.
#include layout
#include thread

@group(0) @binding(0) var<uniform> params: SearchParams;
@group(0) @binding(1) var<storage, read> grid: Grid;
@group(0) @binding(2) var<storage, read> cells: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read_write> occupancy: array<atomic<u32>>;
@group(0) @binding(4) var<storage, read_write> outcome: Outcome;
@group(0) @binding(5) var<storage, read_write> keys: array<u32>;
@group(0) @binding(6) var<storage, read_write> objects: array<u32>;
#include cells
#include occupancy
#include reserve entries
#include workgroup_scan

struct Reservation {
    first: u32,
    descending: u32,
}

var<workgroup> reservation: Reservation;

// One bit per cell.
struct Visit {
    entries: u32,
    passive: u32,
    passed_down: u32,
}

fn key_of(depth: u32, cell: vec3<i32>) -> u32 {
    let level = grid.levels[depth];
    let hashed = vec3<u32>(in_ring(cell, depth)) & ((vec3(1u) << level.bits) - vec3(1u));
    return level.base + (hashed.x | (hashed.y << level.bits.x) | (hashed.z << (level.bits.x + level.bits.y)));
}

// `alive` marks the cells in `above` that passed the sphere down.
fn visit(here: Cells, above: Cells, alive: u32, is_own: bool) -> Visit {
    var found = Visit(0u, 0u, 0u);
    for (var number = 0u; number < 8u; number++) {
        let step = step_of(number);
        let cell = here.first + step;
        if (!has_cell(here, step) || (alive & (1u << parent_of(cell, here.depth, above))) == 0u) {
            continue;
        }
        // At a depth without own spheres, no sphere stays in a cell.
        var is_refined = grid.split_policy == 1u;
        var has_own = (grid.depth_mask & (1u << here.depth)) != 0u;
        if (grid.split_policy == 2u && !is_own) {
            let counted = atomicLoad(&occupancy[occupancy_slot(here.depth, cell)]);
            is_refined = is_overfull(counted);
            has_own = (counted & HAS_OWN) != 0u;
        }
        let bit = 1u << number;
        if (is_own || !is_refined) {
            found.entries |= bit;
        } else {
            found.passed_down |= bit;
            found.entries |= select(0u, bit, has_own);
            found.passive |= select(0u, bit, has_own);
        }
    }
    return found;
}

@compute @workgroup_size(256)
fn entries_emit(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include thread_builtins
) {
#include thread_from_builtins
    let group = workgroup_index(id, groups);
    if (group * WORKGROUP_SIZE >= grid.spheres) {
        return;
    }
    let index = group * WORKGROUP_SIZE + thread.local_index;
    var words = NO_CELLS;
    if (index < grid.spheres) {
        words = cells[index];
    }
    let own = cells_unpacked(words);
    let own_depth = 31u - countLeadingZeros(depths_to(grid.level_mask, own.depth));
    var above = cells_at(own, 0u);
    var alive = select(0u, 0xffu, any(words != NO_CELLS));
    for (var depths = grid.level_mask; depths != 0u; depths &= depths - 1u) {
        let depth = firstTrailingBit(depths);
        var found = Visit(0u, 0u, 0u);
        var here = above;
        if (alive != 0u) {
            here = cells_at(own, depth);
            found = visit(here, above, alive, depth == own_depth);
        }
        // Entries in the lower half, continuing spheres in the upper half.
        let before = workgroup_scan(countOneBits(found.entries) | select(0u, 0x10000u, found.passed_down != 0u), thread);
        if (thread.local_index == 0u) {
            let all = workgroup_sum();
            reservation = Reservation(entries_reserve(all & 0xffffu), all >> 16u);
        }
        let reserved = workgroupUniformLoad(&reservation);
        var at_entry = reserved.first + (before & 0xffffu);
        let fitting = select(0u, found.entries, reserved.first < params.entry_capacity);
        for (var left = fitting; left != 0u; left &= left - 1u) {
            if (at_entry >= params.entry_capacity) {
                break;
            }
            let number = firstTrailingBit(left);
            let step = step_of(number);
            let is_passive = (found.passive >> number) & 1u;
            keys[at_entry] = (key_of(depth, here.first + step) << grid.passive) | is_passive;
            objects[at_entry] = index | ((number ^ 7u) << 29u);
            at_entry += 1u;
        }
        if (reserved.descending == 0u) {
            break;
        }
        above = here;
        alive = found.passed_down;
    }
}
