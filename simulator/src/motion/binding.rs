//! Binding to receptors and unbinding.

use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};

use crate::model::Model;
use crate::model::membrane::MembraneStep;
use crate::model::receiver::{Receiver, rounding, signed_distance};
use crate::model::receptors::ReceptorType;
use crate::motion::adsorption::{AdsorptionStep, reactivity};
use crate::motion::surface_events::Event;
use crate::random::philox::{Draws, Purpose, StepKey};

#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable, Serialize, Deserialize)]
#[repr(C)]
pub struct Bound {
    pub id: u32,
    pub species: u32,
    /// Index in the model.
    pub receiver: u32,
    /// Index among the receptor types of all receivers.
    pub receptor: u32,
    /// Unit vector from the receiver's center.
    pub direction: [f32; 3],
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct UnboundParticle {
    pub(crate) at: usize,
    /// Height above the receiver, in µm.
    height: f32,
}

pub(crate) fn free_receptors(model: &Model, occupied: &[u64]) -> Vec<u32> {
    let one =
        |(kind, &held): (&ReceptorType, &u64)| kind.count.saturating_sub(held.try_into().unwrap_or(u32::MAX));
    model.receptor_types().zip(occupied).map(one).collect()
}

/// `free` returns the free receptors of a type.
pub(crate) fn desorption(
    model: &Model,
    receiver: &Receiver,
    species: u32,
    free: impl Fn(usize) -> u32,
) -> AdsorptionStep {
    let diffusion = (model.species[species as usize].diffusion + receiver.diffusion) * model.time_step;
    let radius = f64::from(receiver.radius);
    let of_type = |(kind, one): (usize, &ReceptorType)| {
        one.ligand(species).map_or(0.0, |ligand| reactivity(ligand.binding_rate, free(kind), radius))
    };
    let reactivity = receiver.receptor_types().iter().enumerate().map(of_type).sum();
    AdsorptionStep::new(diffusion, model.time_step, (radius, reactivity))
}

pub(crate) fn leaving(
    model: &Model,
    bound: &[Bound],
    free: &[u32],
    StepKey { key, step }: StepKey,
) -> Vec<UnboundParticle> {
    let first_types = model.first_receptor_types();
    let leaves = |(at, held): (usize, &Bound)| {
        let receiver = &model.receivers[held.receiver as usize];
        let first = first_types[held.receiver as usize];
        let ligand = receiver.receptor_types().get((held.receptor - first) as usize)?.ligand(held.species)?;
        // Detailed balance: the reverse reaction sees one more.
        let free_of = |kind: usize| {
            let index = first + kind as u32;
            free[index as usize].saturating_add(u32::from(index == held.receptor))
        };
        let desorption = desorption(model, receiver, held.species, free_of);
        let probability = ligand.unbinding_rate * model.time_step * desorption.effective_fraction();
        let mut draws = Draws::new(key, held.id, step, Purpose::Unbinding);
        (draws.unit() < probability)
            .then(|| UnboundParticle { at, height: desorption.height_after(&mut draws) as f32 })
    };
    bound.iter().enumerate().filter_map(leaves).collect()
}

/// Returns `None` for a position across a membrane, or if walls leave no space.
pub(crate) fn unbound_position(
    model: &Model,
    held: &Bound,
    leaving: UnboundParticle,
    center: [f32; 3],
) -> Option<[f32; 3]> {
    let receiver = &model.receivers[held.receiver as usize];
    let domain = model.boundary.inset(model.species[held.species as usize].radius);
    let away = receiver.radius + leaving.height;
    let away = away + rounding(center, away);
    let position = domain.confine(std::array::from_fn(|k| center[k] + away * held.direction[k]));
    let species = held.species as usize;
    let among_membranes = MembraneStep {
        membranes: &model.membranes,
        domain: &domain,
        species,
        diffusion: 0.0,
        spread: 0.0,
        gaps: [f32::INFINITY; 3],
    };
    let is_outside = signed_distance(receiver.radius, center, &domain, position) >= 0.0;
    (is_outside && !among_membranes.separates([position, center])).then_some(position)
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct BindingRequest {
    receptor: u32,
    rank: u32,
    id: u32,
}

impl BindingRequest {
    #[cfg(feature = "gpu")]
    pub(crate) fn new(receptor: u32, rank: u32, id: u32) -> Self {
        Self { receptor, rank, id }
    }

    #[cfg(feature = "gpu")]
    pub(crate) fn id(self) -> u32 {
        self.id
    }

    pub(crate) fn receptor(self) -> usize {
        self.receptor as usize
    }
}

pub(crate) fn requests(events: &[Event], id: impl Fn(u32) -> u32) -> Vec<BindingRequest> {
    let request = |event: &Event| match *event {
        Event::Bound { at, receptor, rank, .. } => Some(BindingRequest { receptor, rank, id: id(at) }),
        _ => None,
    };
    events.iter().filter_map(request).collect()
}

/// Returns the ids without a free receptor, in ascending order. Receptors go to the lowest ranks, then ids.
pub(crate) fn rejected(mut requests: Vec<BindingRequest>, free: &[u32]) -> Vec<u32> {
    requests.sort_unstable();
    let of_one = requests.chunk_by(|a, b| a.receptor == b.receptor);
    let mut rejected: Vec<u32> = of_one
        .flat_map(|many| many.iter().skip(free[many[0].receptor as usize] as usize).map(|request| request.id))
        .collect();
    rejected.sort_unstable();
    rejected
}

#[cfg(test)]
mod tests {
    use lazygrid::Algorithm;

    use super::*;
    use crate::{Boundary, Receiver, ReceiverKind, Shape, Simulation, Species, State, Transmitter};

    #[test]
    fn lowest_ranks_get_receptors() {
        let bound =
            |at, receptor, rank| Event::Bound { at, receiver: 0, receptor, direction: [0.0; 3], rank };
        let events = [bound(4, 1, 7), bound(5, 0, 9), bound(6, 1, 3), bound(7, 1, 3), bound(8, 0, 1)];
        let rejected = |free: &[u32]| rejected(requests(&events, |at| 100 - at), free);
        assert_eq!(rejected(&[1, 1]), [94, 95, 96]);
        assert_eq!(rejected(&[2, 9]), [0; 0]);
        assert_eq!(rejected(&[0, 2]), [92, 95, 96]);
    }

    #[test]
    fn a_run_continues_with_its_bound_particles() {
        let receptors = vec![ReceptorType::new(3, 20.0, 5.0, [0])];
        let receiver = |x| Receiver {
            name: "rx".into(),
            center: [x, 0.0, 0.0],
            radius: 0.5,
            kind: ReceiverKind::Receptors(receptors.clone()),
            sees: vec![true],
            velocity: [0.0, x.into(), 0.0],
            diffusion: 0.5,
            surface_diffusion: 0.25,
        };
        let transmitter = Transmitter {
            name: "tx".into(),
            shape: Shape::Box([4.0; 3]),
            release: vec![(0, 300)],
            ..Transmitter::default()
        };
        let model = Model {
            time_step: 0.01,
            species: vec![Species { name: "A".into(), diffusion: 1.0, ..Species::default() }],
            transmitters: vec![transmitter],
            receivers: vec![receiver(-1.0), receiver(1.0)],
            boundary: Boundary::reflecting([-2.0; 3], [2.0; 3]),
            ..Model::default()
        };
        let mut through = Simulation::new(model.clone(), 3, Algorithm::Auto).unwrap();
        let mut max_bound = 0;
        for _ in 0..60 {
            through.step().unwrap();
            let State { particles, bound, totals, .. } = through.state();
            assert_eq!(particles.len() + bound.len(), 300);
            assert_eq!(totals.arrived.iter().map(|row| row[0]).sum::<u64>(), bound.len() as u64);
            assert_eq!(totals.present, [particles.len() as u64]);
            assert!(totals.arrived.iter().all(|row| row[0] <= 3), "{:?}", totals.arrived);
            max_bound = max_bound.max(bound.len());
        }
        assert_eq!(max_bound, 6);
        let bytes = postcard::to_allocvec(through.state()).unwrap();
        let state: State = postcard::from_bytes(&bytes).unwrap();
        assert!(state.centers != [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]] && !state.bound.is_empty());
        let mut again = Simulation::resume(model.clone(), 3, Algorithm::Auto, state.clone()).unwrap();
        for _ in 0..60 {
            through.step().unwrap();
            again.step().unwrap();
        }
        assert_eq!(through.state(), again.state());
        let other = Model { receivers: vec![receiver(0.0)], ..model };
        assert!(Simulation::resume(other, 3, Algorithm::Auto, state).is_err());
    }
}
