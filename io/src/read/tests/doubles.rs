use super::*;

fn doubles(name: &str, bytes: impl Into<Vec<u8>>, radii: &[(&str, f64)]) -> Result<Frame, Error> {
    let radii = radii.iter().map(|&(name, r)| (name.to_owned(), r)).collect();
    let options = Options { radii, precision: Precision::F64, ..Options::default() };
    let mut frames = frames(name, bytes, options)?;
    assert_eq!(frames.len(), 1);
    Ok(frames.remove(0))
}

fn npy(descr: &str, fortran: &str, shape: &str, numbers: &[f64]) -> Vec<u8> {
    let header = format!("{{'descr': {descr}, 'fortran_order': {fortran}, 'shape': {shape}, }}\n");
    npy::tests::file(1, &header, &numbers.iter().flat_map(|number| number.to_le_bytes()).collect::<Vec<_>>())
}

/// No `f32` numbers; one is beyond their range.
const ROW: [f64; 4] = [0.1, -16_777_217.123_456_7, 1e300, 1.0 / 3.0];

#[test]
fn doubles_of_every_format_are_as_written() {
    let [x, y, z, r] = ROW.map(|number| format!("{number:e}"));
    let diameter = format!("{:e}", 2.0 * ROW[3]);
    let [structured, columns] =
        ["[('z', '<f8'), ('y', '<f8'), ('x', '<f8'), ('r', '<f8')]", "'<f8'"].map(str::to_owned);
    let [a, b, c, d] = ROW;
    for (name, bytes) in [
        ("a.csv", format!("x,y,z,diameter\n{x},{y},{z},{diameter}\n").into_bytes()),
        ("a.xyz", format!("1\nProperties=pos:R:3:radius:R:1\n{x} {y} {z} {r}\n").into_bytes()),
        ("a.smoldyn", format!("A(soln) {x} {y} {z} 1\n").into_bytes()),
        (
            "a.dump",
            format!(
                "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n1\nITEM: BOX BOUNDS ff ff ff\n0 1\n0 1\n0 1\n\
                 ITEM: ATOMS x y z radius\n{x} {y} {z} {r}\n"
            )
            .into_bytes(),
        ),
        ("a.npy", npy(&columns, "False", "(1, 4)", &ROW)),
        ("b.npy", npy(&columns, "True", "(1, 4)", &ROW)),
        ("c.npy", npy(&structured, "False", "(1,)", &[c, b, a, d])),
    ] {
        let frame = doubles(name, bytes, &[("A", ROW[3])]).unwrap();
        assert_eq!((frame.doubles, frame.spheres), (Some(vec![ROW]), vec![]), "{name}");
    }
}

#[test]
fn scaled_coordinates_and_radii_by_species_are_doubles() {
    let text = "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n1\nITEM: BOX BOUNDS pp pp pp\n0 0.3\n0 0.3\n0 0.3\n\
                ITEM: ATOMS type xs ys zs\n7 0.1 0.7 0.9\n";
    let frame = doubles("a.dump", text, &[("7", 0.1)]).unwrap();
    assert_eq!(frame.doubles, Some(vec![[0.3 * 0.1, 0.3 * 0.7, 0.3 * 0.9, 0.1]]));
    assert_eq!(rows("a.dump", text, &[("7", 0.1)])[0][3], 0.1_f32);
}

#[test]
fn doubles_of_32_bit_files_are_their_numbers() {
    let numbers = [1.5_f32, 0.1, -2.0, 0.25];
    let mut bytes = npy("'<f4'", "False", "(1, 4)", &[]);
    bytes.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
    assert_eq!(doubles("a.npy", bytes, &[]).unwrap().doubles, Some(vec![numbers.map(f64::from)]));
}

#[test]
fn doubles_are_sorted_by_id_and_counted() {
    let text = "id,x,y,z,r\n2,0.2,0,0,1\n1,0.1,0,0,1\n";
    let options = Options { ids: true, precision: Precision::F64, ..Options::default() };
    let mut frame = frames("a.csv", text, options).unwrap().remove(0);
    assert_eq!(frame.sort_by_id(), Ok(()));
    assert_eq!((frame.len(), frame.ids.as_deref()), (2, Some(&[1, 2][..])));
    assert_eq!(frame.doubles, Some(vec![[0.1, 0.0, 0.0, 1.0], [0.2, 0.0, 0.0, 1.0]]));
}

#[test]
fn faulty_doubles_are_refused_and_none_is_reported_as_rounded() {
    for (name, text, message) in [
        (
            "a.csv",
            "x,y,z,r\n1e400,0,0,1\n",
            "line 2: x is 1e400; values must be finite floating-point numbers",
        ),
        ("a.csv", "x,y,z,r\n0,0,0,-1e-320\n", "line 2: r is -1e-320; radii must not be negative"),
    ] {
        let error = doubles(name, text, &[]).unwrap_err().to_string();
        assert!(error.contains(message), "{error}");
    }
    let nan = npy("'<f8'", "False", "(1, 4)", &[0.0, 0.0, f64::NAN, 1.0]);
    assert!(doubles("a.npy", nan, &[]).unwrap_err().to_string().contains("z is NaN; values must be finite"));
    let error = doubles("a.csv", "", &[("A", f64::INFINITY)]).unwrap_err().to_string();
    assert!(error.contains("radius of species 'A' is inf"), "{error}");
    for (precision, is_rounded) in [(Precision::F64, false), (Precision::Auto, false), (Precision::F32, true)]
    {
        let options = Options { precision, ..Options::default() };
        let text = "x,y,z,r\n0.12345678901,0,0,1\n";
        let mut frames = Frames::new("a.csv", Cursor::new(text), None, options).unwrap();
        assert!(frames.next().unwrap().is_ok());
        assert_eq!(frames.rounding().is_some(), is_rounded);
    }
}

fn chosen(name: &str, bytes: impl Into<Vec<u8>>, radii: &[(&str, f64)]) -> bool {
    let radii = radii.iter().map(|&(name, r)| (name.to_owned(), r)).collect();
    let options = Options { radii, precision: Precision::Auto, ..Options::default() };
    let frame = frames(name, bytes, options).unwrap().remove(0);
    assert_eq!((frame.len(), frame.as_spheres().len()), (1, 1), "{name}");
    frame.doubles.is_some()
}

#[test]
fn precision_is_that_of_the_numbers() {
    let numbers = |count: usize| vec![0_u8; count];
    let array = |descr: &str, shape: &str, bytes: usize| {
        let mut all = npy(descr, "False", shape, &[]);
        all.extend(numbers(bytes));
        all
    };
    let fields = |radius: &str| {
        format!(
            "[('x', '<f4'), ('y', '<f4'), ('z', '<f4'), ('r', '{radius}'), ('mass', '<f8'), ('species', '<i4')]"
        )
    };
    for (bytes, radii, is_f64) in [
        (array("'<f4'", "(1, 4)", 16), &[][..], false),
        (array("'>f4'", "(1, 4)", 16), &[], false),
        (array("'<f4'", "(1, 4)", 16), &[("0", 0.1)], false),
        (array("'<f8'", "(1, 4)", 32), &[], true),
        (array("'>f8'", "(1, 4)", 32), &[], true),
        (array(&fields("<f4"), "(1,)", 28), &[], false),
        (array(&fields("<f8"), "(1,)", 32), &[], true),
        (array(&fields("<f4"), "(1,)", 28), &[("0", 0.125)], false),
        (array(&fields("<f4"), "(1,)", 28), &[("0", 0.1)], true),
    ] {
        let text = String::from_utf8_lossy(&bytes[10..80]).into_owned();
        assert_eq!(chosen("a.npy", bytes, radii), is_f64, "{text} {radii:?}");
    }
    for (name, text) in
        [("a.csv", "x,y,z,r\n1,2,3,0.5\n"), ("a.xyz", "1\n\nA 1 2 3\n"), ("a.lst", "A(up) 1 2 3 4\n")]
    {
        assert!(chosen(name, text, &[("A", 0.5)]), "{name}");
    }
}

#[test]
fn cells_of_f64_spheres_are_as_written() {
    let lattice = |numbers: &str| {
        let text = format!("1\nProperties=pos:R:3:radius:R:1 Lattice=\"{numbers}\"\n0 0 0 1\n");
        doubles("a.xyz", text, &[]).map(|frame| frame.space)
    };
    let vectors = [[0.1, 0.0, 0.0], [1e-17, 0.2, 0.0], [0.0, 0.0, 0.3]].map(Some);
    assert_eq!(lattice("0.1 0 0 1e-17 0.2 0 0 0 0.3").unwrap(), Space::triclinic(vectors).unwrap());
    let lengths = Space::periodic([Some(0.1), Some(1e300), Some(1e-300)]).unwrap();
    assert_eq!(lattice("0.1 0 0 0 -1e300 0 0 0 1e-300").unwrap(), lengths);
    let refused = lattice("0.1 0 0 0 0.2 0 0 0 0").unwrap_err().to_string();
    assert!(
        refused.contains("periodic along z and its length there is 0, no finite number above zero"),
        "{refused}"
    );
}
