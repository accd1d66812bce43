use super::*;
use crate::random::gaussian::normals;

const KEY: Key = Key::new(3);

fn membrane(position: f32, permeability: f64) -> Membrane {
    Membrane { name: "m".into(), axis: 0, position, permeability, sees: vec![true] }
}

fn ends(membranes: &[Membrane], domain: &Boundary, before: f32, spread: f32, id: u32) -> HeldEnd {
    let step = MembraneStep { membranes, domain, species: 0, diffusion: 1.0, spread };
    let end = before + spread * normals(KEY.draw(id, 0, 0, Purpose::Move))[0];
    step.ends([[before, 0.0, 0.0], [end, 0.0, 0.0]], (KEY, id, 0))[0].expect("a membrane")
}

/// From the height a: ½(1 − erf(y) − exp(ha + h²Dt)·erfc(y + h√(Dt))) with y = a/√(4Dt), h = 2κ/D.
#[test]
fn one_step_changes_sides_with_the_closed_probability() {
    let n = 40_000_u32;
    for (a, spread, permeability) in
        [(0.3_f32, 1.0_f32, 0.5), (0.0, 0.2, 3.0), (0.5, 0.7, 20.0), (0.2, 1.0, 0.0)]
    {
        for sign in [1.0, -1.0] {
            let own = [membrane(5.0, permeability)];
            let on_other_side = |&id: &u32| {
                let before = if sign > 0.0 { 5.0 + a } else { (5.0 - a).min(5.0_f32.next_down()) };
                (ends(&own, &Boundary::default(), before, spread, id).confined >= 5.0) != (sign > 0.0)
            };
            let found = (0..n).filter(on_other_side).count() as f64 / f64::from(n);
            let [a, time] = [f64::from(a), 0.5 * f64::from(spread).powi(2)];
            let (h, y) = (2.0 * permeability, a / (4.0 * time).sqrt());
            let stays = libm::erf(y) + (h * a + h * h * time).exp() * libm::erfc(y + h * time.sqrt());
            let expected = 0.5 * (1.0 - stays);
            let tolerance = 4.0 * (expected * (1.0 - expected) / f64::from(n)).sqrt();
            assert!((found - expected).abs() <= tolerance, "{a} {permeability}: {found}, not {expected}");
        }
    }
}

/// Closed membranes keep particles, in steps of any length and before walls and images.
#[test]
fn nothing_passes_a_closed_membrane() {
    let own = [membrane(-0.5, 0.0), membrane(0.25, 0.0)];
    for domain in [
        Boundary::default(),
        Boundary::reflecting([-1.0; 3], [1.0; 3]),
        Boundary::periodic([-1.0; 3], [1.0; 3]),
    ] {
        for spread in [0.1, 1.0, 30.0] {
            for (slab, start) in [(0, 0.2), (0, -0.5), (1, 0.25), (1, 0.9), (2, -0.75)] {
                let mut x = start;
                for id in 0..2000 {
                    x = ends(&own, &domain, x, spread, id).confined;
                    let is_kept = match (slab, domain.axes[0]) {
                        (0, _) => (-0.5..0.25).contains(&x),
                        (_, Axis::Periodic { .. }) => !(-0.5..0.25).contains(&x),
                        (1, _) => x >= 0.25,
                        _ => x < -0.5,
                    };
                    assert!(is_kept, "{x} from {start} in steps of {spread}, {domain:?}");
                }
            }
        }
    }
}

#[test]
fn a_point_on_a_membrane_is_above_it() {
    let own = [membrane(0.0, 1.0)];
    for (domain, expected) in [
        (Boundary::default(), [false, true, true]),
        (Boundary::periodic([-1.0; 3], [1.0; 3]), [false, true, false]),
    ] {
        let step = MembraneStep { membranes: &own, domain: &domain, species: 0, diffusion: 1.0, spread: 1.0 };
        let points = [[0.0, 0.5], [-0.25, 0.0], [-0.75, 0.75]];
        assert_eq!(points.map(|[a, b]| step.separates([[a, 0.0, 0.0], [b, 0.0, 0.0]])), expected);
    }
}
