const HALF_EDGE: f32 = 50.0;

struct Particle {
    position: vec3<f32>,
    radius: f32,
    velocity: vec3<f32>,
    unused: f32,
}

@group(0) @binding(0) var<storage, read_write> particles: array<Particle>;
@group(0) @binding(1) var<storage, read_write> contacts: array<atomic<u32>>;

@compute @workgroup_size(256)
fn move_particles(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x < arrayLength(&particles)) {
        var particle = particles[id.x];
        particle.position += particle.velocity;
        let outside = abs(particle.position) > vec3(HALF_EDGE);
        particle.velocity = select(particle.velocity, -sign(particle.position) * abs(particle.velocity), outside);
        particles[id.x] = particle;
        atomicStore(&contacts[id.x], 0u);
    }
}

// The first word is the number of pairs. The buffer holds all pairs, so the overflow flag is not read.
@group(1) @binding(0) var<storage, read> outcome: array<u32>;
@group(1) @binding(1) var<storage, read> pairs: array<vec2<u32>>;

@compute @workgroup_size(256)
fn count_contacts(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local_index: u32,
) {
    let index = (group.x + group.y * groups.x) * 256u + local_index;
    if (index < min(outcome[0], arrayLength(&pairs))) {
        atomicAdd(&contacts[pairs[index].x], 1u);
        atomicAdd(&contacts[pairs[index].y], 1u);
    }
}

@group(0) @binding(0) var<storage, read> drawn: array<Particle>;
@group(0) @binding(1) var<storage, read> drawn_contacts: array<u32>;

struct Corner {
    @builtin(position) position: vec4<f32>,
    @location(0) offset: vec2<f32>,
    @location(1) color: vec3<f32>,
}

@vertex
fn particle_corner(@builtin(vertex_index) vertex: u32, @builtin(instance_index) index: u32) -> Corner {
    let particle = drawn[index];
    let corner = vertex % 3u + vertex / 3u;
    let offset = vec2(f32(corner & 1u), f32(corner >> 1u)) * 2.0 - 1.0;
    let at = (particle.position.xy + offset * particle.radius) / HALF_EDGE;
    let depth = 0.5 + 0.5 * particle.position.z / HALF_EDGE;
    let touches = min(f32(drawn_contacts[index]), 3.0) / 3.0;
    let color = mix(vec3(0.2, 0.4, 0.7), vec3(1.0, 0.5, 0.1), touches) * (0.3 + 0.7 * depth);
    return Corner(vec4(at, 0.0, 1.0), offset, color);
}

@fragment
fn particle_color(corner: Corner) -> @location(0) vec4<f32> {
    if (dot(corner.offset, corner.offset) > 1.0) {
        discard;
    }
    return vec4(corner.color, 1.0);
}
