// Chooses the cells from the statistics of the spheres.

#include outcome_begin
#include cell_list_levels

const SAMPLES: u32 = 256u;
const MAX_SAMPLES: u32 = 1024u;
// Cell size over diameter: above the rounding of the distance test.
const SLACK: f32 = 0x1.04p0;
// Devices may flush fixed-point units of smaller cells.
const MIN_CELL_SIZE: f32 = 0x1p-90;
// At or above this size, all spheres share one cell, so that nothing overflows.
const MAX_CELL_SIZE: f32 = 0x1p120;
// Keeps rounding at the periodic boundary below SLACK.
const MAX_RING_CELLS: f32 = 32768.0;
// Boxes begin less than 8 cells below centers, and centers of later calls may lie 8 cells below the lowest.
const MARGIN: u32 = 16u;

var<workgroup> largest: array<u32, 256>;
var<workgroup> base_class: atomic<u32>;
var<workgroup> largest_of_all: atomic<u32>;
var<workgroup> packed_levels: array<atomic<u32>, 64>;
var<workgroup> low: array<u32, 3>;
var<workgroup> high: array<u32, 3>;
var<workgroup> samples: u32;
// Sums of a scan, later the cells of samples.
var<workgroup> sampled: array<u32, 1024>;
var<workgroup> sampled_pairs: atomic<u32>;
var<workgroup> unit_exponent: i32;
var<workgroup> units: u32;
var<workgroup> level_radius: f32;
var<workgroup> is_single: u32;
var<workgroup> level_cells: array<vec3<u32>, LEVELS>;
var<workgroup> has_overfull_cells: bool;
var<workgroup> used_levels: u32;

fn power_of_two(exponent: i32) -> f32 {
    return bitcast<f32>(u32(clamp(127 + exponent, 1, 254)) << 23u);
}

fn exponent_of(value: f32) -> i32 {
    return i32((bitcast<u32>(value) >> 23u) & 255u) - 127;
}

// Some compilers of DirectX refuse to store a component by a varying index.
fn with_extent(extents: vec3<f32>, axis: u32, extent: f32) -> vec3<f32> {
    return select(extents, vec3(extent), vec3(0u, 1u, 2u) == vec3(axis));
}

fn with_cells(cells: vec3<u32>, axis: u32, count: u32) -> vec3<u32> {
    return select(cells, vec3(count), vec3(0u, 1u, 2u) == vec3(axis));
}

fn cube_root(value: f32) -> f32 {
    return pow(max(value, 0x1p-120), 1.0 / 3.0);
}

// Chooses the largest diameter of spheres with cells, or up to `cell_ratio` times it if the table is too small.
fn choose_cell_size() {
    let lengths = periods();
    let diameter = 2.0 * (bitcast<f32>(largest[atomicLoad(&base_class)]) * SLACK);
    var extent = vec3(0.0);
    for (var axis = 0u; axis < 3u; axis++) {
        let open = from_sortable(high[axis]) * 0.5 - from_sortable(low[axis]) * 0.5;
        let length = select(2.0 * min(open, 0x1p126), lengths[axis], lengths[axis] > 0.0);
        extent = with_extent(extent, axis, max(length, diameter));
    }
    let capacity = f32(max(params.cells, 1u));
    let spacing = cube_root(extent.x / capacity) * cube_root(extent.y) * cube_root(extent.z);
    let cell_size = max(clamp(spacing, diameter, diameter * max(params.cell_ratio, 1.0)), MIN_CELL_SIZE);
    is_single = select(0u, 1u, !(cell_size < MAX_CELL_SIZE));
    unit_exponent = exponent_of(cell_size) - 6;
    units = u32(ceil(cell_size * power_of_two(-unit_exponent)));
    if (units > 127u) {
        units = 64u;
        unit_exponent += 1;
    }
    level_radius = (f32(units) * 0.5 / SLACK) * power_of_two(unit_exponent);
}

fn open_extent(axis: u32, level: u32) -> u32 {
    return open_number(from_sortable(high[axis]), level) - open_number(from_sortable(low[axis]), level) + 1u;
}

// Divisions cannot overflow, and their rounding does not matter: an integer is at most a quotient exactly if it is at
// most its floor.
fn are_within(cells: vec3<u32>, capacity: u32) -> bool {
    return capacity / cells.x / cells.y >= cells.z;
}

fn cells_wanted(level: u32) -> vec3<u32> {
    let lengths = periods();
    let cell_size = f32(units) * power_of_two(unit_exponent - i32(depth_of(level)));
    var wanted = vec3(1u);
    for (var axis = 0u; axis < 3u; axis++) {
        if (lengths[axis] > 0.0) {
            // Rounded down, because cells must not become narrower.
            let around = min((lengths[axis] / cell_size) * 0x1.ffffep-1, MAX_RING_CELLS);
            let count = select(1u, u32(around), around >= 3.0 && lengths[axis] > MIN_CELL_SIZE);
            wanted = with_cells(wanted, axis, count);
        } else {
            let extent = open_extent(axis, level);
            wanted = with_cells(wanted, axis, select(max(extent, 3u), 1u, extent == 1u));
        }
    }
    return wanted;
}

// Reduces the longest axes to `capacity` cells in all. Searches bit by bit, because a root that is rounded up would
// leave an axis one cell.
fn cells_of_table(wanted: vec3<u32>, capacity: u32) -> vec3<u32> {
    var limit = 0u;
    let leading = countLeadingZeros(max(max(wanted.x, wanted.y), wanted.z));
    for (var bit = leading; bit < 32u; bit++) {
        let more = limit | (0x80000000u >> bit);
        limit = select(limit, more, are_within(min(wanted, vec3(more)), capacity));
    }
    var cells = min(wanted, vec3(max(limit, 3u)));
    // If three cells do not fit, axes get a single cell until all fit.
    for (var axis = 0u; axis < 3u; axis++) {
        if (!are_within(cells, capacity)) {
            cells = with_cells(cells, axis, 1u);
        }
    }
    return cells;
}

fn set_level(level: u32, capacity: u32) {
    let lengths = periods();
    let depth = i32(depth_of(level));
    cell_list.level[level].units_per_length = power_of_two(depth - unit_exponent);
    cell_list.level[level].far = u32(clamp(127 + 30 + unit_exponent - depth, 1, 255)) << 23u;
    cell_list.level[level].max_radius = level_radius * power_of_two(-depth);
    cell_list.level[level].low = vec3(
        open_number(from_sortable(low[0]), level),
        open_number(from_sortable(low[1]), level),
        open_number(from_sortable(low[2]), level),
    ) - vec3(MARGIN);
    var cells = vec3(1u);
    var repeats = vec3(1u);
    if (is_single == 0u) {
        let wanted = cells_wanted(level);
        cells = cells_of_table(wanted, capacity);
        // The table repeats an integer number of times along an axis with more cells, because the first cell follows
        // the last.
        repeats = wanted / cells;
    }
    level_cells[level] = cells;
    cell_list.level[level].cells = cells;
    let used = (lengths > vec3(0.0)) & (cells > vec3(1u));
    let around = select(vec3(1u), cells * repeats, used);
    cell_list.level[level].around = around;
    cell_list.level[level].cells_per_length = select(vec3(0.0), vec3<f32>(around) / max(lengths, vec3(MIN_CELL_SIZE)), used);
}

fn set_call(count: u32) {
    cell_list.spheres = count;
    cell_list.units_per_cell = units;
    sort_counts.items = count;
    let smallest = bitcast<f32>(~atomicLoad(&stats.smallest));
    var farthest = 0.0;
    for (var axis = 0u; axis < 3u; axis++) {
        farthest = max(farthest, max(abs(from_sortable(low[axis])), abs(from_sortable(high[axis]))));
    }
    let widest = bitcast<f32>(atomicLoad(&largest_of_all));
    // Without a valid sphere, the complement of 0 is NaN, and nothing is tested.
    cell_list.ordinary = select(0u, 1u, smallest > 0x1p-40 && farthest < 0x1p58 && widest < 0x1p58);
    outcome_begin(0u, atomicLoad(&stats.quarantined));
    atomicStore(&outcome.pairs_in_cell_order, params.pairs_in_cell_order);
    atomicStore(&outcome.entries_lo, count);
    atomicStore(&stats.smallest, 0u);
    atomicStore(&stats.quarantined, 0u);
}

// Fewer pairs of samples in one cell may be chance.
const MIN_SIGNIFICANT_PAIRS: f32 = 4.0;

fn may_miss(count: u32, samples: u32) -> bool {
    return count > samples && MIN_SIGNIFICANT_PAIRS * f32(count) > f32(params.tau) * f32(samples) * f32(samples);
}

// Each call sets this word to 1.
fn is_first() -> bool {
    return atomicLoad(&outcome.dispatch_z) == 0u;
}

fn sample_cell(number: u32, count: u32) -> u32 {
    let spread = (count / samples) * number + ((count % samples) * number) / samples;
    let index = select(number, spread, count > samples);
    if (index >= count) {
        return 0xffffffffu - number;
    }
    let sphere = spheres[index];
    if (!may_pair(index, sphere) || class_of(effective_radius(index, sphere)) > atomicLoad(&base_class)) {
        return 0xffffffffu - number;
    }
    return cell_of(wrapped_sphere(sphere).xyz, side_of(index) * params.levels_per_side);
}

// Smaller spheres leave overfull cells if samples or the last call found such cells, or in a first call whose samples
// may miss them.
fn decide_descent(count: u32) {
    let finer = atomicLoad(&level_depths[1]) != DEPTHS;
    // The mean occupancy that a sphere sees: the fraction of ordered pairs of samples in one cell, times the spheres.
    let pairs = f32(atomicLoad(&sampled_pairs));
    let share = f32(count) / f32(min(count, samples) * min(count, samples) + 1u);
    let is_seen = pairs >= MIN_SIGNIFICANT_PAIRS && pairs * share > f32(params.tau);
    let was_dense = atomicLoad(&outcome.max_occupancy) > params.tau;
    has_overfull_cells = finer && (is_seen || was_dense || (is_first() && may_miss(count, samples)));
    cell_list.has_overfull_cells = select(0u, 1u, has_overfull_cells);
    atomicStore(&outcome.max_occupancy, 0u);
}

// Only one workgroup may call it.
fn configure(local_index: u32) {
    let count = min(count_source[0], params.spheres);
    var own_members = 0u;
    for (var side = 0u; side < params.sides; side++) {
        own_members += atomicLoad(&stats.members[side * CLASSES + local_index]);
    }
    sampled[local_index] = own_members;
    largest[local_index] = atomicLoad(&stats.largest[local_index]);
    atomicStore(&stats.largest[local_index], 0u);
    if (local_index < LEVELS) {
        atomicStore(&populations[local_index], 0u);
    }
    if (local_index < DEPTHS) {
        atomicStore(&level_depths[local_index], select(DEPTHS, 0u, local_index == 0u));
    }
    if (local_index < MAX_SIDES) {
        atomicStore(&on_side[local_index], 0u);
    }
    if (local_index < 64u) {
        atomicStore(&packed_levels[local_index], 0u);
    }
    if (local_index < 3u) {
        // Without a valid sphere, the bounds are an empty box at 0.
        let seen = atomicLoad(&stats.high[local_index]) != 0u;
        low[local_index] = select(0x80000000u, ~atomicLoad(&stats.low[local_index]), seen);
        high[local_index] = select(0x80000000u, atomicLoad(&stats.high[local_index]), seen);
        atomicStore(&stats.low[local_index], 0u);
        atomicStore(&stats.high[local_index], 0u);
    }
    if (local_index == 0u) {
        atomicStore(&depths, 1u);
        atomicStore(&base_class, 0u);
        atomicStore(&largest_of_all, 0u);
        atomicStore(&sampled_pairs, 0u);
    }
    workgroupBarrier();
    if (largest[local_index] != 0u) {
        atomicMax(&largest_of_all, largest[local_index]);
    }

    var front = 0u;
    for (var step = 1u; step < CLASSES; step *= 2u) {
        var sum = sampled[front + local_index];
        if (local_index + step < CLASSES) {
            sum += sampled[front + local_index + step];
        }
        front = CLASSES - front;
        sampled[front + local_index] = sum;
        workgroupBarrier();
    }
    if (own_members != 0u && sampled[front + local_index] > MAX_LISTED) {
        atomicMax(&base_class, local_index);
    }
    workgroupBarrier();
    if (local_index == 0u) {
        choose_cell_size();
        set_call(count);
        samples = select(SAMPLES, MAX_SAMPLES, is_first() && may_miss(count, SAMPLES));
    }
    workgroupBarrier();

    let is_listed = local_index > atomicLoad(&base_class);
    let depth = finest_depth(bitcast<f32>(largest[local_index]));
    if (own_members != 0u && !is_listed) {
        atomicOr(&depths, 1u << depth);
    }
    workgroupBarrier();
    let level = select(level_of_depth(depth), LISTED, is_listed);
    if (own_members != 0u && !is_listed) {
        atomicMin(&level_depths[level], depth);
        for (var side = 0u; side < params.sides; side++) {
            let count = atomicLoad(&stats.members[side * CLASSES + local_index]);
            atomicAdd(&populations[side * params.levels_per_side + level], count);
            atomicAdd(&on_side[side], count);
        }
    }
    for (var side = 0u; side < params.sides; side++) {
        atomicStore(&stats.members[side * CLASSES + local_index], 0u);
    }
    atomicOr(&packed_levels[local_index / 4u], level << ((local_index % 4u) * 8u));
    workgroupBarrier();
    if (local_index < 64u) {
        cell_list.class_levels[local_index] = atomicLoad(&packed_levels[local_index]);
    }
    if (local_index < LEVELS) {
        level_cells[local_index] = vec3(0u);
    }
    storageBarrier();
    workgroupBarrier();
    if (local_index < LEVELS && is_used(local_index)) {
        // Sides share half of the cells equally, and half by number of spheres.
        let share = 0.5 / f32(params.sides) + 0.5 * f32(spheres_on_side(local_index)) / f32(max(count, 1u));
        let capacity = select(params.cells, u32(f32(params.cells) * share * 0x1.ffffp-1), params.sides > 1u);
        set_level(local_index, max(capacity, 1u));
    }
    storageBarrier();

    let taken = samples;
    for (var round = 0u; round < MAX_SAMPLES / 256u; round++) {
        let number = round * 256u + local_index;
        if (number < taken) {
            sampled[number] = sample_cell(number, count);
        }
    }
    workgroupBarrier();
    var shared_with = 0u;
    for (var round = 0u; round < MAX_SAMPLES / 256u; round++) {
        let number = round * 256u + local_index;
        if (number < taken) {
            // Numbers of samples are multiples of eight. Each sample also meets itself.
            let cell = vec4(sampled[number]);
            var same = vec4(0u);
            for (var eight = 0u; eight < taken / 8u; eight++) {
                let at = 8u * eight;
                let a = vec4(sampled[at], sampled[at + 1u], sampled[at + 2u], sampled[at + 3u]);
                let b = vec4(sampled[at + 4u], sampled[at + 5u], sampled[at + 6u], sampled[at + 7u]);
                same += select(vec4(0u), vec4(1u), a == cell) + select(vec4(0u), vec4(1u), b == cell);
            }
            shared_with += same.x + same.y + same.z + same.w - 1u;
        }
    }
    atomicAdd(&sampled_pairs, shared_with);
    workgroupBarrier();
    if (local_index == 0u) {
        decide_descent(count);
    }
    if (workgroupUniformLoad(&has_overfull_cells) && local_index < LEVELS) {
        let population = atomicLoad(&populations[local_index]);
        var levels = 0.0;
        for (var other = 0u; other < LEVELS; other++) {
            levels += select(0.0, 1.0, is_used(other) || atomicLoad(&populations[other]) != 0u);
        }
        let share = 0.5 / levels + 0.5 * f32(population) / f32(max(count, 1u));
        if (is_used(local_index) || population != 0u) {
            set_level(local_index, max(u32(f32(params.cells) * share * 0x1.ffffp-1), 1u));
        }
    }
    workgroupBarrier();
    if (local_index == 0u) {
        var base = 0u;
        var levels = 0u;
        for (var level = 0u; level < LEVELS; level++) {
            let cells = level_cells[level];
            cell_list.level[level].base = base;
            levels |= select(0u, 1u << level, cells.x != 0u);
            base += cells.x * cells.y * cells.z;
        }
        cell_list.cells = base;
        cell_list.levels = levels;
        used_levels = levels;
        let tiles = (count + max(params.radix_tile, 1u) - 1u) / max(params.radix_tile, 1u);
        // A `dispatch_z` of 1 means that a call has run.
        atomicStore(&outcome.dispatch_x, 0u);
        atomicStore(&outcome.dispatch_y, 1u);
        atomicStore(&outcome.dispatch_z, 1u);
        sort_counts.counters = select(tiles * 256u, base + 2u, params.radix_tile == 0u);
    }
    workgroupBarrier();
    if (local_index < LEVELS && ((used_levels >> local_index) & 1u) != 0u) {
        set_searched_levels(local_index, used_levels);
    }
}
