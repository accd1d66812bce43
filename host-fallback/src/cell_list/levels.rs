//! Choice of the size classes that share a level, and of each level's cell size.
//!
//! A search compares each sphere with neighbor cells at its own and every coarser level. Few levels mean long runs of
//! spheres too small for their cells; many mean short runs. Dynamic programming minimizes the estimated cost.

#![expect(clippy::disallowed_methods, clippy::disallowed_macros, reason = "a plan is of 256 classes at most")]

use super::density::DensityProfile;
use crate::InputStats;
use crate::input::SizeClass;
use crate::size_class::SIZE_CLASSES;

/// Estimated nanoseconds to look up a row of cells.
const ROW_NS: f32 = 14.0;
/// Estimated nanoseconds to clear and sum a table entry.
const CELL_NS: f32 = 0.7;
/// Maximum table entries per sphere of a level.
pub(crate) const CELLS_PER_SPHERE: f32 = 2.0;
/// Estimated factor on the time of rows of a folded table.
const FOLDED_ROWS: f32 = 4.0;
/// Estimated factor on the time of rows around cells at faces of a periodic box.
const BOUNDARY_ROWS: f32 = 2.0;
/// Folding pays if comparisons with the spheres in eight cells of the finest unfolded table take more. The estimate
/// suits short runs. Long runs take less, above all without minimum images.
const MIN_FOLDING_NS: f32 = 800.0;
const MIN_PERIODIC_FOLDING_NS: f32 = 200.0;
/// With fewer spheres in eight cells, smaller cells save nothing.
const MIN_FOLDED_MEAN: f32 = 16.0;
const SIZES_PER_DOUBLING: f32 = 2.0;
const MAX_CELL_SIZES: usize = 24;

/// Maximum groups of neighboring size classes in a plan.
const MAX_CLASS_GROUPS: usize = 20;
pub(super) const MAX_LEVELS: usize = MAX_CLASS_GROUPS;

/// Levels, coarsest first.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct LevelPlan {
    pub(crate) levels: Vec<Level>,
    pub(crate) of_class: [u8; SIZE_CLASSES],
    /// Estimated nanoseconds of a search.
    pub(crate) cost: f32,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Level {
    pub(crate) spheres: u32,
    pub(crate) largest: f32,
    pub(crate) cell_size: f64,
}

#[derive(Clone, Copy)]
struct LevelOption {
    cost: f32,
    log_size: f32,
    from: usize,
}

impl LevelPlan {
    pub(crate) fn plan(stats: &InputStats, density: &DensityProfile) -> Self {
        let classes: Vec<_> = stats.occupied().collect();
        // Planning is quadratic in the classes, so neighbors are merged.
        let groups: Vec<&[(usize, SizeClass)]> =
            classes.chunks(classes.len().div_ceil(MAX_CLASS_GROUPS).max(1)).collect();
        let count = |group: &&[(usize, SizeClass)]| group.iter().map(|(_, class)| class.count as f32).sum();
        let counts: Vec<f32> = groups.iter().map(count).collect();
        let radii: Vec<f32> = groups.iter().map(|group| group[0].1.largest).collect();
        let model = LevelCostModel { counts, radii, total: stats.spheres as f32, density };

        let untried = LevelOption { cost: f32::INFINITY, log_size: density.log_extent(), from: 0 };
        let mut best = vec![untried; groups.len() + 1];
        best[0].cost = 0.0;
        for from in 0..groups.len() {
            let before = best[from].cost;
            model.levels_from(from, |to, cost, log_size| {
                if before + cost < best[to].cost {
                    best[to] = LevelOption { cost: before + cost, log_size, from };
                }
            });
        }

        let cost = best[groups.len()].cost;
        let mut plan = Self { levels: Vec::new(), of_class: [0; SIZE_CLASSES], cost };
        let mut bounds = Vec::new();
        let mut to = groups.len();
        while to > 0 {
            bounds.push((best[to].from..to, best[to].log_size));
            to = best[to].from;
        }
        for (level, (range, log_size)) in bounds.into_iter().rev().enumerate() {
            let members = groups[range].concat();
            for &(class, _) in &members {
                plan.of_class[class] = level as u8;
            }
            plan.levels.push(Level {
                spheres: members.iter().map(|(_, class)| class.count).sum(),
                largest: members[0].1.largest,
                cell_size: f64::from(log_size).exp2(),
            });
        }
        plan
    }
}

struct LevelCostModel<'c> {
    counts: Vec<f32>,
    radii: Vec<f32>,
    total: f32,
    density: &'c DensityProfile,
}

impl LevelCostModel<'_> {
    /// Offers every level from class `from`: the end of its classes, its cost for them and all smaller spheres, and
    /// log₂ of its cell size.
    fn levels_from(&self, from: usize, mut offer: impl FnMut(usize, f32, f32)) {
        let ends = from + 1..=self.counts.len();
        let extent = self.density.log_extent();
        let members = |to: usize| self.counts[from..to].iter().sum::<f32>();
        let row_ns = ROW_NS * self.density.searches;
        if extent == f32::NEG_INFINITY {
            let fraction = self.density.mean(extent) / self.total.max(1.0);
            let met = |to: usize| fraction * (members(to) / 2.0 + self.counts[to..].iter().sum::<f32>());
            return ends
                .for_each(|to| offer(to, members(to) * (row_ns + self.density.compare_ns * met(to)), 0.0));
        }
        let most: Vec<f32> = ends.clone().map(|to| (members(to) * CELLS_PER_SPHERE).max(64.0)).collect();
        for (log_size, is_folded) in self.cell_sizes(from, most[most.len() - 1]) {
            let cells = (3.0 * (extent - log_size).max(0.0)).exp2();
            let row_ns = self.rows_factor(log_size, is_folded) * row_ns;
            let halves = self.halves(from, log_size, is_folded, row_ns);
            let own: f32 = self.counts[from..].iter().map(|count| count * row_ns).sum();
            let [rows, met] =
                halves.iter().fold([own, 0.0], |[rows, met], half| [rows + half[0], met + half[1]]);
            let mut rest = [0.0, 0.0];
            for to in ends.clone().rev() {
                let members = members(to);
                // Rounding must not exclude a size that just fits.
                if is_folded || cells <= 1.001 * most[to - from - 1] {
                    let table = CELL_NS * cells.min(members * CELLS_PER_SPHERE);
                    let cost = table + rows + rest[0] + members / self.total * (met + rest[1]);
                    offer(to, cost, log_size);
                }
                let half = halves[to - from - 1];
                rest = [rest[0] + half[0], rest[1] + half[1]];
            }
        }
    }

    fn cell_sizes(&self, from: usize, most: f32) -> impl Iterator<Item = (f32, bool)> {
        let (density, extent) = (self.density, self.density.log_extent());
        let finest = extent - most.log2() / 3.0;
        let radius = (self.radii[from].log2() - 1.0).min(extent);
        let lowest = finest.max(radius);
        let unfolded = (0..MAX_CELL_SIZES).map(move |k| lowest + k as f32 / SIZES_PER_DOUBLING);
        let unfolded = unfolded.take_while(move |&log_size| log_size <= extent + 1.0);
        let min_ns = if density.periodic_axes > 0 { MIN_PERIODIC_FOLDING_NS } else { MIN_FOLDING_NS };
        let are_crowded = density.compare_ns * density.mean(finest + 1.0) > min_ns;
        let folded = (1..MAX_CELL_SIZES).map(move |k| finest - k as f32 / SIZES_PER_DOUBLING);
        let is_worthwhile = |log_size: f32| density.mean(log_size + 1.0) > MIN_FOLDED_MEAN;
        let folded = folded.take_while(move |&size| are_crowded && size >= radius && is_worthwhile(size));
        unfolded.map(|size| (size, false)).chain(folded.map(|size| (size, true)))
    }

    fn rows_factor(&self, log_size: f32, is_folded: bool) -> f32 {
        let cells = (self.density.log_extent() - log_size).exp2();
        let inner = (1.0 - 2.0 / cells).max(0.0).powi(self.density.periodic_axes);
        if is_folded { FOLDED_ROWS } else { 1.0 + (BOUNDARY_ROWS - 1.0) * (1.0 - inner) }
    }

    /// Returns costs of each class: of the later half of the rows around its spheres, and of comparisons there if the
    /// level held all spheres.
    fn halves(
        &self,
        from: usize,
        log_size: f32,
        is_folded: bool,
        row_ns: f32,
    ) -> [[f32; 2]; MAX_CLASS_GROUPS] {
        let cell_size = log_size.exp2();
        let mut halves = [[0.0; 2]; MAX_CLASS_GROUPS];
        // Distant spheres share folded entries.
        let distant = if is_folded { 1.0 / CELLS_PER_SPHERE } else { 0.0 };
        let classes = self.radii.iter().zip(&self.counts).skip(from);
        for (half, (radius, count)) in halves.iter_mut().zip(classes) {
            let span = 2.0 * (radius + self.radii[from]) / cell_size;
            let rows = (1.0 + span) * (1.0 + span);
            let distant = distant * rows * (1.0 + span);
            let met = self.density.mean(log_size + (1.0 + span).log2()) + distant;
            *half = [count * row_ns * (rows - 1.0) / 2.0, count * self.density.compare_ns * met / 2.0];
        }
        halves
    }
}

#[cfg(test)]
mod tests {
    use lazygrid_kernels::Sphere;

    use super::*;
    use crate::Settings;
    use crate::compare::PairTest;
    use crate::input::SearchInput;

    fn plan(n: u32, spacing: f32, radii: &[f32]) -> LevelPlan {
        plan_for(1.0, n, spacing, radii)
    }

    fn plan_for(searches: f32, n: u32, spacing: f32, radii: &[f32]) -> LevelPlan {
        let side = f64::from(n).cbrt().ceil() as u32;
        let spheres: Vec<_> = (0..n)
            .map(|k| {
                let cell = [k % side, k / side % side, k / side / side];
                let radius = radii[(k.wrapping_mul(2_654_435_761) >> 8) as usize % radii.len()];
                Sphere::new(cell.map(|at| spacing * at as f32), radius)
            })
            .collect();
        let settings = Settings::default();
        let input = SearchInput::with_stats(PairTest::new((&spheres).into(), None), &settings);
        let mut density = DensityProfile::sample(&input).expect("there is memory");
        density.searches = searches;
        LevelPlan::plan(&input.stats, &density)
    }

    #[test]
    fn few_searches_make_small_cells() {
        let [many, few] = [1.0, 0.01].map(|searches| plan_for(searches, 100_000, 1.0, &[1.0]));
        assert!(few.levels[0].cell_size < 0.8 * many.levels[0].cell_size, "{few:?}, {many:?}");
    }

    #[test]
    fn few_searches_make_more_levels() {
        let levels = |searches| plan_for(searches, 50_000, 1.0, &[1.0, 0.5, 0.25]).levels.len();
        assert_eq!([1.0, 0.01].map(levels), [1, 2]);
    }

    #[test]
    fn searches_of_coincident_spheres_cost_their_fraction() {
        let cost = |searches| plan_for(searches, 3000, 0.0, &[1.0]).cost;
        let saved = cost(1.0) - cost(0.25);
        assert!((saved / (3000.0 * ROW_NS) - 0.75).abs() < 0.01, "{saved}");
    }

    #[test]
    fn equal_spheres_share_one_level_of_cells_about_as_wide_as_their_diameter() {
        let plan = plan(100_000, 4.0, &[1.0]);
        assert_eq!(plan.levels.len(), 1);
        assert_eq!((plan.levels[0].spheres, plan.levels[0].largest), (100_000, 1.0));
        assert!((4.0..=20.0).contains(&plan.levels[0].cell_size), "{:?}", plan.levels);
    }

    #[test]
    fn size_classes_share_a_level_only_at_low_density() {
        let sparse = plan(50_000, 4.0, &[1.0, 0.5, 0.25]);
        assert_eq!(sparse.levels.len(), 1, "{:?}", sparse.levels);
        let mut radii = [0.01; 100];
        radii[7] = 64.0;
        let crowded = plan(50_000, 1.0, &radii);
        assert_eq!(crowded.levels.len(), 2, "{:?}", crowded.levels);
        assert_eq!(crowded.of_class[InputStats::class_of(64.0)], 0);
        assert_eq!(crowded.of_class[InputStats::class_of(0.01)], 1);
    }

    #[test]
    fn every_sphere_has_a_level_for_any_sizes() {
        let radii: Vec<f32> = (0..250).map(|k| 2.0_f32.powi(k - 125)).collect();
        for (n, spacing) in [(1, 1.0), (2, 0.0), (3000, 0.0), (3000, 1e-30), (3000, 1e30)] {
            for radii in [&[0.0][..], &[1.0], &radii] {
                let plan = plan(n, spacing, radii);
                assert_eq!(plan.levels.iter().map(|level| level.spheres).sum::<u32>(), n);
                assert!(plan.levels.len() <= MAX_CLASS_GROUPS);
                for level in &plan.levels {
                    assert!(level.cell_size > 0.0 && level.cell_size.is_finite(), "{level:?}");
                }
            }
        }
    }
}
