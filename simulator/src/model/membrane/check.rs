use super::{Membrane, MembraneSurface};
use crate::model::boundary::Axis;
use crate::model::receiver::{Receiver, signed_distance};
use crate::model::{Contact, Flow, Model};

impl Model {
    pub(crate) fn faulty_membrane(&self) -> Option<(usize, String)> {
        (0..self.membranes.len()).find_map(|k| Some((k, self.fault_of_membrane(k)?)))
    }

    fn fault_of_membrane(&self, k: usize) -> Option<String> {
        let membrane = &self.membranes[k];
        let Membrane { ref name, surface, permeability, ref sees } = *membrane;
        let fault = |what: String| Some(format!("membrane {name} {what}"));
        if sees.len() != self.species.len() {
            return fault(format!("sees {} species, of {}", sees.len(), self.species.len()));
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
            return fault(format!("is where {} is for the same species; remove one", other.name));
        }
        if matches!(self.contact, Contact::Separate | Contact::Elastic) {
            return fault(
                "holds back particles that collide; let contact be \"count\" or \"ignore\"".to_owned(),
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
                "holds back {species}, which drifts or swims through it; let it drift along a plane, or exclude it by species"
            ));
        }
        let receiver = self.receivers.iter().find(|receiver| self.meets(receiver, membrane))?;
        fault(format!(
            "meets receiver {}, which moves, reflects or touches it; use a resting absorbing receiver away from it",
            receiver.name
        ))
    }

    /// Returns the fault of a surface that does not fit the boundary of particles up to a radius.
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

    fn meets(&self, receiver: &Receiver, membrane: &Membrane) -> bool {
        let shares = membrane.sees.iter().zip(&receiver.sees).any(|(a, b)| *a && *b);
        let away = match membrane.surface {
            MembraneSurface::Plane { axis, position } => {
                self.boundary.axes[axis].displacement(receiver.center[axis] - position)
            }
            MembraneSurface::Sphere { center, radius } => {
                signed_distance(radius, center, &self.boundary, receiver.center)
            }
        };
        shares
            && receiver.kind.is_active_sphere()
            && (receiver.moves() || receiver.kind.reflects() || away.abs() <= receiver.radius)
    }
}
