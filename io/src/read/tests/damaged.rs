use proptest::prelude::*;

use super::arrays::{flat, header};
use super::npy::tests::file as npy;
use super::*;

/// Small, so that most mutations have an effect.
fn samples() -> [(Format, Vec<u8>); 9] {
    let data: Vec<u8> = flat(true).iter().flat_map(|&v| f64::from(v).to_le_bytes()).collect();
    let fields = "('id', '<i2'), ('species', '|S1'), ('pos', '<f4', (3,)), ('r', '<f8')";
    let fields = format!("{{'descr': [{fields}], 'fortran_order': False, 'shape': (1,), }}");
    let row = [&b"\x07\x00A"[..], &[0; 12], &1.5_f64.to_le_bytes()].concat();
    let boxed =
        "1\nLattice=\"9 0 0 0 9 0 0 0 9\" pbc=\"T F T\" Properties=id:I:1:pos:R:3:radius:R:1\n7 1 2 3 4\n";
    [
        (Format::Npy, npy(1, &fields, &row)),
        (Format::Xyz, boxed.into()),
        (Format::Csv, b"# x;y;z;diameter;id\n1;2;3;0.5;7\n# none\n-4;5e-3;6.25;0;8\n".to_vec()),
        (Format::Csv, b"species,x,y,z,r\nA,1,2,3,0.5\nB,-4,5e-3,6.25,0\n".to_vec()),
        (Format::Npy, npy(1, &header("<f4", false, 2), bytemuck::cast_slice(&TWO))),
        (Format::Npy, npy(2, &header("<f8", true, 2), &data)),
        (Format::Xyz, b"1\nProperties=species:S:1:pos:R:3:radius:R:1\nA 1 2 3 4\n1\n\nA 1 2 3\n".to_vec()),
        (
            Format::Lammps,
            dump("xy xz yz pp pp pp\n0 1 0\n0 1 0\n0 1 0", "type xs ys zs", "A 0 0 1\nA 1 0 1").into(),
        ),
        (Format::Smoldyn, b"A(up) 1 2 3 4\nB(up) 1 2 3 5\n".to_vec()),
    ]
}

fn survives(format: Option<Format>, bytes: Vec<u8>) -> Result<(), TestCaseError> {
    let radii = options(format, &[("A", 1.0), ("B", 2.0)]);
    for (length, ids) in [(None, true), (Some(bytes.len() as u64), false)] {
        let options = Options { ids, ..radii.clone() };
        let Ok(reader) = Frames::new("any", Cursor::new(bytes.clone()), length, options) else {
            continue;
        };
        let mut spheres = 0;
        let mut failed = false;
        for frame in reader {
            prop_assert!(!failed, "a frame after an error");
            let Ok(frame) = frame else {
                failed = true;
                continue;
            };
            spheres += frame.spheres.len();
            prop_assert!(frame.spheres.iter().all(Sphere::is_valid));
            prop_assert!(frame.species.is_none_or(|species| species.len() == frame.spheres.len()));
            prop_assert!(frame.ids.is_none_or(|ids| ids.len() == frame.spheres.len()));
        }
        prop_assert!(spheres <= bytes.len());
    }
    Ok(())
}

fn mutate(mut bytes: Vec<u8>, edits: Vec<(usize, u8, usize)>) -> Vec<u8> {
    const FRAGMENTS: [&[u8]; 12] =
        [b"\n", b"-", b"9999999999999", b"nan", b"1e999", b",", b" ", b"\"", b"(", b"ITEM: ", b"'", b"\xFF"];
    for (at, kind, what) in edits {
        let at = at % (bytes.len() + 1);
        let end = (at + what % 9).min(bytes.len());
        match kind % 4 {
            0 => drop(bytes.drain(at..end)),
            1 => bytes[at..end].fill(what as u8),
            2 => bytes.extend_from_within(at..end),
            _ => drop(bytes.splice(at..at, FRAGMENTS[what % FRAGMENTS.len()].iter().copied())),
        }
    }
    bytes
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4096, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn damaged_files_are_read_or_refused(
        sample in 0..9_usize,
        edits in prop::collection::vec((any::<usize>(), any::<u8>(), any::<usize>()), 1..6),
    ) {
        let (format, bytes) = samples()[sample].clone();
        let bytes = mutate(bytes, edits);
        survives(Some(format), bytes.clone())?;
        survives(None, bytes)?;
    }

    #[test]
    fn arbitrary_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        for format in Format::ALL {
            survives(Some(format), bytes.clone())?;
        }
        survives(None, bytes)?;
    }
}

#[test]
fn width_of_a_property_beyond_any_row_is_refused() {
    for width in ["1001", "997", "18446744073709551615", "99999999999999999999"] {
        let text = format!("1\nProperties=pos:R:3:radius:R:1:v:R:{width}\n1 2 3 4\n");
        let refused = refusal("a.xyz", text, &[]);
        assert!(refused.contains("expected Properties=name:type:columns"), "{refused}");
    }
}
