use std::ops::ControlFlow;
use std::time::Instant;

use lazygrid_host::{Phase, Refinement};
use lazygrid_kernels::{Algorithm, Interactions, Pair, Space, Spheres};

use super::error::make_room;
use super::session::{Call, GpuSession, Ticket};
use super::slabs::{Slab, Slabs, Whole};
use crate::Error;

/// What a search is given.
#[derive(Clone, Copy, Debug)]
pub(super) struct Given<'a> {
    pub(super) spheres: Spheres<'a>,
    pub(super) interactions: Option<&'a Interactions>,
    pub(super) space: Space,
    pub(super) algorithm: Algorithm,
    /// What is asked of pairs besides, once they have come back.
    pub(super) refinement: Option<&'a Refinement<'a>>,
}

/// Searches in a session: in one call, or slab by slab where the device cannot bind all spheres.
#[derive(Debug)]
pub(super) struct Search {
    pub(super) session: GpuSession,
    slab: Slab,
    /// Times of the last call.
    pub(super) timings: Vec<Phase>,
    /// Slabs of the last call; 1 where it was not cut.
    pub(super) slabs: usize,
}

impl Search {
    pub(super) fn new(session: GpuSession) -> Self {
        let (slab, timings) = Default::default();
        Self { session, slab, timings, slabs: 1 }
    }

    /// Puts the pairs into `list`, unordered.
    ///
    /// # Errors
    /// [`Error::TooManyPairs`] above `limit`, with the exact number; otherwise where the device fails.
    pub(super) fn list(&mut self, given: &Given<'_>, limit: u64, list: &mut Vec<Pair>) -> Result<(), Error> {
        match (self.list_found(given, limit, list), given.refinement) {
            (Ok(()), Some(refinement)) => {
                refine(list, refinement);
                Ok(())
            }
            // What is no pair needs no room in the list.
            (Err(Error::TooManyPairs { .. }), Some(_)) => self.list_in_parts(given, limit, list),
            (result, _) => result,
        }
    }

    /// Puts all that the device finds into `list`.
    fn list_found(&mut self, given: &Given<'_>, limit: u64, list: &mut Vec<Pair>) -> Result<(), Error> {
        let Some((whole, slabs)) = self.cut(given)? else {
            let ticket = self.begin(given)?;
            self.session.finish(ticket, limit)?;
            self.session.swap_pairs(list);
            self.note();
            return Ok(());
        };
        let mut found = 0;
        list.clear();
        for number in 0..slabs.len() {
            let ticket = self.begin_slab(&slabs, number, (&whole, given.algorithm))?;
            if found > limit {
                found += self.session.finish_count(ticket)?;
                continue;
            }
            match self.session.finish(ticket, limit - found) {
                Ok(pairs) => {
                    found += pairs.len() as u64;
                    let before = list.len();
                    make_room(list, pairs.len(), "pairs")?;
                    list.extend_from_slice(pairs);
                    self.slab.name(&mut list[before..]);
                }
                Err(Error::TooManyPairs { found: more, .. }) => found += more,
                Err(error) => return Err(error),
            }
            self.note();
        }
        if found > limit {
            return Err(Error::TooManyPairs { found, limit });
        }
        Ok(())
    }

    /// The pairs, of which no more than fit are ever in memory.
    fn list_in_parts(&mut self, given: &Given<'_>, limit: u64, list: &mut Vec<Pair>) -> Result<(), Error> {
        list.clear();
        let (mut found, mut refused) = (0, None);
        self.parts(given, None, |pairs| {
            found += pairs.len() as u64;
            if found > limit {
                return ControlFlow::Continue(());
            }
            refused = make_room(list, pairs.len(), "pairs").err();
            if refused.is_some() {
                return ControlFlow::Break(());
            }
            list.append(pairs);
            ControlFlow::Continue(())
        })?;
        match refused {
            Some(error) => Err(error),
            None if found > limit => Err(Error::TooManyPairs { found, limit }),
            None => Ok(()),
        }
    }

    /// How many pairs there are.
    ///
    /// # Errors
    /// Where the device fails.
    pub(super) fn count(&mut self, given: &Given<'_>) -> Result<u64, Error> {
        if given.refinement.is_some() {
            let mut found = 0;
            self.parts(given, None, |pairs| {
                found += pairs.len() as u64;
                ControlFlow::Continue(())
            })?;
            return Ok(found);
        }
        let Some((whole, slabs)) = self.cut(given)? else {
            let ticket = self.begin(given)?;
            let found = self.session.finish_count(ticket)?;
            self.note();
            return Ok(found);
        };
        let mut found = 0;
        for number in 0..slabs.len() {
            let ticket = self.begin_slab(&slabs, number, (&whole, given.algorithm))?;
            found += self.session.finish_count(ticket)?;
            self.note();
        }
        Ok(found)
    }

    /// Hands the pairs over in parts: with `in_order_up_to` a number of pairs such that smaller indices ascend from part to
    /// part.
    ///
    /// # Errors
    /// Where the device fails; [`Error::LimitExceeded`] where slabs have more pairs than that.
    pub(super) fn parts(
        &mut self,
        given: &Given<'_>,
        in_order_up_to: Option<u64>,
        mut consume: impl FnMut(&mut Vec<Pair>) -> ControlFlow<()>,
    ) -> Result<(), Error> {
        let mut consume = |pairs: &mut Vec<Pair>| {
            if let Some(refinement) = given.refinement {
                refine(pairs, refinement);
            }
            consume(pairs)
        };
        let Some((whole, slabs)) = self.cut(given)? else {
            let ticket = self.begin(given)?;
            self.session.finish_in_parts(ticket, consume)?;
            self.note();
            return Ok(());
        };
        if let Some(limit) = in_order_up_to {
            // A slab has pairs of small indices and of large ones.
            let mut list = Vec::new();
            self.list(given, limit, &mut list).map_err(|error| match error {
                Error::TooManyPairs { found, limit } => {
                    let what =
                        "a stream in order, of more spheres than the device can bind: the number of pairs";
                    let remedy = "raise `max_pairs`, or stream in any order";
                    Error::LimitExceeded { what, needed: found, limit, remedy }
                }
                other => other,
            })?;
            let _ = consume(&mut list);
            return Ok(());
        }
        for number in 0..slabs.len() {
            let ticket = self.begin_slab(&slabs, number, (&whole, given.algorithm))?;
            let (slab, mut is_enough) = (&self.slab, false);
            self.session.finish_in_parts(ticket, |pairs| {
                slab.name(pairs);
                let flow = consume(pairs);
                is_enough = flow.is_break();
                flow
            })?;
            self.note();
            if is_enough {
                break;
            }
        }
        Ok(())
    }

    /// Cuts what the device cannot bind at once.
    fn cut<'a>(&mut self, given: &Given<'a>) -> Result<Option<(Whole<'a>, Slabs)>, Error> {
        self.timings.clear();
        self.slabs = 1;
        let (spheres, count) = (given.spheres, given.spheres.len() as u64);
        let most = self.session.most_spheres();
        if count <= most {
            return Ok(None);
        }
        let start = Instant::now();
        let whole = Whole::new(spheres, given.interactions, given.space);
        let Some(slabs) = Slabs::new(&whole, most as usize) else {
            let what = "the sphere buffer, which overlaps too much to be cut into several,";
            let remedy = "split the spheres or take a device with a larger limit";
            return Err(Error::LimitExceeded { what, needed: 16 * count, limit: 16 * most, remedy });
        };
        self.slabs = slabs.len();
        self.time("cut", start);
        Ok(Some((whole, slabs)))
    }

    fn begin(&mut self, given: &Given<'_>) -> Result<Ticket, Error> {
        let start = Instant::now();
        let ticket = self.session.begin_as(self.session.call(given.algorithm), given.spheres)?;
        self.time("upload", start);
        Ok(ticket)
    }

    /// Gathers and begins a slab. Candidates are not kept for it: the next call of the session is another slab.
    fn begin_slab(
        &mut self,
        slabs: &Slabs,
        number: usize,
        (whole, algorithm): (&Whole<'_>, Algorithm),
    ) -> Result<Ticket, Error> {
        let start = Instant::now();
        slabs.gather(number, whole, &mut self.slab)?;
        self.time("cut", start);
        let start = Instant::now();
        let call = Call { window: self.slab.window(), keeps: false, ..self.session.call(algorithm) };
        let ticket = self.session.begin_as(call, self.slab.spheres()?)?;
        self.time("upload", start);
        Ok(ticket)
    }

    /// Takes down the times of the session's last call.
    fn note(&mut self) {
        let Self { session, timings, .. } = self;
        session.timings().iter().for_each(|timing| Phase::add(timings, timing.name, timing.time));
    }

    fn time(&mut self, name: &'static str, since: Instant) {
        Phase::add(&mut self.timings, name, since.elapsed());
    }
}

/// Leaves out what is no pair.
fn refine(pairs: &mut Vec<Pair>, refinement: &Refinement<'_>) {
    pairs.retain(|pair| refinement.keeps(pair.i, pair.j));
}
