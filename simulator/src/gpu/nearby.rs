//! Which receivers a particle may meet, by the cell of space that it is in: the host lists them by cells, as it knows where
//! receivers are, so that a particle that meets only those looks at no others.
//!
//! Cells are spheres to the detector, as wide as particles in them get about in a step, and receivers as wide as they go while
//! the lists serve. A list has what is in reach in the order of all, so that what befalls a particle is what a loop over all
//! receivers gives. Particles that get farther, and those that nothing is listed for, take that loop.

use glam::{UVec3, Vec3};
use lazygrid::Sphere;

use super::layout::{Fate, Kind, Lists, NOTHING};
use crate::model::receiver::{finder, rounding};
use crate::{Axis, Boundary, Error};

/// Receivers that a species sees from which on they are listed. Fewer are looked at sooner than a list.
pub(super) const LISTED_FROM: u32 = 4;
/// The cells, as a multiple of the receivers that are listed for a species, and in all.
const CELLS: [usize; 2] = [8, 1 << 16];
/// Entries of lists that there is room for, as a multiple of the same.
const ENTRIES: usize = 24;
/// Steps of particles from which on lists are worth it that serve these alone, for each receiver.
const SERVED: u64 = 64;

/// Lists as kernels read them.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Nearby {
    pub(super) head: Lists,
    /// By species for which there are lists: where that of each cell begins, and the last one ends; then the lists, of places
    /// in the table of fates.
    pub(super) words: Vec<u32>,
}

/// The tables of a model that lists are made of.
#[derive(Clone, Debug)]
pub(super) struct Listing {
    /// Of the species for which there are lists, in the order of these.
    kinds: Vec<Kind>,
    fates: Vec<Fate>,
    room: Boundary,
    /// Fewer where lists would have no room.
    most_cells: usize,
}

impl Listing {
    pub(super) fn new(kinds: &[Kind], fates: &[Fate], room: Boundary) -> Self {
        let kinds: Vec<Kind> = kinds.iter().filter(|kind| kind.lists != NOTHING).copied().collect();
        let most = kinds.iter().map(|kind| kind.decays_begin - kind.fates_begin).max().unwrap_or(0);
        let most_cells = (CELLS[0] * most as usize).min(CELLS[1]);
        Self { kinds, fates: fates.to_vec(), room, most_cells }
    }

    /// The most words that lists take.
    pub(super) fn most_words(&self) -> usize {
        self.kinds.len() * (2 * self.most_cells + 1) + ENTRIES * self.receivers()
    }

    /// Returns `true` if lists pay that serve so many steps of a particle.
    pub(super) fn pays(&self, steps: u64) -> bool {
        !self.kinds.is_empty() && steps >= SERVED * self.receivers() as u64
    }

    fn seen_by(&self, kind: &Kind) -> &[Fate] {
        &self.fates[kind.fates_begin as usize..kind.decays_begin as usize]
    }

    /// Receivers, once for each species for which they are listed.
    fn receivers(&self) -> usize {
        self.kinds.iter().map(|kind| self.seen_by(kind).len()).sum()
    }

    /// The lists for steps in which receivers begin at these centres, get so far from there, and go no longer way in any one.
    /// None where numbers have no room for cells.
    ///
    /// # Errors
    /// Fails if the detector fails.
    pub(super) fn of(&mut self, centers: &[[f32; 3]], gone: &[f32], longest: f32) -> Result<Nearby, Error> {
        if self.kinds.is_empty() {
            return Ok(Nearby::default());
        }
        let sphere = |fate: &Fate| {
            let at = fate.receiver as usize;
            Sphere::new(centers[at], fate.radius + gone.get(at).copied().unwrap_or(0.0))
        };
        let receivers: Vec<Vec<Sphere>> =
            self.kinds.iter().map(|kind| self.seen_by(kind).iter().map(sphere).collect()).collect();
        let reach = |kind: &Kind| kind.reach + 3.0 * longest;
        let widest = self.kinds.iter().map(reach).fold(0.0, f32::max);
        loop {
            let cells = Cells::new(receivers.iter().flatten(), widest, &self.room, self.most_cells);
            if !cells.are_finite(widest) {
                return Ok(Nearby::default());
            }
            let around = |kind| (0..cells.count()).map(|at| cells.sphere(at, reach(kind))).collect();
            let around: Vec<Vec<Sphere>> = self.kinds.iter().map(around).collect();
            // One cell has every receiver once.
            if let Some(words) = self.words(&around, &receivers)? {
                return Ok(Nearby { head: cells.head(), words });
            }
            self.most_cells /= 2;
        }
    }

    /// Nothing if there is no room for so many entries.
    fn words(&self, around: &[Vec<Sphere>], receivers: &[Vec<Sphere>]) -> Result<Option<Vec<u32>>, Error> {
        let mut detector = finder(&self.room)?;
        let cells = around[0].len();
        let mut words = vec![0; self.kinds.len() * (cells + 1)];
        let most = words.len() + ENTRIES * self.receivers();
        for (k, (kind, sets)) in self.kinds.iter().zip(around.iter().zip(receivers)).enumerate() {
            let found = detector.count(sets)?;
            if words.len() as u64 + found > most as u64 {
                return Ok(None);
            }
            let near = detector.neighbors(sets)?;
            for at in 0..cells {
                words[k * (cells + 1) + at] = words.len() as u32;
                words.extend(near.neighbors_of(at).iter().map(|&receiver| kind.fates_begin + receiver));
            }
            words[k * (cells + 1) + cells] = words.len() as u32;
        }
        Ok(Some(words))
    }
}

/// Boxes around all places from which receivers can be met.
struct Cells {
    low: [f64; 3],
    length: [f64; 3],
    cells: [u32; 3],
}

/// The shortest box, in µm: what devices take for zero is nothing beside it.
const SHORTEST: f64 = 1e-20;
/// More than rounding does to which cell a point is in, beside the coordinates and lengths of the box.
const ROUNDED: f64 = 1e-6;

impl Cells {
    /// Not many more than `most` around these receivers, as far as `reach` from them.
    fn new<'a>(
        receivers: impl Iterator<Item = &'a Sphere>,
        reach: f32,
        room: &Boundary,
        most: usize,
    ) -> Self {
        let (mut low, mut high) = ([f64::MAX; 3], [f64::MIN; 3]);
        for Sphere { center, radius } in receivers {
            let center = center.to_array();
            let beyond = radius + reach;
            let beyond = f64::from(beyond + rounding(center, beyond));
            for k in 0..3 {
                low[k] = low[k].min(f64::from(center[k]) - beyond);
                high[k] = high[k].max(f64::from(center[k]) + beyond);
            }
        }
        for (k, axis) in room.axes.into_iter().enumerate() {
            if let Axis::Periodic { low: from, high: to } = axis {
                [low[k], high[k]] = [f64::from(from), f64::from(to)];
            } else {
                let more = ROUNDED * (high[k] - low[k] + low[k].abs() + high[k].abs()) + SHORTEST;
                [low[k], high[k]] = [low[k] - more, high[k] + more];
            }
        }
        let length: [f64; 3] = std::array::from_fn(|k| high[k] - low[k]);
        // Narrower cells would have lists that are hardly shorter.
        let least = 0.5 * f64::from(reach);
        let mut edge = (length.iter().product::<f64>() / most.max(1) as f64).cbrt().max(least);
        loop {
            let cells = length.map(|length| (length / edge).ceil().max(1.0));
            if cells.iter().product::<f64>() <= 2.0 * most as f64 {
                break Self { low, length, cells: cells.map(|count| count as u32) };
            }
            if most <= 1 {
                break Self { low, length, cells: [1; 3] };
            }
            edge *= 1.25;
        }
    }

    fn count(&self) -> usize {
        self.cells.iter().map(|&count| count as usize).product()
    }

    /// Returns `true` if all that is computed with them is a number.
    fn are_finite(&self, reach: f32) -> bool {
        let Lists { low, per_edge, .. } = self.head();
        let last = self.sphere(self.count() - 1, reach);
        low.is_finite() && per_edge.is_finite() && last.center.is_finite() && (2.0 * last.radius).is_finite()
    }

    /// Where particles of a cell get that get about so far, with what rounding may do to which cell they are in.
    fn sphere(&self, at: usize, reach: f32) -> Sphere {
        let [x, y, _] = self.cells.map(|count| count as usize);
        let place = [at % x, at / x % y, at / x / y];
        let edge: [f64; 3] = std::array::from_fn(|k| self.length[k] / f64::from(self.cells[k]));
        let center: [f32; 3] =
            std::array::from_fn(|k| (self.low[k] + (place[k] as f64 + 0.5) * edge[k]) as f32);
        let half = 0.5 * edge.iter().map(|edge| edge * edge).sum::<f64>().sqrt();
        let off: f64 = (0..3).map(|k| ROUNDED * (self.low[k].abs() + self.length[k])).sum();
        let radius = reach + (half + off) as f32;
        Sphere::new(center, radius + rounding(center, radius))
    }

    fn head(&self) -> Lists {
        let of = |value: &dyn Fn(usize) -> f64| Vec3::from_array(std::array::from_fn(|k| value(k) as f32));
        Lists {
            low: of(&|k| self.low[k]),
            per_edge: of(&|k| f64::from(self.cells[k]) / self.length[k]),
            cells: UVec3::from_array(self.cells),
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

    /// The list of a point as `seen.wgsl` finds it; nothing where all are looked at.
    fn list_of(nearby: &Nearby, kind: &Kind, room: &Boundary, point: [f32; 3]) -> Option<Vec<u32>> {
        let Lists { low, per_edge, cells } = nearby.head;
        let at = ((Vec3::from_array(point) - low) * per_edge).floor().to_array();
        let is_within = |k: usize| at[k] >= 0.0 && at[k] < cells[k] as f32;
        if let Some(axis) = (0..3).find(|&k| !is_within(k)).map(|_| (0..3).filter(|&k| !is_within(k))) {
            let mut axes = axis.map(|k| room.axes[k]);
            return (!axes.any(|axis| matches!(axis, Axis::Periodic { .. }))).then(Vec::new);
        }
        let cell = at.map(|c| c as u32);
        let count = cells.x * cells.y * cells.z;
        let k = kind.lists * (count + 1) + cell[0] + cells.x * (cell[1] + cells.y * cell[2]);
        let [begin, end] = [k, k + 1].map(|k| nearby.words[k as usize] as usize);
        Some(nearby.words[begin..end].to_vec())
    }

    #[test]
    fn lists_have_all_that_is_in_reach() {
        let rooms = [
            (Boundary::default(), 10.0),
            (Boundary::default(), 1e-6),
            (Boundary::default(), 1e9),
            (Boundary::periodic([-5.0; 3], [5.0; 3]), 10.0),
            (Boundary::reflecting([-5.0; 3], [5.0; 3]), 10.0),
        ];
        for (room, scale) in rooms {
            let fate = |k: u32| Fate {
                receiver: k % MANY,
                radius: 0.01 * scale * (1 + k % 5) as f32,
                ..Fate::default()
            };
            let fates: Vec<Fate> = (0..2 * MANY).map(fate).collect();
            let kind = |lists: u32, reach: f32| Kind {
                fates_begin: lists * MANY,
                decays_begin: (lists + 1) * MANY,
                fates_end: (lists + 1) * MANY,
                reach: reach * scale,
                lists,
                ..Kind::default()
            };
            let kinds = [kind(0, 0.01), kind(1, 0.05)];
            let mut listing = Listing::new(&kinds, &fates, room);
            let mut centers: Vec<[f32; 3]> = (0..MANY).map(|k| point(k, scale)).collect();
            // One is far from all others if there is room for that.
            if room.is_unbounded() {
                centers[7][1] = 40.0 * scale;
            }
            let gone: Vec<f32> = (0..MANY).map(|k| 0.01 * scale * (k % 3) as f32).collect();
            for (gone, longest) in [(&[][..], 0.0), (&gone[..], 0.004 * scale)] {
                let nearby = listing.of(&centers, gone, longest).expect("lists");
                assert!(nearby.words.len() <= listing.most_words());
                let (mut listed, mut asked) = (0, 0);
                for k in 0..4_000 {
                    let kind = &kinds[k as usize % 2];
                    let point = room.confine(point(1_000 + k, 1.2 * scale));
                    let Some(list) = list_of(&nearby, kind, &room, point) else { continue };
                    asked += 1;
                    listed += list.len();
                    assert!(
                        list.is_sorted()
                            && list.iter().all(|k| (kind.fates_begin..kind.decays_begin).contains(k))
                    );
                    for at in kind.fates_begin..kind.decays_begin {
                        let Fate { receiver, radius, .. } = fates[at as usize];
                        let begin = centers[receiver as usize];
                        let away = gone.get(receiver as usize).copied().unwrap_or(0.0);
                        let gap = signed_distance(radius + away, begin, &room, point);
                        assert!(
                            gap > kind.reach + 3.0 * longest || list.contains(&at),
                            "{at} is {gap} away, {room:?}"
                        );
                    }
                }
                // Else it would be of no use.
                assert!(asked > 3_900 && listed < 20 * asked, "{listed} of {asked}, {room:?}, {scale}");
            }
        }
    }

    /// Where all are in reach from everywhere, there are fewer cells, and not more entries than there is room for.
    #[test]
    fn lists_of_what_is_everywhere_have_room() {
        let fates = vec![Fate { radius: 3.0, ..Fate::default() }; 5_000];
        let kind = Kind { decays_begin: 5_000, fates_end: 5_000, reach: 0.01, ..Kind::default() };
        let mut listing = Listing::new(&[kind], &fates, Boundary::default());
        let room = listing.most_words();
        let nearby = listing.of(&[[0.0; 3]], &[], 0.0).expect("lists");
        assert!(nearby.words.len() <= room, "{} of {room}", nearby.words.len());
    }
}
