struct View {
    // World to eye, which looks along -z.
    camera: mat4x4f,
    focal: vec2f,
    // Size of a pixel at distance 1.
    pixel: f32,
    near: f32,
    frame: u32,
    capacity: u32,
    // Half the edge of the box, or 0.
    half: f32,
    largest: f32,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> outcome: array<u32>;
@group(0) @binding(2) var<storage, read> pairs: array<vec2u>;
@group(0) @binding(3) var<storage, read_write> marks: array<atomic<u32>>;

@compute @workgroup_size(256)
fn mark(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u,
        @builtin(local_invocation_index) local: u32) {
    let index = (group.y * groups.x + group.x) * 256u + local;
    let written = select(min(outcome[0], view.capacity), view.capacity, outcome[1] != 0u);
    if (index < written) {
        let pair = pairs[index];
        atomicStore(&marks[pair.x], view.frame);
        atomicStore(&marks[pair.y], view.frame);
    }
}

@group(0) @binding(4) var<storage, read> spheres: array<vec4f>;
@group(0) @binding(5) var<storage, read> marked: array<u32>;

struct Fragment {
    @builtin(position) position: vec4f,
    @location(0) toward: vec3f,
    @location(1) @interpolate(flat) center: vec3f,
    @location(2) @interpolate(flat) radius: f32,
    @location(3) @interpolate(flat) color: vec3f,
}

fn project(at: vec3f) -> vec4f {
    return vec4f(at.xy * view.focal, view.near, -at.z);
}

@vertex
fn sphere_vertex(@builtin(vertex_index) corner: u32, @builtin(instance_index) instance: u32) -> Fragment {
    let sphere = spheres[instance];
    let center = (view.camera * vec4f(sphere.xyz, 1.0)).xyz;
    let distance = -center.z;
    // Spheres below a pixel stay visible.
    let radius = max(sphere.w, 0.6 * view.pixel * distance);
    var out: Fragment;
    // The square covers the circle in which the cone from the eye touches the sphere.
    let ratio = radius * radius / max(dot(center, center), 1e-30);
    let forward = normalize(center);
    let right = normalize(cross(forward, select(vec3f(0.0, 1.0, 0.0), vec3f(1.0, 0.0, 0.0), abs(forward.y) > 0.9)));
    let offset = vec2f(f32(corner & 1u), f32(corner >> 1u)) * 2.0 - 1.0;
    let toward = center * (1.0 - ratio)
        + (right * offset.x + cross(right, forward) * offset.y) * radius * sqrt(max(1.0 - ratio, 0.0));
    out.position = project(toward);
    if (distance < view.near || ratio >= 1.0) {
        out.position = vec4f(0.0, 0.0, -1.0, 1.0);
    }
    out.toward = toward;
    out.center = center;
    out.radius = radius;
    let size = sqrt(sphere.w / view.largest);
    let plain = mix(vec3f(0.30, 0.42, 0.62), vec3f(0.20, 0.62, 0.66), size);
    out.color = select(plain, vec3f(1.0, 0.50, 0.10), marked[instance] == view.frame);
    return out;
}

struct Shaded {
    @location(0) color: vec4f,
    @builtin(frag_depth) depth: f32,
}

@fragment
fn sphere_fragment(in: Fragment) -> Shaded {
    let ray = normalize(in.toward);
    let along = dot(ray, in.center);
    let aside = in.center - ray * along;
    let inside = in.radius * in.radius - dot(aside, aside);
    if (inside < 0.0) {
        discard;
    }
    let hit = ray * (along - sqrt(inside));
    let normal = (hit - in.center) / in.radius;
    let light = 0.42 + 0.58 * max(dot(normal, normalize(vec3f(0.4, 0.7, 0.6))), 0.0);
    let rim = pow(1.0 - max(dot(normal, -ray), 0.0), 3.0) * 0.25;
    var out: Shaded;
    out.color = vec4f(in.color * (light - rim), 1.0);
    out.depth = clamp(view.near / max(-hit.z, view.near), 0.0, 1.0);
    return out;
}

@vertex
fn box_vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
    let edge = index / 2u;
    let axis = edge / 4u;
    let low = f32(edge & 1u) * 2.0 - 1.0;
    let high = f32((edge >> 1u) & 1u) * 2.0 - 1.0;
    let along = f32(index & 1u) * 2.0 - 1.0;
    var corner = vec3f(along, low, high);
    if (axis == 1u) {
        corner = vec3f(low, along, high);
    } else if (axis == 2u) {
        corner = vec3f(low, high, along);
    }
    return project((view.camera * vec4f(corner * view.half, 1.0)).xyz);
}

@fragment
fn box_fragment() -> @location(0) vec4f {
    return vec4f(0.27, 0.33, 0.42, 1.0);
}
