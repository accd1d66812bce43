use super::*;
use crate::model::receiver::Receiver;
use crate::model::vessel::Vessel;
use crate::random::philox::Key;

fn receiver_state(kind: ReceiverKind) -> ReceiverState {
    let receiver =
        Receiver { center: [1.0, 0.0, 0.0], radius: 1.0, kind, sees: vec![true], ..Receiver::default() };
    ReceiverState::new(0, receiver, 1.0)
}

const CONTEXT: DrawContext = DrawContext { key: Key::new(1), id: 7, step: 3 };

fn path(before: [f32; 3], end: [f32; 3], domain: &Boundary, diffusion: f32) -> Path {
    let drift = std::array::from_fn(|k| if diffusion == 0.0 { end[k] - before[k] } else { 0.0 });
    Path { before, end, after: domain.confine(end), free: end, drift, diffusion }
}

#[test]
fn diffusion_follows_the_bridge() {
    let open = Boundary::default();
    let step = path([2.5, 0.0, 0.0], [1.0, 1.25, 0.0], &open, 0.25);
    let n = 20_000;
    let met = |kind: ReceiverKind| {
        (0..n)
            .filter(|&id| {
                hits(&receiver_state(kind.clone()), &open, &step, DrawContext { id, ..CONTEXT }).is_some()
            })
            .count()
    };
    let p = f64::from(hit_probability(1.0, [0.5, 0.25], 0.25));
    let error =
        (met(ReceiverKind::Absorbing) as f64 - f64::from(n) * p) / (f64::from(n) * p * (1.0 - p)).sqrt();
    assert!(error.abs() < 4.0, "{error} standard errors");
    assert_eq!(met(ReceiverKind::Endpoint), 0);
    let at_rest = path([1.0, 1.25, 0.0], [1.0, 1.25, 0.0], &open, 0.0);
    assert_eq!(hits(&receiver_state(ReceiverKind::Absorbing), &open, &at_rest, CONTEXT), None);
    let inside = path([9.0, 0.0, 0.0], [1.5, 0.0, 0.0], &open, 0.25);
    assert_eq!(hits(&receiver_state(ReceiverKind::Endpoint), &open, &inside, CONTEXT), Some(Hit::at(1.0)));
}

#[test]
fn receivers_and_segments_share_no_draws() {
    let one = |index, part, id| {
        DrawContext { id, ..CONTEXT }.hits_sphere([index, part], 1.0, [0.7, 1.0], 1.0).is_some()
    };
    let draws = |index, part| (0..256).map(|id| one(index, part, id)).collect::<Vec<bool>>();
    let indices = [0, 1, 1 << 15, 1 << 16, (1 << 16) + 1, 1 << 24, u32::MAX];
    let parts = [0, 1, 2, 255, 256, 2 * LAST - 2];
    let all: std::collections::BTreeSet<_> =
        indices.iter().flat_map(|&index| parts.map(|part| draws(index, part))).collect();
    assert_eq!(all.len(), indices.len() * parts.len());
}

#[test]
fn path_without_diffusion_is_followed_through_walls_and_images() {
    let met = |domain: &Boundary, before, end| {
        hits(&receiver_state(ReceiverKind::Absorbing), domain, &path(before, end, domain, 0.0), CONTEXT)
            .is_some()
    };
    let open = Boundary::default();
    assert!(met(&open, [-3.0, 0.5, 0.0], [9.0, 0.5, 0.0]));
    assert!(!met(&open, [-3.0, 1.125, 0.0], [9.0, 1.125, 0.0]));
    assert!(!met(&open, [-3.0, 0.5, 0.0], [-0.5, 0.5, 0.0]));
    assert!(!met(&open, [3.0, 0.5, 0.0], [9.0, 0.5, 0.0]));
    let below = |wall| Boundary::reflecting([-8.0, -4.0, -4.0], [8.0, wall, 4.0]);
    assert!(met(&below(1.1), [6.0, -2.0, 0.0], [-4.0, 4.2, 0.0]));
    assert!(!met(&below(1.5), [6.0, -2.0, 0.0], [-4.0, 5.0, 0.0]));
    assert!(met(&below(4.0), [4.0, 0.0, 0.0], [18.0, 0.0, 0.0]));
    let periodic = Boundary::periodic([-8.0; 3], [8.0; 3]);
    assert!(!met(&periodic, [4.0, 0.5, 0.0], [14.0, 0.5, 0.0]));
    assert!(met(&periodic, [4.0, 0.5, 0.0], [20.0, 0.5, 0.0]));
    assert!(!met(&periodic, [4.0, 1.5, 0.0], [20.0, 1.5, 0.0]));
}

#[test]
fn path_without_diffusion_is_followed_to_the_side_of_a_vessel() {
    let vessel = Vessel { along: Some(2), center: [1.0, 0.0, 0.0], radius: 5.0 };
    let domain = Boundary { vessel: Some(vessel), ..Boundary::default() };
    let time = |center: [f32; 3], free_end: [f32; 3]| {
        let before = [1.0, 0.0, 0.0];
        let drift = std::array::from_fn(|k| free_end[k] - before[k]);
        let end = vessel.reflect(before, free_end, &mut [0.0; 3]);
        let mut ball = receiver_state(ReceiverKind::Absorbing);
        (ball.center, ball.receiver.radius) = (center, 0.5);
        let path = Path { before, end, after: end, free: free_end, drift, diffusion: 0.0 };
        hits(&ball, &domain, &path, CONTEXT).map(|hit| hit.time(CONTEXT, 0))
    };
    let [out, back] = [time([1.0, 4.0, 0.0], [1.0, 9.9, 0.0]), time([1.0, 4.0, 7.0], [1.0, 9.9, 11.0])];
    assert!(out.is_some_and(|time| (time - 3.5 / 9.9).abs() < 1e-6), "{out:?}");
    // At 10 − 4 = 6 of 9.9 along y.
    assert!(back.is_some_and(|time| (0.5..6.0 / 9.9).contains(&time)), "{back:?}");
    assert_eq!(time([1.0, 4.0, 2.0], [1.0, 9.9, 11.0]), None);
}

#[test]
fn path_without_diffusion_is_followed_past_the_end_and_the_side_of_a_vessel() {
    let vessel = Vessel { along: Some(2), center: [1.0, 0.0, 0.0], radius: 5.0 };
    let axes = [Axis::Open, Axis::Open, Axis::Reflecting { low: -4.0, high: 4.0 }];
    let domain = Boundary { axes, vessel: Some(vessel) };
    let (before, free_end) = ([1.0, 0.0, 3.0], [1.0, 9.0, 7.5]);
    let drift = std::array::from_fn(|k| free_end[k] - before[k]);
    let end = vessel.reflect(before, free_end, &mut [0.0; 3]);
    let path = Path { before, end, after: domain.confine(end), free: free_end, drift, diffusion: 0.0 };
    let mut ball = receiver_state(ReceiverKind::Absorbing);
    ball.receiver.radius = 0.25;
    for (center, expected) in [([1.0, 3.0, 1.5], true), ([1.0, 3.0, 2.5], false)] {
        ball.center = center;
        assert_eq!(hits(&ball, &domain, &path, CONTEXT).is_some(), expected, "{center:?}");
    }
}

#[test]
fn little_diffusion_hits_as_none_in_a_vessel() {
    let mut ball = receiver_state(ReceiverKind::Absorbing);
    (ball.center, ball.receiver.radius) = ([0.5, 0.3, -0.2], 0.7);
    for along in [None, Some(2)] {
        let vessel = Vessel { along, center: [0.0; 3], radius: 2.0 };
        let domain = Boundary { vessel: Some(vessel), ..Boundary::default() };
        let (mut met, mut others) = (0, 0);
        for id in 0..4000 {
            let context = DrawContext { id, ..CONTEXT };
            let [before, drift] = [0, 1].map(|k| normals(context.draw(k, Purpose::Velocity)));
            let before = vessel.confine(before);
            let drift = drift.map(|z| 1.5 * z);
            let free = std::array::from_fn(|k| before[k] + drift[k]);
            let end = vessel.reflect(before, free, &mut [0.0; 3]);
            let hit = |diffusion| {
                let path = Path { before, end, after: end, free, drift, diffusion };
                hits(&ball, &domain, &path, context).is_some()
            };
            let [exact, found] = [0.0, 1e-9].map(hit);
            met += u32::from(exact);
            others += u32::from(exact != found);
        }
        // Grazing paths may differ.
        assert!(met > 500 && others < 5, "{along:?}: {others} of {met} hits");
    }
}

#[test]
fn halves_of_a_path_follow_the_drift() {
    let open = Boundary::default();
    for (y, expected) in [(0.5, true), (1.2, false)] {
        let step = Path { diffusion: 1e-6, ..path([-3.0, y, 0.0], [9.0, y, 0.0], &open, 0.0) };
        let hit = hits(&receiver_state(ReceiverKind::Absorbing), &open, &step, CONTEXT);
        assert_eq!(hit.is_some(), expected, "{y}");
    }
}

#[test]
fn hit_probability_of_a_long_step_has_the_image_term() {
    for (radius, [a, b], diffusion) in [
        (1.0_f64, [0.5_f64, 0.25_f64], 0.25_f64),
        (1.0, [2.0, 1.0], 8.0),
        (0.1, [3.0, 2.0], 50.0),
        (2.0, [1e-3, 4.0], 1.0),
    ] {
        let density = |distance: f64| (-distance * distance / (4.0 * diffusion)).exp();
        let [from, to] = [radius + a, radius + b];
        let free = density(from - to) - density(from + to);
        let expected = 1.0 - (density(a - b) - density(a + b)) / free;
        let found = hit_probability(radius as f32, [a as f32, b as f32], diffusion as f32);
        assert!((f64::from(found) - expected).abs() < 1e-5 * expected, "{found} and {expected}");
    }
    assert_eq!(hit_probability(0.0, [1.0, 1.0], 1.0), 0.0);
}

#[test]
fn hitting_times_match_a_brownian_bridge() {
    for (heights, seed) in [([1.0_f64, 1.0], 1), ([0.2, 1.5], 2), ([1.5, -0.2], 3), ([0.7, 0.0], 4)] {
        let n = 20_000;
        let hit = Hit { begin: 0.0, fraction: 1.0, heights: heights.map(|h| h as f32) };
        let context = |id| DrawContext { key: Key::new(seed), id, step: 1 };
        let times: Vec<f64> = (0..n).map(|id| hit.time(context(id), 2).into()).collect();
        let [a, b] = heights;
        let density =
            |s: f64| s.powf(-1.5) * (1.0 - s).powf(-0.5) * (-0.5 * (a * a / s + b * b / (1.0 - s))).exp();
        let panels = 20_000;
        let moment = |power: i32| -> f64 {
            let one = |k: i32| {
                let phi = (f64::from(k) + 0.5) / f64::from(panels) * std::f64::consts::FRAC_PI_2;
                let s = phi.sin().powi(2);
                density(s) * s.powi(power) * phi.sin() * phi.cos()
            };
            (0..panels).map(one).sum()
        };
        let [whole, first, second] = [0, 1, 2].map(moment);
        let mean = times.iter().sum::<f64>() / f64::from(n);
        let error = ((second / whole - (first / whole).powi(2)) / f64::from(n)).sqrt();
        assert!((mean - first / whole).abs() < 4.0 * error, "{heights:?}: {mean} and {}", first / whole);
    }
}
