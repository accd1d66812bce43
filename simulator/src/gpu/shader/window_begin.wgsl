// See collisions/mod.rs.
#include control
#include params
#include boundary
#include window

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> control: Control;
@group(0) @binding(2) var<storage, read_write> window: Window;

const ALLOWANCE: f32 = 0.25;
const TOP_SPEED: f32 = 1.15;

// Inverse of collisions_begin's key.
fn coordinate(key: u32) -> f32 {
    return bitcast<f32>(select(~key, key & 0x7fffffffu, (key & 0x80000000u) != 0u));
}

fn largest_allowance() -> f32 {
    let largest = params.largest_radius;
    var volume = 1.0;
    var dimensions = 0.0;
    var image = NO_LIMIT;
    for (var k = 0u; k < 3u; k++) {
        if (params.axes[k] == FROZEN) {
            continue;
        }
        dimensions += 1.0;
        var extent = params.high[k] - params.low[k];
        if (params.axes[k] == 0u) {
            extent = coordinate(atomicLoad(&window.highs[k])) - coordinate(~atomicLoad(&window.lows[k]));
        } else if (params.axes[k] == 2u) {
            image = min(image, max(0.25 * extent - largest, 0.01 * largest));
        }
        volume *= max(extent, largest);
    }
    let spacing = pow(volume / f32(control.count), 1.0 / dimensions);
    return min(image, max(ALLOWANCE * spacing, ALLOWANCE * largest));
}

const NO_LIMIT: f32 = 3e38;

@compute @workgroup_size(1)
fn window_begin() {
    window.now = window.horizon;
    let fastest = bitcast<f32>(atomicLoad(&window.fastest));
    let moves = fastest > 0.0 && fastest < NO_LIMIT;
    window.count = 0u;
    window.pairs = 0u;
    if (atomicLoad(&control.halted) != 0u || control.count == 0u || window.now >= 1.0 || !moves) {
        if (!moves) {
            window.horizon = 1.0;
        }
        return;
    }
    if (window.now == 0.0) {
        window.largest_allowance = largest_allowance();
    }
    window.count = control.count;
    window.top_speed = TOP_SPEED * control.speed_factor * fastest;
    window.allowance = min(window.largest_allowance, window.top_speed * (1.0 - window.now));
    let end = window.now + window.allowance / window.top_speed;
    window.horizon = select(end, 1.0, end > 0.999999);
    atomicStore(&window.listed, 0u);
    atomicStore(&window.fastest, 0u);
    atomicStore(&window.earliest[0], LATER);
    atomicStore(&window.earliest[1], 0u);
}
