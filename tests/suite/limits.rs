use std::ops::ControlFlow;

use lazygrid::{Algorithm, Backend, Config, Detector, Error, Order, Sphere};
use lazygrid_tests::{SuiteVariant, variants};

fn coincident(n: usize) -> Vec<Sphere> {
    vec![Sphere::new([1.0, -2.0, 3.0], 0.5); n]
}

#[test]
fn more_pairs_than_32_bits_hold_are_counted_exactly() {
    let spheres = coincident(100_000);
    let mut detector = Detector::new(Config::default().backend(Backend::Cpu)).expect("a detector");
    assert_eq!(detector.count(&spheres), Ok(4_999_950_000));
    assert_eq!(detector.report().algorithm, Algorithm::CellList);
}

#[test]
fn a_stream_of_half_a_million_coincident_spheres_can_be_stopped() {
    let spheres = coincident(500_000);
    let config = Config::default().backend(Backend::Cpu).order(Order::Unordered);
    let mut detector = Detector::new(config).expect("a detector");
    let mut received = 0;
    let delivered = detector.stream(&spheres, 1000, |pairs| {
        received += pairs.len() as u64;
        if received >= 1_000_000 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert_eq!(delivered, Ok(received));
    assert!((1_000_000..1_001_000).contains(&received), "{received}");
}

#[test]
fn list_of_too_many_pairs_is_refused_with_its_count() {
    let limit = 1 << 20;
    for variant in variants::each_algorithm() {
        let (n, found) = match variant.backend() {
            Backend::Gpu => (2000, 1_999_000),
            _ => (8000, 31_996_000),
        };
        let spheres = coincident(n);
        let mut detector = Detector::new(variant.settings().max_pairs(limit)).expect("a detector");
        assert_eq!(detector.count(&spheres), Ok(found), "{variant}");
        let Err(error) = detector.pairs(&spheres) else { panic!("{variant}: a list of {found} pairs") };
        assert_eq!(error, Error::TooManyPairs { found, limit }, "{variant}");
        let text = error.to_string();
        for phrase in [&found.to_string(), "1048576", "max_pairs", "stream"] {
            assert!(text.contains(phrase), "'{phrase}' is not in: {text}");
        }
    }
}

#[test]
fn coincident_points_are_counted_exactly() {
    let spheres = vec![Sphere::new([1e30, 0.0, -1e-30], 0.0); 10_000];
    for variant in variants::each_algorithm() {
        let (n, found) = match variant.backend() {
            Backend::Gpu => (2000, 1_999_000),
            _ => (10_000, 49_995_000),
        };
        let mut detector = Detector::new(variant.settings()).expect("a detector");
        assert_eq!(detector.count(&spheres[..n]), Ok(found), "{variant}");
    }
}

/// The squares of the cutoff and, in `f32`, of the distance are at the end of the range.
#[test]
fn contact_of_spheres_whose_squares_overflow_is_exact() {
    let far = (11_863_283_u64 << 40) as f32;
    let [radius, near] = [63, 38].map(|exponent| 2.0_f32.powi(exponent));
    let apart = [Sphere::new([far, far, 0.0], radius), Sphere::new([-near, -near, 0.0], radius)];
    let touching = [apart[0], Sphere::new([near, near, 0.0], radius)];
    for variant in variants::each_algorithm().into_iter().filter(|variant| variant.backend() == Backend::Cpu)
    {
        let mut detector = Detector::new(variant.settings()).expect("a detector");
        assert_eq!(detector.count(&apart), Ok(0), "{variant}");
        assert_eq!(detector.count(&touching), Ok(1), "{variant}");
    }
}
