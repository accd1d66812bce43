use crate::model::Model;
use crate::model::receiver::{Receiver, ReceiverKind};

/// Identical receptors without positions, for which ligands compete.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReceptorType {
    /// Each receptor binds one particle.
    pub count: u32,
    pub ligands: Vec<Ligand>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ligand {
    pub species: u32,
    /// Rate of a free receptor, in µm³/s: `n` free receptors on a sphere have the reactivity n·rate/(4πR²).
    pub binding_rate: f64,
    /// Per bound particle, in 1/s.
    pub unbinding_rate: f64,
}

impl ReceptorType {
    pub fn new(
        count: u32,
        binding_rate: f64,
        unbinding_rate: f64,
        species: impl IntoIterator<Item = u32>,
    ) -> Self {
        let ligand = |species| Ligand { species, binding_rate, unbinding_rate };
        Self { count, ligands: species.into_iter().map(ligand).collect() }
    }

    pub fn ligand(&self, species: u32) -> Option<&Ligand> {
        self.ligands.iter().find(|ligand| ligand.species == species)
    }
}

impl Receiver {
    pub fn receptor_types(&self) -> &[ReceptorType] {
        match &self.kind {
            ReceiverKind::Receptors(types) => types,
            _ => &[],
        }
    }

    pub(crate) fn binds(&self, species: usize) -> bool {
        self.receptor_types().iter().any(|kind| kind.ligand(species as u32).is_some())
    }
}

impl Model {
    pub(crate) fn receptor_types(&self) -> impl Iterator<Item = &ReceptorType> {
        self.receivers.iter().flat_map(Receiver::receptor_types)
    }

    /// Returns each receiver's first receptor type, then the number of types.
    pub(crate) fn first_receptor_types(&self) -> Vec<u32> {
        let mut next = 0;
        let first = self.receivers.iter().map(|receiver| {
            next += receiver.receptor_types().len() as u32;
            next - receiver.receptor_types().len() as u32
        });
        let mut all: Vec<u32> = first.collect();
        all.push(next);
        all
    }
}
