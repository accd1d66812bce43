// Halts the run if events are left.
#include control
#include params
#include boundary
#include mover
#include window
#include round

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> round: Round;
@group(0) @binding(2) var<storage, read_write> control: Control;
@group(0) @binding(3) var<storage, read_write> window: Window;
@group(0) @binding(4) var<storage, read_write> movers: array<Mover>;

@compute @workgroup_size(256)
fn window_end(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local_index: u32) {
    let at = global_index(group, groups, local_index);
    if (at >= window.count) {
        return;
    }
    if (at == 0u && !is_over(round.source) && atomicLoad(&control.halted) == 0u) {
        atomicOr(&control.halted, WINDOW_ROUNDS_LEFT);
    }
    let mover = movers[at];
    movers[at].offset = offset_at(mover, window.horizon);
    movers[at].time = window.horizon;
    let speed = bitcast<u32>(length(mover.motion));
    if (mover.radius >= 0.0 && speed > atomicLoad(&window.fastest)) {
        atomicMax(&window.fastest, speed);
    }
}
