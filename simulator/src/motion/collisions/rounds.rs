//! Events in parallel rounds.
//!
//! Every particle has its own clock and knows its next event. In a round, an event happens if it is the next one of both of its
//! particles and is *safe*: no third particle can hit either of them before. All these events are independent of each other.
//!
//! # Correctness
//!
//! Let `T` be the earliest event that has not happened, and let no particle be faster than `V`.
//!
//! 1. A particle leaves its predicted path at its next event, or when a particle that left its own path before hits it. Nothing
//!    leaves its path before `T`.
//! 2. If a particle leaves its path at `s` or later and hits one of speed `v` that did not, it does so at `s + g/(V + v)` or
//!    later, where `g` is the distance of their surfaces at `s` on the predicted paths. (Until then both move at most `V + v`
//!    towards each other. If one has a clock beyond `s`, its known path is safe until there, and `g` is taken at that clock.)
//! 3. Two such hits in a chain bound the time at which a third particle may hit one of the event. If that bound is not before
//!    the event for any third particle, the event is the same as in the order of all times.
//!
//! The earliest event of all is always safe, so every round has at least one. In dense clusters distances vanish, and so would
//! the parallelism. There each distance counts as larger by [`SLACK`] contact distances: a third particle may then hit late by
//! the time in which it moves that far, and the hit is resolved at that overlap.

use rayon::prelude::*;

use super::mover::{Mover, dot};
use super::rules::{Event, Rules};

/// The largest overlap that a late hit may have by either link of a chain, in contact distances.
pub(crate) const SLACK: f64 = 1.0 / 256.0;
/// The least number of particles per parallel task.
const TASK: usize = 64;

/// The neighbors of every particle in the candidate list.
#[derive(Debug, Default)]
pub(crate) struct Adjacency {
    begins: Vec<u32>,
    neighbors: Vec<u32>,
}

/// A part of a step in which the candidate list is complete.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Window<'a> {
    pub(crate) rules: &'a Rules,
    pub(crate) neighbors: &'a Adjacency,
    /// Its end.
    pub(crate) horizon: f64,
    /// The largest permitted speed, in µm per step.
    pub(crate) top_speed: f64,
    /// [`SLACK`], or 0 for the exact order.
    pub(crate) slack: f64,
    /// The largest permitted number of collisions.
    pub(crate) limit: u64,
}

/// The reason why a window cannot be finished.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Unfinished {
    /// A particle became faster than permitted. The speed of the fastest in that round.
    TooFast(f64),
    /// The number of collisions so far.
    TooMany(u64),
}

/// The next events of all particles, and the particles whose next event is within the window.
#[derive(Debug)]
struct Agenda {
    next: Vec<Event>,
    /// The earliest time of all from which the next event may be safe.
    safe_from: Vec<f64>,
    active: Vec<u32>,
    is_active: Vec<bool>,
    news: Vec<News>,
}

/// The reason why the next event of a particle is predicted again.
#[derive(Clone, Copy, Debug, PartialEq)]
enum News {
    None,
    /// The other particle of its next event changed.
    Partner,
    /// The particle itself changed.
    Own,
}

impl Window<'_> {
    /// Lets all events of the window happen. Returns the number of collisions.
    ///
    /// # Errors
    /// [`Unfinished`], with `movers` in the middle of the window.
    pub(crate) fn run(&self, movers: &mut [Mover]) -> Result<u64, Unfinished> {
        let mut agenda = self.begin(movers);
        let mut collisions = 0;
        while !agenda.active.is_empty() {
            let earliest = agenda.active.iter().map(|&at| agenda.next[at as usize].time);
            let earliest = earliest.fold(f64::INFINITY, f64::min);
            let trial = |&at: &u32| {
                let event = agenda.next[at as usize];
                if event.at[0] != at || agenda.safe_from[at as usize] > earliest {
                    return None;
                }
                let safe_from = self.safe_from(movers, &agenda.next, &event, earliest)?;
                let outcome = || self.rules.outcome(movers, &event);
                Some((event, safe_from, (safe_from <= earliest).then(outcome)))
            };
            let trials: Vec<_> = agenda.active.par_iter().with_min_len(TASK).filter_map(trial).collect();
            let (mut fastest, mut changed) = (0.0, Vec::new());
            for (event, safe_from, outcome) in &trials {
                agenda.safe_from[event.at[0] as usize] = *safe_from;
                let Some((after, met)) = outcome else { continue };
                collisions += met;
                for (&at, mover) in event.particles().iter().zip(after) {
                    movers[at as usize] = *mover;
                    fastest = f64::max(fastest, mover.speed);
                    changed.push(at);
                }
            }
            if fastest > self.top_speed {
                return Err(Unfinished::TooFast(fastest));
            }
            if collisions > self.limit {
                return Err(Unfinished::TooMany(collisions));
            }
            self.update(movers, &mut agenda, &changed);
        }
        Ok(collisions)
    }

    /// Predicts the first events of all particles.
    fn begin(&self, movers: &[Mover]) -> Agenda {
        let all = 0..movers.len() as u32;
        let mut next = Vec::new();
        let first = |at: u32| self.next_event(movers, at);
        next.par_extend(all.clone().into_par_iter().with_min_len(TASK).map(first));
        let is_active: Vec<bool> = next.iter().map(|event: &Event| event.time <= self.horizon).collect();
        let active = all.filter(|&at| is_active[at as usize]).collect();
        let safe_from = vec![0.0; next.len()];
        Agenda { next, safe_from, active, is_active, news: vec![News::None; movers.len()] }
    }

    /// Returns the next event of a particle.
    pub(crate) fn next_event(&self, movers: &[Mover], at: u32) -> Event {
        let others = self.neighbors.of(at).iter();
        let events = others.filter_map(|&other| self.rules.predict(movers, [at, other]));
        events.chain(self.rules.predict_wall(movers, at)).fold(Event::NEVER, Event::earlier)
    }

    /// Predicts the next events of particles again after some have `changed`.
    fn update(&self, movers: &[Mover], agenda: &mut Agenda, changed: &[u32]) {
        changed.iter().for_each(|&at| agenda.news[at as usize] = News::Own);
        let stale = agenda.lose_partners(changed.iter().flat_map(|&at| self.neighbors.of(at)));
        let again = |&at: &u32| self.next_event(movers, at);
        let repeated: Vec<Event> = stale.par_iter().with_min_len(TASK).map(again).collect();
        let of_one = |&at: &u32| {
            let others = self.neighbors.of(at).iter();
            let events = others.filter_map(move |&other| self.rules.predict(movers, [at, other]));
            events.chain(self.rules.predict_wall(movers, at))
        };
        let events: Vec<Event> = changed.par_iter().with_min_len(TASK).flat_map_iter(of_one).collect();
        changed.iter().for_each(|&at| agenda.next[at as usize] = Event::NEVER);
        stale.iter().zip(repeated).for_each(|(&at, event)| agenda.set(at, event, self.horizon));
        for event in events {
            for &at in event.particles() {
                let place = at as usize;
                if agenda.news[place] != News::Partner && event.compare(&agenda.next[place]).is_lt() {
                    agenda.set(at, event, self.horizon);
                }
            }
        }
        changed.iter().chain(&stale).for_each(|&at| agenda.news[at as usize] = News::None);
        let Agenda { next, active, is_active, .. } = agenda;
        active.retain(|&at| {
            is_active[at as usize] = next[at as usize].time <= self.horizon;
            is_active[at as usize]
        });
    }

    /// Returns the earliest time of all from which an event is safe, or `None` if it is not the next one of its particles.
    pub(crate) fn safe_from(
        &self,
        movers: &[Mover],
        next: &[Event],
        event: &Event,
        earliest: f64,
    ) -> Option<f64> {
        let own = event.particles();
        if own.iter().any(|&at| next[at as usize].compare(event).is_ne()) {
            return None;
        }
        for &at in own {
            for &other in self.neighbors.of(at).iter().filter(|other| !own.contains(other)) {
                // First by the least time at which the other one may leave its path, which is often enough.
                if self.misses(movers, [other, at], [earliest, event.time]) {
                    continue;
                }
                let thirds = self.neighbors.of(other).iter().filter(|third| !own.contains(third));
                let hits = thirds.map(|&third| self.hit(movers, [third, other], earliest));
                let leaves = hits.fold(next[other as usize].time, f64::min);
                let late = event.time - self.hit(movers, [other, at], leaves);
                if late > 0.0 {
                    // Later, each of these times is later by as much as the earliest one.
                    return Some(earliest + late);
                }
            }
        }
        Some(earliest)
    }

    /// Returns `true` if [`hit`](Self::hit) from the first time is at the second one or later, without a root.
    fn misses(&self, movers: &[Mover], pair: [u32; 2], [from, until]: [f64; 2]) -> bool {
        let [left, steady] = pair.map(|at| &movers[at as usize]);
        let time = from.max(left.time).max(steady.time);
        let d = left.displacement(steady, time, &self.rules.boundary);
        let near = (1.0 - self.slack) * left.touch(steady);
        let reach = near + (until - from) * (self.top_speed + steady.speed);
        dot(d, d) >= reach * reach
    }

    /// Returns a lower bound of the time at which the first particle, if it leaves its path at `from` or later, hits the second
    /// one.
    fn hit(&self, movers: &[Mover], pair: [u32; 2], from: f64) -> f64 {
        if from == f64::INFINITY {
            return from;
        }
        let [left, steady] = pair.map(|at| &movers[at as usize]);
        let time = from.max(left.time).max(steady.time);
        let gap = left.gap(steady, time, &self.rules.boundary) + self.slack * left.touch(steady);
        from + gap.max(0.0) / (self.top_speed + steady.speed)
    }
}

impl Agenda {
    /// Returns the unchanged particles among `candidates` whose next event was with a changed one.
    fn lose_partners<'a>(&mut self, candidates: impl Iterator<Item = &'a u32>) -> Vec<u32> {
        let Self { next, news, .. } = self;
        let mut stale = Vec::new();
        for &at in candidates {
            let changed = |&other: &u32| news[other as usize] == News::Own;
            if news[at as usize] == News::None && next[at as usize].particles().iter().any(changed) {
                news[at as usize] = News::Partner;
                stale.push(at);
            }
        }
        stale
    }

    /// Sets the next event of a particle.
    fn set(&mut self, at: u32, event: Event, horizon: f64) {
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
                let place = &mut next[at as usize];
                self.neighbors[*place as usize] = other;
                *place += 1;
            }
        }
    }

    fn of(&self, at: u32) -> &[u32] {
        let [begin, end] = [at, at + 1].map(|at| self.begins[at as usize] as usize);
        &self.neighbors[begin..end]
    }
}
