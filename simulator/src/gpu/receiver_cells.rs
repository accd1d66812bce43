//! Lists of the receivers that a particle may hit, by cell.
//!
//! The host searches cells, inflated by a particle's displacement in a step, and receivers, inflated by theirs while
//! the lists are valid. Lists keep the order of receivers, so results equal those of a loop over all, which serves
//! longer displacements and species without lists.

use glam::{UVec3, Vec3};
use lazygrid::Sphere;

use super::layout::{EventRow, NOTHING, ReceiverCellsHeader, SpeciesRow};
use crate::model::receiver::{finder, rounding};
use crate::{Axis, Boundary, Error};

/// A loop over fewer receivers is faster than a list.
pub(super) const MIN_LISTED_RECEIVERS: u32 = 4;
/// Cells, as a multiple of a species' listed receivers, and their limit.
const CELL_LIMITS: [usize; 2] = [8, 1 << 16];
/// Capacity for entries, as a multiple of listed receivers.
const ENTRIES_PER_RECEIVER: usize = 24;
/// Particle steps per receiver from which lists pay off.
const MIN_STEPS_PER_RECEIVER: u64 = 64;

#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct ReceiverCells {
    pub(super) head: ReceiverCellsHeader,
    /// Indexed by species: the beginning of each cell's list and the end of the last, then the lists.
    pub(super) words: Vec<u32>,
}

#[derive(Clone, Debug)]
pub(super) struct ReceiverCellsBuilder {
    species_rows: Vec<SpeciesRow>,
    event_rows: Vec<EventRow>,
    boundary: Boundary,
    /// Decreases if lists exceed their capacity.
    max_cells: usize,
}

impl ReceiverCellsBuilder {
    pub(super) fn new(species_rows: &[SpeciesRow], event_rows: &[EventRow], boundary: Boundary) -> Self {
        let species_rows: Vec<SpeciesRow> =
            species_rows.iter().filter(|kind| kind.cell_lists != NOTHING).copied().collect();
        let max_receivers =
            species_rows.iter().map(|kind| kind.decays_begin - kind.events_begin).max().unwrap_or(0);
        let max_cells = (CELL_LIMITS[0] * max_receivers as usize).min(CELL_LIMITS[1]);
        Self { species_rows, event_rows: event_rows.to_vec(), boundary, max_cells }
    }

    pub(super) fn max_words(&self) -> usize {
        self.species_rows.len() * (2 * self.max_cells + 1) + ENTRIES_PER_RECEIVER * self.receivers()
    }

    pub(super) fn is_worthwhile(&self, steps: u64) -> bool {
        !self.species_rows.is_empty() && steps >= MIN_STEPS_PER_RECEIVER * self.receivers() as u64
    }

    fn events_of(&self, kind: &SpeciesRow) -> &[EventRow] {
        &self.event_rows[kind.events_begin as usize..kind.decays_begin as usize]
    }

    fn receivers(&self) -> usize {
        self.species_rows.iter().map(|kind| self.events_of(kind).len()).sum()
    }

    /// Builds lists for receivers that stay within `displacements` of `centers` and move by at most `max_displacement`
    /// in a step. Returns none if numbers are too large for cells.
    pub(super) fn build(
        &mut self,
        centers: &[[f32; 3]],
        displacements: &[f32],
        max_displacement: f32,
    ) -> Result<ReceiverCells, Error> {
        if self.species_rows.is_empty() {
            return Ok(ReceiverCells::default());
        }
        let sphere = |event: &EventRow| {
            let at = event.receiver as usize;
            Sphere::new(centers[at], event.radius + displacements.get(at).copied().unwrap_or(0.0))
        };
        let receivers: Vec<Vec<Sphere>> =
            self.species_rows.iter().map(|kind| self.events_of(kind).iter().map(sphere).collect()).collect();
        let cell_search_distance = |kind: &SpeciesRow| kind.search_distance + 3.0 * max_displacement;
        let widest = self.species_rows.iter().map(cell_search_distance).fold(0.0, f32::max);
        loop {
            let cells = Cells::new(receivers.iter().flatten(), widest, &self.boundary, self.max_cells);
            if !cells.are_finite(widest) {
                return Ok(ReceiverCells::default());
            }
            let around =
                |kind| (0..cells.count()).map(|at| cells.sphere(at, cell_search_distance(kind))).collect();
            let around: Vec<Vec<Sphere>> = self.species_rows.iter().map(around).collect();
            if let Some(words) = self.words(&around, &receivers)? {
                return Ok(ReceiverCells { head: cells.head(), words });
            }
            self.max_cells /= 2;
        }
    }

    fn words(&self, around: &[Vec<Sphere>], receivers: &[Vec<Sphere>]) -> Result<Option<Vec<u32>>, Error> {
        let mut detector = finder(&self.boundary)?;
        let cells = around[0].len();
        let mut words = vec![0; self.species_rows.len() * (cells + 1)];
        let max_words = words.len() + ENTRIES_PER_RECEIVER * self.receivers();
        for (k, (kind, sets)) in self.species_rows.iter().zip(around.iter().zip(receivers)).enumerate() {
            let found = detector.count(sets)?;
            if words.len() as u64 + found > max_words as u64 {
                return Ok(None);
            }
            let near = detector.neighbors(sets)?;
            for at in 0..cells {
                words[k * (cells + 1) + at] = words.len() as u32;
                words.extend(near.neighbors_of(at).iter().map(|&receiver| kind.events_begin + receiver));
            }
            words[k * (cells + 1) + cells] = words.len() as u32;
        }
        Ok(Some(words))
    }
}

struct Cells {
    low: [f64; 3],
    length: [f64; 3],
    cells: [u32; 3],
}

/// In µm. A smaller box would make flushed-to-zero values matter.
const MIN_BOX: f64 = 1e-20;
const ROUNDING: f64 = 1e-6;

impl Cells {
    fn new<'a>(
        receivers: impl Iterator<Item = &'a Sphere>,
        cell_search_distance: f32,
        boundary: &Boundary,
        max_cells: usize,
    ) -> Self {
        let (mut low, mut high) = ([f64::MAX; 3], [f64::MIN; 3]);
        for Sphere { center, radius } in receivers {
            let center = center.to_array();
            let beyond = radius + cell_search_distance;
            let beyond = f64::from(beyond + rounding(center, beyond));
            for k in 0..3 {
                low[k] = low[k].min(f64::from(center[k]) - beyond);
                high[k] = high[k].max(f64::from(center[k]) + beyond);
            }
        }
        for (k, axis) in boundary.axes.into_iter().enumerate() {
            if let Axis::Periodic { low: from, high: to } = axis {
                [low[k], high[k]] = [f64::from(from), f64::from(to)];
            } else {
                let more = ROUNDING * (high[k] - low[k] + low[k].abs() + high[k].abs()) + MIN_BOX;
                [low[k], high[k]] = [low[k] - more, high[k] + more];
            }
        }
        let length: [f64; 3] = std::array::from_fn(|k| high[k] - low[k]);
        // Narrower cells would hardly shorten the lists.
        let min_cell_size = 0.5 * f64::from(cell_search_distance);
        let mut cell_size =
            (length.iter().product::<f64>() / max_cells.max(1) as f64).cbrt().max(min_cell_size);
        loop {
            let cells = length.map(|length| (length / cell_size).ceil().max(1.0));
            if cells.iter().product::<f64>() <= 2.0 * max_cells as f64 {
                break Self { low, length, cells: cells.map(|count| count as u32) };
            }
            if max_cells <= 1 {
                break Self { low, length, cells: [1; 3] };
            }
            cell_size *= 1.25;
        }
    }

    fn count(&self) -> usize {
        self.cells.iter().map(|&count| count as usize).product()
    }

    fn are_finite(&self, cell_search_distance: f32) -> bool {
        let ReceiverCellsHeader { low, cells_per_length, .. } = self.head();
        let last = self.sphere(self.count() - 1, cell_search_distance);
        low.is_finite()
            && cells_per_length.is_finite()
            && last.center.is_finite()
            && (2.0 * last.radius).is_finite()
    }

    fn sphere(&self, at: usize, cell_search_distance: f32) -> Sphere {
        let [x, y, _] = self.cells.map(|count| count as usize);
        let cell = [at % x, at / x % y, at / x / y];
        let cell_size: [f64; 3] = std::array::from_fn(|k| self.length[k] / f64::from(self.cells[k]));
        let center: [f32; 3] =
            std::array::from_fn(|k| (self.low[k] + (cell[k] as f64 + 0.5) * cell_size[k]) as f32);
        let half = 0.5 * cell_size.iter().map(|cell_size| cell_size * cell_size).sum::<f64>().sqrt();
        let off: f64 = (0..3).map(|k| ROUNDING * (self.low[k].abs() + self.length[k])).sum();
        let radius = cell_search_distance + (half + off) as f32;
        Sphere::new(center, radius + rounding(center, radius))
    }

    fn head(&self) -> ReceiverCellsHeader {
        let vector =
            |value: &dyn Fn(usize) -> f64| Vec3::from_array(std::array::from_fn(|k| value(k) as f32));
        ReceiverCellsHeader {
            low: vector(&|k| self.low[k]),
            cells_per_length: vector(&|k| f64::from(self.cells[k]) / self.length[k]),
            counts: UVec3::from_array(self.cells),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::receiver::signed_distance;
    use crate::random::philox::{open_unit, philox};

    const MANY: u32 = 40;

    fn point(k: u32, scale: f32) -> [f32; 3] {
        let [x, y, z, _] = philox([k, 0, 0, 0], [9, 9]).map(|word| scale * (open_unit(word) - 0.5));
        [x, y, z]
    }

    /// Returns the list of a point, as `receiver_cells.wgsl` finds it; `None` means all receivers.
    fn list_of(
        receiver_cells: &ReceiverCells,
        kind: &SpeciesRow,
        boundary: &Boundary,
        point: [f32; 3],
    ) -> Option<Vec<u32>> {
        let ReceiverCellsHeader { low, cells_per_length, counts: cells } = receiver_cells.head;
        let at = ((Vec3::from_array(point) - low) * cells_per_length).floor().to_array();
        let is_within = |k: usize| at[k] >= 0.0 && at[k] < cells[k] as f32;
        if let Some(axis) = (0..3).find(|&k| !is_within(k)).map(|_| (0..3).filter(|&k| !is_within(k))) {
            let mut axes = axis.map(|k| boundary.axes[k]);
            return (!axes.any(|axis| matches!(axis, Axis::Periodic { .. }))).then(Vec::new);
        }
        let cell = at.map(|c| c as u32);
        let count = cells.x * cells.y * cells.z;
        let k = kind.cell_lists * (count + 1) + cell[0] + cells.x * (cell[1] + cells.y * cell[2]);
        let [begin, end] = [k, k + 1].map(|k| receiver_cells.words[k as usize] as usize);
        Some(receiver_cells.words[begin..end].to_vec())
    }

    #[test]
    fn lists_contain_all_receivers_within_distance() {
        let boundaries = [
            (Boundary::default(), 10.0),
            (Boundary::default(), 1e-6),
            (Boundary::default(), 1e9),
            (Boundary::periodic([-5.0; 3], [5.0; 3]), 10.0),
            (Boundary::reflecting([-5.0; 3], [5.0; 3]), 10.0),
        ];
        for (boundary, scale) in boundaries {
            let event = |k: u32| EventRow {
                receiver: k % MANY,
                radius: 0.01 * scale * (1 + k % 5) as f32,
                ..EventRow::default()
            };
            let event_rows: Vec<EventRow> = (0..2 * MANY).map(event).collect();
            let kind = |lists: u32, search_distance: f32| SpeciesRow {
                events_begin: lists * MANY,
                decays_begin: (lists + 1) * MANY,
                events_end: (lists + 1) * MANY,
                search_distance: search_distance * scale,
                cell_lists: lists,
                ..SpeciesRow::default()
            };
            let species_rows = [kind(0, 0.01), kind(1, 0.05)];
            let mut builder = ReceiverCellsBuilder::new(&species_rows, &event_rows, boundary);
            let mut centers: Vec<[f32; 3]> = (0..MANY).map(|k| point(k, scale)).collect();
            if boundary.is_unbounded() {
                centers[7][1] = 40.0 * scale;
            }
            let displacements: Vec<f32> = (0..MANY).map(|k| 0.01 * scale * (k % 3) as f32).collect();
            for (displacements, max_displacement) in [(&[][..], 0.0), (&displacements[..], 0.004 * scale)] {
                let receiver_cells = builder.build(&centers, displacements, max_displacement).expect("lists");
                assert!(receiver_cells.words.len() <= builder.max_words());
                let (mut listed, mut queries) = (0, 0);
                for k in 0..4_000 {
                    let kind = &species_rows[k as usize % 2];
                    let point = boundary.confine(point(1_000 + k, 1.2 * scale));
                    let Some(list) = list_of(&receiver_cells, kind, &boundary, point) else { continue };
                    queries += 1;
                    listed += list.len();
                    assert!(
                        list.is_sorted()
                            && list.iter().all(|k| (kind.events_begin..kind.decays_begin).contains(k))
                    );
                    for at in kind.events_begin..kind.decays_begin {
                        let EventRow { receiver, radius, .. } = event_rows[at as usize];
                        let begin = centers[receiver as usize];
                        let away = displacements.get(receiver as usize).copied().unwrap_or(0.0);
                        let gap = signed_distance(radius + away, begin, &boundary, point);
                        assert!(
                            gap > kind.search_distance + 3.0 * max_displacement || list.contains(&at),
                            "{at} is {gap} away, {boundary:?}"
                        );
                    }
                }
                assert!(
                    queries > 3_900 && listed < 20 * queries,
                    "{listed} of {queries}, {boundary:?}, {scale}"
                );
            }
        }
    }

    #[test]
    fn lists_of_ubiquitous_receivers_stay_within_capacity() {
        let event_rows = vec![EventRow { radius: 3.0, ..EventRow::default() }; 5_000];
        let kind = SpeciesRow {
            decays_begin: 5_000,
            events_end: 5_000,
            search_distance: 0.01,
            ..SpeciesRow::default()
        };
        let mut builder = ReceiverCellsBuilder::new(&[kind], &event_rows, Boundary::default());
        let capacity = builder.max_words();
        let receiver_cells = builder.build(&[[0.0; 3]], &[], 0.0).expect("lists");
        assert!(receiver_cells.words.len() <= capacity, "{} of {capacity}", receiver_cells.words.len());
    }
}
