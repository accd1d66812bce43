use std::io::Cursor;

use lazygrid_io::read::{Format, Frames, Options};

/// Reads `bytes` with and without a known length and ids. Checks that reading never panics, spheres are valid and no
/// more than bytes, and nothing follows an error.
pub fn read(format: Option<Format>, bytes: &[u8]) {
    let radii = [("A".to_owned(), 1.0), ("1".to_owned(), 0.5)];
    for (length, ids) in [(None, true), (Some(bytes.len() as u64), false)] {
        let options =
            Options { format, radii: radii.clone().into(), ids, doubles: !ids, ..Options::default() };
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
        // Compressed files (gzip, zstd) may hold more spheres than bytes.
        assert!(
            spheres <= bytes.len()
                || bytes.starts_with(b"\x1F\x8B")
                || bytes.starts_with(b"\x28\xB5\x2F\xFD")
        );
    }
}
