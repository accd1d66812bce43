//! Spheres within 2 ulp of tangency in `f64`, which rounding to `f32` would decide otherwise.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::fmt::Write as _;
use std::fs;

use lazygrid_tests::command::{Scratch, has_gpu, npy, npy_bytes, table};
use serde_json::json;

use crate::{LAZYGRID, detect, pairs_by};

type Rows = Vec<[f64; 4]>;
type CellVectors = [Option<[f64; 3]>; 3];

const UNBOUNDED: CellVectors = [None; 3];

struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

fn dot([x, y, z]: [f64; 3]) -> f64 {
    x * x + y * y + z * z
}

fn image(a: &[f64; 4], b: &[f64; 4], vectors: &CellVectors, s: [f64; 3]) -> [f64; 3] {
    let e = vectors.map(|vector| vector.unwrap_or_default());
    [0, 1, 2].map(|k| (b[k] - a[k]) + (s[0] * e[0][k] + s[1] * e[1][k] + s[2] * e[2][k]))
}

fn brute_force(rows: &[[f64; 4]], vectors: &CellVectors) -> Vec<[u32; 2]> {
    let multiples = (0..27).map(|k| [k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1].map(f64::from));
    let is_image = |s: &[f64; 3]| (0..3).all(|k| s[k] == 0.0 || vectors[k].is_some());
    let multiples: Vec<_> = multiples.filter(is_image).collect();
    pairs_by(rows.len(), |i, j| {
        let (a, b) = (&rows[i], &rows[j]);
        let cutoff = a[3] + b[3];
        multiples.iter().any(|&s| dot(image(a, b, vectors, s)) <= cutoff * cutoff)
    })
}

fn in_f32(rows: &[[f64; 4]]) -> Rows {
    rows.iter().map(|row| row.map(|number| f64::from(number as f32))).collect()
}

/// Returns tangent pairs, and asserts that `f32` finds others.
fn tangent(vectors: &CellVectors, seed: u64) -> Rows {
    let mut random = Random(seed);
    let mut rows = Rows::new();
    for k in 0..60 {
        let a = [0, 1, 2].map(|_| 9.9 * random.next());
        let radii = [0, 1].map(|_| 0.05 + 0.2 * random.next());
        let direction = [0, 1, 2].map(|_| random.next() - 0.5);
        let scale = (radii[0] + radii[1]) / dot(direction).sqrt();
        let mut b = [0, 1, 2].map(|k| a[k] + scale * direction[k]);
        for vector in (0..3).filter_map(|axis| vectors[axis].map(|vector| (axis, vector))) {
            let (axis, vector) = vector;
            let out = f64::from(u8::from(b[axis] < 0.0)) - f64::from(u8::from(b[axis] >= vector[axis]));
            b = [0, 1, 2].map(|k| b[k] + out * vector[k]);
        }
        let bits = b[0].abs().to_bits().wrapping_add_signed(k % 5 - 2);
        b[0] = f64::from_bits(bits).copysign(b[0]);
        rows.push([a[0], a[1], a[2], radii[0]]);
        rows.push([b[0], b[1], b[2], radii[1]]);
    }
    let (exact, rounded) = (brute_force(&rows, vectors), brute_force(&in_f32(&rows), vectors));
    assert!(exact.len() > 20 && exact != rounded, "{} pairs", exact.len());
    rows
}

fn lines(rows: &[[f64; 4]], separator: &str) -> String {
    rows.iter().fold(String::new(), |mut text, row| {
        writeln!(text, "{}", row.map(|number| format!("{number:?}")).join(separator)).unwrap();
        text
    })
}

fn csv(rows: &[[f64; 4]]) -> String {
    format!("x,y,z,r\n{}", lines(rows, ","))
}

fn xyz(rows: &[[f64; 4]], comment: &str) -> String {
    format!("{}\nProperties=pos:R:3:radius:R:1 {comment}\n{}", rows.len(), lines(rows, " "))
}

fn dump(rows: &[[f64; 4]], bounds: &str) -> String {
    let head = format!("ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n{}\n", rows.len());
    format!("{head}ITEM: BOX BOUNDS {bounds}\nITEM: ATOMS x y z radius\n{}", lines(rows, " "))
}

fn doubles(rows: &[[f64; 4]]) -> Vec<u8> {
    let data: Vec<u8> = rows.as_flattened().iter().flat_map(|number| number.to_le_bytes()).collect();
    npy_bytes("'<f8'", &format!("({}, 4)", rows.len()), &data)
}

fn check(scratch: &Scratch, file: &str, options: &[&str], expected: &[[u32; 2]]) {
    for backend in if has_gpu() { &["cpu", "gpu"][..] } else { &["cpu"] } {
        let run = |more: &[&str]| {
            let all = ["detect", file, "--backend", backend, "--json"];
            let run = LAZYGRID.run(all.iter().chain(options).chain(more)).succeeds();
            assert_eq!(run.err, "", "{file} {options:?} {more:?} on {backend}");
            let object = run.json();
            assert_eq!(object["precision"], "f64");
            assert_eq!(object["pairs"], expected.len(), "{file} {options:?} {more:?} on {backend}");
        };
        let [csv, npy_path, near] = ["out.csv", "out.npy", "near.csv"].map(|name| scratch.path(name));
        run(&["--count"]);
        run(&["-o", &csv]);
        assert_eq!(table(&csv), expected, "{file} {options:?} on {backend}");
        run(&["-o", &npy_path, "--max-pairs", "7"]);
        assert_eq!(npy::<2>(&npy_path, "<u4").1, expected, "{file} {options:?} on {backend}");
        if *backend == "gpu" && !file.ends_with("a.csv") {
            continue;
        }
        run(&["-o", &npy_path, "--unordered"]);
        let mut unordered = npy::<2>(&npy_path, "<u4").1;
        unordered.sort_unstable();
        assert_eq!(unordered, expected, "{file} {options:?} on {backend}");
        run(&["-o", &near, "--neighbors"]);
        let mut both: Vec<_> = expected.iter().flat_map(|&[i, j]| [[i, j], [j, i]]).collect();
        both.sort_unstable();
        assert_eq!(table(&near), both, "{file} {options:?} on {backend}");
    }
}

#[test]
fn spheres_of_every_format_are_decided_in_f64() {
    let scratch = Scratch::new();
    let rows = tangent(&UNBOUNDED, 1);
    let expected = brute_force(&rows, &UNBOUNDED);
    let array = scratch.path("a.npy");
    fs::write(&array, doubles(&rows)).unwrap();
    for file in [
        array,
        scratch.write("a.csv", &csv(&rows)),
        scratch.write("a.xyz", &xyz(&rows, "")),
        scratch.write("a.dump", &dump(&rows, "ff ff ff\n0 1\n0 1\n0 1")),
    ] {
        check(&scratch, &file, &[], &expected);
    }
}

#[test]
fn spheres_in_boxes_are_decided_in_f64() {
    let scratch = Scratch::new();
    let [long, high] = [-0.3, 9.87];
    let orthogonal = [[10.1, 0.0, 0.0], [0.0, 10.3, 0.0], [0.0, 0.0, high - long]].map(Some);
    let slab = [orthogonal[0], orthogonal[1], None];
    let residue = [Some([10.1, 0.0, 0.0]), Some([1e-9, 10.3, 0.0]), Some([0.0, 0.0, high - long])];
    let tilted = [Some([10.1, 0.0, 0.0]), Some([0.7, 10.3, 0.0]), Some([0.0, 0.1, high - long])];
    let lattice = |vectors: &CellVectors| {
        let numbers =
            vectors.map(|vector| vector.unwrap_or([0.0, 0.0, 1.0]).map(|x| format!("{x:?}")).join(" "));
        let pbc = vectors.map(|vector| if vector.is_some() { "T" } else { "F" }).join(" ");
        format!("Lattice=\"{}\" pbc=\"{pbc}\"", numbers.join(" "))
    };
    for (seed, vectors) in (2..).zip([orthogonal, slab, residue, tilted]) {
        let rows = tangent(&vectors, seed);
        let expected = brute_force(&rows, &vectors);
        let file = scratch.write("a.xyz", &xyz(&rows, &lattice(&vectors)));
        check(&scratch, &file, &[], &expected);
        let length = |k: usize| vectors[k].map_or("-".to_owned(), |vector| format!("{:?}", vector[k]));
        let periodic = [0, 1, 2].map(length).join(",");
        let component = |k: usize, axis: usize| vectors[k].map_or(0.0, |vector| vector[axis]);
        let tilt = format!("{:?},{:?},{:?}", component(1, 0), component(2, 0), component(2, 1));
        let file = scratch.path("a.npy");
        fs::write(&file, doubles(&rows)).unwrap();
        check(&scratch, &file, &["--periodic", &periodic, "--tilt", &tilt], &expected);
        if vectors == orthogonal {
            let bounds = format!("pp pp pp\n0 10.1\n0 10.3\n{long:?} {high:?}");
            let file = scratch.write("a.dump", &dump(&rows, &bounds));
            check(&scratch, &file, &[], &expected);
        }
    }
}

#[test]
fn ids_groups_exclusions_and_frames_are_those_of_f64_spheres() {
    let scratch = Scratch::new();
    let rows = tangent(&UNBOUNDED, 6);
    let all = brute_force(&rows, &UNBOUNDED);
    let excluded = scratch.write("excluded.csv", &format!("{},{}\n", all[0][0], all[0][1]));
    let group = |k: usize| u32::from(all[1].contains(&(k as u32)));
    let line = |k: usize| format!("{},{},{}", lines(&rows[k..=k], ",").trim_end(), k, group(k));
    let table_of = |order: &mut dyn Iterator<Item = usize>| {
        order.fold("x,y,z,r,id,mol\n".to_owned(), |text, k| text + &line(k) + "\n")
    };
    let file = scratch.write("a.csv", &table_of(&mut (0..rows.len()).rev()));
    let output = scratch.path("pairs.csv");
    for backend in if has_gpu() { &["cpu", "gpu"][..] } else { &["cpu"] } {
        let options = ["--ids", "--exclude", &excluded, "--exclude-groups", "-o", &output];
        LAZYGRID.run(["detect", &file, "--backend", backend].iter().chain(&options)).succeeds();
        let text = fs::read_to_string(&output).unwrap();
        let expected: String = all[2..].iter().fold("id_i,id_j\n".to_owned(), |text, [i, j]| {
            let pair = format!("{i},{j}\n");
            text + &pair
        });
        assert_eq!(text, expected, "{backend}");

        // The moves are smaller than the skin, and some pairs change.
        let scenes = [0.0, 1e-9, 3e-9, 0.0].map(|by| {
            let mut moved = rows.clone();
            moved.iter_mut().step_by(2).for_each(|row| row[1] += by);
            moved
        });
        let file = scratch.write("a.xyz", &scenes.each_ref().map(|rows| xyz(rows, "")).concat());
        let numbered = scratch.path("p-{frame}.csv");
        for skin in ["off", "auto", "0.05"] {
            let options = ["--skin", skin, "-o", &numbered];
            LAZYGRID.run(["detect", &file, "--backend", backend].iter().chain(&options)).succeeds();
            for (k, rows) in scenes.iter().enumerate() {
                let found = table(&scratch.path(&format!("p-{k}.csv")));
                assert_eq!(found, brute_force(rows, &UNBOUNDED), "{backend}, skin {skin}, frame {k}");
            }
        }
    }
}

#[test]
fn precision_follows_the_file_unless_it_is_given() {
    let scratch = Scratch::new();
    let rows = tangent(&UNBOUNDED, 7);
    let [exact, rounded] = [&rows, &in_f32(&rows)].map(|rows| brute_force(rows, &UNBOUNDED).len());
    let found = |file: &str, options: &[&str]| {
        let run =
            LAZYGRID.run(["detect", file, "--backend", "cpu", "--json"].iter().chain(options)).succeeds();
        let object = run.json();
        (object["precision"].clone(), object["pairs"].clone(), run.err)
    };
    let in_64 = || (json!("f64"), json!(exact), String::new());
    let narrow: Vec<u8> =
        rows.as_flattened().iter().flat_map(|&number| (number as f32).to_le_bytes()).collect();
    let [wide_file, narrow_file] = ["wide.npy", "narrow.npy"].map(|name| scratch.path(name));
    fs::write(&wide_file, doubles(&rows)).unwrap();
    fs::write(&narrow_file, npy_bytes("'<f4'", &format!("({}, 4)", rows.len()), &narrow)).unwrap();
    let text = scratch.write("a.csv", &csv(&rows));
    for file in [&wide_file, &text] {
        for options in [&[][..], &["--precision", "auto"], &["--precision", "f64"]] {
            assert_eq!(found(file, options), in_64(), "{file}, {options:?}");
        }
        let (precision, pairs, said) = found(file, &["--precision", "f32"]);
        assert_eq!((precision, pairs), (json!("f32"), json!(rounded)), "{file}");
        assert!(said.matches("rounded").count() == 1 && said.contains("--precision f64"), "{said}");
    }
    let in_32 = |precision: &str| (json!(precision), json!(rounded), String::new());
    assert_eq!(found(&narrow_file, &[]), in_32("f32"));
    assert_eq!(found(&narrow_file, &["--precision", "f64"]), in_32("f64"));
    assert!(detect([&text]).succeeds().out.lines().any(|line| line == "precision  f64"));
}

/// The distance is 0.2 rounded up to `f32`. Radii of 0.1 touch in `f32`, but not in `f64`.
#[test]
fn given_radii_are_not_rounded() {
    let scratch = Scratch::new();
    let descr = "[('species', '<i4'), ('x', '<f4'), ('y', '<f4'), ('z', '<f4')]";
    let row = |x: f32| [&7_i32.to_le_bytes()[..], &x.to_le_bytes(), &[0; 8]].concat();
    let file = scratch.path("a.npy");
    fs::write(&file, npy_bytes(descr, "(2,)", &[row(0.0), row(0.2)].concat())).unwrap();
    for (radius, precision, pairs) in [("0.1", "f64", 0), ("0.125", "f32", 1)] {
        let object = detect([&file, "--json", "--radius", &format!("7={radius}")]).succeeds().json();
        assert_eq!((&object["precision"], &object["pairs"]), (&json!(precision), &json!(pairs)), "{radius}");
    }
    let object = detect([&file, "--json", "--radius", "7=0.1", "--precision", "f32"]).succeeds().json();
    assert_eq!(object["pairs"], 1);
}

#[test]
fn numbers_and_lengths_beyond_f32_are_used() {
    let scratch = Scratch::new();
    let rows = [[1e200, 0.0, 0.0, 2e199], [1.03e201, 0.0, 0.0, 2e199], [5e200, 0.0, 0.0, 1e199]];
    let file = scratch.write("a.csv", &csv(&rows));
    let pairs = |options: &[&str]| {
        let run = LAZYGRID.run(["detect", &file, "--backend", "cpu", "--json"].iter().chain(options));
        run.succeeds().json()["pairs"].clone()
    };
    assert_eq!((pairs(&[]), pairs(&["--periodic", "9.5e200,-,-"])), (json!(0), json!(1)));
    let file = scratch.write("a.xyz", &xyz(&rows, "Lattice=\"9.5e200 0 0 0 1 0 0 0 1\" pbc=\"T F F\""));
    assert_eq!(detect([&file, "--json"]).succeeds().json()["pairs"], 1);
    let refused = detect([&file, "--precision", "f32"]).fails().err;
    assert!(refused.contains("no 32-bit number above zero"), "{refused}");
    let radius = scratch.write("b.csv", "x,y,z,r\n0,0,0,1e40\n");
    let refused = detect([&radius, "--precision", "f32"]).fails().err;
    assert!(refused.contains("b.csv, line 2: r is 1e40; values must be finite 32-bit"), "{refused}");
}
