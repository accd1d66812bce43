//! Trimmed frames, for a few spheres far away from all others.

use lazygrid_kernels::Space;

use super::{Bounds, GROWTH, SearchFrame, scale_of};
use crate::executor::{Chunks, Executor};

const CHUNK_SPHERES: usize = 1 << 13;
/// Spheres, evenly spaced by index, whose medians are taken.
const SAMPLE: usize = 255;
/// Maximum spheres of the sample outside the frame.
const SAMPLE_OUTSIDE: usize = SAMPLE / 16;
/// Binary exponents of `f64`.
const EXPONENTS: usize = 2048;
/// A frame is trimmed only if it gets smaller by this factor: contacts in a trimmed frame are never certain.
const MIN_GAIN: f64 = 16.0;
/// Growth of radii as a fraction of the median radius: above the first, a frame is trimmed; the second is acceptable.
const RELATIVE_GROWTH: [f64; 2] = [1.0 / 4.0, 1.0 / 32.0];

/// The second set follows the first.
pub(crate) struct RowsByIndex<'r> {
    pub(crate) count: usize,
    pub(crate) bounds: &'r Bounds,
    pub(crate) get: &'r (dyn Fn(usize) -> [f64; 4] + Sync),
}

impl RowsByIndex<'_> {
    /// Limits the pairs of outside spheres to eight per input sphere.
    fn most_outside(&self) -> usize {
        (4 * self.count.isqrt()).min(self.count / 8)
    }

    fn sample(&self) -> [[f64; 4]; SAMPLE] {
        std::array::from_fn(|k| (self.get)((k as u128 * self.count as u128 / SAMPLE as u128) as usize))
    }
}

impl SearchFrame {
    pub(crate) fn is_trimmed(&self) -> bool {
        self.is_trimmed
    }

    /// Returns a trimmed frame if a few far spheres make this frame of all `rows` enlarge radii too much. Keeps the `last`
    /// one if it serves. Independent of threads.
    pub(crate) fn trimmed(
        &self,
        space: &Space,
        rows: &RowsByIndex<'_>,
        last: Option<&Self>,
        executor: Executor,
    ) -> Option<Self> {
        let is_free = Self::periodic_axes(space).map(|is_periodic| !is_periodic);
        if !self.is_orthogonal() || is_free == [false; 3] || rows.most_outside() == 0 {
            return None;
        }
        let mut sample = rows.sample();
        let radius = median(&mut sample, 3);
        let growth = GROWTH[1] / self.scale;
        if growth <= RELATIVE_GROWTH[0] * radius {
            return None;
        }
        let mut origin = self.origin;
        for axis in (0..3).filter(|&axis| is_free[axis]) {
            origin[axis] = median(&mut sample, axis);
        }
        let last = last.filter(|last| last.is_trimmed && last.is_near(&origin));
        let axes = FreeAxes { origin: last.map_or(origin, |last| last.origin), is_free };
        let most = self.scale.recip() / MIN_GAIN;
        if sample.iter().filter(|row| axes.offset(row) > most).count() > SAMPLE_OUTSIDE {
            return None;
        }
        let size = axes.size_of_most(rows, executor).max(radius * (RELATIVE_GROWTH[1] / GROWTH[1]));
        let size = size.max(Self::size(&axes.cut(rows.bounds), space, &axes.origin));
        if size > most {
            return None;
        }
        let trimmed = Self { is_trimmed: true, ..Self::at(axes.origin, scale_of(size), space) };
        let reused = last.filter(|last| last.scale <= trimmed.scale && trimmed.scale <= 4.0 * last.scale);
        Some(reused.cloned().unwrap_or(trimmed))
    }

    fn is_near(&self, origin: &[f64; 3]) -> bool {
        (0..3).all(|axis| (origin[axis] - self.origin[axis]).abs() * self.scale < 0.25)
    }

    /// The extent along unbounded axes does not matter in a trimmed frame.
    pub(super) fn without_free_axes(&self, bounds: &Bounds, space: &Space) -> Bounds {
        let is_free = Self::periodic_axes(space).map(|is_periodic| !is_periodic);
        FreeAxes { origin: self.origin, is_free }.cut(bounds)
    }
}

struct FreeAxes {
    origin: [f64; 3],
    is_free: [bool; 3],
}

impl FreeAxes {
    fn offset(&self, row: &[f64; 4]) -> f64 {
        let along =
            |axis: usize| if self.is_free[axis] { (row[axis] - self.origin[axis]).abs() } else { 0.0 };
        along(0).max(along(1)).max(along(2))
    }

    fn size_of_most(&self, rows: &RowsByIndex<'_>, executor: Executor) -> f64 {
        let farthest = (0..3).filter(|&axis| self.is_free[axis]);
        let farthest =
            farthest.map(|axis| rows.bounds.largest_offset(axis, self.origin[axis])).fold(0.0, f64::max);
        let levels = self.count_levels(rows, exponent(farthest), executor);
        let (mut outside, mut level) = (0, 0);
        while level < EXPONENTS && outside + levels[level] as usize <= rows.most_outside() {
            outside += levels[level] as usize;
            level += 1;
        }
        let below = exponent(farthest).saturating_sub(level as u64) + 1;
        f64::from_bits(below.min(2046) << 52)
    }

    /// Level 0 has the exponent `largest`.
    fn count_levels(&self, rows: &RowsByIndex<'_>, largest: u64, executor: Executor) -> [u32; EXPONENTS] {
        let fold_chunk = |mut levels: [u32; EXPONENTS], chunk: usize| {
            for k in chunk * CHUNK_SPHERES..rows.count.min((chunk + 1) * CHUNK_SPHERES) {
                let level = largest.saturating_sub(exponent(self.offset(&(rows.get)(k))));
                levels[level as usize] += 1;
            }
            Ok(levels)
        };
        let merge = |mut a: [u32; EXPONENTS], b: [u32; EXPONENTS]| {
            a.iter_mut().zip(b).for_each(|(sum, count)| *sum += count);
            Ok::<_, std::convert::Infallible>(a)
        };
        let chunks = Chunks::unlimited(rows.count.div_ceil(CHUNK_SPHERES));
        let Ok(levels) =
            executor.for_light_work(rows.count).fold(chunks, || [0; EXPONENTS], fold_chunk, merge);
        levels
    }

    fn cut(&self, bounds: &Bounds) -> Bounds {
        let mut bounds = *bounds;
        for axis in (0..3).filter(|&axis| self.is_free[axis]) {
            (bounds.min[axis], bounds.max[axis]) = (self.origin[axis], self.origin[axis]);
        }
        bounds
    }
}

fn median(sample: &mut [[f64; 4]; SAMPLE], component: usize) -> f64 {
    sample.select_nth_unstable_by(SAMPLE / 2, |a, b| a[component].total_cmp(&b[component])).1[component]
}

fn exponent(distance: f64) -> u64 {
    distance.to_bits() >> 52
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::Random;

    const RADIUS: f64 = 1e-3;

    fn cloud(count: usize) -> Vec<[f64; 4]> {
        let mut random = Random(23);
        (0..count)
            .map(|_| {
                let [x, y, z] = random.point(0.5).map(f64::from);
                [x + 7.0, y, z, RADIUS]
            })
            .collect()
    }

    fn frame(rows: &[[f64; 4]], space: &Space, last: Option<&SearchFrame>) -> SearchFrame {
        let mut bounds = Bounds::EMPTY;
        rows.iter().for_each(|&row| bounds.add(row));
        let frame = SearchFrame::new(&bounds, space);
        let rows = RowsByIndex { count: rows.len(), bounds: &bounds, get: &|k| rows[k] };
        frame.trimmed(space, &rows, last, Executor::Pool).unwrap_or(frame)
    }

    fn spaces() -> [Space; 2] {
        [Space::UNBOUNDED, Space::periodic([None, Some(1.1), None]).expect("a length")]
    }

    #[test]
    fn far_spheres_hardly_enlarge_radii() {
        for space in spaces() {
            for far in [1e6, 1e9, -1e30, 1e300, f64::MIN] {
                let mut rows = cloud(3000);
                rows[1234] = [far, 0.1, far, RADIUS];
                rows[77] = [0.0, -0.2, f64::MAX, 3.0];
                let frame = frame(&rows, &space, None);
                let searched = frame.sphere(rows[0]).radius;
                assert!(
                    f64::from(searched) < 1.1 * RADIUS * frame.scale(),
                    "{space:?}, {far:e}: {searched:e}"
                );
                let clamped = frame.sphere(rows[1234]).center.to_array();
                assert!(clamped.iter().all(|at| at.abs() <= 1.0), "{clamped:?}");
                assert!(!frame.has_certain_contacts());
            }
        }
    }

    #[test]
    fn ordinary_scenes_keep_the_frame_of_their_bounds() {
        for space in spaces() {
            let mut scenes = [(); 5].map(|()| cloud(3000));
            scenes[1][5][0] = 1e3;
            scenes[2].iter_mut().step_by(2).for_each(|row| row[2] += 1e9);
            scenes[3].iter_mut().for_each(|row| row[3] = 0.0);
            scenes[4].iter_mut().for_each(|row| *row = row.map(|number| number * 1e-300));
            for (k, rows) in scenes.iter().enumerate() {
                assert!(!frame(rows, &space, None).is_trimmed(), "{space:?}, scene {k}");
            }
        }
    }

    #[test]
    fn clamping_moves_no_spheres_apart() {
        let mut random = Random(29);
        for space in spaces() {
            let mut rows = cloud(3000);
            for (k, row) in rows.iter_mut().take(150).enumerate() {
                let away = 10.0_f64.powi(2 * k as i32);
                *row = [7.0 + away, 0.3, f64::from(random.unit()) * away, RADIUS];
            }
            let frame = frame(&rows, &space, None);
            assert!(frame.is_trimmed());
            for i in 0..200 {
                for j in (i + 1)..200 {
                    let [a, b] = [i, j].map(|k| frame.sphere(rows[k]).center);
                    let apart = frame.space().distance_squared(a, b).sqrt();
                    let image = space.minimum_image(
                        [rows[i][0], rows[i][1], rows[i][2]],
                        [rows[j][0], rows[j][1], rows[j][2]],
                    );
                    assert!(apart <= image.length() * frame.scale() + 2.0 * GROWTH[1], "{i}, {j}: {apart:e}");
                }
            }
        }
    }

    #[test]
    fn trimmed_frames_are_kept_while_they_serve() {
        for space in spaces() {
            let mut rows = cloud(3000);
            rows[9][2] = 1e9;
            let first = frame(&rows, &space, None);
            rows.iter_mut().for_each(|row| row[0] += 0.01);
            assert!(first.is_trimmed() && frame(&rows, &space, Some(&first)) == first);
            rows.iter_mut().for_each(|row| row[0] += 1e5);
            assert_ne!(frame(&rows, &space, Some(&first)), first);
            rows[9][2] = 0.1;
            assert!(!frame(&rows, &space, Some(&first)).is_trimmed());
        }
    }
}
