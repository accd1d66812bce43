use super::npy::tests::file as npy;
use super::*;

#[test]
fn csv_with_other_separators_and_comments() {
    for text in [
        "x;y;z;r\n1;2;3;0.5\n-4;5e-3;6.25;0\n",
        "x\ty\tz\tr\n1\t2\t3\t0.5\n -4 \t5e-3\t6.25\t0\n",
        "# units: µm; made by hand\n\nx,y,z,diameter\n1,2,3,1\n  # between\n-4,5e-3,6.25,0\n#end",
        // Output of `numpy.savetxt(…, header="x,y,z,r", delimiter=",")`.
        "# some title\n# x,y,z,r\n1.0e+00,2.0e+00,3.0e+00,5.0e-01\n-4,5e-3,6.25,0\n",
        "# x,y,z,r\n# x,y,z\n1,2,3,0.5\n-4,5e-3,6.25,0\n",
        "\u{feff}x,y,z,r\n1,2,3,0.5\n-4,5e-3,6.25,0\n",
        "# z,y,x,r\nx,y,z,r\n1,2,3,0.5\n-4,5e-3,6.25,0\n",
        "# x,y,z: the center\n# x,y,z\nx,y,z,r\n1,2,3,0.5\n-4,5e-3,6.25,0\n",
        "\"x\";\"y\";\"note, or not\";\"z\";\"r\"\n1;2;\"a, b\";3;0.5\n-4;5e-3;;6.25;0\n",
    ] {
        assert_eq!(rows("a.csv", text, &[]), TWO, "{text}");
        assert_eq!(rows("a", text, &[]), TWO, "{text}");
    }
    assert_eq!(rows("a.csv", "# x,y,z,r\n", &[]), [[0.0; 4]; 0]);
    for (text, message) in [
        ("# x,y,z\n1,2,3\n", "a.csv, line 1: expected a radius column, found columns x, y, z"),
        (
            "# nothing\n",
            "a.csv, line 1: expected a header with x, y, z and r, radius or diameter, found an empty file",
        ),
        (
            "1,2,3,4\n",
            "a.csv, line 1: expected a header with x, y, z and r, radius or diameter, separated by commas, \
             semicolons or tabs, found '1,2,3,4'",
        ),
        (
            "x y z r\n1 2 3 4\n",
            "a.csv, line 1: expected a header with x, y, z and r, radius or diameter, separated by commas, \
             semicolons or tabs, found 'x y z r'",
        ),
        ("x,z,r\n1,2,3\n", "a.csv, line 1: expected a column `y`, found columns x, z, r"),
        ("x,y,z,diameter\n1,2,3,-4\n", "a.csv, line 2: diameter is -4; diameters must not be negative"),
        ("x;y;z;r\n1,5;2;3;4\n", "a.csv, line 2: x '1,5' is not a number"),
        (
            "r,x,y,z,note\r1,2,3,4,a\r1,2,3,4,b\r",
            "a.csv, line 1: expected lines that end with \\n or \\r\\n, found \\r within a line; convert the line \
             ends, for example with tr '\\r' '\\n'",
        ),
        (
            "#units\r#r,x,y,z,note\r1,2,3,4,a\r",
            "a.csv, line 1: expected lines that end with \\n or \\r\\n, found \\r within a line; convert the line \
             ends, for example with tr '\\r' '\\n'",
        ),
        (
            "x,y,z,r,diameter\n",
            "a.csv, line 1: expected one column each for x, y, z, species, id and either radius or diameter, found columns x, y, z, r, diameter",
        ),
    ] {
        assert_eq!(refusal("a.csv", text, &[]), message);
    }
}

#[test]
fn xyz_properties_without_coordinates_or_sizes_are_named() {
    for (comment, message) in [
        (
            "Properties=x:R:1:y:R:1:z:R:1:r:R:1",
            "expected coordinates as pos:R:3 in Properties, found columns x, y, z, r",
        ),
        (
            "Properties=pos:R:2:radius:R:1",
            "expected coordinates as pos:R:3 in Properties, found columns pos, pos, radius",
        ),
        (
            "Properties=pos:R:3:r:R:1",
            "expected radius:R:1 or diameter:R:1 in Properties, found columns x, y, z, r",
        ),
        (
            "Properties=species:S:1:pos:R:3",
            "expected radius:R:1 or diameter:R:1 in Properties, or radii by species (--radius SPECIES=R), found columns \
             species, x, y, z",
        ),
        (
            "Properties=pos:R:9999",
            "expected Properties=name:type:columns with 1 to 1000 columns in all, found 'Properties=pos:R:9999'",
        ),
        (
            "Lattice=\"1 0 0 0 1 0 0 0 1 Properties=pos:R:3",
            "expected a closing quote or bracket after the value of Lattice=, found 'Lattice=\"1 0 0 0 1 0 0 0 1 Properties=pos:R:3'",
        ),
    ] {
        let text = format!("1\n{comment}\n1 2 3 4\n");
        assert_eq!(refusal("a.xyz", text, &[]), format!("a.xyz, line 2: {message}"));
    }
}

fn ids(name: &str, bytes: impl Into<Vec<u8>>) -> Result<Vec<i64>, String> {
    let options = Options { ids: true, ..options(None, &[("A", 1.0)]) };
    let frames = frames(name, bytes, options).map_err(|error| error.to_string())?;
    Ok(frames.into_iter().flat_map(|frame| frame.ids.unwrap()).collect())
}

#[test]
fn ids_come_from_the_file() {
    let atoms = dump("ff ff ff\n0 1\n0 1\n0 1", "type id x y z radius", "1 7 1 2 3 4\n1 -3 1 2 3 4");
    for (name, text) in [
        ("a.csv", "x,y,ID,z,r\n1,2,7,3,4\n1,2,-3,3,4\n"),
        ("a.xyz", "2\nProperties=pos:R:3:id:I:1:radius:R:1\n1 2 3 7 4\n1 2 3 -3 4\n"),
        ("a.dump", &atoms),
    ] {
        assert_eq!(ids(name, text), Ok(vec![7, -3]), "{name}");
        let frames = frames(name, text.replace("-3", "me"), Options::default()).unwrap();
        assert_eq!(frames[0].ids, None);
    }
    assert_eq!(ids("a.lst", "A(up) 1 2 3 17\nA(up) 1 2 3 4\n"), Ok(vec![17, 4]));
    for (name, text, message) in [
        (
            "a.csv",
            "x,y,z,r\n1,2,3,4\n",
            "a.csv, line 1: expected a column `id`, which --ids asks for, found columns x, y, z, r",
        ),
        ("a.csv", "x,y,z,r,id\n1,2,3,4,me\n", "a.csv, line 2: expected a whole number as id, found 'me'"),
        ("a.lst", "A(up) 1 2 3 4.16\n", "a.lst, line 1: expected a whole number as id, found '4.16'"),
        (
            "a.xyz",
            "1\n\nA 1 2 3\n",
            "a.xyz, line 2: expected a column `id`, which --ids asks for, found columns species, x, y, z",
        ),
    ] {
        assert_eq!(ids(name, text).unwrap_err(), message);
    }
    let plain = npy(1, &super::arrays::header("<f4", false, 2), bytemuck::cast_slice(&TWO));
    assert!(ids("a.npy", plain).unwrap_err().contains("a structured array with a field `id`"));
}

fn structured(fields: &str, row: impl Fn([f32; 4], u8, u8) -> Vec<u8>) -> Vec<u8> {
    let header = format!("{{'descr': [{fields}], 'fortran_order': False, 'shape': (2,), }}\n");
    let data = [row(TWO[0], 3, 70), row(TWO[1], 5, 1)].concat();
    npy(1, &header, &data)
}

#[test]
fn structured_arrays_in_any_order() {
    let bytes = |values: &[f32]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<_>>();
    let simulated = structured(
        "('id', '<u4'), ('species', '<u4'), ('x', '<f4'), ('y', '<f4'), ('z', '<f4'), ('r', '<f4')",
        |sphere, kind, id| [vec![id, 0, 0, 0, kind, 0, 0, 0], bytes(&sphere)].concat(),
    );
    let wide = structured(
        "('diameter', '>f8'), ('', '|V3'), ('pos', '<f8', (3,)), ('v', '<f4', (2, 2)), ('id', '>i2'), ('species', '<U2')",
        |[x, y, z, r], kind, id| {
            let diameter = (f64::from(r) * 2.0).to_be_bytes().to_vec();
            let pos = [x, y, z].iter().flat_map(|&v| f64::from(v).to_le_bytes()).collect();
            [diameter, vec![9; 3], pos, vec![9; 16], vec![0, id], vec![b'0' + kind, 0, 0, 0, 0, 0, 0, 0]]
                .concat()
        },
    );
    let short =
        structured("('z', '<f4'), ('Radius', '<f4'), ('Y', '<f4'), ('x', '>f4')", |[x, y, z, r], _, _| {
            [bytes(&[z, r, y]), x.to_be_bytes().to_vec()].concat()
        });
    for (file, has_species) in [(simulated, true), (wide, true), (short, false)] {
        assert_eq!(rows("a.npy", file.clone(), &[]), TWO);
        let options = Options { ids: has_species, ..Options::default() };
        let mut reader = Frames::new("a", Cursor::new(file), None, options).unwrap();
        let frame = reader.next().unwrap().unwrap();
        assert_eq!(bytemuck::cast_slice::<_, [f32; 4]>(&frame.spheres), TWO);
        if has_species {
            assert_eq!((frame.species, frame.ids), (Some(vec![0, 1]), Some(vec![70, 1])));
            assert_eq!(reader.species().names(), ["3", "5"]);
        }
    }
    // Other numbers than whole ones are no ids.
    let of_floats = structured(
        "('id', '<f8'), ('x', '<f4'), ('y', '<f4'), ('z', '<f4'), ('r', '<f4')",
        |sphere, _, id| [f64::from(id).to_le_bytes().to_vec(), bytes(&sphere)].concat(),
    );
    assert_eq!(rows("a.npy", of_floats, &[]), TWO);
    let by_species = structured(
        "('x', '<f4', (1,)), ('y', '<f4'), ('z', '<f4'), ('species', '|i1')",
        |[x, y, z, _], kind, _| [bytes(&[x, y, z]), vec![kind]].concat(),
    );
    assert_eq!(rows("a.npy", by_species, &[("3", 0.5), ("5", 0.0)]), TWO);
}

#[test]
fn structured_refusals_name_field_row_and_value() {
    let bytes = |values: &[f32]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<_>>();
    let plain = "('x', '<f4'), ('y', '<f4'), ('z', '<f4'), ('r', '<f4')";
    let with = |fields: &str, sphere: [f32; 4]| structured(fields, |_, _, _| bytes(&sphere));
    for (file, message) in [
        (with(plain, [1.0, f32::NAN, 1.0, 1.0]), "a.npy, row 0: y is NaN; values must be finite"),
        (with(plain, [1.0, 1.0, 1.0, -1.0]), "a.npy, row 0: r is -1; radii must not be negative"),
        (
            with(&plain.replace("'z', '<f4'", "'z', '<i4'"), [1.0; 4]),
            "a.npy: expected coordinates and radii of type f4 or f8, found field z of type '<i4'",
        ),
        (
            with(&plain.replace("'z'", "'w'"), [1.0; 4]),
            "a.npy: expected a column `z`, found fields x, y, w, r",
        ),
        (
            with(&plain.replace("'r'", "'q'"), [1.0; 4]),
            "a.npy: expected a radius column, found fields x, y, z, q",
        ),
        (
            with(&plain.replace("'<f4')", "'|O')"), [1.0; 4]),
            "a.npy: expected fields of numbers and text, found field x of type '|O'",
        ),
        (with("('x', '<f4', (99999999999999999999))", [1.0; 4]), "a.npy: expected a header {"),
        (
            with("('x', '<f4', (4294967296, 4294967296))", [1.0; 4]),
            "a.npy: expected rows of at most a MiB, found field x of type '<f4'",
        ),
        (
            npy(1, &format!("{{'descr': [{plain}], 'fortran_order': False, 'shape': (2, 1), }}"), &[]),
            "a.npy: expected a structured array of shape (n,), found shape [2, 1]",
        ),
        (
            npy(1, &format!("{{'descr': [{plain}], 'fortran_order': False, 'shape': (3,), }}"), &[0; 32]),
            "a.npy: the file ends after 2 of 3 rows",
        ),
        (
            npy(1, "{'descr': [], 'fortran_order': False, 'shape': (3,), }", &[0; 32]),
            "a.npy: expected a column `x`, found fields ",
        ),
    ] {
        let refused = refusal("a.npy", file, &[]);
        assert!(refused.starts_with(message), "{refused}");
    }
}

#[test]
fn frames_without_spheres_have_the_requested_columns() {
    let fields = "('id', '<u4'), ('species', '<u4'), ('group', '<u4'), ('x', '<f4'), ('y', '<f4'), ('z', '<f4'), ('r', '<f4')";
    let header = format!("{{'descr': [{fields}], 'fortran_order': False, 'shape': (0,), }}\n");
    let atoms = dump("ff ff ff\n0 1\n0 1\n0 1", "id type mol x y z radius", "");
    for (name, bytes) in [
        ("a.csv", b"x,y,z,r,id,species,group\n".to_vec()),
        ("a.xyz", b"0\nProperties=pos:R:3:radius:R:1:id:I:1:species:S:1:group:I:1\n".to_vec()),
        ("a.dump", atoms.trim_end().to_owned().into_bytes()),
        ("a.npy", npy(1, &header, &[])),
    ] {
        let options = Options { ids: true, groups: true, ..Options::default() };
        let frames = frames(name, bytes, options).unwrap();
        assert_eq!(frames.len(), 1, "{name}");
        let Frame { ids, species, groups, .. } = &frames[0];
        assert_eq!((ids, species, groups), (&Some(vec![]), &Some(vec![]), &Some(vec![])), "{name}");
    }
}
