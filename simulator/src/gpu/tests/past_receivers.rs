use super::*;
use crate::model::receiver::Receiver;
use crate::motion::path_hit::{Path, hits};
use crate::motion::receiver_state::ReceiverState;
use crate::random::philox::{DrawContext, open_unit};
use crate::{Axis, Vessel};

const INCLUDES: &str = "#include params\nvar<private> params: Params;\n\
    struct Control { step: u32 }\nvar<private> control: Control;\nconst NOTHING: u32 = 0xffffffffu;\n\
    var<private> event_rows: array<EventRow, 1>;\nvar<private> spheres: array<vec4<f32>, 1>;\n\
    var<private> scene_rows: array<vec4<u32>, 1>;\nvar<private> trajectory: TrajectoryHeader;\n\
    fn velocity_at(at: u32) -> u32 { return at; }\n#include philox\n#include normal\n#include unit_32\n\
    #include velocity\n#include boundary\n#include event\n#include first_passage\n#include wall\n#include hit\n\
    #include path_hit";

const RADIUS: f32 = 0.125;
const CENTER: [f32; 3] = [0.75, -0.5, 0.25];
const MOVED: [f32; 3] = [0.5, 0.25, -0.25];
const DRIFT: [f32; 3] = [0.375, 0.25, 0.0];
const SIDE: f32 = 2.0;

fn step_of(boundary: &Boundary, [particle, receiver]: [f32; 2], moves: bool) -> String {
    let kind = |axis: Axis| match axis {
        Axis::Open => 0,
        Axis::Reflecting { .. } => 1,
        Axis::Periodic { .. } => 2,
        Axis::Frozen => 3,
    };
    let [x, y, z] = boundary.axes.map(kind);
    let vessel = boundary.vessel.map_or(0, |vessel| 1 + vessel.along.unwrap_or(3));
    let factor = f32::from(u8::from(moves));
    format!(
        "params.axes = vec3({x}u, {y}u, {z}u); params.key = vec2(1u, 2u); control.step = 3u;
        params.low = select(vec3(0.0), vec3(-{SIDE:?}), (params.axes == vec3(1u)) | (params.axes == vec3(2u)));
        params.high = select(vec3(1.0), vec3({SIDE:?}), (params.axes == vec3(1u)) | (params.axes == vec3(2u)));
        params.vessel_axis = {vessel}u; params.vessel_radius = {SIDE:?};
        let w = philox(vec4(k, 1u, 2u, 3u), vec2(4u, 5u));
        let m = philox(vec4(k, 2u, 2u, 3u), vec2(4u, 5u));
        let before = flattened(2.0 * vec3(open_unit(w.x), open_unit(w.y), open_unit(w.z)) - 1.0);
        let drift = flattened(12.0 * (vec3(open_unit(m.x), open_unit(m.y), open_unit(m.z)) - 0.5));
        let spread = sqrt(2.0 * {particle:?}) * flattened(normals(philox(vec4(k, 3u, 2u, 3u), vec2(4u, 5u))));
        let free_end = before + (spread + drift);
        var end = free_end;
        if (params.vessel_axis != NO_VESSEL) {{
            end = reflect_in_vessel(before, free_end, params.vessel_radius - {RADIUS:?}, vec3(0.0)).end;
        }}
        let path = Path(before, end, confined(end, {RADIUS:?}), vec3(0.0), free_end, drift);
        var event: EventRow;
        event.radius = 0.25; event.diffusion = {receiver:?}; event.receiver = 7u;
        event.drift = {factor:?} * vec3({}, {}, {});
        let moved = {factor:?} * vec3({}, {}, {});
        let receiver = ReceiverRow(flattened(vec3({}, {}, {})), flattened(moved));
        var kind: SpeciesRow;
        kind.diffusion = {particle:?}; kind.radius = {RADIUS:?};
        let hit = hit_of(event, receiver, path, kind, k);
        out[k] = vec4(u32(hit.is_hit), bitcast<u32>(time_of(hit, 7u, k)), 0u, 0u);",
        DRIFT[0], DRIFT[1], DRIFT[2], MOVED[0], MOVED[1], MOVED[2], CENTER[0], CENTER[1], CENTER[2],
    )
}

fn on_the_cpu(boundary: &Boundary, [particle, receiver]: [f32; 2], moves: bool, id: u32) -> Option<f32> {
    let factor = f32::from(u8::from(moves));
    let domain = boundary.inset(RADIUS);
    let units = |word: u32| philox([id, word, 2, 3], [4, 5]).map(open_unit);
    let [w, m] = [units(1), units(2)];
    let before = boundary.flattened(std::array::from_fn(|k| 2.0 * w[k] - 1.0));
    let drift = boundary.flattened(std::array::from_fn(|k| 12.0 * (m[k] - 0.5)));
    let normals = gaussian::normals(philox([id, 3, 2, 3], [4, 5]));
    let spread = boundary.flattened(normals.map(|z| (2.0 * particle).sqrt() * z));
    let free_end: [f32; 3] = std::array::from_fn(|k| before[k] + (spread[k] + drift[k]));
    let end = domain.vessel.map_or(free_end, |vessel| vessel.reflect(before, free_end, &mut [0.0; 3]));
    let path = Path { before, end, after: domain.confine(end), free: free_end, drift, diffusion: particle };
    let sphere = Receiver { radius: 0.25, ..Receiver::default() };
    let mut state = ReceiverState::new(7, sphere, 1.0);
    state.center = boundary.flattened(CENTER);
    state.displacement = boundary.flattened(MOVED.map(|c| factor * c));
    state.drift = DRIFT.map(|c| factor * c);
    state.diffusion = receiver;
    state.dimensions = boundary.dimensions();
    let context = DrawContext { key: Key([1, 2]), id, step: 3 };
    hits(&state, &domain, &path, context).map(|hit| hit.time(context, 7))
}

#[test]
fn hits_of_long_paths_match_the_cpu() {
    let Some(gpu) = device() else { return };
    let wall = Axis::Reflecting { low: -SIDE, high: SIDE };
    let period = Axis::Periodic { low: -SIDE, high: SIDE };
    let vessel = |along| Some(Vessel { along, center: [0.0; 3], radius: SIDE });
    let boundaries = [
        Boundary::default(),
        Boundary { axes: [wall; 3], vessel: None },
        Boundary { axes: [period, wall, period], vessel: None },
        Boundary { axes: [Axis::Open, Axis::Open, period], vessel: vessel(Some(2)) },
        Boundary { axes: [wall, Axis::Open, Axis::Open], vessel: vessel(Some(0)) },
        Boundary { axes: [Axis::Open; 3], vessel: vessel(None) },
        Boundary { axes: [period, wall, Axis::Frozen], vessel: None },
        Boundary { axes: [period, Axis::Frozen, Axis::Frozen], vessel: None },
    ];
    let count = 10_000;
    for boundary in boundaries {
        for (diffusions, moves) in [([0.0, 0.0], true), ([0.02, 0.0], false), ([0.01, 0.01], true)] {
            let (mut met, mut others) = (0, 0);
            let found = evaluate(&gpu, INCLUDES, &step_of(&boundary, diffusions, moves), count);
            for (id, [is_hit, time, ..]) in (0..).zip(found) {
                let expected = on_the_cpu(&boundary, diffusions, moves, id);
                met += u32::from(expected.is_some());
                let found = (is_hit != 0).then_some(f32::from_bits(time));
                let is_equal = match (found, expected) {
                    (Some(a), Some(b)) => (a - b).abs() < 1e-3,
                    (a, b) => a.is_none() == b.is_none(),
                };
                others += u32::from(!is_equal);
            }
            assert!(met > count / 50, "{boundary:?} {diffusions:?}: {met} hits");
            // Rounding decides on grazing paths.
            assert!(others <= count / 1000, "{boundary:?} {diffusions:?}: {others} of {count} differ");
        }
    }
}
