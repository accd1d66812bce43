// See boundary.rs.
#include vessel

const FROZEN: u32 = 3u;

fn flattened(v: vec3<f32>) -> vec3<f32> {
    return select(v, vec3(0.0), params.axes == vec3(FROZEN));
}

// Some compilers of DirectX refuse a store to a component whose index varies.
fn with_component(v: vec3<f32>, axis: u32, x: f32) -> vec3<f32> {
    return select(v, vec3(x), vec3(0u, 1u, 2u) == vec3(axis));
}

// Makes a direction uniform in the dimensions of the run.
fn direction_within(direction: vec3<f32>) -> vec3<f32> {
    if (params.axes.z != FROZEN) {
        return direction;
    }
    let flat = flattened(direction);
    return flat / max(length(flat), 1e-37);
}

fn confined_axes(x: vec3<f32>, radius: f32) -> vec3<f32> {
    let inset = select(vec3(0.0), vec3(radius), params.axes == vec3(1u));
    let low = params.low + inset;
    let high = params.high - inset;
    let length = high - low;
    let y = x - low;
    let rest = y - 2.0 * length * floor(y / (2.0 * length));
    let folded = clamp(low + (length - abs(length - rest)), low, high);
    let mirrored = select(folded, x, (x >= low) & (x <= high));
    let shifted = x - length * floor(y / length);
    let wrapped = select(low, shifted, (shifted >= low) & (shifted < high));
    let repeated = select(wrapped, x, (x >= low) & (x < high));
    let axes = params.axes;
    // A path beyond the range of floats stays so, which is an error. Compilers may assume that floats are finite, so
    // integers decide.
    let is_infinite = (bitcast<vec3<u32>>(x) & vec3(0x7f800000u)) == vec3(0x7f800000u);
    return flattened(select(select(repeated, mirrored, axes == vec3(1u)), x, (axes == vec3(0u)) | is_infinite));
}

fn confined(x: vec3<f32>, radius: f32) -> vec3<f32> {
    if (params.is_open != 0u) {
        return x;
    }
    let p = confined_axes(x, radius);
    if (params.vessel_axis == NO_VESSEL) {
        return p;
    }
    return confined_in_vessel(p, params.vessel_radius - radius);
}

// True for walls that reverse a particle on its path to x.
fn reversed_axes(x: vec3<f32>, radius: f32) -> vec3<bool> {
    let low = params.low + radius;
    let high = params.high - radius;
    let length = high - low;
    let y = x - low;
    let rest = y - 2.0 * length * floor(y / (2.0 * length));
    return (params.axes == vec3(1u)) & ((x < low) | (x > high)) & (rest > length);
}

fn minimum_image(d: vec3<f32>) -> vec3<f32> {
    let length = params.high - params.low;
    return select(d, d - length * floor(d / length + 0.5), params.axes == vec3(2u));
}
