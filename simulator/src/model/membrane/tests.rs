use super::*;
use crate::random::gaussian::normals;
use crate::random::philox::Key;

const KEY: Key = Key::new(3);

fn membrane(position: f32, permeability: f64) -> Membrane {
    let surface = MembraneSurface::Plane { axis: 0, position };
    Membrane { name: "m".into(), surface, permeability, sees: vec![true] }
}

fn step<'a>(membranes: &'a [Membrane], domain: &'a Boundary, spread: f32) -> MembraneStep<'a> {
    let gaps = narrowest_gaps(membranes, domain, 0);
    MembraneStep { membranes, domain, species: 0, diffusion: 1.0, spread, gaps }
}

fn ends(membranes: &[Membrane], domain: &Boundary, before: f32, spread: f32, id: u32) -> HeldEnd {
    let step = step(membranes, domain, spread);
    let end = before + spread * normals(KEY.draw(id, 0, 0, Purpose::Move))[0];
    let words = |index, part| KEY.draw_part([id, index], part, 0, Purpose::Membrane);
    step.ends([[before, 0.0, 0.0], [end, 0.0, 0.0]], words)[0].expect("a membrane")
}

/// From the height a: ½(1 − erf(y) − exp(ha + h²Dt)·erfc(y + h√(Dt))) with y = a/√(4Dt), h = 2κ/D.
#[test]
fn one_step_changes_sides_with_the_closed_probability() {
    let n = 40_000_u32;
    for (a, spread, permeability) in
        [(0.3_f32, 1.0_f32, 0.5), (0.0, 0.2, 3.0), (0.5, 0.7, 20.0), (0.2, 1.0, 0.0)]
    {
        for sign in [1.0, -1.0] {
            let membranes = [membrane(5.0, permeability)];
            let on_other_side = |&id: &u32| {
                let before = if sign > 0.0 { 5.0 + a } else { (5.0 - a).min(5.0_f32.next_down()) };
                (ends(&membranes, &Boundary::default(), before, spread, id).confined >= 5.0) != (sign > 0.0)
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

/// With the lowest point at −√(−2 ln ½)/2 = −0.589 of the spread the probability is 2.94e-8, 126 words of 2³².
#[test]
fn lowest_words_pass_at_low_permeability() {
    let (membranes, domain) = ([membrane(5.0, 5e-8)], Boundary::default());
    let step = step(&membranes, &domain, 1.0);
    let is_below = |word: u32| step.end(0, [5.0; 2], |_, _| [1 << 31, word, 0, 0]).confined < 5.0;
    assert_eq!((0..1000).filter(|&word| is_below(word)).count(), 126);
}

#[test]
fn nothing_passes_a_closed_membrane() {
    let membranes = [membrane(-0.5, 0.0), membrane(0.25, 0.0)];
    for domain in [
        Boundary::default(),
        Boundary::reflecting([-1.0; 3], [1.0; 3]),
        Boundary::periodic([-1.0; 3], [1.0; 3]),
    ] {
        for spread in [0.1, 1.0, 30.0] {
            for (slab, start) in [(0, 0.2), (0, -0.5), (1, 0.25), (1, 0.9), (2, -0.75)] {
                let mut x = start;
                for id in 0..2000 {
                    x = ends(&membranes, &domain, x, spread, id).confined;
                    let is_in_slab = match (slab, domain.axes[0]) {
                        (0, _) => (-0.5..0.25).contains(&x),
                        (_, Axis::Periodic { .. }) => !(-0.5..0.25).contains(&x),
                        (1, _) => x >= 0.25,
                        _ => x < -0.5,
                    };
                    assert!(is_in_slab, "{x} from {start} in steps of {spread}, {domain:?}");
                }
            }
        }
    }
}

/// Particles that begin with a uniform density keep it, in gaps as wide as the step or narrower.
#[test]
fn narrow_gaps_keep_a_uniform_density() {
    const N: u32 = 10_000;
    let periodic = Boundary::periodic([0.0; 3], [10.0; 3]);
    let walls = Boundary::reflecting([0.0; 3], [10.0; 3]);
    let two = [membrane(4.75, 5.0), membrane(5.25, 5.0)];
    for (membranes, domain, [low, high]) in [
        (&two[..], periodic, [4.75, 5.25]),
        (&two[..], walls, [4.75, 5.25]),
        (&[membrane(0.5, 5.0)], walls, [0.0, 0.5]),
        (&[membrane(9.75, 1.0)], walls, [9.75, 10.0]),
    ] {
        let mut all: Vec<f32> = (0..N).map(|k| 10.0 * (k as f32 + 0.5) / N as f32).collect();
        for now in 0..60 {
            for (id, x) in (0..).zip(&mut all) {
                let step = step(membranes, &domain, 0.5);
                let end = *x + 0.5 * normals(KEY.draw(id, 0, now, Purpose::Move))[0];
                let words = |index, part| KEY.draw_part([id, index], part, now, Purpose::Membrane);
                *x = step.end(0, [*x, end], words).confined;
            }
        }
        let fraction = all.iter().filter(|x| (low..high).contains(*x)).count() as f64 / f64::from(N);
        let expected = f64::from(high - low) / 10.0;
        let error = (expected * (1.0 - expected) / f64::from(N)).sqrt();
        assert!((fraction - expected).abs() < 5.0 * error, "{low} to {high}, {domain:?}: {fraction}");
    }
}

#[test]
fn a_point_on_a_membrane_is_above_it() {
    let membranes = [membrane(0.0, 1.0)];
    for (domain, expected) in [
        (Boundary::default(), [false, true, true]),
        (Boundary::periodic([-1.0; 3], [1.0; 3]), [false, true, false]),
    ] {
        let step = step(&membranes, &domain, 1.0);
        let points = [[0.0, 0.5], [-0.25, 0.0], [-0.75, 0.75]];
        assert_eq!(points.map(|[a, b]| step.separates([[a, 0.0, 0.0], [b, 0.0, 0.0]])), expected);
    }
}

fn sphere(center: [f32; 3], radius: f32, permeability: f64) -> Membrane {
    let surface = MembraneSurface::Sphere { center, radius };
    Membrane { name: "m".into(), surface, permeability, sees: vec![true] }
}

fn crossed(membranes: &[Membrane], domain: &Boundary, from: [f32; 3], spread: f32) -> u32 {
    let step = step(membranes, domain, spread);
    let walk = |id: u32| {
        let mut at = from;
        for now in 0..40 {
            let z = normals(KEY.draw(id, 0, now, Purpose::Move));
            let end: [f32; 3] = std::array::from_fn(|k| at[k] + spread * z[k]);
            let mut ends = StepEnds { end, free: end, after: domain.confine(end) };
            step.hold_back(at, &mut ends, DrawContext { key: KEY, id, step: now });
            at = ends.after;
            assert_eq!(at, domain.confine(at));
        }
        step.is_across_sphere([from, at])
    };
    (0..400).map(|id| u32::from(walk(id))).sum()
}

#[test]
fn closed_spheres_keep_particles_on_their_side() {
    let center = [1.0, -2.0, 0.5];
    let closed = [sphere(center, 0.5, 0.0), sphere(center, 0.75, 0.0), membrane(1.8, 0.0)];
    for domain in [
        Boundary::default(),
        Boundary::periodic([0.0, -3.0, -1.0], [2.0, -1.0, 3.0]),
        Boundary::reflecting([0.0, -3.0, -1.0], [2.0, -1.0, 3.0]),
    ] {
        for spread in [0.02, 0.3, 3.0] {
            for from in [center, [1.0, -2.0, 1.0625], [0.125, -2.75, 0.5]] {
                assert_eq!(crossed(&closed, &domain, from, spread), 0, "{domain:?} {spread} {from:?}");
            }
        }
        let open = [sphere(center, 0.5, 1.0)];
        assert!(crossed(&open, &domain, center, 0.3) > 100, "{domain:?}");
    }
}

#[test]
fn segment_across_a_sphere_passes_with_the_probability_of_a_plane() {
    // A segment of length 2 at 60° to the normal, in a step with DΔt = 0.5 and κ = 0.75: X = 1.5·√0.5, y = 1/√2.
    let membranes = [sphere([0.0; 3], 4.0, 0.75)];
    let domain = Boundary::default();
    let step = step(&membranes, &domain, 1.0);
    let (before, end) = ([3.5, -0.866_025_4, 0.0], [4.5, 0.866_025_4, 0.0]);
    let n = 40_000_u32;
    let passes = |&id: &u32| {
        let mut ends = StepEnds { end, free: end, after: end };
        step.hold_back(before, &mut ends, DrawContext { key: KEY, id, step: 0 });
        ends.after == end
    };
    let found = (0..n).filter(passes).count() as f64 / f64::from(n);
    let x = 1.5 * 0.5_f64.sqrt();
    let y = x + 0.5_f64.sqrt();
    let expected = std::f64::consts::PI.sqrt() * x * (y * y).exp() * libm::erfc(y);
    let tolerance = 4.0 * (expected * (1.0 - expected) / f64::from(n)).sqrt();
    assert!((found - expected).abs() <= tolerance, "{found}, not {expected}");
}
