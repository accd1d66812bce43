use lazygrid::Sphere;
use lazygrid_io::read::Frames;
use lazygrid_io::scenes::Scene;
use lazygrid_tests::command::{Scratch, data, table};
use serde_json::json;

use crate::{LAZYGRID, brute_force, detect_file, pairs_by};

fn spheres() -> Vec<Sphere> {
    Scene::FiveSizes.spheres(600, 11)
}

fn xyz(comment: &str) -> String {
    let rows: String = spheres()
        .iter()
        .map(|s| format!("{} {} {} {}\n", s.center.x, s.center.y, s.center.z, s.radius))
        .collect();
    format!("600\nProperties=pos:R:3:radius:R:1 {comment}\n{rows}")
}

fn dump(bounds: &str, scale: Option<[f64; 3]>) -> String {
    let columns = if scale.is_some() { "xs ys zs radius" } else { "x y z radius" };
    let [a, b, c] = scale.unwrap_or([1.0; 3]);
    let rows: String = spheres()
        .iter()
        .map(|s| {
            let [x, y, z] = s.center.to_array().map(f64::from);
            format!("{} {} {} {}\n", x / a, y / b, z / c, s.radius)
        })
        .collect();
    format!(
        "ITEM: TIMESTEP\n7\nITEM: NUMBER OF ATOMS\n600\nITEM: BOX BOUNDS {bounds}\nITEM: ATOMS {columns}\n{rows}"
    )
}

#[test]
fn a_box_of_the_file_is_used_and_said() {
    let scratch = Scratch::new();
    let slab = [Some(16.0), Some(20.0), None];
    let files = [
        ("a.xyz", xyz("Lattice=\"16 0 0 0 20 0 0 0 12\" pbc=\"T T F\"")),
        ("a.dump", dump("pp pp ff\n0 16\n0 20\n0 12", None)),
        ("b.dump", dump("pp pp ff\n0 16\n0 20\n0 16", Some([16.0, 20.0, 16.0]))),
    ];
    let unbounded = brute_force(&spheres(), [None; 3]);
    let expected = brute_force(&spheres(), slab);
    assert!(expected.len() > unbounded.len() + 30, "{} and {}", expected.len(), unbounded.len());
    for (name, text) in files {
        let file = scratch.write(name, &text);
        let output = scratch.path("pairs.csv");
        let run = detect_file(&file, ["-o", &output]).succeeds();
        assert_eq!(table(&output), expected, "{name}");
        let line = "periodic   16,20,- (as the file says; --periodic none for unbounded space)";
        assert!(run.out.lines().any(|l| l == line), "{}", run.out);
        let object = detect_file(&file, ["--json"]).succeeds().json();
        assert_eq!(object["periodic"], json!([16.0, 20.0, null]));
        assert_eq!(object["periodic_from"], "file");

        let run = detect_file(&file, ["-o", &output, "--periodic", "none"]).succeeds();
        assert_eq!(table(&output), unbounded, "{name}");
        assert!(run.out.lines().any(|l| l == "periodic   none (--periodic)"), "{}", run.out);
        let object = detect_file(&file, ["--json", "--periodic", "none"]).succeeds().json();
        assert_eq!((&object["periodic"], &object["periodic_from"]), (&json!(null), &json!("option")));

        detect_file(&file, ["-o", &output, "--periodic", "-,15,12.5"]).succeeds();
        assert_eq!(table(&output), brute_force(&spheres(), [None, Some(15.0), Some(12.5)]), "{name}");
    }
}

#[test]
fn a_box_may_change_from_frame_to_frame() {
    let scratch = Scratch::new();
    let frames = [
        dump("pp pp pp\n0 16\n0 16\n0 16", None),
        dump("pp ff pp\n-1 14\n0 16\n0 12", None),
        dump("ff ff ff\n0 16\n0 16\n0 16", None),
        dump("pp pp pp\n0 16\n0 16\n0 16", None),
    ];
    let file = scratch.write("run.lammpstrj", &frames.concat());
    let counts = detect_file(&file, ["--json"]).succeeds().json_lines();
    let counts: Vec<_> = counts.iter().map(|object| object["pairs"].as_u64().unwrap() as usize).collect();
    let boxes = [[Some(16.0); 3], [Some(15.0), None, Some(12.0)], [None; 3], [Some(16.0); 3]];
    assert_eq!(counts, boxes.map(|lengths| brute_force(&spheres(), lengths).len()));
}

fn brute_force_of_vectors(spheres: &[Sphere], vectors: [[f64; 3]; 3]) -> Vec<[u32; 2]> {
    let steps = (0..343).map(|k| [k % 7 - 3, k / 7 % 7 - 3, k / 49 - 3].map(f64::from));
    let images: Vec<[f64; 3]> =
        steps.map(|n| [0, 1, 2].map(|axis| (0..3).map(|k| n[k] * vectors[k][axis]).sum())).collect();
    pairs_by(spheres.len(), |i, j| {
        let (a, b) = (&spheres[i], &spheres[j]);
        let d = [0, 1, 2].map(|axis| f64::from(a.center[axis]) - f64::from(b.center[axis]));
        let cutoff = f64::from(a.radius) + f64::from(b.radius);
        images
            .iter()
            .any(|image| (0..3).map(|axis| (d[axis] + image[axis]).powi(2)).sum::<f64>() <= cutoff * cutoff)
    })
}

#[test]
fn a_box_that_leans_is_used_and_said() {
    let scratch = Scratch::new();
    let expected =
        brute_force_of_vectors(&spheres(), [[16.0, 0.0, 0.0], [2.0, 16.0, 0.0], [0.0, -3.0, 16.0]]);
    assert_ne!(expected.len(), brute_force(&spheres(), [Some(16.0); 3]).len());
    let output = scratch.path("pairs.csv");
    for (name, text) in [
        ("a.dump", dump("xy xz yz pp pp pp\n0 18 2\n-3 16 0\n0 16 -3", None)),
        ("a.xyz", xyz("Lattice=\"16 0 0 2 16 0 0 -3 16\"")),
    ] {
        let file = scratch.write(name, &text);
        let run = detect_file(&file, ["-o", &output]).succeeds();
        assert_eq!(table(&output), expected, "{name}");
        let line = "periodic   along (16,0,0) (2,16,0) (0,-3,16) (as the file says; --periodic none for unbounded space)";
        assert!(run.out.lines().any(|l| l == line), "{}", run.out);
        let object = detect_file(&file, ["--json"]).succeeds().json();
        assert_eq!(object["cell_vectors"], json!([[16.0, 0.0, 0.0], [2.0, 16.0, 0.0], [0.0, -3.0, 16.0]]));
        let pairs = |periodic| {
            detect_file(&file, ["--json", "--periodic", periodic]).succeeds().json()["pairs"].clone()
        };
        assert_eq!(pairs("none"), brute_force(&spheres(), [None; 3]).len());
        assert_eq!(pairs("16,16,16"), brute_force(&spheres(), [Some(16.0); 3]).len());
        detect_file(&file, ["-o", &output, "--periodic", "16,16,16", "--tilt", "2,0,-3"]).succeeds();
        assert_eq!(table(&output), expected, "{name}");
    }
    let file = scratch.write("b.xyz", &xyz(""));
    assert!(LAZYGRID.run(["detect", &file, "--tilt", "2,0,0"]).err.contains("--periodic"));
    let run = detect_file(&file, ["--periodic", "16,16,16", "--tilt", "1e9,0,0"]).fails();
    assert!(run.err.contains("(1000000000, 16, 0)"), "{}", run.err);
}

/// The length would be 0.100000001 in `f32`.
#[test]
fn lengths_and_tilts_are_not_rounded() {
    let scratch = Scratch::new();
    let point = |x: f64| format!("{x} 0 0 0\n");
    let file = |comment: &str, x: f64| {
        let rows = point(0.0) + &point(x);
        scratch.write("a.xyz", &format!("2\nProperties=pos:R:3:radius:R:1 {comment}\n{rows}"))
    };
    let narrow = f64::from(0.1_f32);
    let lattice = |x: f64, xy: f64| format!("Lattice=\"{x} 0 0 {xy} 4 0 0 0 4\"");
    for (length, pairs) in [(narrow, 1), (0.1, 0)] {
        for (comment, periodic) in
            [(lattice(length, 0.0), None), (String::new(), Some(format!("{length},4,4")))]
        {
            let file = file(&comment, narrow);
            let options = periodic.iter().map(|lengths| format!("--periodic={lengths}"));
            let args = ["detect", "--backend", "cpu", "--json", &file].map(str::to_owned);
            let object = LAZYGRID.run(args.into_iter().chain(options)).succeeds().json();
            assert_eq!(
                (&object["pairs"], &object["periodic"][0]),
                (&json!(pairs), &json!(length)),
                "{comment}"
            );
        }
    }
    let file = file("", 0.0);
    let object = detect_file(&file, ["--json", "--periodic", "1,4,4", "--tilt", "0.1,0,0"]).succeeds().json();
    assert_eq!(object["cell_vectors"][1], json!([0.1, 4.0, 0.0]));
}

/// A periodic box adds pairs across the file's fixed walls (`BOX BOUNDS ff ff ff`).
#[test]
fn the_pour_is_not_periodic_and_could_be() {
    let scratch = Scratch::new();
    let walled = std::fs::read_to_string(data("lammps-pour.dump")).unwrap();
    let file = scratch.write("a.dump", &walled.replacen("BOUNDS ff ff ff", "BOUNDS pp ff pp", 1));
    let spheres = Frames::open(&file, Default::default()).unwrap().next().unwrap().unwrap().spheres;
    let count =
        |file: &str| detect_file(file, ["--json"]).succeeds().json()["pairs"].as_u64().unwrap() as usize;
    assert_eq!(count(&data("lammps-pour.dump")), 3072);
    assert_eq!(count(&file), brute_force(&spheres, [Some(24.0), None, Some(24.0)]).len());
}
