#include layout
#include thread
#include sphere

@group(0) @binding(0) var<uniform> params: SearchParams;
@group(0) @binding(1) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read_write> bounds: Bounds;
@group(0) @binding(3) var<storage, read_write> grid: Grid;
#include float_order
#include key_hash
#include periods

const SAMPLES: u32 = 256u;
// Factor on the cell size that lets widened boxes of half-size spheres fit the next depth.
const SLACK: f32 = 0x1.04p0;
// Cells on either side of the origin; coordinates beyond share the outermost cell. Within them a box widens by at most
// an eighth of a cell, so it overlaps at most two cells per axis.
const HALF_GRID: f32 = 0x1p17;
// Cells in a ring at depth 0. The upper limit keeps rounding at the boundary below a fraction of a cell. Rings at the
// lower limit, or of a length out of range, have one cell.
const MAX_RING_CELLS: f32 = 0x1p15;
const MIN_RING_CELLS: f32 = 0x1p-40;
const MIN_LENGTH: f32 = 0x1p-80;
const MAX_LENGTH: f32 = 0x1p80;

var<workgroup> samples: array<array<f32, 256>, 3>;
var<workgroup> accepted: atomic<u32>;
var<workgroup> quartiles: array<array<f32, 3>, 3>;

// Compares bits, because devices may flush small periods to 0.
fn is_open(period: f32) -> bool {
    return bitcast<u32>(period) == 0u;
}

// Limits keep every intermediate value finite.
fn cell_of(position: vec3<f32>, origin: vec3<f32>, inverse_edge: vec3<f32>) -> vec3<i32> {
    let offset = clamp(position - origin, vec3(-0x1p126), vec3(0x1p126));
    return vec3<i32>(floor(clamp(offset * inverse_edge, vec3(-HALF_GRID), vec3(HALF_GRID - 1.0))));
}

#ifdef PERIODIC
// Keeps a cluster across the boundary together.
fn from_first(sample: vec3<f32>) -> vec3<f32> {
    let lengths = periods();
    let first = spheres[0].xyz;
    let used = (lengths > vec3(0.0)) & vec3(is_finite(first.x), is_finite(first.y), is_finite(first.z));
    let d = sample - first;
    let shift = select(vec3(0.0), select(lengths, -lengths, d > vec3(0.0)), abs(d) > 0.5 * lengths);
    return select(sample, d + shift, used);
}

// Returns the number of cells at least `cell_size` wide around an axis. With a multiple of four, neither the key hash nor
// the boundary merges neighbors. A smaller power of two means one cell until a depth at which four fit.
fn ring_cells_of(length: f32, cell_size: f32) -> f32 {
    if (is_open(length)) {
        return 0.0;
    }
    if (length < MIN_LENGTH || length > MAX_LENGTH || cell_size >= 0x1p120 || length < cell_size * MIN_RING_CELLS) {
        return MIN_RING_CELLS;
    }
    if (length * (1.0 / MAX_RING_CELLS) >= cell_size) {
        return MAX_RING_CELLS;
    }
    // Rounded down, because cells must not be narrower than `cell_size`.
    let ring_cells = (length / cell_size) * 0x1.ffffep-1;
    if (ring_cells >= 4.0) {
        return 4.0 * floor(0.25 * ring_cells);
    }
    return max(bitcast<f32>(bitcast<u32>(ring_cells) & 0x7f800000u), MIN_RING_CELLS);
}
#else
fn from_first(sample: vec3<f32>) -> vec3<f32> {
    return sample;
}

fn ring_cells_of(length: f32, cell_size: f32) -> f32 {
    return 0.0;
}
#endif

@compute @workgroup_size(256)
fn grid_configure(
#include thread_builtins
) {
#include thread_from_builtins
    let local_index = thread.local_index;
    let count = grid.spheres;
    if (local_index == 0u) {
        atomicStore(&accepted, 0u);
    }
    if (local_index < 3u) {
        quartiles[local_index] = array(0.0, 0.0, 0.0);
    }
    workgroupBarrier();
    // Threads without a valid sphere rank last.
    var sample = vec4(0x1.fffffep127);
    var used = false;
    if (local_index < count) {
        let index = select(local_index, (count / SAMPLES) * local_index + ((count % SAMPLES) * local_index) / SAMPLES, count > SAMPLES);
        let sphere = spheres[index];
        if (is_valid(sphere)) {
            sample = vec4(from_first(sphere.xyz), sphere.w);
            used = true;
            atomicAdd(&accepted, 1u);
        }
    }
    for (var axis = 0u; axis < 3u; axis++) {
        samples[axis][local_index] = sample[axis];
    }
    workgroupBarrier();
    let total = atomicLoad(&accepted);
    if (used) {
        for (var axis = 0u; axis < 3u; axis++) {
            var rank = 0u;
            for (var other = 0u; other < SAMPLES; other++) {
                let value = samples[axis][other];
                rank += select(0u, 1u, value < sample[axis] || (value == sample[axis] && other < local_index));
            }
            for (var quarter = 1u; quarter <= 3u; quarter++) {
                if (rank == (total * quarter) / 4u) {
                    quartiles[axis][quarter - 1u] = sample[axis];
                }
            }
        }
    }
    workgroupBarrier();
    if (local_index != 0u) {
        return;
    }

    let origin = vec3(quartiles[0][1], quartiles[1][1], quartiles[2][1]);
    // Never -0.0: `pow` is undefined for it.
    let spread = abs(vec3(
        quartiles[0][2] * 0.25 - quartiles[0][0] * 0.25,
        quartiles[1][2] * 0.25 - quartiles[1][0] * 0.25,
        quartiles[2][2] * 0.25 - quartiles[2][0] * 0.25,
    ));
    let radius_max = bitcast<f32>(atomicLoad(&bounds.radius_max));
    let radius_min = bitcast<f32>(min(atomicLoad(&bounds.radius_min), 0x7f7fffffu));
    let lengths = periods();
    let open = vec3(is_open(lengths.x), is_open(lengths.y), is_open(lengths.z));
    let aside = select(vec3(0.0), abs(origin), open);
    let far = max(max(aside.x, aside.y), aside.z);
    let spheres_count = f32(max(count, 1u));
    // Sparse points need no cells below about an eighth of their mean distance, in a volume or on a line.
    let volume_spacing = pow(spread.x, 1.0 / 3.0) * pow(spread.y, 1.0 / 3.0) * pow(spread.z, 1.0 / 3.0)
        * pow(spheres_count, -1.0 / 3.0);
    let line_spacing = max(spread.x, max(spread.y, spread.z)) / spheres_count;
    let width = radius_max * params.cell_ratio * select(2.0, 2.0 * SLACK, params.split_policy != 0u);
    let cell_size = max(
        max(width, far * 0x1p-17),
        max(max(volume_spacing, line_spacing), 0x1p-100),
    );
    let ring_cells = vec3(ring_cells_of(lengths.x, cell_size), ring_cells_of(lengths.y, cell_size), ring_cells_of(lengths.z, cell_size));
    let open_inverse = select(0.0, 1.0 / cell_size, cell_size < 0x1p120);
    let ring_inverse = select(vec3(0.0), ring_cells / max(lengths, vec3(MIN_LENGTH)), ring_cells > vec3(MIN_RING_CELLS));
    let inverse_edge = select(ring_inverse, vec3(open_inverse), open);
    let corner = select(-0.5 * lengths, origin, open);
    let lowest = vec3(
        from_sortable(atomicLoad(&bounds.low_x)),
        from_sortable(atomicLoad(&bounds.low_y)),
        from_sortable(atomicLoad(&bounds.low_z)),
    );
    let highest = vec3(
        from_sortable(atomicLoad(&bounds.high_x)),
        from_sortable(atomicLoad(&bounds.high_y)),
        from_sortable(atomicLoad(&bounds.high_z)),
    );
    var low = vec3(0);
    var high = vec3(0);
    if (open_inverse > 0.0 && atomicLoad(&bounds.radius_min) != 0xffffffffu) {
        low = cell_of(lowest, corner, inverse_edge);
        high = max(low, cell_of(highest, corner, inverse_edge));
    }
    // Boxes extend past the boundary by less than a cell.
    low = select(vec3(-1), low, open);
    high = select(vec3<i32>(ring_cells) + vec3(1), high, open);
    let largest = max(
        max(max(abs(lowest.x), abs(lowest.y)), abs(lowest.z)),
        max(max(abs(highest.x), abs(highest.y)), abs(highest.z)),
    );
    grid.origin = corner;
    grid.inverse_edge = inverse_edge;
    grid.ring_cells = ring_cells;
    grid.low = low;
    grid.high = high;
    grid.ordinary = select(0u, 1u, radius_min > 0x1p-40 && largest < 0x1p58);
    // Unless the smallest sphere fits cells of half the size, all have depth 0.
    let finest = max(inverse_edge.x, max(inverse_edge.y, inverse_edge.z));
    let some_fit = 4.0 * params.cell_ratio * (radius_min * finest) < 0x1.01p0;
    grid.split_policy = select(0u, params.split_policy, some_fit && open_inverse > 0.0);
    grid.level_mask = 1u;
    grid.depth_mask = 1u;
    grid.passive = 0u;
    if (params.key_bits != 0u) {
        grid.levels[0] = LevelKeys(hash_bits(axis_bits(low, high, ring_cells, 0u), params.key_bits), 0u);
    }
}
