use std::ffi::OsStr;
use std::io::{self, Write};
use std::path::Path;

use lazygrid::Sphere;

use super::encoder::uncompressed;
use super::text::Rows;
use super::{AtomicFile, npy_header};
use crate::Error;

/// A format of spheres.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SphereFormat {
    /// Table `x,y,z,r`.
    Csv,
    /// NumPy array of shape `(n, 4)` and type `f4`.
    Npy,
    /// Extended XYZ with position and radius.
    Xyz,
}

impl SphereFormat {
    /// Returns the format of an extension, before `.gz` or `.zst`.
    pub fn from_extension(path: &Path) -> Option<Self> {
        match uncompressed(path).extension().and_then(OsStr::to_str)? {
            "csv" => Some(Self::Csv),
            "npy" => Some(Self::Npy),
            "xyz" => Some(Self::Xyz),
            _ => None,
        }
    }
}

/// Writes spheres so that they read back exactly.
///
/// # Errors
/// [`Error::Write`].
pub fn spheres(path: &Path, format: SphereFormat, spheres: &[Sphere]) -> Result<(), Error> {
    let mut file = AtomicFile::create(path)?;
    file.write_with(|out| match format {
        SphereFormat::Npy => {
            out.write_all(&npy_header("f4", &format!("({}, 4)", spheres.len())))?;
            out.write_all(bytemuck::cast_slice(spheres))
        }
        SphereFormat::Csv => {
            out.write_all(b"x,y,z,r\n")?;
            rows(out, spheres, b',')
        }
        SphereFormat::Xyz => {
            writeln!(out, "{}\nProperties=pos:R:3:radius:R:1", spheres.len())?;
            rows(out, spheres, b' ')
        }
    })?;
    file.commit()
}

fn rows(out: impl Write, spheres: &[Sphere], separator: u8) -> io::Result<()> {
    let mut rows = Rows::new(out);
    spheres.iter().try_for_each(|&Sphere { center, radius }| {
        rows.row([center.x, center.y, center.z, radius], separator)
    })?;
    rows.flush()
}
