// Later kernels grant the requests for receptors.
#include particles_move
#include candidate
#include receptor

@group(0) @binding(10) var<storage, read_write> claims: array<Claim>;
@group(0) @binding(11) var<storage, read_write> receptors: array<Receptors>;

#include reflection
#include adsorption
#include surface_diffusion

const REQUESTED: u32 = 2u;

fn free_receptors(receptor: u32) -> u32 {
    let count = receptors[receptor].count;
    return count - min(count, atomicLoad(&receptors[receptor].bound));
}

// Counts one more free receptor in row `bound`, for the detailed balance of unbinding.
fn reactivity_of(event: EventRow, bound: u32) -> f32 {
    var sum = 0.0;
    for (var k = event.ligands_begin; k < event.ligands_end; k++) {
        sum += event_rows[k].scaled_reactivity * (f32(free_receptors(event_rows[k].receptor)) + select(0.0, 1.0, k == bound));
    }
    return sum;
}

fn chosen_ligand(event: EventRow, fraction: f32) -> u32 {
    var rest = fraction * reactivity_of(event, NOTHING);
    var last = event.ligands_begin;
    for (var k = event.ligands_begin; k < event.ligands_end; k++) {
        let reactivity = event_rows[k].scaled_reactivity * f32(free_receptors(event_rows[k].receptor));
        if (reactivity > 0.0) {
            last = k;
            rest -= reactivity;
        }
        if (rest < 0.0) {
            break;
        }
    }
    return last;
}

fn adsorbs(event: EventRow, a: f32, b: f32, word: u32) -> bool {
    if (event.kind == PER_STEP) {
        return word <= event.threshold;
    }
    var reactivity = event.scaled_reactivity;
    if (event.kind == RECEPTORS) {
        reactivity = reactivity_of(event, NOTHING);
    }
    // Radius of a sphere with the curvature of a disk or a segment.
    let flatter = select(2.0 * event.radius, FLAT, params.axes.y == FROZEN);
    let radius = select(event.radius, flatter, params.axes.z == FROZEN);
    return unit_32(word) < adsorption_probability(surface_of(reactivity, event.length, radius), a, b);
}

fn request_binding(at: u32, k: u32, touching: vec3<f32>, center: vec3<f32>, rank: u32) {
    let out = minimum_image(touching - center);
    let distance = length(out);
    let direction = select(vec3(1.0, 0.0, 0.0), out / max(distance, 1e-37), distance > 0.0);
    claims[at].sphere = vec4(direction, 0.0);
    claims[at].product = k;
    atomicStore(&claims[at].priority, rank);
    atomicStore(&claims[at].other, atomicAdd(&receptors[event_rows[k].receptor].requests, 1u));
    atomicStore(&claims[at].is_taken, REQUESTED);
}

// Unbinds the particle, or moves it on the surface.
fn unbind(bound: vec4<f32>, id: u32, kind: SpeciesRow) -> vec4<f32> {
    let ligand = ligand_of_bound(bound);
    let event = event_rows[ligand];
    let stays = vec4(moved_on_surface(bound.xyz, event.concentration, id), bound.w);
    let surface = surface_of(reactivity_of(event, ligand), event.length, event.radius);
    var draws = Draws(vec4(id, 0u, control.step, PURPOSE_UNBINDING), vec4(0u), 4u);
    if (unit_of(&draws) >= event.unbinding * effective_part(surface)) {
        return stays;
    }
    let center = receiver_at(event.receiver, control.step + 1u).center;
    let above = event.radius + height_after(surface, &draws);
    let away = above + 4e-6 * (abs(center.x) + abs(center.y) + abs(center.z) + above);
    let position = confined(center + away * stays.xyz, kind.radius);
    if (signed_distance(event.radius, center, position) < 0.0 || is_separated(kind, position, center)) {
        return stays;
    }
    atomicSub(&control.tallies[event.tally], 1u);
    atomicSub(&control.tallies[event.occupied], 1u);
    return vec4(position, kind.radius);
}

// The first receiver reflected the original path.
fn path_to(receiver: u32, path: Path, reflected: ReflectedPath) -> Path {
    if (reflected.first == receiver) {
        return path;
    }
    return Path(path.before, reflected.end, reflected.after, path.velocity, path.free_end, path.drift);
}

fn bind(at: u32, index: u32, path: Path, id: u32) {
    let event = event_rows[index];
    let receiver = receiver_at(event.receiver, control.step);
    let a = abs(signed_distance(event.radius, receiver.center, path.before));
    let b = abs(signed_distance(event.radius, receiver.center + receiver.displacement, path.after));
    var time = 0.0;
    if (a + b > 0.0) {
        time = a / (a + b);
    }
    let words = philox(vec4(id, event.receiver, control.step, PURPOSE_RECEIVER), params.key);
    let touching = path.before + time * (path.end - path.before);
    let ligand = chosen_ligand(event, unit_32(words.w));
    request_binding(at, ligand, touching, receiver.center + time * receiver.displacement, words.z);
}

fn move_free(at: u32, path: Path, kind: SpeciesRow, tag: vec2<u32>, radius: f32) -> Moved {
    var reflected = reflect_path(kind, aimed(kind, path));
    var turns = without_turns();
    if (reflected.first == NOTHING) {
        reflected.end = path.end;
        reflected.after = path.after;
    } else {
        turns = PathTurns(true, reflected.contact, reflected.end - reflected.last, reflected.end);
    }
    if (near_count > MAX_NEAR) {
        atomicMax(&control.near_surfaces, near_count);
        atomicOr(&control.halted, TOO_MANY_SURFACES);
    } else if (left_region) {
        atomicOr(&control.halted, TOO_MANY_REQUERIES);
    }
    // See surfaces.rs.
    let stays = turns.exist && is_separated(kind, path.after, reflected.after);
    var here = Moved(vec4(select(reflected.after, path.before, stays), radius), tag.x, reflected.velocity, false);
    let search_distance = max(path_extent(path), max(reflected.length, length(minimum_image(reflected.after - path.before))));
    let near_receivers = receivers_near(kind, path.before, search_distance + kind.bend + trajectory.max_displacement);
    var first = FirstHit(NOTHING, hit_at(false, 0.0));
    for (var k = near_receivers.begin; k < near_receivers.end; k++) {
        let index = event_at(near_receivers, k);
        let event = event_rows[index];
        let receiver = receiver_at(event.receiver, control.step);
        let a = signed_distance(event.radius, receiver.center, path.before);
        // A particle inside may leave.
        if (is_separated(kind, path.after, receiver.center) || event.kind == REFLECTING || (event.kind > REFLECTING && a < 0.0)) {
            continue;
        }
        let taken = path_to(event.receiver, path, reflected);
        let hit = hit_of(event, receiver, taken, kind, tag.y);
        if (!hit.is_hit) {
            continue;
        }
        if (event.kind > REFLECTING) {
            let b = heights_of(event, receiver, taken).y;
            let words = philox(vec4(tag.y, event.receiver, control.step, PURPOSE_RECEIVER), params.key);
            if (!adsorbs(event, a, b, words.y)) {
                continue;
            }
        }
        if (is_earlier(hit, event.receiver, first.hit, first.row, tag.y)) {
            first = FirstHit(index, hit);
        }
    }
    if (stays) {
        first = first_with_walls(first, at_rest(path), without_turns(), kind, tag.y);
    } else {
        first = first_with_walls(first, path_to(NOTHING, path, reflected), turns, kind, tag.y);
    }
    if (first.row == NOTHING || event_rows[first.row].kind != RECEPTORS) {
        return captured_or_decayed(here, first, kind, tag.y);
    }
    var capture = capture_of(first.row, first.hit, kind, tag.y);
    if (!decays_before(capture, tag.x, tag.y)) {
        bind(at, first.row, path_to(event_rows[first.row].receiver, path, reflected), tag.y);
        return here;
    }
    // Receptors bind no products; see surfaces.rs.
    capture.row = NOTHING;
    return decay(here, capture, tag.y);
}

@compute @workgroup_size(256)
fn particles_move_reflecting(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                  @builtin(local_invocation_index) local_index: u32) {
    let at = global_index(group, groups, local_index);
    if (at >= control.count) {
        return;
    }
    let before = spheres[at];
    let marked = tags[at];
    let tag = vec2(species_of(marked), marked.y);
    let kind = species_rows[tag.x];
    var here = Moved(before, tag.x, vec3(0.0), false);
    if (before.w <= BOUND_RADIUS) {
        here.sphere = unbind(before, tag.y, kind);
        if (params.has_velocity != 0u && here.sphere.w >= 0.0) {
            here.velocity = drawn_velocity(kind.speed, kind.thermal_speed, tag.y, VELOCITY_OF_UNBOUND);
        }
    } else {
        let path = collided(path_of(before.xyz, velocity_of(at, kind, tag.y), kind, tag.y), at, kind);
        here = move_free(at, held_back(path, kind, tag.y), kind, tag, before.w);
    }
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
