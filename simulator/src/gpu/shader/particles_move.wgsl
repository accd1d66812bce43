// A removed particle stays until the end of the step with a negative radius, which pairs with nothing.
#include particles_move

@compute @workgroup_size(256)
fn particles_move(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                  @builtin(local_invocation_index) local_index: u32) {
    let at = global_index(group, groups, local_index);
    if (at >= control.count) {
        return;
    }
    let before = spheres[at];
    let marked = tags[at];
    let tag = vec2(species_of(marked), marked.y);
    let kind = species_rows[tag.x];
    let free = path_of(before.xyz, velocity_of(at, kind, tag.y), kind, tag.y);
    let path = held_back(collided(free, at, kind), kind, tag.y);
    var here = Moved(vec4(path.after, before.w), tag.x, path.velocity, false);
    var first = FirstHit(NOTHING, hit_at(false, 0.0));
    let near_receivers = receivers_near(kind, before.xyz, path_extent(path) + kind.bend + trajectory.max_displacement);
    for (var k = near_receivers.begin; k < near_receivers.end; k++) {
        let index = event_at(near_receivers, k);
        let event = event_rows[index];
        let receiver = receiver_at(event.receiver, control.step);
        if (is_separated(kind, path.after, receiver.center)) {
            continue;
        }
        let hit = hit_of(event, receiver, path, kind, tag.y);
        if (hit.is_hit && is_earlier(hit, event.receiver, first.hit, first.row, tag.y)) {
            first = FirstHit(index, hit);
        }
    }
    here = captured_or_decayed(here, first_with_walls(first, path, without_turns(), kind, tag.y), kind, tag.y);
    if (here.sphere.w < 0.0) {
        atomicAdd(&control.removed, 1u);
    }
    moved[at] = here.sphere;
    species[at] = here.species;
    mark(at, marked, here.is_spared);
    if (params.has_velocity != 0u) {
        moved[velocity_at(at)] = vec4(here.velocity, 0.0);
    }
}
