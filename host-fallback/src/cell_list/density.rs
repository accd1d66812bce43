//! Density of spheres by cell size, estimated from a sample: bounds do not show clusters. Morton order keeps the
//! members of every octree cell adjacent, so one sort serves all cube sizes.

use glam::{DVec3, Vec3};
use lazygrid_kernels::{Space, Spheres};

use crate::compare::COMPARE_NS;
use crate::input::{CenterBounds, Grouping, MAX_GROUPS, SearchInput};
use crate::memory::try_collect;
use crate::{Error, InputStats};

/// Halvings of the bounding cube: 21 bits per axis fill a 63-bit Morton code.
const DEPTHS: usize = 21;
/// Fewer coincidences (pairs of sampled spheres in one cube) at a depth may be chance.
const MIN_COINCIDENCES: u64 = 24;
/// Estimated nanoseconds of an exact test, with random access.
pub(super) const EXACT_TEST_NS: f32 = 60.0;
const MAX_SEPARATE: usize = 2 * (MAX_GROUPS + 1);

/// Mean number of spheres around a sphere by cube size, as a log-log polyline.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct DensityProfile {
    /// log₂ of the size of the bounding cube.
    top: f32,
    /// log₂ of the longest axis of the grid.
    log_extent: f32,
    pub(super) periodic_axes: i32,
    /// log₂ of the mean at size `2^(top - depth)`, per resolved depth.
    log_mean: Vec<f32>,
    /// Decrease of log₂ of the mean per halving below these depths.
    slope: f32,
    /// Searches relative to a search without groups.
    pub(crate) searches: f32,
    pub(crate) compare_ns: f32,
}

impl DensityProfile {
    #[cfg(test)]
    pub(crate) fn sample(input: &SearchInput<'_>) -> Result<Self, Error> {
        Ok(Sample::take(input)?.density(None))
    }

    pub(crate) fn from_centers(spheres: Spheres<'_>, space: Space) -> Result<Self, Error> {
        let n = spheres.len();
        let size = sample_size(n);
        let center = |k| space.wrap(spheres.get(sample_index(k, size, n)).center);
        let centers = try_collect((0..size).map(center), "a sample of the spheres")?;
        let mut bounds = CenterBounds::EMPTY;
        centers.iter().for_each(|center| bounds.add(*center));
        let centers = centers.into_iter().map(|center| (center, 0));
        Ok(Sample::new(bounds, centers, n)?.density(None))
    }

    /// With a grouping, only coincidences of groups that pair count.
    #[expect(clippy::disallowed_macros, clippy::disallowed_methods, reason = "there are 22 depths")]
    pub(super) fn from_codes(
        codes: &[(u64, u32)],
        n: usize,
        cube_size: f64,
        grouping: Option<&Grouping<'_>>,
    ) -> Self {
        let (n, size) = (n as f32, codes.len() as f32);
        let pairs = size * (size - 1.0) / 2.0;
        let mut log_mean = vec![n.max(1.0).log2()];
        for depth in 1..=DEPTHS {
            let shared = coincidences(codes, depth);
            if shared < MIN_COINCIDENCES {
                break;
            }
            log_mean.push((n * shared as f32 / pairs).log2());
        }
        if let Some(grouping) = grouping {
            // With too few pairs, the fraction of enclosing cubes is an upper estimate.
            let mut fraction = 1.0;
            for (depth, log_mean) in log_mean.iter_mut().enumerate() {
                let [met, all] = compared_pairs(codes, depth, grouping);
                if met >= MIN_COINCIDENCES || depth == 0 {
                    fraction = (met.max(1) as f32 / all.max(1) as f32).min(1.0);
                }
                *log_mean += fraction.log2();
            }
        }
        let falls = match log_mean[..] {
            [.., a, b] if log_mean.len() > 2 => a - b,
            _ => 3.0,
        };
        let top = if cube_size > 0.0 { cube_size.log2() as f32 } else { f32::NEG_INFINITY };
        let slope = falls.clamp(0.0, 3.0);
        let (log_extent, searches, compare_ns) = (top, 1.0, COMPARE_NS);
        Self { top, log_extent, periodic_axes: 0, log_mean, slope, searches, compare_ns }
    }

    pub(crate) fn log_extent(&self) -> f32 {
        self.log_extent
    }

    pub(super) fn for_group(self, periodic_axes: i32, compares: bool) -> Self {
        let compare_ns = if compares { EXACT_TEST_NS } else { COMPARE_NS };
        Self { periodic_axes, compare_ns, ..self }
    }

    pub(super) fn within(self, extent: f32) -> Self {
        let top = if extent > 0.0 { self.top } else { f32::NEG_INFINITY };
        Self { top, log_extent: extent.log2(), ..self }
    }

    pub(super) fn contacts(&self, stats: &InputStats) -> f32 {
        // Side of a cube with the volume of a ball of radius `2 * radius`.
        let around = |radius: f32| if radius > 0.0 { self.mean((3.2 * radius).log2()) } else { 0.0 };
        stats.occupied().map(|(_, class)| class.count as f32 * around(class.largest)).sum::<f32>() / 2.0
    }

    /// Returns the mean number of spheres in a cube of size 2^`log_size` around a sphere, itself included.
    pub(crate) fn mean(&self, log_size: f32) -> f32 {
        let (depth, last) = ((self.top - log_size).max(0.0), self.log_mean.len() - 1);
        let log_mean = if depth >= last as f32 {
            self.log_mean[last] - self.slope * (depth - last as f32)
        } else {
            let (k, fraction) = (depth as usize, depth.fract());
            self.log_mean[k] + fraction * (self.log_mean[k + 1] - self.log_mean[k])
        };
        log_mean.exp2()
    }
}

pub(super) struct Sample {
    pub(super) codes: Vec<(u64, u32)>,
    pub(super) spheres: usize,
    pub(super) cube_size: f64,
    extent: f32,
    pub(super) periodic_axes: i32,
}

impl Sample {
    pub(super) fn take(input: &SearchInput<'_>) -> Result<Self, Error> {
        let (n, bounds) = (input.stats.spheres, input.stats.bounds());
        let (spheres, size) = (input.test.spheres(), sample_size(n));
        let indices = (0..size).map(|k| sample_index(k, size, n));
        let centers = indices.map(|index| (spheres.get(index).center, index as u32));
        let periodic_axes = input.test.lengths().iter().flatten().count() as i32;
        Ok(Self { extent: input.extent(bounds), periodic_axes, ..Self::new(bounds, centers, n)? })
    }

    fn new(
        bounds: CenterBounds,
        centers: impl ExactSizeIterator<Item = (Vec3, u32)>,
        n: usize,
    ) -> Result<Self, Error> {
        let origin = bounds.min.as_dvec3();
        let cube_size = (bounds.max.as_dvec3() - origin).max_element();
        let scale = if cube_size > 0.0 { f64::from(1 << DEPTHS) / cube_size } else { 0.0 };
        let codes = centers.map(|(center, index)| (morton((center.as_dvec3() - origin) * scale), index));
        let mut codes = try_collect(codes, "a sample of the spheres")?;
        codes.sort_unstable();
        Ok(Self { codes, spheres: n, cube_size, extent: cube_size as f32, periodic_axes: 0 })
    }

    pub(super) fn density(&self, grouping: Option<&Grouping<'_>>) -> DensityProfile {
        let density = DensityProfile::from_codes(&self.codes, self.spheres, self.cube_size, grouping);
        let searches = grouping.map_or(1.0, |grouping| self.searches(grouping));
        let (log_extent, periodic_axes) = (self.extent.log2(), self.periodic_axes);
        DensityProfile { log_extent, periodic_axes, searches, ..density }
    }

    fn searches(&self, grouping: &Grouping<'_>) -> f32 {
        let mut members = [0.0_f32; MAX_SEPARATE];
        for (_, index) in &self.codes {
            members[grouping.group_of(*index as usize)] += 1.0;
        }
        let searches =
            |(a, b): (usize, usize)| if a == b { members[a] / 2.0 } else { members[a].min(members[b]) };
        let apart: f32 = grouping.paired_groups().map(searches).sum();
        2.0 * apart / self.codes.len().max(1) as f32
    }
}

/// With one sphere per cell on average, a sample has about 18 coincidences.
fn sample_size(n: usize) -> usize {
    n.min((6.0 * (n as f64).sqrt()) as usize).clamp(n.min(64), 1 << 16)
}

fn sample_index(k: usize, size: usize, n: usize) -> usize {
    let (from, to) = (k * n / size, (k + 1) * n / size);
    let mixed = (k as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 32;
    from + ((mixed * (to - from) as u64) >> 32) as usize
}

fn morton(at: DVec3) -> u64 {
    let spread = |v: f64| {
        let mut v = (v as u64).min((1 << DEPTHS) - 1);
        v = (v | v << 32) & 0x1F_0000_0000_FFFF;
        v = (v | v << 16) & 0x1F_0000_FF00_00FF;
        v = (v | v << 8) & 0x100F_00F0_0F00_F00F;
        v = (v | v << 4) & 0x10C3_0C30_C30C_30C3;
        (v | v << 2) & 0x1249_2492_4924_9249
    };
    spread(at.x) | (spread(at.y) << 1) | (spread(at.z) << 2)
}

fn cells(codes: &[(u64, u32)], depth: usize) -> impl Iterator<Item = &[(u64, u32)]> {
    let shift = 3 * (DEPTHS - depth);
    codes.chunk_by(move |(a, _), (b, _)| a >> shift == b >> shift)
}

fn coincidences(codes: &[(u64, u32)], depth: usize) -> u64 {
    cells(codes, depth).map(|run| run.len() as u64 * (run.len() as u64 - 1) / 2).sum()
}

fn compared_pairs(codes: &[(u64, u32)], depth: usize, grouping: &Grouping<'_>) -> [u64; 2] {
    cells(codes, depth).fold([0, 0], |[met, all], run| {
        let mut members = [0_u64; MAX_SEPARATE];
        run.iter().for_each(|(_, index)| members[grouping.group_of(*index as usize)] += 1);
        let pairs = |(a, b): (usize, usize)| match a == b {
            true => members[a] * members[a].saturating_sub(1) / 2,
            false => members[a] * members[b],
        };
        let (own, count) = (grouping.paired_groups().map(pairs).sum::<u64>(), run.len() as u64);
        [met + own, all + count * (count - 1) / 2]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn full_lattice_has_its_density_at_every_size() {
        let codes: Vec<_> = (0..1 << 12).map(|k| (k << 51, k as u32)).collect();
        let density = DensityProfile::from_codes(&codes, 1 << 20, 16.0, None);
        for (log_size, expected) in [(4.0, 20.0), (3.0, 17.0), (2.0, 14.0), (1.5, 12.5), (-2.0, 2.0)] {
            let mean = density.mean(log_size).log2();
            assert!((mean - expected).abs() < 0.6, "size 2^{log_size}: 2^{mean}, not 2^{expected}");
        }
    }

    #[test]
    fn coincident_spheres_are_dense_at_every_size() {
        let density = DensityProfile::from_codes(&[(7, 0); 100], 1000, 0.0, None);
        assert!(density.mean(-100.0) > 990.0);
        assert!(density.mean(10.0) > 990.0);
    }

    #[test]
    fn samples_are_distinct_and_inside() {
        for n in [1, 2, 63, 64, 65, 1000, 123_457] {
            let size = sample_size(n);
            let picked: Vec<_> = (0..size).map(|k| sample_index(k, size, n)).collect();
            assert!(picked.windows(2).all(|w| w[0] < w[1]) && picked.iter().all(|&i| i < n), "n = {n}");
        }
    }
}
