use super::*;
use crate::Vessel;
use crate::motion::wall::hit_from_inside;
use crate::random::philox::open_unit;

#[test]
fn vessel_paths_match_the_cpu() {
    let Some(gpu) = device() else { return };
    let includes = "#include params\nvar<private> params: Params;\n#include philox\n#include boundary";
    for along in [Some(0), Some(1), Some(2), None] {
        let vessel = Vessel { along, center: [1.0, -2.0, 0.5], radius: 2.0 };
        let body = format!(
            "params.vessel_axis = {}u; params.vessel_center = vec3(1.0, -2.0, 0.5); params.vessel_radius = 2.5;
            let w = philox(vec4(k, 1u, 2u, 3u), vec2(4u, 5u));
            let m = philox(vec4(k, 2u, 2u, 3u), vec2(4u, 5u));
            let inner = 2.8 * vec3(open_unit(w.x), open_unit(w.y), open_unit(w.z)) - 1.4;
            let before = params.vessel_center + inner;
            let end = before + 12.0 * (vec3(open_unit(m.x), open_unit(m.y), open_unit(m.z)) - 0.5);
            let found = reflect_in_vessel(before, end, 2.0, vec3(1.0, 2.0, 4.0));
            let shown = select(found.end, found.velocity, (k & 1u) == 1u);
            out[k] = vec4(bitcast<vec3<u32>>(shown), 0u);",
            1 + along.unwrap_or(3)
        );
        let (mut reflected, mut others, count) = (0, 0, 20_000);
        for (k, [x, y, z, _]) in (0..).zip(evaluate(&gpu, includes, &body, count)) {
            let units = |word: u32| philox([k, word, 2, 3], [4, 5]).map(open_unit);
            let [w, m] = [units(1), units(2)];
            let before: [f32; 3] = std::array::from_fn(|k| vessel.center[k] + (2.8 * w[k] - 1.4));
            let end = std::array::from_fn(|k| before[k] + 12.0 * (m[k] - 0.5));
            let mut velocity = [1.0, 2.0, 4.0];
            let expected = vessel.reflect(before, end, &mut velocity);
            reflected += u32::from(expected != end);
            let expected = if k % 2 == 1 { velocity } else { expected };
            let found = [x, y, z].map(f32::from_bits);
            // Paths almost parallel to the wall amplify rounding.
            others += u32::from(!found.into_iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-3));
        }
        assert!(reflected > count / 2, "{reflected}");
        assert!(others <= count / 1000, "{others} of {count} differ, axis {along:?}");
    }
}

#[test]
fn absorption_from_inside_a_sphere_matches_the_cpu() {
    let Some(gpu) = device() else { return };
    let includes = "#include params\nvar<private> params: Params;\n#include control\n\
        @group(0) @binding(1) var<storage, read_write> control: Control;\n\
        @group(0) @binding(2) var<storage, read> event_rows: array<EventRow>;\n\
        @group(0) @binding(3) var<storage, read> species_rows: array<SpeciesRow>;\n\
        #include philox\n#include normal\n#include unit_32\n#include velocity\n#include boundary\n\
        #include event_rows\n#include first_passage\n#include hit\n#include decay\n\
        fn is_separated(kind: SpeciesRow, a: vec3<f32>, b: vec3<f32>) -> bool { return false; }\n\
        fn is_earlier(hit: Hit, receiver: u32, first_hit: Hit, first: u32, id: u32) -> bool { return true; }\n\
        #include absorbing_wall";
    let body = "let w = philox(vec4(k, 1u, 2u, 3u), vec2(4u, 5u));
        let heights = 2.0 * pow(vec2(open_unit(w.x), open_unit(w.y)), vec2(f32(1u + k % 4u)));
        let diffusion = 4.5 * pow(10.0, -5.0 * open_unit(w.z));
        out[k] = vec4(bitcast<vec3<u32>>(vec3(heights, diffusion)),
                      bitcast<u32>(hit_from_inside(2.0, heights, diffusion)));";
    let (mut between, count) = (0, 40_000);
    for (k, words) in (0..).zip(evaluate(&gpu, includes, body, count)) {
        let [a, b, diffusion, found] = words.map(f32::from_bits);
        let expected = hit_from_inside(2.0, [a, b], diffusion);
        assert!((found - expected).abs() < 1e-5, "{k}: {found}, not {expected}, {a} {b} {diffusion}");
        between += u32::from((0.01..0.99).contains(&expected));
    }
    assert!(between > count / 20, "{between}");
}
