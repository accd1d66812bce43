use lazygrid::{Interaction, Space, Sphere, Spheres};
use lazygrid_check::scenes::triclinic::{space, tilted};
use lazygrid_check::{ExclusionCase, SpeciesSetup, TestInput};
use lazygrid_io::read::{Frames, Options, pairs};

use super::*;

#[test]
fn a_failing_input_is_written_as_detect_reads_it() {
    let tiny = f32::from_bits(1);
    let spheres = vec![
        Sphere::new([tiny, -3e38, 0.1], 1.0),
        Sphere::new([1.0 / 3.0, -0.0, 1e-38], tiny),
        Sphere::new([f32::MAX, f32::MIN, f32::MIN_POSITIVE], 0.0),
    ];
    let rows = vec![vec![Interaction::Never], vec![Interaction::Within(0.25), Interaction::Touch]];
    let mixture = SpeciesSetup { species: vec![1, 0, 1], rows };
    let directory = tempfile::tempdir().unwrap();
    for mixture in [None, Some(mixture)] {
        let scenario = TestInput { mixture, ..spheres.clone().into() };
        let path = directory.path().join("failing.csv");
        shown::write(&path, &scenario, "x, y and z: 1 missing\nlazygrid detect").unwrap();
        let mut frames = Frames::open(&path, Options::default()).unwrap();
        let frame = frames.next().unwrap().unwrap();
        assert_eq!(frame.spheres, scenario.spheres);
        assert_eq!(frame.species.is_some(), scenario.mixture.is_some());
        let text = std::fs::read_to_string(&path).unwrap();
        assert_eq!(text.contains("#   1 and 0 within 0.25"), scenario.mixture.is_some(), "{text}");
    }
}

fn fault(name: &str, scenario: Option<&TestInput>, options: &str) -> FailedCase {
    let (name, options) = (name.to_owned(), options.to_owned());
    FailedCase { name, scenario: scenario.cloned(), options, ..FailedCase::default() }
}

#[test]
fn commands_reproduce_the_settings() {
    let report = Report::empty(true, "all");
    let path = Path::new("f.csv");
    let scenario =
        TestInput { space: Space::periodic([Some(0.1), None, Some(1e-40)]).unwrap(), ..TestInput::default() };
    let plain = TestInput::default();
    let command_for = |name, scenario, options| report.command(path, &fault(name, scenario, options));
    assert_eq!(
        command_for("soup: naive on cpu", Some(&scenario), " --backend cpu"),
        "lazygrid detect f.csv --backend cpu --periodic 0.1,-,1e-40 --precision f32"
    );
    assert_eq!(
        command_for("fuzz seed 12: naive", Some(&plain), " --count"),
        "lazygrid detect f.csv --count --periodic none --precision f32, or lazygrid check --backend all --seed 12"
    );
    assert_eq!(
        command_for("fuzz seed 12: naive", Some(&scenario), ""),
        "lazygrid check --backend all --seed 12"
    );
    assert_eq!(command_for("radix sort", None, ""), "lazygrid check --backend all");
    let narrow = FailedCase { environment: "LAZYGRID_SIMD=avx2 ", ..fault("soup", Some(&plain), " --tau 1") };
    assert_eq!(
        report.command(path, &narrow),
        "LAZYGRID_SIMD=avx2 lazygrid detect f.csv --tau 1 --periodic none --precision f32"
    );
    assert_eq!(command_for("soup: candidates kept", Some(&plain), ""), "lazygrid check --backend all");
}

#[test]
fn triclinic_boxes_and_exclusions_are_shown() {
    let report = Report::empty(true, "cpu");
    let skewed = TestInput {
        space: space(tilted([Some(4.0), None, Some(0.1)], [9.0, -1.5, 1e-7])),
        groups: Some(vec![u32::MAX - 1, Spheres::NO_GROUP, 0, u32::MAX - 1]),
        excluded: ExclusionCase::new(4, [(3, 1), (0, 2)]).ok(),
        ..vec![Sphere::new([0.5; 3], 1.0); 4].into()
    };
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("f.csv");
    let command = report.command(&path, &fault("soup: naive on cpu", Some(&skewed), " --backend cpu"));
    let folder = directory.path().display();
    let expected = format!(
        "lazygrid detect {folder}/f.csv --backend cpu --periodic 4.0,-,0.10000000149011612 \
         --tilt 0.0,-1.5,1.0000000116860974e-7 --precision f32 \
         --exclude {folder}/f-excluded.csv --exclude-groups"
    );
    assert_eq!(command, expected);
    shown::write(&path, &skewed, &command).unwrap();
    let mut frames = Frames::open(&path, Options { groups: true, ..Options::default() }).unwrap();
    let frame = frames.next().unwrap().unwrap();
    assert_eq!(
        (frame.spheres, frame.groups),
        (skewed.spheres.clone(), Some(vec![1, Spheres::NO_GROUP, 2, 1]))
    );
    assert_eq!(pairs(directory.path().join("f-excluded.csv")).unwrap(), [(0, 2), (1, 3)]);
    let [x, y, z] = [[1.0, 0.5, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]].map(|vector| Some(vector.into()));
    let any = TestInput { space: space([x, y, z]), ..skewed };
    let command = report.command(&path, &fault("soup: naive on cpu", Some(&any), " --backend cpu"));
    assert_eq!(command, "lazygrid check --backend cpu");
    shown::write(&path, &any, &command).unwrap();
    assert!(std::fs::read_to_string(&path).unwrap().contains("\n#   1.0 0.5 0.0\n"));
}

#[test]
fn counts_that_differ_are_wrong() {
    let mut report = Report::empty(true, "all");
    let mut count = |backend, spheres, pairs| {
        let label = TimingLabel { backend, algorithm: Algorithm::Naive, scene: Scene::Equal, spheres };
        report.compare_count(label, pairs);
        report.failures.len()
    };
    assert_eq!(count(Backend::Cpu, 10, 5), 0);
    assert_eq!(count(Backend::Gpu, 10, 7), 0);
    assert_eq!(count(Backend::Gpu, 10, 8), 1);
    assert_eq!(count(Backend::Cpu, 10, 6), 2);
    assert_eq!(count(Backend::Cpu, 20, 6), 2);
    assert!(matches!(report.finish(), Err(CliError::Wrong { failures: 2 })));
}

#[test]
fn verdict_comes_before_a_closed_output() {
    let finished = |is_json, fails| {
        let mut report = Report::empty(is_json, "cpu");
        report.printer = Printer::closed();
        if fails {
            let (name, what) = ("radix sort".to_owned(), "not sorted".to_owned());
            report.failure(FailedCase { name, what, ..FailedCase::default() });
        }
        report.finish()
    };
    for is_json in [false, true] {
        assert!(matches!(finished(is_json, true), Err(CliError::Wrong { failures: 1 })));
        assert!(matches!(finished(is_json, false), Err(CliError::Stdout(_))));
    }
}

#[test]
fn scenes_that_a_variant_does_not_take_are_listed() {
    let mut report = Report::empty(true, "gpu");
    let searches = |name: &str, scenes| vec![(name.to_owned(), scenes)];
    let (left_out, not_taken) = (searches("naive on gpu", 3), searches("lazy-grid on gpu", 24));
    report.scenes([90, 15, 0], [&left_out, &not_taken], Duration::ZERO);
    let scenes = &report.object["scenes"];
    assert_eq!(
        (&scenes["left_out"], &scenes["not_taken"]),
        (&json!({ "naive on gpu": 3 }), &json!({ "lazy-grid on gpu": 24 }))
    );
}
