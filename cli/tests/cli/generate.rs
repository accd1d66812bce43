use std::path::Path;

use lazygrid_io::scenes::{Scene, Transceivers};
use lazygrid_tests::command::{Scratch, npy};

use crate::{brute_force, lazygrid, read};

#[test]
fn every_scene_goes_through_every_format() {
    let scratch = Scratch::new();
    for scene in Scene::ALL {
        let spheres = scene.spheres(400, 7);
        let expected = brute_force(&spheres, [None; 3]);
        for extension in ["npy", "csv", "xyz"] {
            let file = scratch.path(&format!("{scene}.{extension}"));
            let pairs = scratch.path("pairs.npy");
            let name = scene.name();
            lazygrid(["generate", name, "-n", "400", "--seed", "7", "--output", &file]).succeeds();
            assert_eq!(read(Path::new(&file)), spheres, "{file}");
            lazygrid(["detect", &file, "--output", &pairs]).succeeds();
            let (shape, found) = npy::<2>(&pairs, "<u4");
            assert_eq!(found, expected, "{file}");
            assert_eq!(shape, format!("({}, 2)", expected.len()));
        }
    }
}

#[test]
fn generate_moves_as_the_benchmarks_do() {
    let scratch = Scratch::new();
    let file = scratch.path("moved.npy");
    lazygrid(["generate", "equal", "-n", "50", "--seed", "3", "--steps", "2", "-o", &file]).succeeds();
    let mut spheres = Scene::Equal.spheres(50, 3);
    Scene::advance(&mut spheres, 3, 0);
    Scene::advance(&mut spheres, 3, 1);
    assert_eq!(read(Path::new(&file)), spheres);
}

#[test]
fn generate_makes_as_many_transceivers_as_large_as_asked_for() {
    let scratch = Scratch::new();
    let file = scratch.path("transceivers.npy");
    let generate = |scene: &str, options: &[&str]| {
        let args = ["generate", scene, "-n", "300", "--seed", "5", "-o", &file];
        lazygrid(args.iter().chain(options))
    };
    let made = |options: &[&str]| {
        generate("transceivers", options).succeeds();
        read(Path::new(&file))
    };
    let scene = |count, ratio| Scene::Transceivers(Transceivers { count, ratio }).spheres(300, 5);
    assert_eq!(made(&["--transceivers", "4", "--size-ratio", "1000"]), scene(4, 1000));
    assert_eq!(made(&["--transceivers", "300"]), scene(300, 100));
    assert_eq!(made(&["--size-ratio", "7"]), scene(30, 7));

    for (scene, options, reason) in [
        ("equal", ["--size-ratio", "7"], "the scene equal has no transceivers"),
        ("burst", ["--transceivers", "7"], "the scene burst has no transceivers"),
        ("transceivers", ["--transceivers", "301"], "--transceivers 301 of 300 spheres"),
        ("transceivers", ["--transceivers", "0"], "0 is not in 1.."),
        ("transceivers", ["--size-ratio", "0"], "0 is not in 1..=1000000"),
    ] {
        let run = generate(scene, &options);
        assert!(run.code == Some(2) && run.err.contains(reason), "{scene} {options:?}: {}", run.err);
    }
}
