use super::{GpuSimulation, Tables};
use crate::model::receiver::ReceiverKind;

impl GpuSimulation {
    pub(super) fn add_tallies(&mut self, counts: &[u32]) {
        let Self { model, tables: Tables { tallies, .. }, totals, requests, .. } = self;
        let count = |at: usize| u64::from(counts[at]);
        // A species may appear and disappear between readbacks, so only the final count is not negative.
        let present = &mut totals.present;
        let mut convert = |from: Option<u32>, to: Option<u32>, count: u64| {
            if let Some(from) = from {
                present[from as usize] = present[from as usize].wrapping_sub(count);
            }
            if let Some(to) = to {
                present[to as usize] = present[to as usize].wrapping_add(count);
            }
        };
        for (k, decay) in model.decays.iter().enumerate() {
            let count = count(tallies.decay(k));
            totals.decayed[k] += count;
            convert(Some(decay.reactant), decay.products[0], count);
            convert(None, decay.products[1], count);
        }
        for (k, reaction) in model.reactions.iter().enumerate() {
            let count = count(tallies.reaction(k));
            totals.reacted[k] += count;
            for (from, to) in reaction.reactants.into_iter().zip(reaction.products) {
                convert(Some(from), to, count);
            }
        }
        for receiver in 0..tallies.receivers {
            let holds = matches!(model.receivers[receiver].kind, ReceiverKind::Receptors(_));
            for species in 0..tallies.species {
                let word = counts[tallies.arrival(receiver, species)];
                let count = if holds { i64::from(word as i32) as u64 } else { word.into() };
                let arrived = &mut totals.arrived[receiver][species];
                *arrived = arrived.wrapping_add(count);
                convert(Some(species as u32), None, count);
            }
        }
        for (receptor, occupied) in totals.occupied.iter_mut().enumerate() {
            let change = i64::from(counts[tallies.occupied(receptor)] as i32);
            *occupied = occupied.wrapping_add(change as u64);
        }
        let of_type = |receptor: usize| [0, 1].map(|k| count(tallies.requests(receptor) + k));
        requests.add((0..tallies.receptors).map(of_type));
    }
}
