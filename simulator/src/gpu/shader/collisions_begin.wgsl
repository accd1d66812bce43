#include control
#include params
#include philox
#include normal
#include velocity
#include boundary
#include event_rows
#include mover
#include window
#include tag

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> control: Control;
@group(0) @binding(2) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> tags: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read> species_rows: array<SpeciesRow>;
@group(0) @binding(5) var<storage, read_write> movers: array<Mover>;
@group(0) @binding(6) var<storage, read_write> next_events: array<NextEvent>;
@group(0) @binding(7) var<storage, read_write> window: Window;
@group(0) @binding(8) var<storage, read> scene_rows: array<vec4<u32>>;

#include velocity_index
#include wall
#include path

fn ascending(x: f32) -> u32 {
    let bits = bitcast<u32>(x);
    return select(bits | 0x80000000u, ~bits, (bits & 0x80000000u) != 0u);
}

@compute @workgroup_size(256)
fn collisions_begin(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                    @builtin(local_invocation_index) local_index: u32) {
    let at = global_index(group, groups, local_index);
    if (at >= control.count) {
        return;
    }
    let before = spheres[at];
    let tag = tags[at];
    let kind = species_rows[species_of(tag)];
    let velocity = velocity_of(at, kind, tag.y);
    var end = free_path_of(before.xyz, velocity, kind, tag.y).end;
    if (params.vessel_axis != NO_VESSEL) {
        let across = reflect_in_vessel(before.xyz, end, params.vessel_radius - kind.radius, velocity).end;
        end += flow_between(before.xyz, across) * along_vessel();
    }
    // Bound particles have a negative radius and no position.
    let is_free = before.w >= 0.0;
    let motion = select(vec3(0.0), end - before.xyz, is_free);
    movers[at] = Mover(before.xyz, tag.y, vec3(0.0), 0.0, motion, before.w, velocity, kind.mobility);
    next_events[at] = NextEvent(NEVER, NOTHING, 0u, 0u, 0u, 0u, 0u);
    if (!is_free) {
        return;
    }
    let speed = bitcast<u32>(length(motion));
    if (speed > atomicLoad(&window.fastest)) {
        atomicMax(&window.fastest, speed);
    }
    for (var k = 0u; k < 3u; k++) {
        let key = ascending(before[k]);
        if (~key > atomicLoad(&window.lows[k])) {
            atomicMax(&window.lows[k], ~key);
        }
        if (key > atomicLoad(&window.highs[k])) {
            atomicMax(&window.highs[k], key);
        }
    }
}
