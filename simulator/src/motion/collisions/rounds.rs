//! Events in parallel rounds.
//!
//! Every particle has a clock and a next event. In a round, an event happens if it is the next of both its particles
//! and *safe*: no third particle can hit either before. Such events are independent.
//!
//! # Correctness
//!
//! Let `T` be the earliest pending event, and `V` the top speed.
//!
//! 1. A particle leaves its predicted path at its next event, or when one that left its own path hits it. So none does
//!    before `T`.
//! 2. A particle that leaves its path at `s` or later cannot hit one that stays on its path, with the speed `v`, before
//!    `s + g/(V + v)`. Their surface distance on the predicted paths, `g` at `s`, shrinks at `V + v` at most. If a
//!    clock is beyond `s`, `g` is taken there: the path up to it is known.
//! 3. Two such hits bound the time at which a third particle may hit one of the event. If no bound is before the event,
//!    the event is that of the order of times.
//!
//! The earliest event is always safe, so every round has one. In dense clusters distances vanish, and the parallelism
//! with them. So [`SLACK`] contact distances are added, and a third particle may hit late at that overlap.

use bytemuck::{Pod, Zeroable};
use rayon::prelude::*;

use super::halo::Halo;
use super::mover::{Mover, dot};
use super::rules::{CollisionEvent, Rules};

/// Largest overlap of a late hit, in contact distances, for each of the two hits in a row.
pub(crate) const SLACK: f64 = 1.0 / 256.0;
const CHUNK: usize = 64;

#[derive(Debug, Default)]
pub(crate) struct Adjacency {
    begins: Vec<u32>,
    neighbors: Vec<u32>,
}

/// A time window of a step with a complete candidate list.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Window<'a> {
    pub(crate) rules: &'a Rules,
    pub(crate) neighbors: &'a Adjacency,
    /// Own movers precede the ghosts.
    pub(crate) own_count: usize,
    /// Fraction of the step.
    pub(crate) horizon: f64,
    /// In µm per step.
    pub(crate) top_speed: f64,
    /// [`SLACK`], or 0 for the exact order.
    pub(crate) slack: f64,
    pub(crate) limit: u64,
}

/// The end of a window, with the number of collisions or the speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum WindowEnd {
    Finished(u64),
    TooFast(f64),
    TooMany(u64),
}

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Progress {
    earliest: f64,
    fastest: f64,
    collisions: u64,
}

#[derive(Debug)]
struct EventSchedule {
    next: Vec<CollisionEvent>,
    safe_from: Vec<f64>,
    active: Vec<u32>,
    is_active: Vec<bool>,
    changes: Vec<MoverChange>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum MoverChange {
    None,
    /// The partner of its next event changed.
    Partner,
    Own,
}

impl Window<'_> {
    /// Ghosts must include the movers up to [`HOPS`](super::halo::HOPS) candidate pairs away.
    pub(crate) fn run<H: Halo>(&self, movers: &mut [Mover], halo: &mut H) -> Result<WindowEnd, H::Error> {
        let mut schedule = self.begin(movers);
        let (mut last, mut collisions) = (Progress::zeroed(), 0);
        loop {
            last.earliest = schedule.earliest(self.own_count);
            let Progress { earliest, fastest, collisions: more } = Progress::from_ranks(halo.gather(last));
            collisions += more;
            if fastest > self.top_speed {
                return Ok(WindowEnd::TooFast(fastest));
            }
            if collisions > self.limit {
                return Ok(WindowEnd::TooMany(collisions));
            }
            if earliest == f64::INFINITY {
                return Ok(WindowEnd::Finished(collisions));
            }
            let mut changed = Vec::new();
            last = self.round(movers, &mut schedule, earliest, &mut changed);
            halo.refresh(movers, &mut changed)?;
            self.update(movers, &mut schedule, &changed);
        }
    }

    fn round(
        &self,
        movers: &mut [Mover],
        schedule: &mut EventSchedule,
        earliest: f64,
        changed: &mut Vec<u32>,
    ) -> Progress {
        let is_own = |at: u32| (at as usize) < self.own_count;
        let trial = |&at: &u32| {
            let event = schedule.next[at as usize];
            let is_here = event.at[0] == at && event.particles().iter().any(|&at| is_own(at));
            if !is_here || schedule.safe_from[at as usize] > earliest {
                return None;
            }
            let safe_from = self.safe_from(movers, &schedule.next, &event, earliest)?;
            let outcome = || self.rules.outcome(movers, &event);
            Some((event, safe_from, (safe_from <= earliest).then(outcome)))
        };
        let trials: Vec<_> = schedule.active.par_iter().with_min_len(CHUNK).filter_map(trial).collect();
        let mut progress = Progress { earliest, fastest: 0.0, collisions: 0 };
        for (event, safe_from, outcome) in &trials {
            schedule.safe_from[event.at[0] as usize] = *safe_from;
            let Some((after, hits)) = outcome else { continue };
            if is_own(event.at[0]) {
                progress.collisions += hits;
            }
            for (&at, mover) in event.particles().iter().zip(after).filter(|&(&at, _)| is_own(at)) {
                movers[at as usize] = *mover;
                progress.fastest = f64::max(progress.fastest, mover.speed);
                changed.push(at);
            }
        }
        progress
    }

    fn begin(&self, movers: &[Mover]) -> EventSchedule {
        let all = 0..movers.len() as u32;
        let mut next = Vec::new();
        let first = |at: u32| self.next_event(movers, at);
        next.par_extend(all.clone().into_par_iter().with_min_len(CHUNK).map(first));
        let is_active: Vec<bool> =
            next.iter().map(|event: &CollisionEvent| event.time <= self.horizon).collect();
        let active = all.filter(|&at| is_active[at as usize]).collect();
        let safe_from = vec![0.0; next.len()];
        EventSchedule { next, safe_from, active, is_active, changes: vec![MoverChange::None; movers.len()] }
    }

    pub(crate) fn next_event(&self, movers: &[Mover], at: u32) -> CollisionEvent {
        let others = self.neighbors.neighbors_of(at).iter();
        let events = others.filter_map(|&other| self.rules.predict(movers, [at, other]));
        events.chain(self.rules.predict_wall(movers, at)).fold(CollisionEvent::NEVER, CollisionEvent::earlier)
    }

    fn update(&self, movers: &[Mover], schedule: &mut EventSchedule, changed: &[u32]) {
        changed.iter().for_each(|&at| schedule.changes[at as usize] = MoverChange::Own);
        let stale = schedule.lose_partners(changed.iter().flat_map(|&at| self.neighbors.neighbors_of(at)));
        let again = |&at: &u32| self.next_event(movers, at);
        let repeated: Vec<CollisionEvent> = stale.par_iter().with_min_len(CHUNK).map(again).collect();
        let of_one = |&at: &u32| {
            let others = self.neighbors.neighbors_of(at).iter();
            let events = others.filter_map(move |&other| self.rules.predict(movers, [at, other]));
            events.chain(self.rules.predict_wall(movers, at))
        };
        let events: Vec<CollisionEvent> =
            changed.par_iter().with_min_len(CHUNK).flat_map_iter(of_one).collect();
        changed.iter().for_each(|&at| schedule.next[at as usize] = CollisionEvent::NEVER);
        stale.iter().zip(repeated).for_each(|(&at, event)| schedule.set(at, event, self.horizon));
        for event in events {
            for &at in event.particles() {
                let index = at as usize;
                if schedule.changes[index] != MoverChange::Partner
                    && event.compare(&schedule.next[index]).is_lt()
                {
                    schedule.set(at, event, self.horizon);
                }
            }
        }
        changed.iter().chain(&stale).for_each(|&at| schedule.changes[at as usize] = MoverChange::None);
        let EventSchedule { next, active, is_active, .. } = schedule;
        active.retain(|&at| {
            is_active[at as usize] = next[at as usize].time <= self.horizon;
            is_active[at as usize]
        });
    }

    /// Returns the earliest time at which an event may be safe, `earliest` if it is safe; `None` if it is not the next
    /// event of all its particles.
    pub(crate) fn safe_from(
        &self,
        movers: &[Mover],
        next: &[CollisionEvent],
        event: &CollisionEvent,
        earliest: f64,
    ) -> Option<f64> {
        let participants = event.particles();
        if participants.iter().any(|&at| next[at as usize].compare(event).is_ne()) {
            return None;
        }
        for &at in participants {
            for &other in self.neighbors.neighbors_of(at).iter().filter(|other| !participants.contains(other))
            {
                // The other leaves its path at `earliest` or later, a bound that often suffices.
                if self.misses(movers, [other, at], [earliest, event.time]) {
                    continue;
                }
                let thirds =
                    self.neighbors.neighbors_of(other).iter().filter(|third| !participants.contains(third));
                let hits = thirds.map(|&third| self.hit(movers, [third, other], earliest));
                let leaves = hits.fold(next[other as usize].time, f64::min);
                let late = event.time - self.hit(movers, [other, at], leaves);
                if late > 0.0 {
                    // The bound rises about as much as `earliest`, so earlier tests would be in vain.
                    return Some(earliest + late);
                }
            }
        }
        Some(earliest)
    }

    /// Returns `true` if [`hit`](Self::hit) is at `until` or later, without a square root.
    fn misses(&self, movers: &[Mover], pair: [u32; 2], [from, until]: [f64; 2]) -> bool {
        let [left, steady] = pair.map(|at| &movers[at as usize]);
        let time = from.max(left.time).max(steady.time);
        let d = left.displacement(steady, time, &self.rules.boundary);
        let near = (1.0 - self.slack) * left.contact_distance(steady);
        let max_distance = near + (until - from) * (self.top_speed + steady.speed);
        dot(d, d) >= max_distance * max_distance
    }

    /// Returns a lower bound of the time at which the first particle, off its path at `from` or later, hits the second.
    fn hit(&self, movers: &[Mover], pair: [u32; 2], from: f64) -> f64 {
        if from == f64::INFINITY {
            return from;
        }
        let [left, steady] = pair.map(|at| &movers[at as usize]);
        let time = from.max(left.time).max(steady.time);
        let gap = left.gap(steady, time, &self.rules.boundary) + self.slack * left.contact_distance(steady);
        from + gap.max(0.0) / (self.top_speed + steady.speed)
    }
}

impl Progress {
    fn from_ranks(ranks: Vec<Self>) -> Self {
        let none = Self { earliest: f64::INFINITY, fastest: 0.0, collisions: 0 };
        ranks.into_iter().fold(none, |all, rank| Self {
            earliest: all.earliest.min(rank.earliest),
            fastest: all.fastest.max(rank.fastest),
            collisions: all.collisions + rank.collisions,
        })
    }
}

impl EventSchedule {
    fn earliest(&self, own_count: usize) -> f64 {
        let active = self.active.iter().filter(|&&at| (at as usize) < own_count);
        active.map(|&at| self.next[at as usize].time).fold(f64::INFINITY, f64::min)
    }

    fn lose_partners<'a>(&mut self, candidates: impl Iterator<Item = &'a u32>) -> Vec<u32> {
        let Self { next, changes, .. } = self;
        let mut stale = Vec::new();
        for &at in candidates {
            let changed = |&other: &u32| changes[other as usize] == MoverChange::Own;
            if changes[at as usize] == MoverChange::None && next[at as usize].particles().iter().any(changed)
            {
                changes[at as usize] = MoverChange::Partner;
                stale.push(at);
            }
        }
        stale
    }

    fn set(&mut self, at: u32, event: CollisionEvent, horizon: f64) {
        self.next[at as usize] = event;
        self.safe_from[at as usize] = 0.0;
        if event.time <= horizon && !std::mem::replace(&mut self.is_active[at as usize], true) {
            self.active.push(at);
        }
    }
}

impl Adjacency {
    pub(crate) fn build(&mut self, pairs: &[[u32; 2]], particles: usize) {
        self.begins.clear();
        self.begins.resize(particles + 1, 0);
        pairs.iter().flatten().for_each(|&at| self.begins[at as usize + 1] += 1);
        (0..particles).for_each(|k| self.begins[k + 1] += self.begins[k]);
        self.neighbors.clear();
        self.neighbors.resize(2 * pairs.len(), 0);
        let mut next = self.begins.clone();
        for &[a, b] in pairs {
            for [at, other] in [[a, b], [b, a]] {
                let next_index = &mut next[at as usize];
                self.neighbors[*next_index as usize] = other;
                *next_index += 1;
            }
        }
    }

    /// Sorts candidates by id, so that the first that delays an event is always the same.
    pub(crate) fn sort_by_id(&mut self, movers: &[Mover]) {
        // Reading large movers in this order would miss caches.
        let ids: Vec<u32> = movers.iter().map(|mover| mover.id).collect();
        for begins in self.begins.windows(2) {
            let neighbors = &mut self.neighbors[begins[0] as usize..begins[1] as usize];
            neighbors.sort_unstable_by_key(|&at| ids[at as usize]);
        }
    }

    pub(super) fn neighbors_of(&self, at: u32) -> &[u32] {
        let [begin, end] = [at, at + 1].map(|at| self.begins[at as usize] as usize);
        &self.neighbors[begin..end]
    }
}
