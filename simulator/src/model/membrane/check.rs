use super::receiver::STEPS_APART;
use super::{Membrane, MembraneSurface};
use crate::model::boundary::Axis;
use crate::model::receiver::{Receiver, signed_distance};
use crate::model::{Flow, Model};

impl Model {
    pub(crate) fn faulty_membrane(&self) -> Option<(usize, String)> {
        (0..self.membranes.len()).find_map(|k| Some((k, self.fault_of_membrane(k)?)))
    }

    fn fault_of_membrane(&self, k: usize) -> Option<String> {
        let membrane = &self.membranes[k];
        let Membrane { ref name, surface, permeability, ref sees } = *membrane;
        let fault = |what: String| Some(format!("membrane {name} {what}"));
        if sees.len() != self.species.len() {
            return fault(format!(
                "has flags for {} species of {}; give one for each",
                sees.len(),
                self.species.len()
            ));
        }
        if !(permeability.is_finite() && permeability >= 0.0) {
            return fault(format!("has the permeability {permeability}; it must be finite and not negative"));
        }
        let seen = self.species.iter().zip(sees).filter(|(_, sees)| **sees);
        let largest = seen.map(|(species, _)| species.radius).fold(0.0, f32::max);
        if let Some(what) = self.misplaced(surface, largest) {
            return fault(what);
        }
        let shared = |other: &Membrane| (0..sees.len()).find(|&species| sees[species] && other.sees[species]);
        let is_same = |other: &&Membrane| other.surface == surface;
        if let Some(other) = self.membranes[..k].iter().filter(is_same).find(|other| shared(other).is_some())
        {
            return fault(format!(
                "has the same surface as {} and holds back a species that {} does; remove one",
                other.name, other.name
            ));
        }
        if self.contact.collides() {
            return fault(
                "holds back particles that collide; set contact = \"count\" or \"ignore\"".to_owned(),
            );
        }
        let flow = match &self.flow {
            Some(Flow::Plug(velocity)) => *velocity,
            Some(Flow::Poiseuille { mean }) => [*mean; 3],
            Some(Flow::Field(field)) => field.fastest(),
            None => [0.0; 3],
        };
        let is_across = |axis: usize| match surface {
            MembraneSurface::Plane { axis: across, .. } => axis == across,
            MembraneSurface::Sphere { .. } => true,
        };
        let drifts = |species: &usize| {
            let one = &self.species[*species];
            let carries = |axis: usize| is_across(axis) && (one.drift[axis] != 0.0 || flow[axis] != 0.0);
            sees[*species] && (one.has_velocity() || (0..3).any(carries))
        };
        if let Some(species) = (0..sees.len()).find(drifts) {
            let species = &self.species[species].name;
            return fault(format!(
                "holds back {species}, which drifts or swims through it; let it drift along a plane only, or exclude it by species"
            ));
        }
        self.receivers.iter().find_map(|receiver| self.fault_beside(receiver, membrane)).and_then(fault)
    }

    fn misplaced(&self, surface: MembraneSurface, largest: f32) -> Option<String> {
        let domain = self.boundary.inset(largest);
        let fits = |axis: usize, [low_end, high_end]: [f32; 2]| match domain.axes[axis] {
            Axis::Open => low_end.is_finite() && high_end.is_finite(),
            Axis::Reflecting { low, high } => low < low_end && high_end < high,
            Axis::Periodic { low, high } => low < low_end && high_end < high,
            Axis::Frozen => low_end == -high_end,
        };
        match surface {
            MembraneSurface::Plane { axis, position } => {
                let vessel = self.boundary.vessel.is_some_and(|vessel| vessel.along != Some(axis));
                let is_inside = axis < 3 && domain.axes[axis] != Axis::Frozen && fits(axis, [position; 2]);
                (vessel || !is_inside).then(|| {
                    format!(
                        "is at {position} µm, where no plane fits; put it between the walls of a box, or across the axis of a \
                         cylinder"
                    )
                })
            }
            MembraneSurface::Sphere { center, radius } => {
                let is_inside = (0..3).all(|axis| fits(axis, [center[axis] - radius, center[axis] + radius]));
                (!(radius > 0.0 && is_inside) || self.boundary.vessel.is_some()).then(|| {
                    format!(
                        "has the radius {radius} µm around {center:?}, where no sphere fits; put it between the walls of a box, \
                         or into unbounded space"
                    )
                })
            }
        }
    }

    fn fault_beside(&self, receiver: &Receiver, membrane: &Membrane) -> Option<String> {
        let fastest = self.fastest_shared(receiver, membrane)?;
        let away = match membrane.surface {
            MembraneSurface::Plane { axis, position } => {
                self.boundary.axes[axis].displacement(receiver.center[axis] - position)
            }
            MembraneSurface::Sphere { center, radius } => {
                signed_distance(radius, center, &self.boundary, receiver.center)
            }
        };
        let gap = f64::from(away.abs() - receiver.radius);
        let name = &receiver.name;
        if gap <= 0.0 {
            return Some(format!("meets receiver {name}, which touches it; use a receiver away from it"));
        }
        let needed = self.least_gap(receiver, fastest);
        (gap < needed).then(|| {
            let (length, moves) = match receiver.moves() {
                true => ("√(2DΔt), with the diffusion of both, and its drift in a step", "moves and "),
                false => ("√(2DΔt)", ""),
            };
            format!(
                "is {gap:.3} µm from the surface of receiver {name}, which {moves}reflects {}; the distance must be at least \
                 {needed:.3} µm, {STEPS_APART} times {length}; move the receiver, or let time-step be {:.2e}",
                fastest.name,
                // Rounded to a shorter one.
                0.995 * receiver.time_of_gap(gap, fastest.diffusion)
            )
        })
    }
}
