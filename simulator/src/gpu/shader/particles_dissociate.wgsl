// The first product replaces the particle; born_place assigns ids to second ones. See dissociation.rs.
#include control
#include params
#include philox
#include normal
#include velocity
#include boundary
#include candidate
#include born
#include tag

// The table begins with the first channel of each species.
struct DissociationRow {
    threshold: u32,
    next: u32,
    // NOTHING if the species does not dissociate.
    tally: u32,
    // 1 for products anywhere within the unbinding radius, 0 at it.
    is_within: u32,
    unbinding: f32,
    first_fraction: f32,
    products: vec2<u32>,
    radii: vec2<f32>,
    product_speeds: vec2<f32>,
    product_thermal_speeds: vec2<f32>,
    speed: f32,
    thermal_speed: f32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> control: Control;
@group(0) @binding(2) var<storage, read_write> moved: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> species: array<u32>;
@group(0) @binding(4) var<storage, read> tags: array<vec2<u32>>;
@group(0) @binding(5) var<storage, read_write> claims: array<Claim>;
@group(0) @binding(6) var<storage, read> dissociation_rows: array<DissociationRow>;
@group(0) @binding(7) var<storage, read_write> born: array<Born>;
@group(0) @binding(8) var<storage, read_write> born_keys0: array<vec2<u32>>;

fn channel_of(kind: u32, word: u32) -> u32 {
    var row = kind;
    if (dissociation_rows[row].tally == NOTHING) {
        return NOTHING;
    }
    for (var k = 0u; k < arrayLength(&dissociation_rows); k++) {
        if (row == NOTHING || word <= dissociation_rows[row].threshold) {
            break;
        }
        row = dissociation_rows[row].next;
    }
    return row;
}

@compute @workgroup_size(256)
fn particles_dissociate(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                        @builtin(local_invocation_index) local_index: u32) {
    let at = global_index(group, groups, local_index);
    if (at >= control.count || atomicLoad(&control.halted) != 0u) {
        return;
    }
    let parent = moved[at];
    if (parent.w < 0.0) {
        return;
    }
    let tag = tags[at];
    let id = tag.y;
    let words = philox(vec4(id, 0u, control.step, PURPOSE_DISSOCIATION), params.key);
    let found = channel_of(species[at], words.x);
    if (found == NOTHING || (tag.x & SPARED) != 0u) {
        return;
    }
    let row = dissociation_rows[found];
    var distance = row.unbinding;
    if (row.is_within != 0u) {
        let free = select(vec3(1.0), vec3(0.0), params.axes == vec3(FROZEN));
        distance *= pow(open_unit(words.y), 1.0 / (free.x + free.y + free.z));
    }
    let has_second = row.products.y != NOTHING;
    let apart = select(0.0, distance, has_second) * direction_within(direction(words.z, words.w));
    atomicAdd(&control.tallies[row.tally], 1u);
    claims[at].product = row.products.x;
    claims[at].sphere = vec4(confined(parent.xyz - row.first_fraction * apart, row.radii.x), row.radii.x);
    atomicStore(&claims[at].is_taken, 1u);
    var second_velocity = vec3(0.0);
    if (params.has_velocity != 0u) {
        let own = arrayLength(&moved) / 2u + at;
        let velocity = moved[own].xyz;
        let before = vec2(row.speed, row.thermal_speed);
        let after = vec2(row.product_speeds.x, row.product_thermal_speeds.x);
        moved[own] = vec4(converted_velocity(velocity, before, after, id, VELOCITY_OF_PRODUCT), 0.0);
        let second = vec2(row.product_speeds.y, row.product_thermal_speeds.y);
        second_velocity = converted_velocity(velocity, before, second, id, VELOCITY_OF_SECOND_PRODUCT);
    }
    if (has_second) {
        let slot = atomicAdd(&control.born, 1u);
        if (slot < arrayLength(&born)) {
            let position = confined(parent.xyz + (1.0 - row.first_fraction) * apart, row.radii.y);
            born[slot] = Born(vec4(position, row.radii.y), second_velocity, row.products.y);
            born_keys0[slot] = vec2(id, slot);
        }
    }
}
