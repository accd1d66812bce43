//! The plan of a cell list: which sizes share a level, and how large its cells are. No data is touched here.
//!
//! Every sphere lies in the one cell of its centre, at the level of its size. A search looks around each sphere at
//! its own level and at every coarser one. Few levels mean long runs of spheres too small for their cells; many
//! mean that each sphere looks up many short runs. What is cheapest depends on how crowded the space is, so levels
//! are chosen by dynamic programming over a cost estimate. The paper's τ decides the same for each cell by itself.

use super::crowding::Crowding;
use crate::Survey;
use crate::survey::CLASSES;

/// Estimated time to look up one row of cells and start comparing, in nanoseconds.
const ROW: f32 = 8.0;
/// Estimated time to compare with one sphere of a long run, in nanoseconds.
const COMPARE: f32 = 0.2;
/// Estimated time per table entry, which must be cleared and summed, in nanoseconds.
const CELL: f32 = 0.7;
/// Table entries per sphere at most.
pub(crate) const CELLS_PER_SPHERE: f32 = 2.0;
/// Candidate edges per doubling.
const STEPS: f32 = 2.0;
/// Candidate edges per level at most.
const EDGES: usize = 24;

/// The levels of one cell list, coarsest first.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Levels {
    pub(crate) levels: Vec<Level>,
    /// The level of each size class.
    pub(crate) of_class: [u8; CLASSES],
}

/// One level: spheres of neighbouring size classes.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Level {
    pub(crate) spheres: u32,
    /// Their largest effective radius.
    pub(crate) largest: f32,
    /// Edge of a cell.
    pub(crate) edge: f64,
}

/// A run of neighbouring classes, and what it costs as one level.
#[derive(Clone, Copy)]
struct Candidate {
    cost: f32,
    log_edge: f32,
    /// Number of classes before this level; the best plan for those precedes it.
    from: usize,
}

impl Levels {
    /// The cheapest levels for the sizes in `survey` at this crowding.
    pub(crate) fn plan(survey: &Survey, crowding: &Crowding) -> Self {
        let classes: Vec<_> = survey.occupied().collect();
        let counts: Vec<f32> = classes.iter().map(|(_, class)| class.count as f32).collect();
        let radii: Vec<f32> = classes.iter().map(|(_, class)| class.largest).collect();
        let model = Model { counts, radii, total: survey.spheres as f32, crowding };

        let mut best: Vec<Candidate> = vec![Candidate { cost: 0.0, log_edge: 0.0, from: 0 }];
        for to in 1..=classes.len() {
            let candidates = (0..to).map(|from| {
                let (cost, log_edge) = model.level(from, to);
                Candidate { cost: best[from].cost + cost, log_edge, from }
            });
            let cheapest = candidates.min_by(|a, b| a.cost.total_cmp(&b.cost));
            best.extend(cheapest);
        }

        let mut plan = Self { levels: Vec::new(), of_class: [0; CLASSES] };
        let mut bounds = Vec::new();
        let mut to = classes.len();
        while to > 0 {
            bounds.push((best[to].from..to, best[to].log_edge));
            to = best[to].from;
        }
        for (level, (range, log_edge)) in bounds.into_iter().rev().enumerate() {
            for &(class, _) in &classes[range.clone()] {
                plan.of_class[class] = level as u8;
            }
            plan.levels.push(Level {
                spheres: classes[range.clone()].iter().map(|(_, class)| class.count).sum(),
                largest: classes[range.start].1.largest,
                edge: f64::from(log_edge).exp2(),
            });
        }
        plan
    }
}

/// The cost estimate.
struct Model<'c> {
    /// Spheres and largest radius of each occupied class, the largest class first.
    counts: Vec<f32>,
    radii: Vec<f32>,
    total: f32,
    crowding: &'c Crowding,
}

impl Model<'_> {
    /// Least cost of one level of the classes `from..to`, with its edge as log₂.
    fn level(&self, from: usize, to: usize) -> (f32, f32) {
        let members: f32 = self.counts[from..to].iter().sum();
        let most_cells = (members * CELLS_PER_SPHERE).max(64.0);
        let extent = self.crowding.log_extent();
        if extent == f32::NEG_INFINITY {
            return (members, 0.0);
        }
        // From cells of the table's full size to one cell for all; those far below the reach are not worth a look.
        let finest = extent - most_cells.log2() / 3.0;
        let lowest = finest.max(self.radii[from].log2() - 1.0).min(extent);
        (0..EDGES)
            .map(|k| lowest + k as f32 / STEPS)
            .take_while(|&log_edge| log_edge <= extent + 1.0)
            .map(|log_edge| (self.cost(from..to, members, log_edge), log_edge))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .unwrap_or((f32::INFINITY, extent))
    }

    /// Cost of searching a level of cells of this edge, from its own spheres and from all smaller ones.
    fn cost(&self, classes: std::ops::Range<usize>, members: f32, log_edge: f32) -> f32 {
        let (largest, share) = (self.radii[classes.start], members / self.total);
        let edge = log_edge.exp2();
        let cells = (self.crowding.log_extent() - log_edge).max(0.0) * 3.0;
        let mut cost = cells.exp2().min(members * CELLS_PER_SPHERE) * CELL;
        for class in classes.start..self.radii.len() {
            let reach = 2.0 * (self.radii[class] + largest) / edge;
            let rows = (1.0 + reach) * (1.0 + reach);
            let met = share * self.crowding.mean(log_edge + (1.0 + reach).log2());
            // At their own level spheres look at later ones only.
            let each = match classes.contains(&class) {
                true => ROW * (1.0 + (rows - 1.0) / 2.0) + COMPARE * met / 2.0,
                false => ROW * rows + COMPARE * met,
            };
            cost += self.counts[class] * each;
        }
        cost
    }
}
