use std::path::{Path, PathBuf};

use lazygrid::Config;
use lazygrid_io::read::{Format, Frames, Options};
use lazygrid_tests::{SuiteVariant, TestInput, checksum, variants};

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data").join(name)
}

fn frame(name: &str, format: Option<Format>, radii: &[(&str, f32)]) -> TestInput {
    let radii = radii.iter().map(|&(name, radius)| (name.to_owned(), radius.into())).collect();
    let frames =
        Frames::open(data(name), Options { format, radii, ..Options::default() }).expect("the file opens");
    let mut frames: Vec<_> = frames.collect::<Result<_, _>>().expect("the file is well-formed");
    assert_eq!(frames.len(), 1);
    frames.remove(0).spheres.into()
}

fn check(scenario: &TestInput, spheres: usize, pairs: usize, sum: u64) {
    assert_eq!(scenario.spheres.len(), spheres);
    let expected = scenario.oracle();
    assert_eq!((expected.len(), checksum(&expected)), (pairs, sum));
    for variant in variants::all() {
        let verdict = variant.verify(scenario, &expected, &Config::default());
        verdict.unwrap_or_else(|text| panic!("{text}"));
    }
}

/// A granular pour of diameters 2, 1 and ½ from LAMMPS. SciPy's cKDTree and LAMMPS find 3072 pairs.
#[test]
fn lammps_pour() {
    check(&frame("lammps-pour.dump", None, &[]), 15_208, 3_072, 0x9545_c450_a3ed_9bf6);
}

/// Two carrier species released at two points, from Smoldyn. SciPy's cKDTree finds 35,236 pairs.
#[test]
fn smoldyn_burst() {
    let radii = [("acid", 0.1), ("base", 0.15), ("salt", 0.2)];
    check(&frame("smoldyn-burst.lst", None, &radii), 10_623, 35_236, 0x4121_022f_05b3_18c3);
}
