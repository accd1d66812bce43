//! Numbers by species and size class: displacements per call, and their limits.

use bytemuck::Zeroable;

use crate::Error;
use crate::memory::try_resize;
use crate::size_class::{SIZE_CLASSES, class_of};

/// Maximum rows, a power of two. Further species share the rows of earlier ones.
const MAX_ROWS: u32 = 16;
const NAME: &str = "displacements by species";

pub(crate) type PerClass<T = f32> = [T; SIZE_CLASSES];

#[derive(Debug, Default)]
pub(crate) struct SpeciesClasses<T = f32> {
    /// The number of rows is a power of two, or 0 before the first use.
    rows: Vec<PerClass<T>>,
}

impl<T: Copy + Zeroable> SpeciesClasses<T> {
    pub(crate) fn set_all(&mut self, species: u32, number: T) -> Result<(), Error> {
        try_resize(&mut self.rows, rows_for(species), NAME)?;
        self.fill(number);
        Ok(())
    }

    pub(crate) fn fill(&mut self, number: T) {
        self.rows.fill([number; SIZE_CLASSES]);
    }

    pub(crate) fn set_from(&mut self, others: &Self, map: impl Fn(T) -> T) -> Result<(), Error> {
        try_resize(&mut self.rows, others.rows.len(), NAME)?;
        self.numbers_mut().zip(others.numbers()).for_each(|(to, from)| *to = map(from));
        Ok(())
    }

    pub(crate) fn has_rows_for(&self, species: u32) -> bool {
        self.rows.len() == rows_for(species)
    }

    pub(crate) fn rows(&self) -> &[PerClass<T>] {
        &self.rows
    }

    /// Species 0 represents all spheres without a table.
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
        self.rows.as_flattened().iter().copied()
    }

    pub(crate) fn numbers_mut(&mut self) -> impl Iterator<Item = &mut T> {
        self.rows.as_flattened_mut().iter_mut()
    }
}

fn rows_for(species: u32) -> usize {
    species.clamp(1, MAX_ROWS).next_power_of_two() as usize
}
