//! Frames for OVITO and Python. Particles come in ascending order of their ids.

use std::io::{self, Write};

use bytemuck::{Pod, Zeroable};

use crate::boundary::Axis;
use crate::{Model, Particles, State};

/// Bytes of the header of a NumPy file.
pub(super) const NPY_HEADER: usize = 192;
/// Bytes of a particle in a NumPy file.
pub(super) const NPY_ROW: u64 = size_of::<Row>() as u64;

/// Appends a frame of extended XYZ.
pub(super) fn xyz(out: &mut impl Write, model: &Model, state: &State) -> io::Result<()> {
    let particles = &state.particles;
    writeln!(out, "{}", particles.len())?;
    let axes = model.boundary.axes;
    let bounds = axes.map(|axis| match axis {
        Axis::Open => None,
        Axis::Reflecting { low, high } | Axis::Periodic { low, high } => Some((low, high)),
    });
    if let [Some(x), Some(y), Some(z)] = bounds {
        let [a, b, c] = [x, y, z].map(|(low, high)| high - low);
        write!(out, "Lattice=\"{a} 0 0 0 {b} 0 0 0 {c}\" Origin=\"{} {} {}\" ", x.0, y.0, z.0)?;
    }
    let periodic = axes.map(|axis| if matches!(axis, Axis::Periodic { .. }) { 'T' } else { 'F' });
    let [x, y, z] = periodic;
    writeln!(
        out,
        "pbc=\"{x} {y} {z}\" Properties=id:I:1:species:S:1:pos:R:3:radius:R:1 Time={} Step={}",
        f64::from(state.step) * model.time_step,
        state.step
    )?;
    for at in particles.by_id() {
        let at = at as usize;
        let [x, y, z] = particles.position_of(at);
        let name = &model.species[particles.species[at] as usize].name;
        writeln!(out, "{} {name} {x} {y} {z} {}", particles.id[at], particles.radius[at])?;
    }
    Ok(())
}

/// A row of a NumPy file.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Row {
    id: u32,
    species: u32,
    sphere: [f32; 4],
}

/// Writes a NumPy file of one frame: a structured array with the fields `id`, `species`, `x`, `y`, `z`, `r`.
pub(super) fn npy(out: &mut impl Write, particles: &Particles) -> io::Result<()> {
    let order = if cfg!(target_endian = "big") { '>' } else { '<' };
    let field = |(name, kind): (&str, &str)| format!("('{name}', '{order}{kind}')");
    let fields = [("id", "u4"), ("species", "u4"), ("x", "f4"), ("y", "f4"), ("z", "f4"), ("r", "f4")];
    let descr = fields.map(field).join(", ");
    let mut header =
        format!("{{'descr': [{descr}], 'fortran_order': False, 'shape': ({},), }}", particles.len());
    // The format asks for a multiple of 64 with what comes before, and a line break at the end.
    let before = 10;
    let length = (before + header.len() + 1).next_multiple_of(64) - before;
    header.extend(std::iter::repeat_n(' ', length - header.len() - 1));
    header.push('\n');
    out.write_all(b"\x93NUMPY\x01\x00")?;
    out.write_all(&(length as u16).to_le_bytes())?;
    out.write_all(header.as_bytes())?;
    for at in particles.by_id() {
        let at = at as usize;
        let [x, y, z] = particles.position_of(at);
        let row = Row {
            id: particles.id[at],
            species: particles.species[at],
            sphere: [x, y, z, particles.radius[at]],
        };
        out.write_all(bytemuck::bytes_of(&row))?;
    }
    Ok(())
}
