use super::npy::tests::file as npy;
use super::*;

pub(super) fn header(descr: &str, fortran: bool, rows: u64) -> String {
    let fortran = if fortran { "True" } else { "False" };
    format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': ({rows}, 4), }}      \n")
}

pub(super) fn flat(fortran: bool) -> Vec<f32> {
    match fortran {
        false => TWO.concat(),
        true => (0..4).flat_map(|column| TWO.map(|row| row[column])).collect(),
    }
}

#[test]
fn npy_in_every_arrangement() {
    for (version, fortran) in [(1, false), (2, false), (3, false), (1, true), (3, true)] {
        let values = flat(fortran);
        let stored: [(&str, Vec<u8>); 4] = [
            ("<f4", values.iter().flat_map(|v| v.to_le_bytes()).collect()),
            (">f4", values.iter().flat_map(|v| v.to_be_bytes()).collect()),
            ("<f8", values.iter().flat_map(|&v| f64::from(v).to_le_bytes()).collect()),
            (">f8", values.iter().flat_map(|&v| f64::from(v).to_be_bytes()).collect()),
        ];
        for (descr, data) in stored {
            let file = npy(version, &header(descr, fortran, 2), &data);
            assert_eq!(rows("a.npy", file.clone(), &[]), TWO, "{descr} {fortran} {version}");
            let frame = Frames::new("a", Cursor::new(file), None, Options::default()).unwrap().next();
            assert_eq!(bytemuck::cast_slice::<_, [f32; 4]>(&frame.unwrap().unwrap().spheres), TWO);
        }
    }
    assert_eq!(rows("a.npy", npy(1, &header("<f4", false, 0), &[]), &[]), [[0.0; 4]; 0]);
    assert_eq!(rows("a.npy", npy(1, &header("<f8", true, 0), &[]), &[]), [[0.0; 4]; 0]);
}

#[test]
fn npy_of_more_than_a_block() {
    let many: Vec<[f32; 4]> = (0..100_000).map(|i| [i as f32, -(i as f32), 0.5, 1.0]).collect();
    let narrow = npy(1, &header("<f4", false, 100_000), bytemuck::cast_slice(&many));
    assert_eq!(rows("a.npy", narrow, &[]), many);
    let wide: Vec<u8> = many.concat().iter().flat_map(|&v| f64::from(v).to_le_bytes()).collect();
    assert_eq!(rows("a.npy", npy(1, &header("<f8", false, 100_000), &wide), &[]), many);
    let columns: Vec<u8> =
        (0..4).flat_map(|c| many.iter().flat_map(move |row| row[c].to_le_bytes())).collect();
    assert_eq!(rows("a.npy", npy(1, &header("<f4", true, 100_000), &columns), &[]), many);
}

#[test]
fn npy_refusals_name_row_and_value() {
    let plain = "a.npy: expected a header {'descr': …, 'fortran_order': …, 'shape': …} of a plain or structured array, found ";
    let finite = "values must be finite 32-bit floating-point numbers";
    let data: Vec<u8> = TWO.concat().iter().flat_map(|v| v.to_le_bytes()).collect();
    let with = |at: usize, value: f32| {
        let mut values = TWO.concat();
        values[at] = value;
        npy(1, &header("<f4", false, 2), bytemuck::cast_slice(&values))
    };
    let wide = |value: f64| {
        let values = [1.0, value, 1.0, 1.0];
        npy(1, &header("<f8", false, 1), bytemuck::cast_slice(&values))
    };
    for (file, message) in [
        (b"x,y,z,r".to_vec(), "a.npy: expected a NumPy array, found other content".into()),
        (npy(4, "", b""), "a.npy: expected version 1, 2 or 3 of the NumPy format, found version 4".into()),
        (npy(1, "[]", b""), format!("{plain}'[]'")),
        (npy(1, "{'descr': [('x', '<f4', x)], }", b""), format!("{plain}'x)], }}'")),
        (
            npy(1, &header("<i4", false, 2), &data),
            "a.npy: expected values of type f4 or f8, found '<i4'; convert it with .astype('f8')".into(),
        ),
        (
            npy(1, "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3)}", &data),
            "a.npy: expected an array of shape (n, 4), found shape [2, 3]".into(),
        ),
        (npy(1, &header("<f4", false, 3), &data), "a.npy: the file ends after 2 of 3 rows".into()),
        (npy(1, &header("<f8", true, 2), &data), "a.npy: the file ends after 1 of 2 rows".into()),
        (
            npy(1, &header("<f4", false, 1), &data),
            "a.npy: expected the end of the file after the array, found further bytes".into(),
        ),
        (
            npy(1, &header("<f4", false, 1_000_000_000), &data),
            "a.npy: the file ends after 2 of 1000000000 rows".into(),
        ),
        (
            npy(1, &header("<f4", false, 10_u64.pow(15)), &data),
            "a.npy: 1000000000000000 spheres exceed the 4294967294 that 32-bit indices can name; split the file".into(),
        ),
        (with(6, f32::NAN), format!("a.npy, row 1: z is NaN; {finite}")),
        (with(3, -1.5), "a.npy, row 0: radius is -1.5; radii must not be negative".into()),
        (wide(1e39), format!("a.npy, row 0: y is 1e39; {finite}")),
        (wide(f64::NEG_INFINITY), format!("a.npy, row 0: y is -inf; {finite}")),
    ] {
        assert_eq!(refusal("a.npy", file, &[]), message);
    }
    // A pipe that promises 64 GB reserves no memory for them.
    for fortran in [false, true] {
        let file = npy(1, &header("<f4", fortran, 4_000_000_000), &data);
        let mut frames = Frames::new("a.npy", Cursor::new(file), None, Options::default()).unwrap();
        let error = frames.next().unwrap().unwrap_err();
        assert!(matches!(error, Error::Truncated { expected: 4_000_000_000, .. }), "{error}");
    }
}
