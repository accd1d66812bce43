use std::ops::{ControlFlow, Range};
use std::time::Instant;

use lazygrid_host::{
    CandidateFilter, ChunkConsumer, Executor, PairConsumer, PairSource, PhaseTime, Team, ranges,
};
use lazygrid_kernels::{Algorithm, Interactions, Pair, Space, Spheres, try_reserve};

use super::slabs::{Slab, SlabInput, Slabs};
use crate::Error;
use crate::gpu::detector::GpuSpheres;
use crate::gpu::session::{GpuSession, QueuedCall, Ticket};

#[derive(Clone, Copy, Debug)]
pub(super) struct SearchRequest<'a> {
    pub(super) spheres: Spheres<'a>,
    pub(super) split: Option<u32>,
    pub(super) interactions: Option<&'a Interactions>,
    pub(super) space: Space,
    pub(super) algorithm: Algorithm,
    pub(super) filter: Option<(&'a CandidateFilter<'a>, &'a Team)>,
}

impl SearchRequest<'_> {
    fn has_no_pairs(&self) -> bool {
        has_empty_set(self.split, self.spheres.len() as u32)
    }

    fn filter_pairs(&self, pairs: &mut Vec<Pair>) {
        let Some((filter, team)) = self.filter else { return };
        let filtered = team.pass(pairs.len(), |executor| {
            filter.retain(pairs, executor);
            Ok(())
        });
        if filtered.is_err() {
            filter.retain(pairs, Executor::Caller);
        }
    }
}

pub(super) fn has_empty_set(split: Option<u32>, spheres: u32) -> bool {
    split.is_some_and(|split| split == 0 || split == spheres)
}

struct SlabCut<'a> {
    request: &'a SearchRequest<'a>,
    input: SlabInput<'a>,
    slabs: Slabs,
}

#[derive(Debug)]
pub(super) struct SlabSearch {
    pub(super) session: GpuSession,
    slab: Slab,
    pub(super) timings: Vec<PhaseTime>,
    /// 1 for an undivided call.
    pub(super) slabs: usize,
    /// `false` if all slabs were empty, or one of two sets was.
    pub(super) has_searched: bool,
    found: Vec<Pair>,
}

pub(super) struct SlabPairSource<'b> {
    pub(super) search: &'b mut SlabSearch,
    pub(super) request: &'b SearchRequest<'b>,
}

impl PairSource for SlabPairSource<'_> {
    fn count(&mut self) -> Result<u64, Error> {
        self.search.count(self.request)
    }

    fn list(&mut self, limit: u64, take: ChunkConsumer<'_>) -> Result<u64, Error> {
        let mut chunk = [std::mem::take(&mut self.search.found)];
        let listed = self.search.list(self.request, limit, &mut chunk[0]);
        let found = match listed {
            Ok(()) => {
                let found = chunk[0].len() as u64;
                let _ = take(&mut chunk);
                Ok(found)
            }
            Err(Error::TooManyPairs { found, .. }) => Ok(found),
            Err(error) => Err(error),
        };
        [self.search.found] = chunk;
        found
    }

    fn ascending(&mut self, limit: u64, take: ChunkConsumer<'_>) -> Result<(), Error> {
        self.search.for_each_chunk(self.request, Some(limit), |pairs| take(std::slice::from_mut(pairs)))
    }

    fn unordered(&mut self, take: PairConsumer<'_>) -> Result<(), Error> {
        self.search.for_each_chunk(self.request, None, |pairs| take(pairs))
    }
}

impl SlabSearch {
    pub(super) fn new(session: GpuSession) -> Self {
        let (slab, timings, found) = Default::default();
        Self { session, slab, timings, slabs: 1, has_searched: false, found }
    }

    pub(super) fn list(
        &mut self,
        request: &SearchRequest<'_>,
        limit: u64,
        list: &mut Vec<Pair>,
    ) -> Result<(), Error> {
        match self.list_found(request, limit, list) {
            Ok(()) => {
                request.filter_pairs(list);
                Ok(())
            }
            // Dropped pairs do not count towards the limit.
            Err(Error::TooManyPairs { .. }) if self.drops_pairs(request) => {
                self.list_in_chunks(request, limit, list)
            }
            error => error,
        }
    }

    fn list_found(
        &mut self,
        request: &SearchRequest<'_>,
        limit: u64,
        list: &mut Vec<Pair>,
    ) -> Result<(), Error> {
        if request.has_no_pairs() {
            list.clear();
            return Ok(());
        }
        let Some(cut) = self.cut(request)? else {
            let ticket = self.begin(request)?;
            let finished = self.session.finish(ticket, limit).map(|_| ());
            self.add_timings();
            std::mem::swap(self.session.pairs_mut(), list);
            return finished;
        };
        let mut found = 0;
        list.clear();
        for number in 0..cut.slabs.len() {
            let Some(ticket) = self.begin_slab(&cut, number, &GpuSpheres::ALL)? else { continue };
            if found > limit {
                found += self.session.finish_count(ticket)?;
                self.add_timings();
                continue;
            }
            match self.session.finish(ticket, limit - found).map(<[Pair]>::len) {
                Ok(count) => {
                    found += count as u64;
                    let pairs = self.session.pairs_mut();
                    self.slab.restore_indices(pairs);
                    try_reserve(list, pairs.len(), "pairs")?;
                    list.append(pairs);
                }
                Err(Error::TooManyPairs { found: more, .. }) => found += more,
                Err(error) => return Err(error),
            }
            self.add_timings();
        }
        if found > limit {
            return Err(Error::TooManyPairs { found, limit });
        }
        Ok(())
    }

    fn list_in_chunks(
        &mut self,
        request: &SearchRequest<'_>,
        limit: u64,
        list: &mut Vec<Pair>,
    ) -> Result<(), Error> {
        list.clear();
        let (mut found, mut refused) = (0, None);
        self.for_each_chunk(request, None, |pairs| {
            found += pairs.len() as u64;
            if found > limit {
                return ControlFlow::Continue(());
            }
            append(list, pairs, &mut refused)
        })?;
        match refused {
            Some(error) => Err(error),
            None if found > limit => Err(Error::TooManyPairs { found, limit }),
            None => Ok(()),
        }
    }

    pub(super) fn count(&mut self, request: &SearchRequest<'_>) -> Result<u64, Error> {
        if request.has_no_pairs() {
            return Ok(0);
        }
        if self.drops_pairs(request) {
            let mut found = 0;
            self.for_each_chunk(request, None, |pairs| {
                found += pairs.len() as u64;
                ControlFlow::Continue(())
            })?;
            return Ok(found);
        }
        let Some(cut) = self.cut(request)? else {
            let ticket = self.begin(request)?;
            let found = self.session.finish_count(ticket)?;
            self.add_timings();
            return Ok(found);
        };
        let mut found = 0;
        for number in 0..cut.slabs.len() {
            let Some(ticket) = self.begin_slab(&cut, number, &GpuSpheres::ALL)? else { continue };
            found += self.session.finish_count(ticket)?;
            self.add_timings();
        }
        Ok(found)
    }

    /// With `in_order`, chunks ascend by smaller index and have at most that number of pairs, unless one sphere, or the
    /// output of the device, has more.
    pub(super) fn for_each_chunk(
        &mut self,
        request: &SearchRequest<'_>,
        in_order: Option<u64>,
        mut consume: impl FnMut(&mut Vec<Pair>) -> ControlFlow<()>,
    ) -> Result<(), Error> {
        if request.has_no_pairs() {
            return Ok(());
        }
        let Some(cut) = self.cut(request)? else {
            let ticket = self.begin(request)?;
            self.session.finish_in_parts(ticket, |pairs| {
                request.filter_pairs(pairs);
                consume(pairs)
            })?;
            self.add_timings();
            return Ok(());
        };
        match in_order {
            None => self.slab_by_slab(&cut, &GpuSpheres::ALL, consume),
            Some(most) => self.range_by_range(&cut, most, consume),
        }
    }

    fn slab_by_slab(
        &mut self,
        cut: &SlabCut<'_>,
        range: &Range<u32>,
        mut consume: impl FnMut(&mut Vec<Pair>) -> ControlFlow<()>,
    ) -> Result<(), Error> {
        for number in 0..cut.slabs.len() {
            let Some(ticket) = self.begin_slab(cut, number, range)? else { continue };
            let (slab, mut is_enough) = (&self.slab, false);
            self.session.finish_in_parts(ticket, |pairs| {
                slab.restore_indices(pairs);
                cut.request.filter_pairs(pairs);
                let flow = consume(pairs);
                is_enough = flow.is_break();
                flow
            })?;
            self.add_timings();
            if is_enough {
                break;
            }
        }
        Ok(())
    }

    /// Searches ranges of indices if there are more than `most` pairs.
    fn range_by_range(
        &mut self,
        cut: &SlabCut<'_>,
        most: u64,
        mut consume: impl FnMut(&mut Vec<Pair>) -> ControlFlow<()>,
    ) -> Result<(), Error> {
        let mut counts = Vec::new();
        let (mut list, mut found) = (Vec::new(), 0);
        try_reserve(&mut counts, cut.request.spheres.len(), "pairs of each sphere")?;
        counts.resize(cut.request.spheres.len(), 0_u32);
        self.slab_by_slab(cut, &GpuSpheres::ALL, |pairs| {
            found += pairs.len() as u64;
            pairs.iter().for_each(|pair| counts[pair.i as usize] += 1);
            match found <= most && try_reserve(&mut list, pairs.len(), "pairs").is_ok() {
                true => list.append(pairs),
                false => list = Vec::new(),
            }
            ControlFlow::Continue(())
        })?;
        if list.len() as u64 == found {
            let _ = consume(&mut list);
            return Ok(());
        }
        log::info!("{found} pairs of {} slabs are more than {most}: searching ranges of indices", self.slabs);
        for range in ranges(&counts, most) {
            list.clear();
            let mut refused = None;
            self.slab_by_slab(cut, &range, |pairs| append(&mut list, pairs, &mut refused))?;
            if let Some(error) = refused {
                return Err(error);
            }
            if consume(&mut list).is_break() {
                break;
            }
        }
        Ok(())
    }

    /// Returns `true` if the host drops found pairs: by the filter, or of two ghosts, which the window of one set
    /// excludes.
    fn drops_pairs(&self, request: &SearchRequest<'_>) -> bool {
        request.filter.is_some() || (request.split.is_some() && !self.is_bound_at_once(request))
    }

    pub(super) fn is_bound_at_once(&self, request: &SearchRequest<'_>) -> bool {
        request.spheres.len() as u64 <= self.session.most_spheres()
    }

    fn cut<'a>(&mut self, request: &'a SearchRequest<'a>) -> Result<Option<SlabCut<'a>>, Error> {
        self.timings.clear();
        self.slabs = 1;
        if self.is_bound_at_once(request) {
            return Ok(None);
        }
        let most = self.session.most_spheres();
        let start = Instant::now();
        let input = SlabInput::new(request.spheres, request.interactions, request.space)
            .across(request.split.unwrap_or(0));
        let Some(slabs) = Slabs::new(&input, most as usize) else {
            let what = "the sphere buffer, which overlaps too much to be cut into several,";
            let remedy = "split the spheres or take a device with a larger limit";
            let needed = 16 * request.spheres.len() as u64;
            return Err(Error::LimitExceeded { what, needed, limit: 16 * most, remedy });
        };
        self.slabs = slabs.len();
        self.time("cut", start);
        Ok(Some(SlabCut { request, input, slabs }))
    }

    fn begin(&mut self, request: &SearchRequest<'_>) -> Result<Ticket, Error> {
        let start = Instant::now();
        let call = self.session.call(request.algorithm);
        let call = match request.split {
            None => call,
            Some(split) => QueuedCall { split, may_use_candidates: false, ..call },
        };
        let ticket = self.session.begin_as(call, request.spheres)?;
        self.has_searched = true;
        self.time("upload", start);
        Ok(ticket)
    }

    /// Uses no candidate list, because the next call is another slab.
    fn begin_slab(
        &mut self,
        cut: &SlabCut<'_>,
        number: usize,
        range: &Range<u32>,
    ) -> Result<Option<Ticket>, Error> {
        let start = Instant::now();
        cut.slabs.gather(number, &cut.input, range, &mut self.slab)?;
        self.time("cut", start);
        if self.slab.window().is_empty() {
            return Ok(None);
        }
        let start = Instant::now();
        let (window, split) = (self.slab.window(), self.slab.split());
        let call = QueuedCall {
            window,
            split,
            may_use_candidates: false,
            ..self.session.call(cut.request.algorithm)
        };
        let ticket = self.session.begin_as(call, self.slab.spheres()?)?;
        self.has_searched = true;
        self.time("upload", start);
        Ok(Some(ticket))
    }

    fn add_timings(&mut self) {
        let Self { session, timings, .. } = self;
        session.timings().iter().for_each(|timing| PhaseTime::add(timings, timing.name, timing.time));
    }

    fn time(&mut self, name: &'static str, since: Instant) {
        PhaseTime::add(&mut self.timings, name, since.elapsed());
    }
}

fn append(list: &mut Vec<Pair>, pairs: &mut Vec<Pair>, refused: &mut Option<Error>) -> ControlFlow<()> {
    match try_reserve(list, pairs.len(), "pairs") {
        Ok(()) => {
            list.append(pairs);
            ControlFlow::Continue(())
        }
        Err(error) => {
            *refused = Some(error);
            ControlFlow::Break(())
        }
    }
}
