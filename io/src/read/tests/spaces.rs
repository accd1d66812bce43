use super::*;

fn spaces(name: &str, text: impl Into<Vec<u8>>) -> Vec<[Option<f32>; 3]> {
    let frames = frames(name, text, Options::default()).unwrap();
    frames.iter().map(|frame| frame.space.lengths_f32()).collect()
}

fn xyz(comment: &str) -> String {
    format!("1\nProperties=pos:R:3:radius:R:1 {comment}\n1 2 3 0.5\n")
}

#[test]
fn xyz_lattices() {
    const BOX: &str = "Lattice=\"10 0 0 0 20.5 0 0 0 30\"";
    let all = [Some(10.0), Some(20.5), Some(30.0)];
    for (comment, lengths) in [
        (BOX.to_owned(), all),
        (String::new(), [None; 3]),
        (format!("{BOX} pbc=\"T T T\""), all),
        (format!("{BOX} pbc=\"T T F\""), [Some(10.0), Some(20.5), None]),
        (format!("pbc=[False, true, 0] {BOX}"), [None, Some(20.5), None]),
        (format!("{BOX} pbc=\"F F F\""), [None; 3]),
        ("pbc=\"F F F\"".into(), [None; 3]),
        ("lattice = '10 20.5 30'".into(), all),
        ("Lattice=[[10, 0, 0], [0, 20.5, 0], [0, 0, 30]] Origin=\"-5 -5 -5\"".into(), all),
        ("note=\"Lattice=1 pbc=2\"".into(), [None; 3]),
        ("Lattice=\"10 0 0 0 20.5 0 3 3 30\" pbc=\"T T F\"".into(), [Some(10.0), Some(20.5), None]),
    ] {
        assert_eq!(spaces("a.xyz", xyz(&comment)), [lengths], "{comment}");
    }
    let plain = format!("1\n{BOX}\nA 1 2 3\n");
    let frames = frames("a.xyz", plain, options(None, &[("A", 1.0)])).unwrap();
    assert_eq!(frames[0].space.lengths_f32(), all);
}

#[test]
fn lammps_bounds() {
    let one = |bounds: &str| dump(bounds, "x y z radius", "1 2 3 0.5");
    for (bounds, lengths) in [
        ("pp pp pp\n0 10\n-5 15.5\n0 3e1", [Some(10.0), Some(20.5), Some(30.0)]),
        ("pp ff pp\n0 10\n-5 15.5\n0 30", [Some(10.0), None, Some(30.0)]),
        ("ff ss mm\n0 10\n-5 15.5\n0 30", [None; 3]),
        ("fs pp sf\n0 10\n-5 15.5\n0 30", [None, Some(20.5), None]),
        ("\n0 10\n-5 15.5\n0 30", [None; 3]),
        ("xy xz yz pp pp ff\n0 10 0\n-5 15.5 0\n0 30 0", [Some(10.0), Some(20.5), None]),
        ("abc origin pp pp pp\n10 0 0 1\n0 20.5 0 2\n0 0 30 3", [Some(10.0), Some(20.5), Some(30.0)]),
        ("abc origin\n10 0 0 1\n3 20.5 0 2\n0 0 30 3", [None; 3]),
    ] {
        assert_eq!(spaces("a.dump", one(bounds)), [lengths], "{bounds}");
    }
    let shrinking = one("pp pp pp\n0 10\n0 10\n0 10")
        + &one("pp pp pp\n0 9\n0 8\n0 7.5")
        + &one("ff ff ff\n0 9\n0 9\n0 9");
    assert_eq!(spaces("a.dump", shrinking), [[Some(10.0); 3], [Some(9.0), Some(8.0), Some(7.5)], [None; 3]]);
}

#[test]
fn lammps_bounds_that_would_lose_a_period_or_a_tilt_are_refused() {
    for (bounds, message) in [
        (
            "pp pp\n0 1\n0 1\n0 1",
            "line 5: expected three boundary flags after BOX BOUNDS, such as pp pp ff, or none",
        ),
        ("pp pp px\n0 1\n0 1\n0 1", "line 5: expected three boundary flags after BOX BOUNDS"),
        ("PP PP PP\n0 1\n0 1\n0 1", "line 5: expected three boundary flags after BOX BOUNDS"),
        (
            "pp pp pp\n0 1 0.5\n0 1 0\n0 1 0",
            "line 6: expected the low and the high bound of an axis, two numbers",
        ),
        (
            "xy xz yz pp pp pp\n0 1\n0 1\n0 1",
            "line 6: expected the low and the high bound of an axis and a tilt",
        ),
        (
            "abc origin pp pp pp\n1 0 0\n0 1 0\n0 0 1",
            "line 6: expected a cell vector and a coordinate of the origin",
        ),
    ] {
        let text = dump(bounds, "x y z radius", "1 2 3 0.5");
        let refused = refusal("a.dump", text.clone(), &[]);
        assert!(refused.starts_with(&format!("a.dump, {message}")), "{refused}");
        if bounds.lines().nth(1) == Some("0 1") && !bounds.starts_with("xy") {
            let space = Some(Space::UNBOUNDED);
            assert!(frames("a.dump", text, Options { space, ..Options::default() }).is_ok(), "{bounds}");
        }
    }
}

#[test]
fn boxes_that_lean() {
    let skewed =
        |name: &str, text: String| frames(name, text, Options::default()).unwrap()[0].space.cell_vectors();
    let vectors = [[10.0, 0.0, 0.0], [2.0, 20.0, 0.0], [-1.0, 3.0, 30.0]].map(Some);
    // LAMMPS writes the bounding box of the corners.
    let bounds = "xy xz yz pp pp pp\n-1 12 2\n-5 18 -1\n0 30 3";
    let dump_of = |bounds: &str| dump(bounds, "x y z radius", "1 2 3 0.5");
    assert_eq!(skewed("a.dump", dump_of(bounds)), vectors);
    let slab = dump_of(&bounds.replace("pp pp pp", "pp pp ff"));
    assert_eq!(skewed("a.dump", slab), [vectors[0], vectors[1], None]);
    assert_eq!(skewed("a.dump", dump_of("abc origin pp pp pp\n10 0 0 1\n2 20 0 2\n-1 3 30 3")), vectors);
    assert_eq!(skewed("a.xyz", xyz("Lattice=\"10 0 0 2 20 0 -1 3 30\"")), vectors);
    let turned = [None, Some([1.0, 2.0, 3.0]), Some([0.0, 0.0, 5.0])];
    assert_eq!(skewed("a.xyz", xyz("Lattice=\"9 9 9 1 2 3 0 0 5\" pbc=\"F T T\"")), turned);
}

#[test]
fn a_given_space_overrides_the_file() {
    let flat = dump("pp pp pp\n0 10\n0 10\n4 4", "x y z radius", "1 2 3 0.5");
    let without = xyz("pbc=\"T T T\"");
    for (name, text) in [("a.dump", flat), ("a.xyz", without), ("a.xyz", xyz("Lattice=cubic pbc=maybe"))] {
        assert!(frames(name, text.clone(), Options::default()).is_err());
        for space in [Space::UNBOUNDED, Space::periodic([Some(7.0), None, None]).unwrap()] {
            let options = Options { space: Some(space), ..Options::default() };
            assert_eq!(frames(name, text.clone(), options).unwrap()[0].space, space);
        }
    }
    let space = Space::periodic([Some(7.0); 3]).unwrap();
    let options = Options { space: Some(space), ..Options::default() };
    assert_eq!(frames("a.csv", "x,y,z,r\n1,2,3,4\n", options).unwrap()[0].space, space);
}

#[test]
fn refusals_name_line_and_remedy() {
    let flat = dump("abc origin pp pp pp\n10 0 0 0\n20 0 0 0\n0 0 9 0", "x y z radius", "1 2 3 0.5");
    for (name, text, message) in [
        (
            "a.dump",
            flat,
            "a.dump, line 5: the box cannot be periodic: the cell vectors (10, 0, 0), (20, 0, 0), (0, 0, 9)",
        ),
        (
            "a.dump",
            dump("pp pp pp\n0 10\n0 10\n4 4", "x y z radius", "1 2 3 0.5"),
            "a.dump, line 5: the box is periodic along z and its length there is 0, no 32-bit number above zero",
        ),
        (
            "a.dump",
            dump("xy xz yz pp pp pp\n0 1 5\n0 1 0\n0 1 0", "x y z radius", "1 2 3 0.5"),
            "a.dump, line 6: high without the tilts is -4; the high bound of an axis must not be less than the low one",
        ),
        (
            "a.xyz",
            xyz("Lattice=\"1 0 0 2\""),
            "a.xyz, line 2: expected Lattice=\"ax ay az bx by bz cx cy cz\"",
        ),
        ("a.xyz", xyz("Lattice=\"1 2 three\""), "a.xyz, line 2: Lattice 'three' is not a number"),
        (
            "a.xyz",
            xyz("Lattice=\"1 2 3\" pbc=\"T T\""),
            "a.xyz, line 2: expected pbc=\"T T F\", one of T and F",
        ),
        ("a.xyz", xyz("pbc=\"T T F\""), "a.xyz, line 2: expected Lattice= with a periodic pbc="),
    ] {
        let refused = refusal(name, text, &[]);
        assert!(refused.starts_with(message), "{refused}");
        let has_remedy =
            ["--periodic", "is not a number", "the high bound"].iter().any(|phrase| refused.contains(phrase));
        assert!(has_remedy, "{refused}");
    }
}
