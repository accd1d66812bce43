//! Rows of species that receptors bind, one per receptor type.

use std::ops::Range;

use super::layout::EventRow;
use super::tables::Tables;
use super::tally_layout::Tallies;
use crate::model::Model;
use crate::motion::adsorption;
use crate::motion::surface_diffusion::SurfaceSteps;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct LigandRow {
    pub(super) species: u32,
    pub(super) receiver: u32,
    pub(super) receptor: u32,
    pub(super) row: u32,
}

pub(super) struct LigandRows<'a> {
    model: &'a Model,
    tallies: &'a Tallies,
    first_types: Vec<u32>,
    surface_steps: SurfaceSteps,
}

impl<'a> LigandRows<'a> {
    pub(super) fn new(model: &'a Model, tallies: &'a Tallies) -> Self {
        let (first_types, surface_steps) = (model.first_receptor_types(), SurfaceSteps::new(model));
        Self { model, tallies, first_types, surface_steps }
    }

    pub(super) fn append(&self, species: u32, events: Range<usize>, rows: &mut Vec<EventRow>) {
        for at in events {
            let event = rows[at];
            if event.kind != EventRow::RECEPTORS {
                continue;
            }
            let begin = rows.len();
            rows.extend(self.rows_for(species, event));
            let [ligands_begin, ligands_end] = [begin, rows.len()].map(|row| row as u32);
            for row in (begin..rows.len()).chain([at]) {
                rows[row] = EventRow { ligands_begin, ligands_end, ..rows[row] };
            }
        }
    }

    fn rows_for(&self, species: u32, event: EventRow) -> impl Iterator<Item = EventRow> {
        let Self { model, tallies, .. } = self;
        let (index, time_step) = (event.receiver as usize, model.time_step);
        let receiver = &model.receivers[index];
        let concentration = self.surface_steps.concentration_of(index).map_or(0.0, |k| k as f32);
        let types = (self.first_types[index]..).zip(receiver.receptor_types());
        types.filter_map(move |(receptor, kind)| {
            let ligand = kind.ligand(species)?;
            let reactivity = adsorption::reactivity(ligand.binding_rate, 1, receiver.radius.into());
            Some(EventRow {
                scaled_reactivity: (reactivity * time_step / f64::from(event.length)) as f32,
                unbinding: (ligand.unbinding_rate * time_step) as f32,
                receptor,
                occupied: tallies.occupied(receptor as usize) as u32,
                concentration,
                ..event
            })
        })
    }
}

impl Tables {
    pub(super) fn ligands(&self) -> Vec<LigandRow> {
        let mut ligands = Vec::new();
        for (species, kind) in (0..).zip(&self.species_rows) {
            let events = &self.event_rows[kind.events_begin as usize..kind.decays_begin as usize];
            for row in events.iter().flat_map(|event| event.ligands_begin..event.ligands_end) {
                let EventRow { receiver, receptor, .. } = self.event_rows[row as usize];
                ligands.push(LigandRow { species, receiver, receptor, row });
            }
        }
        ligands
    }
}
