use std::ops::ControlFlow;

use lazygrid::{
    Algorithm, Backend, Config, Detector, Error, InputError, Interaction, Interactions, Sphere, Spheres,
};
use lazygrid_tests::{SuiteVariant, variants};

fn refusal(config: &Config, spheres: Spheres<'_>) -> Error {
    let mut errors = Vec::new();
    for variant in variants::all() {
        let config = config.clone().backend(variant.backend()).algorithm(variant.algorithm);
        let mut detector = Detector::new(config).expect("a detector");
        variant.run(|| {
            errors.push(detector.pairs(spheres).map(|_| ()).expect_err("pairs"));
            errors.push(detector.count(spheres).map(|_| ()).expect_err("count"));
            errors.push(detector.neighbors(spheres).map(|_| ()).expect_err("neighbors"));
            let stream = detector.stream(spheres, 10, |_| ControlFlow::Continue(()));
            errors.push(stream.map(|_| ()).expect_err("stream"));
        });
    }
    let first = errors.swap_remove(0);
    // NaN differs from itself, but its text does not.
    errors.iter().for_each(|error| assert_eq!(format!("{error:?}"), format!("{first:?}")));
    first
}

#[test]
fn non_finite_or_negative_spheres_are_refused() {
    let good = Sphere::new([1.0, 2.0, 3.0], 0.5);
    let bad = [
        Sphere::new([f32::NAN, 0.0, 0.0], 1.0),
        Sphere::new([0.0, f32::INFINITY, 0.0], 1.0),
        Sphere::new([0.0, 0.0, f32::NEG_INFINITY], 1.0),
        Sphere::new([0.0; 3], f32::NAN),
        Sphere::new([0.0; 3], f32::INFINITY),
        Sphere::new([0.0; 3], -1.0),
        Sphere::new([0.0; 3], -f32::from_bits(1)),
    ];
    for wrong in bad {
        for (n, indices) in [(1, &[0][..]), (2, &[1]), (300, &[299]), (70_000, &[40_000, 40_001, 69_999])] {
            let mut spheres = vec![good; n];
            indices.iter().for_each(|&at| spheres[at] = wrong);
            let Error::Input(InputError::Sphere { index, center, radius, count, total }) =
                refusal(&Config::default(), (&spheres).into())
            else {
                panic!("another error")
            };
            assert_eq!((index, count, total), (indices[0] as u32, indices.len() as u64, n as u64));
            let numbers = [wrong.center.x, wrong.center.y, wrong.center.z, wrong.radius].map(f64::from);
            let [x, y, z] = center;
            assert_eq!(format!("{:?}", [x, y, z, radius]), format!("{numbers:?}"));
        }
    }
}

#[test]
fn bad_sphere_message_names_index_value_and_count() {
    let spheres = [[0.0, 0.0, 0.0, 1.0], [4.5, 0.0, 0.0, -2.5], [0.0, f32::NAN, 0.0, 1.0]];
    let text = refusal(&Config::default(), spheres[..].into()).to_string();
    for phrase in ["sphere 1", "4.5", "-2.5", "2 of 3"] {
        assert!(text.contains(phrase), "'{phrase}' is not in: {text}");
    }
}

#[test]
fn signed_zeros_are_valid() {
    let spheres = [[0.0, -0.0, 0.0, -0.0], [-0.0, 0.0, 0.0, 0.0]];
    for variant in variants::all() {
        let mut detector = Detector::new(variant.settings()).expect("a detector");
        assert_eq!(detector.count(&spheres[..]), Ok(1), "{variant}");
    }
}

#[test]
fn missing_or_invalid_species_are_refused() {
    let spheres = vec![Sphere::new([0.0; 3], 1.0); 3];
    let table = Interactions::new(2, Interaction::Touch).expect("a table");
    let config = Config::default().interactions(table);
    let spheres = Spheres::from(&spheres);
    assert_eq!(refusal(&config, spheres), Error::Input(InputError::SpeciesMissing));
    let ids = [0, 2, 9];
    let outside = InputError::SpeciesId { index: Some(1), id: 2, count: 2 };
    assert_eq!(refusal(&config, spheres.with_species(&ids).expect("three ids")), Error::Input(outside));
}

#[test]
fn invalid_interaction_tables_are_refused() {
    let species = Interactions::MAX_SPECIES + 1;
    let too_many = InputError::SpeciesCount { count: species, limit: Interactions::MAX_SPECIES };
    assert_eq!(Interactions::new(species, Interaction::Never), Err(too_many));
    assert!(Interactions::new(Interactions::MAX_SPECIES, Interaction::Never).is_ok());
    let mut table = Interactions::new(3, Interaction::Never).expect("a table");
    let outside = InputError::SpeciesId { index: None, id: 3, count: 3 };
    assert_eq!(table.set(1, 3, Interaction::Touch), Err(outside.clone()));
    assert_eq!(table.set(3, 1, Interaction::Touch), Err(outside));
    for distance in [-1.0, f64::NAN, f64::INFINITY] {
        let refused = table.set(1, 2, Interaction::Within(distance));
        assert!(matches!(refused, Err(InputError::Distance { a: 1, b: 2, .. })), "{refused:?}");
        assert!(Interactions::new(1, Interaction::Within(distance)).is_err());
    }
    assert_eq!(table.get(1, 2), Interaction::Never);
}

#[test]
fn columns_of_different_lengths_are_refused() {
    let (two, three) = (&[0.0_f32; 2][..], &[0.0_f32; 3][..]);
    for (k, name) in [(1, "y"), (2, "z"), (3, "r")] {
        let mut columns = [three; 4];
        columns[k] = two;
        let [x, y, z, r] = columns;
        let error = Spheres::columns(x, y, z, r).expect_err("lengths differ");
        assert_eq!(error, InputError::Lengths { what: name, length: 2, expected: 3 });
    }
    let spheres = Spheres::columns(three, three, three, three).expect("equal lengths");
    for ids in [&[][..], &[0; 2], &[0; 4]] {
        let error = spheres.with_species(ids).expect_err("lengths differ");
        assert_eq!(error, InputError::Lengths { what: "species", length: ids.len(), expected: 3 });
    }
}

#[test]
fn settings_out_of_range_are_refused() {
    let refused = |config: Config| Detector::new(config.backend(Backend::Cpu)).expect_err("refused");
    for variant in variants::each_algorithm() {
        let with = |ratio| Detector::new(variant.settings().cell_ratio(ratio));
        for ratio in [0.49, 0.1, 16.01, f32::NAN, f32::INFINITY, -1.0] {
            let Err(error) = with(ratio) else { panic!("{variant}: {ratio} is accepted") };
            let known = matches!(error, Error::InvalidSetting { name: "cell_ratio", .. });
            assert!(known && error.to_string().contains(&ratio.to_string()), "{variant}: {error:?}");
        }
        for ratio in [0.5, 16.0] {
            assert!(with(ratio).is_ok(), "{variant}: {ratio} is refused");
        }
    }
    let error = refused(Config::default().threads(0));
    assert!(matches!(error, Error::InvalidSetting { name: "threads", .. }), "{error:?}");
    for algorithm in [Algorithm::EagerGrid, Algorithm::LazyGrid] {
        let error = refused(Config::default().algorithm(algorithm));
        assert_eq!(error, Error::NotOnBackend { algorithm, backend: Backend::Cpu });
    }
}
