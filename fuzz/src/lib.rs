use std::io::Cursor;

use lazygrid_io::read::{Format, Frames, Options, Precision};

/// Reads `bytes` in every precision. Checks that reading never panics, spheres are valid and no more than
/// bytes, and nothing follows an error.
pub fn read(format: Option<Format>, bytes: &[u8]) {
    let radii = [("A".to_owned(), 1.0), ("1".to_owned(), 0.5)];
    let length = Some(bytes.len() as u64);
    for (length, ids, precision) in
        [(None, true, Precision::F32), (length, false, Precision::F64), (length, true, Precision::Auto)]
    {
        let radii = radii.clone().into();
        let options = Options { format, radii, ids, precision, ..Options::default() };
        let Ok(frames) = Frames::new("fuzz", Cursor::new(bytes.to_vec()), length, options) else { continue };
        let (mut spheres, mut failed) = (0, false);
        for frame in frames {
            assert!(!failed, "a frame after an error");
            match frame {
                Ok(frame) => {
                    let count = frame.len();
                    spheres += count;
                    assert!(frame.spheres.iter().all(|sphere| sphere.is_valid()));
                    let mut doubles = frame.doubles.iter().flatten();
                    assert!(doubles.all(|row| row.iter().all(|number| number.is_finite()) && row[3] >= 0.0));
                    assert!(frame.species.is_none_or(|species| species.len() == count));
                    assert!(frame.ids.is_none_or(|ids| ids.len() == count));
                }
                Err(error) => {
                    failed = true;
                    assert!(error.to_string().starts_with("fuzz"));
                }
            }
        }
        // Compressed files may hold more spheres than bytes.
        assert!(
            spheres <= bytes.len()
                || bytes.starts_with(b"\x1F\x8B")
                || bytes.starts_with(b"\x28\xB5\x2F\xFD")
        );
    }
}
