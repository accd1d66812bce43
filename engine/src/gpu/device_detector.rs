use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

use lazygrid_host::{
    Canonical, Frame, Kept, Lists, Neighbors, Order, Phase, Places, SKINS, Settings, Skin, Survey, Team,
    check_valid,
};
use lazygrid_kernels::{Interactions, Pair, Query, Space};

use super::course::Course;
use super::device_search::{Given, Search};
use super::plan::DeviceLimits;
use super::{GpuDevice, GpuSession, GpuSettings};
use crate::choice::{self, Known};
use crate::{Backend, Config, Error, Report};

/// Parts in which the threads that order a list share it out.
const PARTS: usize = 128;

/// The GPU side of a `Detector`: checks and chooses like the CPU path, works in a session, and orders on the host.
#[derive(Debug)]
pub(crate) struct DeviceDetector {
    settings: Settings,
    known: Known,
    device: Device,
    /// What searches in frames, if only some calls need one.
    framed: Option<Box<Device>>,
    /// The host's threads.
    team: Arc<Team>,
    places: Places,
    /// Where it is for the detector to choose a skin.
    course: Option<Course>,
    canonical: Canonical,
    lists: Lists,
    /// As they came; its memory serves the next call.
    found: Vec<Pair>,
    pairs: Vec<Pair>,
    report: Report,
}

impl DeviceDetector {
    pub(crate) fn new(own: GpuDevice, config: Config) -> Result<Self, Error> {
        let settings = config.settings;
        let interactions = searched_table(&settings, settings.is_framed());
        let known = choice::known(&config.calibrations, &own.adapter);
        let most_pairs = DeviceLimits::of(&own.device).bytes() / size_of::<Pair>() as u64;
        let defaults = GpuSettings::default();
        let gpu = GpuSettings {
            pair_capacity: most_pairs.min(defaults.pair_capacity.into()) as u32,
            algorithm: settings.algorithm,
            crossover: known.crossover,
            radix_from: known.radix_from,
            raster_ratio: raster_ratio(config.raster_ratio)?,
            tau: config.tau.unwrap_or(GpuSettings::TAU),
            interactions: interactions.clone(),
            space: searched_space(&settings.space),
            timed: true,
            ..defaults
        };
        let report = Report {
            spheres: 0,
            pairs: 0,
            backend: Backend::Gpu,
            adapter: Some(own.adapter.name.clone()),
            algorithm: settings.algorithm,
            reason: String::new(),
            cost: None,
            candidates: None,
            phases: Vec::new(),
        };
        let mut session = GpuSession::new(own, gpu)?;
        let chooses = settings.skin == Skin::Auto && settings.keeps_candidates();
        let course = chooses.then(Course::default);
        if let Some(timeout) = config.timeout {
            session.set_timeout(timeout);
        }
        let team = Arc::new(Team::new(settings.threads)?);
        let (places, canonical, lists, found, pairs) = Default::default();
        let mut device = Device { search: Search::new(session), interactions };
        if let Skin::Fixed(distance) = settings.skin {
            device.search.session.set_skin(Some(distance as f32))?;
        }
        Ok(Self {
            settings,
            known,
            device,
            framed: None,
            team,
            places,
            course,
            canonical,
            lists,
            found,
            pairs,
            report,
        })
    }

    pub(crate) fn pairs(&mut self, query: Query<'_>) -> Result<&[Pair], Error> {
        self.list(&query, self.settings.order)?;
        Ok(&self.pairs)
    }

    pub(crate) fn neighbors(&mut self, query: Query<'_>) -> Result<Neighbors<'_>, Error> {
        self.list(&query, Order::Canonical)?;
        let start = Instant::now();
        let neighbors = self.lists.of_query(&self.pairs, &query)?;
        self.report.phases.push(Phase { name: "neighbors", time: start.elapsed() });
        Ok(neighbors)
    }

    pub(crate) fn count(&mut self, query: Query<'_>) -> Result<u64, Error> {
        let found = self.search(&query, |search, given| search.count(given))?;
        self.report.pairs = found;
        Ok(found)
    }

    pub(crate) fn stream(
        &mut self,
        query: Query<'_>,
        chunk: usize,
        mut consume: impl FnMut(&[Pair]) -> ControlFlow<()>,
    ) -> Result<u64, Error> {
        let mut canonical = std::mem::take(&mut self.canonical);
        let mut ordered = std::mem::take(&mut self.pairs);
        let in_order = self.settings.order == Order::Canonical;
        let most = in_order.then_some(self.settings.max_pairs);
        let (mut handed, mut refused) = (0, None);
        let team = self.team.clone();
        let result = self.search(&query, |search, given| {
            search.parts(given, most, |pairs| {
                if in_order {
                    refused = order(&team, (&mut canonical, pairs), query.len(), &mut ordered).err();
                    std::mem::swap(pairs, &mut ordered);
                }
                if refused.is_some() {
                    return ControlFlow::Break(());
                }
                number_second(pairs, query.split());
                for part in pairs.chunks(chunk.max(1)) {
                    handed += part.len() as u64;
                    consume(part)?;
                }
                ControlFlow::Continue(())
            })
        });
        (self.canonical, self.pairs) = (canonical, ordered);
        self.report.pairs = handed;
        result.and(refused.map_or(Ok(handed), Err))
    }

    pub(crate) fn report(&self) -> &Report {
        &self.report
    }

    pub(crate) fn memory_for(&self, spheres: u64) -> u64 {
        let session = &self.device.search.session;
        // More are searched in slabs. What cannot be held at all is refused when it is tried.
        let keeps = self.course.is_some() || matches!(self.settings.skin, Skin::Fixed(_));
        let memory = |n| if keeps { session.memory_with_candidates(n) } else { session.memory_for(n) };
        let at_once = u32::try_from(spheres.min(session.most_spheres())).ok();
        at_once.and_then(|n| memory(n).ok()).unwrap_or(u64::MAX)
    }

    pub(crate) fn into_pairs(self) -> Vec<Pair> {
        self.pairs
    }

    /// The pairs of the last list.
    pub(crate) fn last_pairs(&self) -> &[Pair] {
        &self.pairs
    }

    pub(crate) fn settings(&self) -> &Settings {
        &self.settings
    }

    pub(crate) fn team(&self) -> &Team {
        &self.team
    }

    pub(crate) fn phases_mut(&mut self) -> &mut Vec<Phase> {
        &mut self.report.phases
    }

    /// Finds the pairs, in this order; [`last_pairs`](Self::last_pairs) has them.
    pub(crate) fn list(&mut self, query: &Query<'_>, by: Order) -> Result<(), Error> {
        let limit = self.settings.max_pairs;
        let mut found = std::mem::take(&mut self.found);
        self.search(query, |search, given| search.list(given, limit, &mut found))?;
        self.report.pairs = found.len() as u64;
        let start = Instant::now();
        if by == Order::Canonical {
            order(&self.team, (&mut self.canonical, &found), query.len(), &mut self.pairs)?;
            self.report.phases.push(Phase { name: "order", time: start.elapsed() });
        } else {
            std::mem::swap(&mut found, &mut self.pairs);
        }
        self.found = found;
        number_second(&mut self.pairs, query.split());
        Ok(())
    }

    /// Checks and chooses, has `work` search, and reports.
    fn search<R>(
        &mut self,
        query: &Query<'_>,
        work: impl FnOnce(&mut Search, &Given<'_>) -> Result<R, Error>,
    ) -> Result<R, Error> {
        let Self { settings, known, device, framed, course, team, places, report, .. } = self;
        report.begin(query.len());
        let (placed, survey) = team.pass(query.len(), |threads| {
            let placed = places.place(query, (settings, false), threads, &mut report.phases)?;
            let start = Instant::now();
            let table = settings.interactions.as_ref().filter(|_| placed.frame.is_none());
            let survey = Survey::new(placed.spheres, table, threads)
                .or_else(|error| check_valid(query, threads).and(Err(error)))?;
            report.phases.push(Phase { name: "choice", time: start.elapsed() });
            Ok((placed, survey))
        })?;
        let asked_for = settings.algorithm;
        let classes = survey.occupied().count();
        // Below 2³² by the check.
        let (spheres, split) = (query.len() as u32, placed.split.map(|split| split as u32));
        let (algorithm, reason) =
            choice::algorithm(asked_for, (spheres, split, classes), (known.crossover, known.how));
        log::debug!("{reason}");
        (report.algorithm, report.reason) = (algorithm, reason);
        let device = match placed.frame {
            Some(_) if !settings.is_framed() => Device::framed(framed, device, settings)?,
            _ => device,
        };
        let space = placed.frame.map_or(settings.space, Frame::space);
        let Device { search, interactions } = device;
        search.session.set_space(space)?;
        if let Skin::Fixed(distance) = settings.skin {
            let distance = distance * placed.frame.map_or(1.0, Frame::scale);
            search.session.change_skin(Some(distance as f32).filter(|skin| SKINS.contains(skin)))?;
        }
        let given = Given {
            spheres: placed.spheres.without_groups(),
            split,
            interactions: interactions.as_ref(),
            space,
            algorithm,
            refinement: placed.refinement.as_ref(),
        };
        let mut course = course.as_mut().filter(|_| split.is_none());
        if let Some(course) = course.as_deref_mut().filter(|_| search.is_bound_at_once(&given)) {
            let skin = match choice::may_keep(asked_for, algorithm, spheres, &known.skin) {
                Ok(()) => course.next(&given, &known.skin.into())?,
                Err(why) => {
                    log::debug!("no candidates: {why}");
                    course.restart();
                    None
                }
            };
            search.session.change_skin(skin)?;
        }
        let result = work(search, &given)?;
        conclude(report, search);
        if let Some(course) = course {
            course.note(query.len(), report.candidates, search.session.went());
        }
        Ok(result)
    }
}

/// A search on a device, and the table with which it searches.
#[derive(Debug)]
struct Device {
    search: Search,
    interactions: Option<Interactions>,
}

impl Device {
    /// The search in frames, made beside another one at the first call that needs it.
    fn framed<'d>(
        framed: &'d mut Option<Box<Self>>,
        beside: &Self,
        settings: &Settings,
    ) -> Result<&'d mut Self, Error> {
        match framed {
            Some(framed) => Ok(framed),
            none => {
                let interactions = searched_table(settings, true);
                let session = beside.search.session.beside(interactions.clone())?;
                Ok(none.insert(Box::new(Self { search: Search::new(session), interactions })))
            }
        }
    }
}

/// The table with which a device searches. In a frame spheres are as large as the reach of their species: they are
/// candidates if they touch and their species ever pair.
fn searched_table(settings: &Settings, is_framed: bool) -> Option<Interactions> {
    settings.interactions.as_ref().map(|table| if is_framed { table.touching() } else { table.clone() })
}

/// A space as a device searches it, which repeats along the same axes as that of every frame.
fn searched_space(space: &Space) -> Space {
    let lengths = match space.shear() {
        None => space.lengths_f32(),
        Some(shear) => [0, 1, 2].map(|axis| (axis < shear.rank()).then_some(1.0)),
    };
    let in_range = |length: f32| f64::from(length.clamp(f32::MIN_POSITIVE, f32::MAX));
    Space::periodic(lengths.map(|length| length.map(in_range))).unwrap_or_default()
}

/// Has pairs of two sets name the second sphere by its index in the second set.
fn number_second(pairs: &mut [Pair], split: Option<usize>) {
    if let Some(split) = split {
        pairs.iter_mut().for_each(|pair| pair.j -= split as u32);
    }
}

/// Writes pairs in canonical order.
fn order(
    team: &Team,
    (canonical, pairs): (&mut Canonical, &[Pair]),
    spheres: usize,
    ordered: &mut Vec<Pair>,
) -> Result<(), Error> {
    team.pass(pairs.len(), |threads| canonical.order(threads, &parts(pairs), spheres, ordered))
}

/// Says what a search did.
fn conclude(report: &mut Report, search: &Search) {
    let session = &search.session;
    report.cost = session.cost();
    let ran = session.algorithm();
    if ran != report.algorithm {
        let instead = choice::one_level(ran, report.algorithm);
        log::info!("{instead}");
        report.algorithm = ran;
        report.reason += &format!("; {instead}");
    }
    if search.slabs != 1 {
        report.reason += &format!("; in {} slabs: the device cannot bind all spheres at once", search.slabs);
    }
    report.candidates = session.kept();
    if let Some(Kept { count, age, rebuilt, .. }) = report.candidates {
        report.reason += &match rebuilt {
            None => format!("; {count} candidates of {age} calls ago"),
            Some(why) => format!("; {count} candidates were found: {why}"),
        };
    }
    report.phases.extend_from_slice(&search.timings);
}

/// The raster ratio that was `asked` for, as near as the GPU comes to it.
fn raster_ratio(asked: Option<f32>) -> Result<f32, Error> {
    let ratio = asked.unwrap_or(GpuSettings::RASTER_RATIO);
    if Config::RASTER_RATIOS.contains(&ratio) {
        return Ok(ratio.max(GpuSettings::MIN_RASTER_RATIO));
    }
    let range = "choose between 0.5 and 16";
    Err(Error::Setting { name: "raster_ratio", value: ratio.to_string(), range })
}

fn parts(pairs: &[Pair]) -> Vec<&[Pair]> {
    pairs.chunks(pairs.len().div_ceil(PARTS).max(1)).collect()
}

#[cfg(test)]
mod tests;
