mod arrays;
mod blocks;
mod compressed;
mod damaged;
mod doubles;
mod spaces;
mod tables;

use std::io::{self, Cursor, Read};

use lazygrid::Sphere;

use super::*;

fn options(format: Option<Format>, radii: &[(&str, f32)]) -> Options {
    let radii = radii.iter().map(|&(name, r)| (name.to_owned(), r.into())).collect();
    Options { format, radii, ..Options::default() }
}

fn frames(name: &str, bytes: impl Into<Vec<u8>>, options: Options) -> Result<Vec<Frame>, Error> {
    let bytes = bytes.into();
    let length = bytes.len() as u64;
    Frames::new(name, Cursor::new(bytes), Some(length), options)?.collect()
}

fn rows(name: &str, bytes: impl Into<Vec<u8>>, radii: &[(&str, f32)]) -> Vec<[f32; 4]> {
    let mut frames = frames(name, bytes, options(None, radii)).unwrap();
    assert_eq!(frames.len(), 1);
    bytemuck::cast_slice(&frames.remove(0).spheres).to_vec()
}

fn refusal(name: &str, bytes: impl Into<Vec<u8>>, radii: &[(&str, f32)]) -> String {
    frames(name, bytes, options(None, radii)).unwrap_err().to_string()
}

const TWO: [[f32; 4]; 2] = [[1.0, 2.0, 3.0, 0.5], [-4.0, 5e-3, 6.25, 0.0]];

#[test]
fn csv_columns_in_any_order_and_case() {
    for text in [
        "x,y,z,r\n1,2,3,0.5\n-4,5e-3,6.25,0\n",
        "\u{feff}Radius, Z ,id,Y,X\r\n0.5,3,a,2,1\r\n\r\n0, 6.25 ,b,0.005,-4",
        "\"x\",\"y\",\"z\",\"r\"\n\"1\",2,3,0.5\n-4,5e-3,6.25,0\n",
    ] {
        assert_eq!(rows("a.csv", text, &[]), TWO, "{text}");
    }
    assert_eq!(rows("a.csv", "x,y,z,r\n", &[]), [[0.0; 4]; 0]);
}

#[test]
fn radii_that_no_sphere_can_have_are_refused() {
    for (radius, shown) in [(f32::NAN, "NaN"), (f32::INFINITY, "inf"), (-1.0, "-1")] {
        assert_eq!(
            refusal("a.csv", "species,x,y,z\na,0,0,0\n", &[("b", 1.0), ("a", radius)]),
            format!(
                "the radius of species 'a' is {shown}; radii must be finite in the precision that is read, and not negative"
            )
        );
    }
}

#[test]
fn rounding_warning_appears_once_with_the_first_number() {
    let text = "x,y,z,r\n1,2,3,4\n16777217,0,0,1\n1,16777219,0,1\n";
    let mut reader = Frames::new("a.csv", Cursor::new(text), None, Options::default()).unwrap();
    assert_eq!(reader.rounding(), None);
    reader.next().unwrap().unwrap();
    let warning = reader.rounding().unwrap();
    assert!(warning.starts_with("a.csv, line 3: x is 16777217, which the 32-bit"), "{warning}");
    assert!(warning.contains("(lazygrid detect --precision f64; "), "{warning}");
}

#[test]
fn numbers_below_the_range_of_f32_are_rounded_with_a_warning() {
    let text = "x,y,z,r\n0,0,0,1e-45\n0,0,0,1e-50\n";
    let mut reader = Frames::new("a.csv", Cursor::new(text), None, Options::default()).unwrap();
    assert_eq!(reader.next().unwrap().unwrap().spheres[1].radius, 0.0);
    let warning = reader.rounding().unwrap();
    assert!(warning.starts_with("a.csv, line 3: r is 1e-50, "), "{warning}");
}

#[test]
fn csv_species_are_interned_and_may_give_the_radius() {
    let text = "species,x,y,z\nb,0,0,0\na,0,0,0\nb,1,0,0\n";
    let options = options(None, &[("a", 1.0), ("b", 2.0), ("c", 3.0)]);
    let mut reader = Frames::new("a.csv", Cursor::new(text), None, options).unwrap();
    let frame = reader.next().unwrap().unwrap();
    assert_eq!(frame.species, Some(vec![0, 1, 0]));
    assert_eq!(reader.species().names(), ["b", "a"]);
    assert_eq!(frame.spheres.iter().map(|s| s.radius).collect::<Vec<_>>(), [2.0, 1.0, 2.0]);
    assert_eq!(reader.species().unused_radii().collect::<Vec<_>>(), ["c"]);
    let both = rows("a.csv", "species,x,y,z,r\nb,0,0,0,7\na,0,0,0,7\n", &[("b", 2.0)]);
    assert_eq!(both.map_column(3), [2.0, 7.0]);
}

trait MapColumn {
    fn map_column(&self, column: usize) -> Vec<f32>;
}

impl MapColumn for Vec<[f32; 4]> {
    fn map_column(&self, column: usize) -> Vec<f32> {
        self.iter().map(|row| row[column]).collect()
    }
}

#[test]
fn csv_refusals_name_line_and_value() {
    for (text, message) in [
        ("", "a.csv: expected a header with x, y, z and r, radius or diameter, found an empty file"),
        ("x,y,r\n", "a.csv, line 1: expected a column `z`, found columns x, y, r"),
        ("x,y,z\n", "a.csv, line 1: expected a radius column, found columns x, y, z"),
        (
            "x,y,z,species\n",
            "a.csv, line 1: expected a radius column, or radii by species (--radius SPECIES=R), found columns \
             x, y, z, species",
        ),
        (
            "x,y,z,r,radius\n",
            "a.csv, line 1: expected one column each for x, y, z, species, id and either radius or diameter, found columns \
             x, y, z, r, radius",
        ),
        ("x,y,z,r\n1,2,3,4\n1,2,O,4\n", "a.csv, line 3: z 'O' is not a number"),
        ("x,y,z,r\n1,2,3\n", "a.csv, line 2: expected 4 fields (x, y, z, r), found 3: '1,2,3'"),
        ("x,y,z,r\n1,2,3,4,5\n", "a.csv, line 2: expected 4 fields (x, y, z, r), found 5: '1,2,3,4,5'"),
        ("x,y,z,r\n\n1,2,3,-4\n", "a.csv, line 3: r is -4; radii must not be negative"),
        (
            "x,y,z,r\n1,1e39,3,4\n",
            "a.csv, line 2: y is 1e39; values must be finite 32-bit floating-point numbers",
        ),
        (
            "x,y,z,r\n1,NaN,3,4\n",
            "a.csv, line 2: y is NaN; values must be finite 32-bit floating-point numbers",
        ),
        (
            "x,y,z,species,r\n1,2,3,\"a,b\",4\n",
            "a.csv, line 2: expected quotes around whole fields without separators or quotes in them, found \
             '1,2,3,\"a,b\",4'",
        ),
        ("x,y,z,r\n1,2,3,\x1b[31m\n", "a.csv, line 2: r '\\u{1b}[31m' is not a number"),
    ] {
        assert_eq!(refusal("a.csv", text, &[]), message);
    }
    assert_eq!(
        refusal("a.csv", "x,y,z,species\n1,2,3,a\n1,2,3,b\n", &[("a", 1.0)]),
        "a.csv, line 3: no radius column and no radius for species 'b'; give it with --radius 'b=R'"
    );
}

#[test]
fn xyz_plain_and_extended() {
    let plain = "2\nwater\nO 1 2 3\nH -4 0.005 6.25 extra\n";
    assert_eq!(rows("a.xyz", plain, &[("O", 0.5), ("H", 0.0)]), TWO);
    let reordered = "2\nLattice=\"1 0 0 0 1 0 0 0 1\" Properties=id:I:1:radius:R:1:vel:R:3:pos:R:3 pbc=\"F F F\"\n\
                     7 0.5 0 0 0 1 2 3\n8 0 0 0 0 -4 0.005 6.25\n";
    assert_eq!(rows("a.xyz", reordered, &[]), TWO);
    let quoted = "2\nProperties=\"species:S:1:pos:R:3:Radius:R:1\"\nA 1 2 3 0.5\nB -4 0.005 6.25 0\n";
    assert_eq!(rows("a.xyz", quoted, &[]), TWO);
}

#[test]
fn xyz_frames_follow_one_another() {
    let text = "1\n\nA 1 2 3\n0\nnothing\n\n2\n\nB 0 0 0\nA 0 0 0\n\n";
    let options = options(None, &[("A", 1.0), ("B", 2.0)]);
    let mut reader = Frames::new("a.xyz", Cursor::new(text), None, options).unwrap();
    let sizes: Vec<_> = reader.by_ref().map(|frame| frame.unwrap().spheres.len()).collect();
    assert_eq!(sizes, [1, 0, 2]);
    assert_eq!(reader.species().names(), ["A", "B"]);
    assert!(reader.next().is_none());
}

#[test]
fn xyz_refusals_name_line_and_value() {
    let a = &[("A", 1.0)];
    for (text, message) in [
        (
            "two\n",
            "a.xyz, line 1: expected the number of spheres of the next frame, a whole number, found 'two'",
        ),
        ("2\n", "a.xyz, line 1: the file ends after 1 of 2 lines of the frame's head"),
        ("2\n\nA 1 2 3\n", "a.xyz, line 3: the file ends after 1 of 2 spheres"),
        ("1\n\nA 1 2\n", "a.xyz, line 3: expected 4 fields (species, x, y, z), found 3: 'A 1 2'"),
        ("1\n\nA 1 2 nan\n", "a.xyz, line 3: z is nan; values must be finite 32-bit floating-point numbers"),
        (
            "1\n\nB 1 2 3\n",
            "a.xyz, line 3: no radius column and no radius for species 'B'; give it with --radius 'B=R'",
        ),
        (
            "1\nProperties=pos:R\n1 2 3\n",
            "a.xyz, line 2: expected Properties=name:type:columns, such as pos:R:3:radius:R:1, found \
             'Properties=pos:R'",
        ),
        (
            "1\nProperties=species:S:1:radius:R:1\nA 3\n",
            "a.xyz, line 2: expected coordinates as pos:R:3 in Properties, found columns species, radius",
        ),
        (
            "1\nProperties=pos:R:3:v:R:99999999999\n1 2 3\n",
            "a.xyz, line 2: expected Properties=name:type:columns with 1 to 1000 columns in all, found \
             'Properties=pos:R:3:v:R:99999999999'",
        ),
        ("99999999999999\n\nA 1 2 3\n", "a.xyz, line 3: the file ends after 1 of 99999999999999 spheres"),
    ] {
        assert_eq!(refusal("a.xyz", text, a), message);
    }
}

fn dump(bounds: &str, columns: &str, atoms: &str) -> String {
    let n = atoms.lines().count();
    format!(
        "ITEM: TIMESTEP\n40\nITEM: NUMBER OF ATOMS\n{n}\nITEM: BOX BOUNDS {bounds}\nITEM: ATOMS {columns}\n{atoms}\n"
    )
}

#[test]
fn lammps_columns_by_name() {
    let cube = "pp pp pp\n-8 8\n-8 8\n-8 8";
    for (columns, atoms) in [
        ("id type x y z radius", "2 1 1 2 3 0.5\n1 1 -4 0.005 6.25 0"),
        ("diameter zu yu xu", "1 3 2 1\n0 6.25 0.005 -4"),
        ("xs ys zs radius", "0.5625 0.625 0.6875 0.5\n0.25 0.5003125 0.890625 0"),
        ("xsu ysu zsu radius", "0.5625 0.625 0.6875 0.5\n0.25 0.5003125 0.890625 0"),
        ("xs ys zs x y z diameter radius", "9 9 9 1 2 3 9 0.5\n9 9 9 -4 0.005 6.25 9 0"),
    ] {
        assert_eq!(rows("a.dump", dump(cube, columns, atoms), &[]), TWO, "{columns}");
    }
    let typed = dump(cube, "id type x y z", "1 7 1 2 3\n2 9 -4 0.005 6.25");
    assert_eq!(rows("a.dump", typed, &[("7", 0.5), ("9", 0.0)]), TWO);
}

#[test]
fn lammps_tilted_boxes() {
    let corner = "0.25 0.5 1 0";
    let columns = "xs ys zs radius";
    // Vectors (4, 0, 0), (1, 2, 0) and (-2, 1, 8) from the origin.
    let tilted = dump("xy xz yz ff ff ff\n-2 5 1\n0 3 -2\n0 8 1", columns, corner);
    assert_eq!(rows("a.dump", tilted, &[]), [[-0.5, 2.0, 8.0, 0.0]]);
    let skewed = dump("xy xz yz ff ff ff\n0 7 1\n0 3 2\n0 8 1", columns, corner);
    assert_eq!(rows("a.dump", skewed, &[]), [[3.5, 2.0, 8.0, 0.0]]);
    let general = dump("abc origin\n4 0 0 10\n1 2 0 20\n-2 1 8 30", columns, corner);
    assert_eq!(rows("a.dump", general, &[]), [[9.5, 22.0, 38.0, 0.0]]);
}

#[test]
fn lammps_frames_carry_their_time_step() {
    let one = dump("pp pp pp\n0 1\n0 1\n0 1", "x y z radius", "1 2 3 0.5");
    let text = format!("ITEM: UNITS\nlj\nITEM: TIME\n0.5\n{one}{}", one.replace("\n40\n", "\n-7\n"));
    let frames = frames("dump.7", text, Options::default()).unwrap();
    assert_eq!(
        frames.iter().map(|f| (f.step, f.spheres.len())).collect::<Vec<_>>(),
        [(Some(40), 1), (Some(-7), 1)]
    );
}

#[test]
fn lammps_refusals_name_line_and_value() {
    let cube = "pp pp pp\n0 1\n0 1\n0 1";
    let finite = "values must be finite 32-bit floating-point numbers";
    for (text, message) in [
        ("hello".into(), "line 1: expected ITEM: TIMESTEP, NUMBER OF ATOMS, BOX BOUNDS or ATOMS, found 'hello'".into()),
        ("ITEM: TIMESTEP\nsoon\n".into(), "line 2: expected the time step, a whole number, found 'soon'".into()),
        ("ITEM: TIMESTEP\n\n4\n".into(), "line 2: expected the time step, a whole number, found a blank line".into()),
        ("ITEM: TIMESTEP\n4\n".into(), "line 2: the file ends after 0 of 1 frame heads".into()),
        (
            "ITEM: ATOMS x y z radius\n".into(),
            "line 1: expected ITEM: NUMBER OF ATOMS before the atoms, found 'ITEM: ATOMS x y z radius'".into(),
        ),
        (
            "ITEM: NUMBER OF ATOMS\n1\nITEM: ATOMS xs ys zs radius\n0 0 0 1\n".into(),
            "line 3: expected ITEM: BOX BOUNDS before scaled coordinates, found 'ITEM: ATOMS xs ys zs radius'".into(),
        ),
        (
            dump("pp pp pp\n0 1\n1 0.5\n0 1", "x y z radius", "0 0 0 1"),
            "line 7: high is 0.5; the high bound of an axis must not be less than the low one, which comes first".into(),
        ),
        (
            "ITEM: NUMBER OF ATOMS\n-1\n".into(),
            "line 2: expected the number of atoms, a whole number, found '-1'".into(),
        ),
        (dump(cube, "x y radius", ""), "line 9: expected a column `z`, found columns x, y, radius".into()),
        (dump(cube, "x y z radius", "0 0 inf 1"), format!("line 10: z is inf; {finite}")),
        (dump(cube, "x y z diameter", "0 0 0 -1"), "line 10: diameter is -1; diameters must not be negative".into()),
        (dump("ff pp pp\n0 1e308\n0 1\n0 1", "xs ys zs radius", "1 0 0 1"), format!("line 10: x is 1e308; {finite}")),
        (dump(cube, "x y z radius", "0 0 0 1").replace("ATOMS\n1", "ATOMS\n2"), "line 10: the file ends after 1 of 2 atoms".into()),
    ] {
        assert_eq!(refusal("a.dump", text, &[]), format!("a.dump, {message}"));
    }
}

#[test]
fn smoldyn_molecules_have_the_radius_of_their_species() {
    let text = "acid(solution) 1 2 3 17\nbase(front) -4 0.005 6.25 4.16\n";
    assert_eq!(rows("burst.lst", text, &[("acid", 0.5), ("base", 0.0)]), TWO);
    let empty = Frame { species: Some(vec![]), ..Frame::default() };
    assert_eq!(frames("a.smoldyn", "", Options::default()).unwrap(), [empty]);
}

#[test]
fn smoldyn_refusals_name_line_and_value() {
    let a = &[("A", 1.0)];
    for (text, message) in [
        ("A(up) 1 2 3\n", "line 1: expected 5 fields (name(state), x, y, z, serial), found 4: 'A(up) 1 2 3'"),
        ("A(up) 1 2 3 4\nA 1 2 3 4\n", "line 2: expected name(state) x y z serial, found 'A 1 2 3 4'"),
        (
            "A(up) 1 2 3 4\nB(up) 1 2 3 5\n",
            "line 2: no radius column and no radius for species 'B(up)'; give it with --radius 'B=R', or \
             'B(up)=R' for that state alone",
        ),
        (
            "A(up) 1 2 3 4\nA(up) 1 2 3 5\nA(up) 1 2 3 4\n",
            "line 3: molecule 4 is listed a second time, first on line 1; several listings in one file cannot be \
             told apart: write one file per listing (Smoldyn's `incrementfile`)",
        ),
    ] {
        assert_eq!(refusal("a.smoldyn", text, a), format!("a.smoldyn, {message}"));
    }
}

#[test]
fn format_is_chosen_by_option_then_extension_then_content() {
    let text = "x,y,z,r\n1,2,3,0.5\n-4,5e-3,6.25,0\n";
    assert_eq!(rows("no-extension", text, &[]), TWO);
    assert_eq!(rows("a.dat", text, &[]), TWO);
    assert!(refusal("a.xyz", text, &[]).starts_with("a.xyz, line 1: expected the number of spheres"));
    assert!(frames("a.xyz", text, options(Some(Format::Csv), &[])).is_ok());
    for unknown in ["", "hello\n", "1 2 3 4\n"] {
        assert_eq!(
            refusal("a.dat", unknown, &[]),
            "a.dat: neither the name nor the content tells the format; say --format csv, npy, xyz, lammps or smoldyn"
        );
    }
}

#[test]
fn a_failing_disk_is_an_error_with_the_file_named() {
    struct Broken;
    impl Read for Broken {
        fn read(&mut self, _: &mut [u8]) -> io::Result<usize> {
            Err(io::Error::other("input/output error"))
        }
    }
    for format in Format::ALL {
        let refused = Frames::new("a", Broken, None, options(Some(format), &[])).err();
        assert_eq!(refused.unwrap().to_string(), "a: cannot read: input/output error");
    }
    assert_eq!(
        Frames::open("/nowhere/a.csv", Options::default()).err().unwrap().to_string(),
        "/nowhere/a.csv: cannot read: No such file or directory (os error 2)"
    );
}
