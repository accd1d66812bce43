use super::*;

#[test]
fn bad_f64_spheres_are_refused_while_candidates_serve() {
    let settings = Settings { skin: Skin::Fixed(1.0), ..Settings::default() };
    let mut detector = new_detector(settings);
    let mut rows = wide(&gas(3000, 2, 20.0));
    rows[2000][3] = 0.0;
    // A tiny radius is lost in the growth of the frame's radii, and a large one is cut.
    rows[17][3] = 1e30;
    let all = detector.count(&rows).expect("valid");
    for (k, component, bad) in
        [(2000, 3, -1e-300), (17, 3, f64::INFINITY), (2999, 1, f64::NAN), (0, 2, f64::NEG_INFINITY)]
    {
        assert_eq!(detector.count(&rows), Ok(all));
        assert_eq!(detector.count(&rows), Ok(all));
        let good = std::mem::replace(&mut rows[k][component], bad);
        let refused = detector.count(&rows);
        assert!(
            matches!(refused, Err(Error::Input(InputError::Sphere { index, count: 1, .. })) if index == k as u32),
            "{bad}: {refused:?}"
        );
        rows[k][component] = good;
    }
}

#[test]
fn f64_spheres_that_leave_their_frame_rebuild_the_list() {
    let settings = Settings { skin: Skin::Fixed(1.0), ..Settings::default() };
    let mut detector = new_detector(settings);
    let mut off = new_detector(Settings { skin: Skin::Off, ..Settings::default() });
    let mut rows = wide(&gas(3000, 2, 20.0));
    rows[0] = [-15.8, 0.0, 0.0, 1.0];
    // The frame ends at 16, less than a displacement limit away.
    for (x, rebuilt) in [
        (15.8, Some(RebuildReason::NoList)),
        (15.95, None),
        (16.1, Some(RebuildReason::InputChanged)),
        (16.15, None),
    ] {
        rows[1] = [x, 0.0, 0.0, 1.0];
        assert_eq!(detector.count(&rows), off.count(&rows));
        assert_eq!(detector.report().candidates.expect("there is a skin").rebuilt, rebuilt, "at {x}");
    }
}

#[test]
fn f64_spheres_many_lengths_away_rebuild_the_list() {
    let space = Space::periodic([Some(8.0), None, None]).expect("a box");
    let settings = Settings { skin: Skin::Fixed(1.0), space, ..Settings::default() };
    let mut detector = new_detector(settings.clone());
    let mut off = new_detector(Settings { skin: Skin::Off, ..settings });
    let mut rows = wide(&gas(1000, 2, 8.0));
    for (lengths, rebuilt) in [
        (0_u32, Some(RebuildReason::NoList)),
        (3, None),
        (1 << 15, None),
        (1 << 25, Some(RebuildReason::InputChanged)),
        (1 << 25, None),
    ] {
        let x = rows[5][0] + 8.0 * f64::from(lengths);
        let near = std::mem::replace(&mut rows[5][0], x);
        assert_eq!(detector.count(&rows), off.count(&rows));
        assert_eq!(
            detector.report().candidates.expect("there is a skin").rebuilt,
            rebuilt,
            "{lengths} lengths"
        );
        rows[5][0] = near;
    }
}

/// A call of two sets replaces the frame, but candidates stay.
#[test]
fn candidates_of_another_frame_are_not_used() {
    let space = Space::periodic([Some(1.0), None, None]).expect("a box");
    let settings = Settings { skin: Skin::Fixed(1e-3), space, ..Settings::default() };
    let mut detector = new_detector(settings);
    let near_the_boundary = |scale: f64| -> Vec<[f64; 4]> {
        let row = |x: f64, k: u32| [x, f64::from(k) / 124.5 - 1.0, 0.0, 0.003].map(|number| scale * number);
        (0..250).flat_map(|k| [row(-0.06, k), row(0.06, k)]).collect()
    };
    assert_eq!(detector.count(&near_the_boundary(1.0)), Ok(0));
    assert!(detector.report().candidates.is_some());
    let far_apart = ([[0.0, -8.0, 0.0, 0.1]], [[0.0, 8.0, 0.0, 0.1]]);
    assert_eq!(detector.count((&far_apart.0, &far_apart.1)), Ok(0));
    assert_eq!(detector.count(&near_the_boundary(8.0)), Ok(250));
}
