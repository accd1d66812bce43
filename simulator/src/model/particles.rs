use std::ops::Range;

use lazygrid::Spheres;
use serde::{Deserialize, Serialize};

use crate::Error;
use crate::memory::check_available;

/// Particles as columns. An id names a particle; its index changes when others are removed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Particles {
    /// Coordinates by axis, in µm.
    pub position: [Vec<f32>; 3],
    /// In µm/s, by axis; empty in a model without velocities.
    pub velocity: [Vec<f32>; 3],
    pub radius: Vec<f32>,
    pub species: Vec<u32>,
    pub id: Vec<u32>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Particle {
    pub position: [f32; 3],
    /// In µm/s; unused in a model without velocities.
    pub velocity: [f32; 3],
    pub radius: f32,
    pub species: u32,
    pub id: u32,
}

impl Particles {
    pub fn len(&self) -> usize {
        self.id.len()
    }

    pub fn is_empty(&self) -> bool {
        self.id.is_empty()
    }

    pub fn has_velocity(&self) -> bool {
        !self.is_empty() && self.velocity[0].len() == self.len()
    }

    pub(crate) fn has_whole_columns(&self) -> bool {
        let n = self.len();
        let velocities = self.velocity.each_ref().map(Vec::len);
        self.position.iter().all(|column| column.len() == n)
            && (velocities == [n; 3] || velocities == [0; 3])
            && self.radius.len() == n
            && self.species.len() == n
    }

    /// Reserves memory for `count` more particles.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`] if the system refuses, and [`Error::TooLittleMemory`] for more than is available, which
    /// the system may grant and then end the process.
    pub fn reserve(&mut self, count: u64, with_velocity: bool) -> Result<(), Error> {
        let particles = self.len() as u64 + count;
        let columns = if with_velocity { 9 } else { 6 };
        let needed = count.saturating_mul(columns * size_of::<f32>() as u64);
        check_available(&format!("{count} particles"), needed, "release or copy fewer, or raise the limit")?;
        let refused = |_| Error::OutOfMemory { particles, bytes: particles * size_of::<f32>() as u64 };
        let count = usize::try_from(count).unwrap_or(usize::MAX);
        let velocity = self.velocity.iter_mut().filter(|_| with_velocity);
        for column in self.position.iter_mut().chain(velocity).chain([&mut self.radius]) {
            column.try_reserve(count).map_err(refused)?;
        }
        for column in [&mut self.species, &mut self.id] {
            column.try_reserve(count).map_err(refused)?;
        }
        Ok(())
    }

    pub fn push(&mut self, particle: Particle, with_velocity: bool) {
        for axis in 0..3 {
            self.position[axis].push(particle.position[axis]);
            if with_velocity {
                self.velocity[axis].push(particle.velocity[axis]);
            }
        }
        self.radius.push(particle.radius);
        self.species.push(particle.species);
        self.id.push(particle.id);
    }

    /// Returns a copy.
    ///
    /// # Errors
    /// See [`reserve`](Self::reserve).
    pub fn try_clone(&self) -> Result<Self, Error> {
        let mut copy = Self::default();
        copy.reserve(self.len() as u64, self.has_velocity())?;
        for axis in 0..3 {
            copy.position[axis].extend_from_slice(&self.position[axis]);
            copy.velocity[axis].extend_from_slice(&self.velocity[axis]);
        }
        copy.radius.extend_from_slice(&self.radius);
        copy.species.extend_from_slice(&self.species);
        copy.id.extend_from_slice(&self.id);
        Ok(copy)
    }

    pub fn append(&mut self, mut others: Self) {
        for axis in 0..3 {
            self.position[axis].append(&mut others.position[axis]);
            self.velocity[axis].append(&mut others.velocity[axis]);
        }
        self.radius.append(&mut others.radius);
        self.species.append(&mut others.species);
        self.id.append(&mut others.id);
    }

    pub fn get(&self, at: usize) -> Particle {
        Particle {
            position: self.position_of(at),
            velocity: std::array::from_fn(|axis| self.velocity[axis].get(at).copied().unwrap_or(0.0)),
            radius: self.radius[at],
            species: self.species[at],
            id: self.id[at],
        }
    }

    #[inline]
    pub fn position_of(&self, at: usize) -> [f32; 3] {
        [self.position[0][at], self.position[1][at], self.position[2][at]]
    }

    #[inline]
    pub fn set_position(&mut self, at: usize, position: [f32; 3]) {
        for (column, coordinate) in self.position.iter_mut().zip(position) {
            column[at] = coordinate;
        }
    }

    /// Removes the particles at distinct indices. The last ones fill the gaps.
    pub fn remove(&mut self, indices: &mut [u32]) {
        indices.sort_unstable_by(|a, b| b.cmp(a));
        let with_velocity = self.has_velocity();
        for &mut at in indices {
            let at = at as usize;
            for axis in 0..3 {
                self.position[axis].swap_remove(at);
                if with_velocity {
                    self.velocity[axis].swap_remove(at);
                }
            }
            self.radius.swap_remove(at);
            self.species.swap_remove(at);
            self.id.swap_remove(at);
        }
    }

    pub(crate) fn range(&self, indices: Range<usize>) -> Self {
        let velocity = if self.has_velocity() { indices.clone() } else { 0..0 };
        Self {
            position: self.position.each_ref().map(|column| column[indices.clone()].to_vec()),
            velocity: self.velocity.each_ref().map(|column| column[velocity.clone()].to_vec()),
            radius: self.radius[indices.clone()].to_vec(),
            species: self.species[indices.clone()].to_vec(),
            id: self.id[indices].to_vec(),
        }
    }

    pub fn truncate(&mut self, count: usize) {
        for column in self.position.iter_mut().chain(&mut self.velocity).chain([&mut self.radius]) {
            column.truncate(count);
        }
        self.species.truncate(count);
        self.id.truncate(count);
    }

    /// Returns the particles with `order[k]` at index `k`.
    pub fn permuted(&self, order: &[u32]) -> Self {
        let mut permuted = Self::default();
        for &at in order {
            permuted.push(self.get(at as usize), self.has_velocity());
        }
        permuted
    }

    pub fn by_id(&self) -> Vec<u32> {
        let mut order: Vec<u32> = (0..self.len() as u32).collect();
        order.sort_unstable_by_key(|&at| self.id[at as usize]);
        order
    }

    /// Returns the particles for the detector.
    ///
    /// # Errors
    /// [`Error::Detection`] if columns differ in length.
    pub fn spheres(&self) -> Result<Spheres<'_>, Error> {
        self.first_spheres(self.len())
    }

    pub(crate) fn first_spheres(&self, count: usize) -> Result<Spheres<'_>, Error> {
        let [x, y, z] = self.position.each_ref().map(|column| &column[..count]);
        let spheres = Spheres::columns(x, y, z, &self.radius[..count]).map_err(lazygrid::Error::from)?;
        Ok(spheres.with_species(&self.species[..count]).map_err(lazygrid::Error::from)?)
    }
}

pub(crate) fn non_finite([x, y, z]: [&[f32]; 3]) -> usize {
    let lost = |((x, y), z): ((&f32, &f32), &f32)| !(x.is_finite() & y.is_finite() & z.is_finite());
    x.iter().zip(y).zip(z).map(|position| usize::from(lost(position))).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn particle(id: u32) -> Particle {
        let x = id as f32;
        Particle { position: [x, x + 1.0, -x], velocity: [1.0, x, 0.0], radius: x, species: id % 3, id }
    }

    #[test]
    fn removing_keeps_all_others_whole() {
        let mut particles = Particles::default();
        (0..10).for_each(|id| particles.push(particle(id), true));
        particles.remove(&mut [3, 9, 0, 5]);
        let mut ids = particles.id.clone();
        ids.sort_unstable();
        assert_eq!(ids, [1, 2, 4, 6, 7, 8]);
        for at in 0..particles.len() {
            assert_eq!(particles.get(at), particle(particles.id[at]));
        }
        particles.remove(&mut [0, 1, 2, 3, 4, 5]);
        assert_eq!(particles, Particles::default());
    }
}
