// Positions at time 0 are integers below 2^24 times one factor, so the host computes the same bits
// (`page/scenes.rs`).

struct Scene {
    count: u32,
    // 0 uniform in a cube, 1 normal about the origin.
    is_burst: u32,
    seed: u32,
    classes: u32,
    scale: f32,
    time: f32,
    giant_radius: f32,
    giants: u32,
    radii: array<vec4f, 3>,
}

@group(0) @binding(0) var<uniform> scene: Scene;
@group(0) @binding(1) var<storage, read_write> spheres: array<vec4f>;

fn word(index: u32, stream: u32) -> u32 {
    var x = index * 0x9e3779b1u + stream * 0x85ebca77u + scene.seed;
    x = (x ^ (x >> 16u)) * 0x7feb352du;
    x = (x ^ (x >> 15u)) * 0x846ca68bu;
    return x ^ (x >> 16u);
}

// Uniform in -2^23 .. 2^23.
fn centered(index: u32, stream: u32) -> i32 {
    return i32(word(index, stream) >> 8u) - 8388608;
}

// A sum of eight uniform numbers, nearly normal.
fn bell(index: u32, axis: u32) -> i32 {
    var sum = 0u;
    for (var k = 0u; k < 8u; k++) {
        sum += word(index, 8u * axis + k + 8u) >> 11u;
    }
    return i32(sum) - 8388608;
}

fn radius_of(index: u32) -> f32 {
    if (index < scene.giants) {
        return scene.giant_radius;
    }
    let class_index = ((word(index, 3u) >> 16u) * scene.classes) >> 16u;
    return scene.radii[class_index / 4u][class_index % 4u];
}

fn folded(x: f32, half: f32) -> f32 {
    let turns = (x + half) / (4.0 * half);
    return (abs(fract(turns) - 0.5) * -4.0 + 1.0) * half;
}

@compute @workgroup_size(256)
fn place(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u,
         @builtin(local_invocation_index) local: u32) {
    let index = (group.y * groups.x + group.x) * 256u + local;
    if (index >= scene.count) {
        return;
    }
    let radius = radius_of(index);
    var center = vec3f();
    if (scene.is_burst != 0u) {
        center = vec3f(f32(bell(index, 0u)), f32(bell(index, 1u)), f32(bell(index, 2u))) * scene.scale;
        if (scene.time != 0.0) {
            let phase = vec3f(f32(word(index, 4u) >> 8u), f32(word(index, 5u) >> 8u), f32(word(index, 6u) >> 8u)) * 3.7e-7;
            center += sin(phase + scene.time * (1.0 + fract(phase.zxy))) * 2e5 * scene.scale;
        }
    } else {
        center = vec3f(f32(centered(index, 0u)), f32(centered(index, 1u)), f32(centered(index, 2u))) * scene.scale;
        if (scene.time != 0.0) {
            let velocity = vec3f(f32(centered(index, 4u)), f32(centered(index, 5u)), f32(centered(index, 6u))) * 1.2e-7;
            let half = 8388608.0 * scene.scale;
            let moved = center + velocity * scene.time;
            center = vec3f(folded(moved.x, half), folded(moved.y, half), folded(moved.z, half));
        }
    }
    spheres[index] = vec4f(center, radius);
}
