//! Numbers by species and size class: displacements per call, and their limits.

#![expect(clippy::disallowed_methods, clippy::disallowed_macros, reason = "there are at most MAX_ROWS rows")]

use crate::size_class::{SIZE_CLASSES, class_of};

/// Further species share the rows of earlier ones.
const MAX_ROWS: u32 = 16;

/// Indexed by size class.
pub(crate) type PerClass<T = f32> = [T; SIZE_CLASSES];

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SpeciesClasses<T = f32> {
    /// A power of two.
    rows: Vec<PerClass<T>>,
}

impl<T: Copy> SpeciesClasses<T> {
    pub(crate) fn uniform(species: u32, number: T) -> Self {
        Self { rows: vec![[number; SIZE_CLASSES]; species.clamp(1, MAX_ROWS).next_power_of_two() as usize] }
    }

    pub(crate) fn fill(&mut self, number: T) {
        self.rows.iter_mut().for_each(|row| *row = [number; SIZE_CLASSES]);
    }

    pub(crate) fn has_rows_for(&self, species: u32) -> bool {
        self.rows.len() == species.clamp(1, MAX_ROWS).next_power_of_two() as usize
    }

    pub(crate) fn rows(&self) -> &[PerClass<T>] {
        &self.rows
    }

    /// Species 0 stands for all spheres if there is no table of species.
    #[inline(always)]
    pub(crate) fn get(&self, species: u32, radius: f32) -> T {
        self.rows[species as usize & (self.rows.len() - 1)][class_of(radius)]
    }

    #[inline(always)]
    pub(crate) fn get_mut(&mut self, species: u32, radius: f32) -> &mut T {
        let row = species as usize & (self.rows.len() - 1);
        &mut self.rows[row][class_of(radius)]
    }

    pub(crate) fn numbers(&self) -> impl Iterator<Item = T> + '_ {
        self.rows.iter().flatten().copied()
    }

    pub(crate) fn numbers_mut(&mut self) -> impl Iterator<Item = &mut T> {
        self.rows.iter_mut().flatten()
    }

    pub(crate) fn map(&self, of: impl Fn(T) -> T) -> Self {
        Self { rows: self.rows.iter().map(|row| row.map(&of)).collect() }
    }
}
