use std::ops::ControlFlow;
use std::time::Instant;

use lazygrid_host::{Canonical, Kept, Lists, Neighbors, Order, Phase, Refinement, Settings, Skin, Survey};
use lazygrid_kernels::{
    InputError, Interactions, MAX_SPHERES, Pair, Shear, Space, Sphere, Spheres, make_room,
};

use super::asked::Asked;
use super::course::Course;
use super::device_search::{Given, Search};
use super::plan::DeviceLimits;
use super::two_sets::TwoSets;
use super::{GpuDevice, GpuSession, GpuSettings};
use crate::choice::{self, Known};
use crate::{Backend, Config, Error, Report};

/// Parts in which the threads that order a list share it out.
const PARTS: usize = 128;

/// The GPU side of a `Detector`: checks and chooses like the CPU path, works in a session, and orders on the host.
#[derive(Debug)]
pub(crate) struct DeviceDetector {
    settings: Settings,
    /// The space and the table with which the device searches.
    searched: (Space, Option<Interactions>),
    known: Known,
    one: Search,
    two: Option<Box<TwoSets>>,
    /// Where it is for the detector to choose a skin.
    course: Option<Course>,
    canonical: Canonical,
    lists: Lists,
    /// The spheres of a sheared space, as they are searched.
    straight: Vec<Sphere>,
    /// As they came; its memory serves the next call.
    found: Vec<Pair>,
    pairs: Vec<Pair>,
    report: Report,
}

impl DeviceDetector {
    pub(crate) fn new(own: GpuDevice, config: Config) -> Result<Self, Error> {
        let settings = config.settings;
        let searched = searched(&settings);
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
            interactions: searched.1.clone(),
            space: searched.0,
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
        if let Skin::Fixed(distance) = settings.skin {
            let scale = settings.space.shear().map_or(1.0, |_| Shear::SCALE);
            session.set_skin(Some(distance * scale))?;
        }
        let chooses = settings.skin == Skin::Auto && settings.keeps_candidates();
        let course = chooses.then(Course::default);
        if let Some(timeout) = config.timeout {
            session.set_timeout(timeout);
        }
        let (one, two) = (Search::new(session), None);
        let (canonical, lists, straight, found, pairs) = Default::default();
        Ok(Self {
            settings,
            searched,
            known,
            one,
            two,
            course,
            canonical,
            lists,
            straight,
            found,
            pairs,
            report,
        })
    }

    pub(crate) fn pairs(&mut self, spheres: Spheres<'_>) -> Result<&[Pair], Error> {
        self.list(Asked::One(spheres), self.settings.order)?;
        Ok(&self.pairs)
    }

    pub(crate) fn between(&mut self, a: Spheres<'_>, b: Spheres<'_>) -> Result<&[Pair], Error> {
        self.list(Asked::Two(a, b), self.settings.order)?;
        Ok(&self.pairs)
    }

    pub(crate) fn neighbors(&mut self, spheres: Spheres<'_>) -> Result<Neighbors<'_>, Error> {
        self.neighbors_of(Asked::One(spheres))
    }

    pub(crate) fn neighbors_between(
        &mut self,
        a: Spheres<'_>,
        b: Spheres<'_>,
    ) -> Result<Neighbors<'_>, Error> {
        self.neighbors_of(Asked::Two(a, b))
    }

    fn neighbors_of(&mut self, asked: Asked<'_>) -> Result<Neighbors<'_>, Error> {
        self.list(asked, Order::Canonical)?;
        let start = Instant::now();
        let neighbors = match asked {
            Asked::One(all) => self.lists.fill(&self.pairs, all.len())?,
            Asked::Two(a, _) => self.lists.fill_forward(&self.pairs, a.len())?,
        };
        self.report.phases.push(Phase { name: "neighbors", time: start.elapsed() });
        Ok(neighbors)
    }

    pub(crate) fn count(&mut self, spheres: Spheres<'_>) -> Result<u64, Error> {
        self.count_of(Asked::One(spheres))
    }

    pub(crate) fn count_between(&mut self, a: Spheres<'_>, b: Spheres<'_>) -> Result<u64, Error> {
        self.count_of(Asked::Two(a, b))
    }

    fn count_of(&mut self, asked: Asked<'_>) -> Result<u64, Error> {
        let found = self.search(asked, |search, given| search.count(given))?;
        self.report.pairs = found;
        Ok(found)
    }

    pub(crate) fn stream(
        &mut self,
        spheres: Spheres<'_>,
        chunk: usize,
        consume: impl FnMut(&[Pair]) -> ControlFlow<()>,
    ) -> Result<u64, Error> {
        self.stream_of(Asked::One(spheres), chunk, consume)
    }

    pub(crate) fn stream_between(
        &mut self,
        (a, b): (Spheres<'_>, Spheres<'_>),
        chunk: usize,
        consume: impl FnMut(&[Pair]) -> ControlFlow<()>,
    ) -> Result<u64, Error> {
        self.stream_of(Asked::Two(a, b), chunk, consume)
    }

    fn stream_of(
        &mut self,
        asked: Asked<'_>,
        chunk: usize,
        mut consume: impl FnMut(&[Pair]) -> ControlFlow<()>,
    ) -> Result<u64, Error> {
        let mut canonical = std::mem::take(&mut self.canonical);
        let mut ordered = std::mem::take(&mut self.pairs);
        let in_order = self.settings.order == Order::Canonical;
        let most = in_order.then_some(self.settings.max_pairs);
        let (mut handed, mut refused) = (0, None);
        let result = self.search(asked, |search, given| {
            search.parts(given, most, |pairs| {
                if in_order {
                    refused = canonical.order(&parts(pairs), asked.len(), &mut ordered).err();
                    std::mem::swap(pairs, &mut ordered);
                }
                if refused.is_some() {
                    return ControlFlow::Break(());
                }
                from_first(pairs, asked.first());
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
        let session = &self.one.session;
        // More are searched in slabs. What cannot be held at all is refused when it is tried.
        let keeps = self.course.is_some() || matches!(self.settings.skin, Skin::Fixed(_));
        let memory = |n| if keeps { session.memory_with_candidates(n) } else { session.memory_for(n) };
        let at_once = u32::try_from(spheres.min(session.most_spheres())).ok();
        at_once.and_then(|n| memory(n).ok()).unwrap_or(u64::MAX)
    }

    pub(crate) fn into_pairs(self) -> Vec<Pair> {
        self.pairs
    }

    fn list(&mut self, asked: Asked<'_>, order: Order) -> Result<(), Error> {
        let limit = self.settings.max_pairs;
        let mut found = std::mem::take(&mut self.found);
        self.search(asked, |search, given| search.list(given, limit, &mut found))?;
        self.report.pairs = found.len() as u64;
        let start = Instant::now();
        if order == Order::Canonical {
            self.canonical.order(&parts(&found), asked.len(), &mut self.pairs)?;
            self.report.phases.push(Phase { name: "order", time: start.elapsed() });
        } else {
            std::mem::swap(&mut found, &mut self.pairs);
        }
        self.found = found;
        from_first(&mut self.pairs, asked.first());
        Ok(())
    }

    /// Checks and chooses, has `work` search, and reports.
    fn search<R>(
        &mut self,
        asked: Asked<'_>,
        work: impl FnOnce(&mut Search, &Given<'_>) -> Result<R, Error>,
    ) -> Result<R, Error> {
        self.report.phases.clear();
        self.report.spheres = asked.len() as u64;
        self.report.pairs = 0;
        self.report.cost = None;
        self.report.candidates = None;
        let start = Instant::now();
        let classes = self.check(asked)?;
        self.report.phases.push(Phase { name: "check", time: start.elapsed() });
        // Below 2³² by the check.
        let load = (asked.len() as u32, classes);
        let asked_for = self.settings.algorithm;
        let (algorithm, reason) = choice::algorithm(asked_for, load, (self.known.crossover, self.known.how));
        log::debug!("{reason}");
        self.report.algorithm = algorithm;
        self.report.reason = reason;
        let Settings { space, interactions, .. } = &self.settings;
        let (first, second) = asked.parts();
        let refinement = Refinement::new(first, second, interactions.as_ref(), space)?;
        if let Some(refinement) = refinement.as_ref().filter(|refinement| refinement.is_sheared()) {
            let start = Instant::now();
            self.straight.clear();
            make_room(&mut self.straight, asked.len(), "straight spheres")?;
            self.straight.extend((0..asked.len()).map(|k| refinement.searched(k)));
            self.report.phases.push(Phase { name: "copy", time: start.elapsed() });
        }
        let is_sheared = space.shear().is_some();
        let (space, interactions) = (self.searched.0, self.searched.1.as_ref());
        let refinement = refinement.as_ref();
        match asked.searched(is_sheared.then_some(&self.straight))? {
            Asked::One(spheres) => {
                let given = Given { spheres, interactions, space, algorithm, refinement };
                let course = self.course.as_mut().filter(|_| self.one.is_bound_at_once(&given));
                if let Some(course) = course {
                    let skin = match choice::may_keep(asked_for, algorithm, load.0, &self.known.skin) {
                        Ok(()) => course.next(&given, &self.known.skin.into())?,
                        Err(why) => {
                            log::debug!("no candidates: {why}");
                            course.restart();
                            None
                        }
                    };
                    self.one.session.change_skin(skin)?;
                }
                let result = work(&mut self.one, &given)?;
                conclude(&mut self.report, &self.one);
                if let Some(course) = &mut self.course {
                    course.note(spheres.len(), self.report.candidates, self.one.session.went());
                }
                Ok(result)
            }
            Asked::Two(a, b) => {
                let two = match &mut self.two {
                    Some(two) => two,
                    none => none.insert(Box::new(TwoSets::new(&self.one.session, interactions)?)),
                };
                let result = two.search((a, b), (space, algorithm), refinement, work)?;
                conclude(&mut self.report, &two.search);
                Ok(result)
            }
        }
    }

    /// Refuses what is not valid; how many size classes there are.
    fn check(&self, asked: Asked<'_>) -> Result<usize, Error> {
        let survey = |spheres| Survey::new(spheres, self.settings.interactions.as_ref());
        match asked {
            Asked::One(spheres) => Ok(survey(spheres)?.occupied().count()),
            Asked::Two(..) if asked.len() as u64 > MAX_SPHERES => {
                Err(InputError::TooManySpheres { count: asked.len() as u64 }.into())
            }
            Asked::Two(a, b) => {
                let a = survey(a)?;
                let b = survey(b).map_err(|error| match error {
                    Error::Input(error) => Error::Input(InputError::Second(Box::new(error))),
                    other => other,
                })?;
                let of_a: Vec<usize> = a.occupied().map(|(class, _)| class).collect();
                Ok(of_a.len() + b.occupied().filter(|(class, _)| !of_a.contains(class)).count())
            }
        }
    }
}

/// The space and the table with which a device searches: those of the settings, or where space is sheared that of straight
/// coordinates, in which species pair that ever do, when their spheres, as large as the species reach, touch.
fn searched(settings: &Settings) -> (Space, Option<Interactions>) {
    let Settings { space, interactions, .. } = settings;
    match space.shear() {
        None => (*space, interactions.clone()),
        Some(shear) => (shear.straight(), interactions.as_ref().map(Interactions::touching)),
    }
}

/// Has pairs of two sets name the second sphere by its index in the second set.
fn from_first(pairs: &mut [Pair], first: usize) {
    if first > 0 {
        pairs.iter_mut().for_each(|pair| pair.j -= first as u32);
    }
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
