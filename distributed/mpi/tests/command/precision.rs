use std::fmt::Write as _;
use std::path::Path;

use lazygrid::{Space, Sphere};
use serde_json::{Value, json};

use crate::{array, csv, error, npy, pairs, run, stdout};

type Rows = Vec<[f64; 4]>;

fn random(state: &mut u64) -> f64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 11) as f64 / (1_u64 << 53) as f64
}

fn tangent(space: &Space) -> Rows {
    let (mut state, mut rows) = (3, Rows::new());
    for k in 0..90 {
        let a = [0, 1, 2].map(|_| 9.9 * random(&mut state));
        let b = a.map(|x| (x + 0.6 * (random(&mut state) - 0.5)).rem_euclid(9.9));
        let apart = space.minimum_image(a, b).length();
        let radius = apart * random(&mut state);
        let rest = (apart - radius).to_bits().saturating_add_signed(k % 5 - 2);
        let radii = if apart < 1.0 { [radius, f64::from_bits(rest)] } else { [0.1; 2] };
        rows.extend([(a, radii[0]), (b, radii[1])].map(|([x, y, z], r)| [x, y, z, r]));
    }
    rows
}

fn in_f32(rows: &[[f64; 4]]) -> Vec<Sphere> {
    rows.iter().map(|row| Sphere::from(row.map(|x| x as f32))).collect()
}

fn lines(rows: &[[f64; 4]], separator: &str) -> String {
    rows.iter().fold(String::new(), |mut text, row| {
        writeln!(text, "{}", row.map(|number| format!("{number:?}")).join(separator)).unwrap();
        text
    })
}

fn doubles(rows: &[[f64; 4]]) -> Vec<u8> {
    let text = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({}, 4), }}\n", rows.len());
    let data: Vec<u8> = rows.as_flattened().iter().flat_map(|number| number.to_le_bytes()).collect();
    array(&text, &data)
}

fn detect(directory: &Path, ranks: usize, arguments: &[&str]) -> (Value, String) {
    let output = ["-o", "pairs.csv", "--gather", "--json"];
    let said = stdout(ranks, directory, &[arguments, &output].concat());
    (serde_json::from_str(&said).unwrap(), std::fs::read_to_string(directory.join("pairs.csv")).unwrap())
}

#[test]
fn text_and_arrays_of_f64_are_decided_in_f64() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name);
    let slab = Space::periodic([Some(10.1), Some(10.3), None]).unwrap();
    let cell = [Some([10.1, 0.0, 0.0]), Some([0.7, 10.3, 0.0]), Some([0.0, 0.1, 10.17])];
    let lattices = [
        (Space::UNBOUNDED, "", &["none"][..]),
        (slab, "Lattice=\"10.1 0 0 0 10.3 0 0 0 1\" pbc=\"T T F\"", &["10.1,10.3,-"]),
        (Space::triclinic(cell).unwrap(), "Lattice=\"10.1 0 0 0.7 10.3 0 0 0.1 10.17\" pbc=\"T T T\"", &[]),
    ];
    for (space, lattice, options) in lattices {
        let rows = tangent(&space);
        let exact = pairs(&rows, space);
        assert!(exact.len() > 40 && exact != pairs(&in_f32(&rows), space), "{space:?}");
        std::fs::write(at("a.npy"), doubles(&rows)).unwrap();
        std::fs::write(at("a.csv"), format!("x,y,z,r\n{}", lines(&rows, ","))).unwrap();
        let head = format!("{}\nProperties=pos:R:3:radius:R:1 {lattice}\n", rows.len());
        std::fs::write(at("a.xyz"), head + &lines(&rows, " ")).unwrap();
        let periodic: Vec<&str> = options.iter().flat_map(|lengths| ["--periodic", lengths]).collect();
        let files = [("a.xyz", &[][..]), ("a.csv", &periodic[..]), ("a.npy", &periodic[..])];
        for (file, options) in files.into_iter().take(if options.is_empty() { 1 } else { 3 }) {
            for more in [&["--no-rebalance"][..], &["--precision", "f64"]] {
                let (said, found) = detect(directory.path(), 3, &[&[file], options, more].concat());
                assert!(found == csv(&exact), "{file} {options:?} {more:?} in {space:?}");
                assert_eq!((&said["precision"], &said["pairs"]), (&json!("f64"), &json!(exact.len())));
            }
        }
    }
}

#[test]
fn precision_follows_the_files_unless_it_is_given() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name);
    let space = Space::periodic([Some(10.1), None, Some(10.3)]).unwrap();
    let rows = tangent(&space);
    let narrow = in_f32(&rows);
    let [exact, rounded] = [pairs(&rows, space), pairs(&narrow, space)].map(|pairs| csv(&pairs));
    assert_ne!(exact, rounded);
    std::fs::write(at("wide.csv"), format!("x,y,z,r\n{}", lines(&rows, ","))).unwrap();
    std::fs::write(at("wide.npy"), doubles(&rows)).unwrap();
    std::fs::write(at("narrow.npy"), npy(&narrow)).unwrap();
    let periodic = ["--periodic", "10.1,-,10.3"];
    for (file, options, precision, expected) in [
        ("wide.csv", &[][..], "f64", &exact),
        ("wide.npy", &["--precision", "auto"], "f64", &exact),
        ("wide.npy", &["--precision", "f32"], "f32", &rounded),
        ("wide.csv", &["--precision", "f32"], "f32", &rounded),
        ("narrow.npy", &[], "f32", &rounded),
        ("narrow.npy", &["--precision", "f64"], "f64", &rounded),
    ] {
        let (said, found) = detect(directory.path(), 2, &[&[file], &periodic[..], options].concat());
        assert!(found == *expected, "{file} {options:?}");
        assert_eq!(said["precision"], precision, "{file} {options:?}");
        assert_eq!(said["periodic"], json!([10.1, null, 10.3]));
    }
    let rounding = run(2, directory.path(), &["wide.csv", "--precision", "f32"]);
    assert!(String::from_utf8(rounding.stderr).unwrap().contains("--precision f64"));
    let refused = error(2, directory.path(), &["wide.csv", "--precision", "f16"], 2);
    assert!(refused.contains("f16"), "{refused}");
}

#[test]
fn files_of_ranks_may_have_different_types() {
    let directory = tempfile::tempdir().unwrap();
    let mut rows = tangent(&Space::UNBOUNDED);
    for row in rows.iter_mut().step_by(2) {
        *row = row.map(|x| f64::from(x as f32));
    }
    let [even, odd]: [Rows; 2] = [0, 1].map(|k| rows.iter().copied().skip(k).step_by(2).collect());
    std::fs::write(directory.path().join("part-0.npy"), npy(&in_f32(&even))).unwrap();
    std::fs::write(directory.path().join("part-1.npy"), doubles(&odd)).unwrap();
    let all = [even, odd].concat();
    let (said, found) = detect(directory.path(), 2, &["part-{rank}.npy"]);
    assert!(found == csv(&pairs(&all, Space::UNBOUNDED)));
    assert_eq!(said["precision"], "f64");
    let (said, found) = detect(directory.path(), 2, &["part-{rank}.npy", "--precision", "f32"]);
    assert!(found == csv(&pairs(&in_f32(&all), Space::UNBOUNDED)));
    assert_eq!(said["precision"], "f32");
}
