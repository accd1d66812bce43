//! Frames, with particles by ascending id.

use std::io::{self, Write};

use lazygrid::Sphere;
use lazygrid_io::write::frames::{self, FrameInfo, Particle};

use crate::model::boundary::Axis;
use crate::{Model, Particles, State};

pub(super) const NPY_HEADER: usize = 192;
pub(super) const NPY_ROW: u64 = frames::NPY_ROW;

pub(super) fn xyz(out: &mut impl Write, model: &Model, state: &State) -> io::Result<()> {
    let axes = model.boundary.axes;
    let bounds = axes.map(|axis| match axis {
        Axis::Open | Axis::Frozen => None,
        Axis::Reflecting { low, high } | Axis::Periodic { low, high } => Some([low, high]),
    });
    let info = FrameInfo {
        step: state.step,
        time: f64::from(state.step) * model.time_step,
        bounds: if let [Some(x), Some(y), Some(z)] = bounds { Some([x, y, z]) } else { None },
        periodic: axes.map(|axis| matches!(axis, Axis::Periodic { .. })),
    };
    let particles = &state.particles;
    frames::xyz(out, &info, particles.by_id().into_iter().map(|at| particle(model, particles, at as usize)))
}

pub(super) fn npy(out: &mut impl Write, model: &Model, particles: &Particles) -> io::Result<()> {
    frames::npy(out, particles.by_id().into_iter().map(|at| particle(model, particles, at as usize)))
}

fn particle<'a>(model: &'a Model, particles: &Particles, at: usize) -> Particle<'a> {
    let species = particles.species[at];
    Particle {
        id: particles.id[at],
        species,
        name: &model.species[species as usize].name,
        sphere: Sphere::new(particles.position_of(at), particles.radius[at]),
    }
}
