//! Frames of a simulation.

use std::io::{self, Write};

use bytemuck::{Pod, Zeroable};
use lazygrid::Sphere;

use super::{header_of, number};

/// A particle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Particle<'a> {
    /// Id, equal in all frames.
    pub id: u32,
    /// Species index.
    pub species: u32,
    /// Species name, without white space.
    pub name: &'a str,
    /// Position and radius.
    pub sphere: Sphere,
}

/// The header of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameInfo {
    /// Time step.
    pub step: u32,
    /// Simulation time.
    pub time: f64,
    /// Lower and upper bound by axis, if any.
    pub bounds: Option<[[f32; 2]; 3]>,
    /// Periodic axes.
    pub periodic: [bool; 3],
}

/// Bytes of a particle in a NumPy file.
pub const NPY_ROW: u64 = size_of::<Row>() as u64;

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Row {
    id: u32,
    species: u32,
    sphere: Sphere,
}

/// Appends a frame of extended XYZ: id, species, position, radius.
///
/// # Errors
/// Fails if the writer fails.
pub fn xyz<'a>(
    out: &mut (impl Write + ?Sized),
    info: &FrameInfo,
    particles: impl ExactSizeIterator<Item = Particle<'a>>,
) -> io::Result<()> {
    writeln!(out, "{}", particles.len())?;
    if let Some(bounds) = info.bounds {
        let [a, b, c] = bounds.map(|[low, high]| high - low);
        let [x, y, z] = bounds.map(|[low, _]| low);
        write!(out, "Lattice=\"{a} 0 0 0 {b} 0 0 0 {c}\" Origin=\"{x} {y} {z}\" ")?;
    }
    let [x, y, z] = info.periodic.map(|periodic| if periodic { 'T' } else { 'F' });
    let FrameInfo { step, time, .. } = info;
    writeln!(
        out,
        "pbc=\"{x} {y} {z}\" Properties=id:I:1:species:S:1:pos:R:3:radius:R:1 Time={time} Step={step}"
    )?;
    for Particle { id, name, sphere: Sphere { center, radius }, .. } in particles {
        writeln!(out, "{id} {name} {} {} {} {radius}", center.x, center.y, center.z)?;
    }
    Ok(())
}

/// Writes a frame as a NumPy array with fields `id`, `species`, `x`, `y`, `z`, `r`.
///
/// # Errors
/// Fails if the writer fails.
pub fn npy<'a>(
    out: &mut (impl Write + ?Sized),
    particles: impl ExactSizeIterator<Item = Particle<'a>>,
) -> io::Result<()> {
    out.write_all(&npy_frame_header(particles.len()))?;
    for Particle { id, species, sphere, .. } in particles {
        out.write_all(bytemuck::bytes_of(&Row { id, species, sphere }))?;
    }
    Ok(())
}

/// Returns the NumPy header of a frame.
pub fn npy_frame_header(particles: usize) -> Vec<u8> {
    let fields = [("id", "u4"), ("species", "u4"), ("x", "f4"), ("y", "f4"), ("z", "f4"), ("r", "f4")];
    let fields = fields.map(|(name, kind)| format!("('{name}', {})", number(kind))).join(", ");
    header_of(&format!("[{fields}]"), &format!("({particles},)"))
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;
    use crate::read::{Frame, Frames, Options};
    use crate::scenes::Scene;
    use crate::write::{self, SphereFormat};

    fn spheres() -> Vec<Sphere> {
        let mut spheres = Scene::FiveSizes.spheres(500, 9);
        let extreme = [f32::MAX, f32::MIN_POSITIVE, 1e-45, -0.0, 0.1, 16_777_217.0];
        spheres.extend(extreme.map(|x| Sphere::new([x, -x, 1.0 / 3.0], x.abs())));
        spheres
    }

    fn read(name: &str, bytes: Vec<u8>) -> (Frame, Vec<String>) {
        let options = Options { ids: true, ..Options::default() };
        let mut frames = Frames::new(name, Cursor::new(bytes), None, options).unwrap();
        let frame = frames.next().unwrap().unwrap();
        assert!(frames.next().is_none());
        (frame, frames.species().names().to_vec())
    }

    #[test]
    fn frames_read_back_as_they_were() {
        let spheres = spheres();
        let particles = || {
            let row = |(k, &sphere): (usize, &Sphere)| Particle {
                id: 3 * k as u32,
                species: k as u32 % 2,
                name: ["acid", "base"][k % 2],
                sphere,
            };
            spheres.iter().enumerate().map(row)
        };
        let ids: Vec<_> = particles().map(|particle| i64::from(particle.id)).collect();
        let kinds: Vec<_> = particles().map(|particle| particle.species).collect();
        let info = FrameInfo {
            step: 40,
            time: 0.5,
            bounds: Some([[-8.0, 8.0], [0.0, 12.5], [-1.0, 1.0]]),
            periodic: [true, true, false],
        };
        let (mut text, mut array) = (Vec::new(), Vec::new());
        xyz(&mut text, &info, particles()).unwrap();
        npy(&mut array, particles()).unwrap();

        let (frame, names) = read("a.xyz", text);
        assert_eq!((frame.step, frame.space.lengths()), (Some(40), [Some(16.0), Some(12.5), None]));
        assert_eq!((&frame.spheres, &names[..]), (&spheres, &["acid".to_owned(), "base".to_owned()][..]));
        assert_eq!((frame.ids.as_ref(), frame.species.as_ref()), (Some(&ids), Some(&kinds)));

        let (frame, names) = read("a.npy", array);
        assert_eq!((&frame.spheres, &names[..]), (&spheres, &["0".to_owned(), "1".to_owned()][..]));
        assert_eq!((frame.ids, frame.species), (Some(ids), Some(kinds)));
    }

    #[test]
    fn spheres_read_back_in_every_format() {
        let (directory, spheres) = (tempfile::tempdir().unwrap(), spheres());
        for (name, format) in
            [("csv", SphereFormat::Csv), ("npy", SphereFormat::Npy), ("xyz", SphereFormat::Xyz)]
        {
            for end in ["", ".gz", ".zst"] {
                let path = directory.path().join(format!("a.{name}{end}"));
                assert_eq!(SphereFormat::from_extension(&path), Some(format));
                write::spheres(&path, format, &spheres).unwrap();
                let frames: Vec<_> = Frames::open(&path, Options::default()).unwrap().collect();
                let [Ok(frame)] = &frames[..] else { panic!("{frames:?}") };
                assert_eq!(frame.spheres, spheres, "{}", path.display());
            }
        }
    }
}
