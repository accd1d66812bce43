use lazygrid_kernels::{InputError, Query, Space};

use crate::executor::{Chunks, Executor};

const CHUNK_SPHERES: usize = 1 << 13;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
    pub(crate) min: [f64; 4],
    pub(crate) max: [f64; 4],
    /// NaN after any non-finite number.
    pub(crate) zero: [f64; 4],
}

impl Bounds {
    pub(crate) const EMPTY: Self =
        Self { min: [f64::INFINITY; 4], max: [f64::NEG_INFINITY; 4], zero: [0.0; 4] };

    pub(crate) fn from_query(query: &Query<'_>, executor: Executor) -> Self {
        let sets = [Some(query.first()), query.second()];
        sets.into_iter().flatten().fold(Self::EMPTY, |bounds, set| {
            let count = set.len();
            let fold_chunk = |mut bounds: Self, chunk: usize| {
                let range = chunk * CHUNK_SPHERES..count.min((chunk + 1) * CHUNK_SPHERES);
                range.for_each(|k| bounds.add(set.get_f64(k)));
                Ok(bounds)
            };
            let merge = |a: Self, b: Self| Ok::<_, std::convert::Infallible>(a.merge(b));
            let chunks = Chunks::unlimited(count.div_ceil(CHUNK_SPHERES));
            let Ok(of_set) = executor.for_light_work(count).fold(chunks, || Self::EMPTY, fold_chunk, merge);
            bounds.merge(of_set)
        })
    }

    #[inline(always)]
    pub(crate) fn add(&mut self, row: [f64; 4]) {
        for (component, number) in row.into_iter().enumerate() {
            self.min[component] = if number < self.min[component] { number } else { self.min[component] };
            self.max[component] = if number > self.max[component] { number } else { self.max[component] };
            self.zero[component] += number * 0.0;
        }
    }

    pub(crate) fn merge(mut self, other: Self) -> Self {
        for component in 0..4 {
            self.min[component] = self.min[component].min(other.min[component]);
            self.max[component] = self.max[component].max(other.max[component]);
            self.zero[component] += other.zero[component];
        }
        self
    }

    pub(crate) fn are_valid(&self) -> bool {
        self.zero == [0.0; 4] && self.min[3] >= 0.0
    }

    /// Checks that the exact test cannot overflow in a triclinic cell.
    pub(crate) fn check_range(&self, space: &Space) -> Result<(), InputError> {
        let Some(cell) = space.triclinic_cell() else { return Ok(()) };
        let limit = cell.max_component();
        for ((axis, from), to) in ['x', 'y', 'z'].into_iter().zip(self.min).zip(self.max) {
            if to - from > limit {
                return Err(InputError::CoordinateRange { axis, from, to, limit });
            }
        }
        Ok(())
    }

    pub(super) fn middle(&self, axis: usize) -> f64 {
        if self.min[axis] > self.max[axis] { 0.0 } else { 0.5 * self.min[axis] + 0.5 * self.max[axis] }
    }

    pub(super) fn largest_offset(&self, axis: usize, origin: f64) -> f64 {
        (self.max[axis] - origin).max(origin - self.min[axis])
    }
}
