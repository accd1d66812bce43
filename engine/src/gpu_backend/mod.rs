mod auto_backend;
mod frequent_species;
mod searched_species;
mod skin_controller;
mod slab_search;
mod slabs;

#[cfg(test)]
mod tests;

use std::sync::Arc;
use std::time::Instant;

use lazygrid_host::{
    CandidateListStats, InputStats, PhaseTime, Preparation, QueryBuffers, SKIN_RANGE, SearchBackend,
    SearchFrame, Settings, Skin, SpeciesGroups, Team, Work, check_valid,
};
use lazygrid_kernels::{Interactions, Pair, Query, Space};

use self::frequent_species::FrequentSpecies;
use self::searched_species::SearchedSpecies;
use self::skin_controller::SkinController;
use self::slab_search::{SearchRequest, SlabPairSource, SlabSearch, has_empty_set};
use crate::backend::DetectorBackend;
use crate::config::Config;
use crate::gpu::choice::{self, CallSize};
use crate::gpu::config::GpuConfig;
use crate::gpu::costs::{AdapterProfile, profile_of};
use crate::gpu::device::GpuDevice;
use crate::gpu::plan::{DeviceLimits, tests_within_limit};
use crate::gpu::session::GpuSession;
use crate::report::Report;
use crate::{Backend, Error};

pub(crate) use self::auto_backend::AutoBackend;

#[derive(Debug)]
pub(crate) struct GpuBackend {
    settings: Settings,
    pub(super) profile: AdapterProfile,
    device: Device,
    framed: Option<Box<Device>>,
    species: DeviceSpecies,
    team: Arc<Team>,
    buffers: QueryBuffers,
    /// `Some` only with [`Skin::Auto`].
    skin_controller: Option<SkinController>,
    report: Report,
}

impl GpuBackend {
    pub(crate) fn new(gpu: GpuDevice, config: Config) -> Result<Self, Error> {
        let team = Arc::new(Team::new(config.settings.threads)?);
        Self::on_team(gpu, config, team)
    }

    pub(crate) fn on_team(gpu: GpuDevice, config: Config, team: Arc<Team>) -> Result<Self, Error> {
        let settings = config.settings;
        let interactions = searched_table(&settings, settings.is_framed())?;
        let profile = profile_of(&config.calibrations, &gpu.adapter);
        let most_pairs = DeviceLimits::from_device(&gpu.device).bytes() / size_of::<Pair>() as u64;
        let defaults = GpuConfig::default();
        let pair_capacity = most_pairs.min(defaults.pair_capacity.into()) as u32;
        let gpu_config = defaults
            .pair_capacity(pair_capacity)
            .algorithm(settings.algorithm)
            .crossover(profile.crossover)
            .radix_sort_from(profile.radix_sort_from)
            .max_tests_per_dispatch(tests_within_limit(profile.tests_per_second))
            .cell_ratio(cell_ratio(config.cell_ratio)?)
            .tau(config.tau.unwrap_or(GpuConfig::TAU))
            .interactions(interactions.clone())
            .space(searched_space(&settings.space))
            .timestamps(true);
        let report = Report {
            spheres: 0,
            pairs: 0,
            backend: Backend::Gpu,
            adapter: Some(gpu.adapter.name.clone()),
            algorithm: settings.algorithm,
            reason: String::new(),
            cost: None,
            candidates: None,
            phases: Vec::new(),
        };
        settings.check_skin()?;
        let mut session = GpuSession::new(gpu, gpu_config)?;
        let chooses = settings.skin == Skin::Auto && settings.keeps_candidates();
        let skin_controller = chooses.then(SkinController::default);
        if let Some(timeout) = config.timeout {
            session.set_timeout(timeout);
        }
        let mut device = Device { search: SlabSearch::new(session), interactions };
        if let Skin::Fixed(distance) = settings.skin {
            device.search.session.set_skin(Some(distance as f32))?;
        }
        Ok(Self {
            settings,
            profile,
            device,
            framed: None,
            species: DeviceSpecies::default(),
            team,
            buffers: QueryBuffers::default(),
            skin_controller,
            report,
        })
    }
}

impl DetectorBackend for GpuBackend {
    fn report(&self) -> Report {
        self.report.clone()
    }

    fn memory_for(&self, spheres: u64, is_f64: bool) -> u64 {
        let session = &self.device.search.session;
        // More spheres are searched in slabs.
        let may_use_candidates =
            self.skin_controller.is_some() || matches!(self.settings.skin, Skin::Fixed(_));
        let memory =
            |n| if may_use_candidates { session.memory_with_candidates(n) } else { session.memory_for(n) };
        let at_once = u32::try_from(spheres.min(session.most_spheres())).ok();
        let on_device = at_once.and_then(|n| memory(n).ok()).unwrap_or(u64::MAX);
        on_device.saturating_add(QueryBuffers::memory_for(spheres, is_f64, &self.settings, false))
    }
}

impl SearchBackend for GpuBackend {
    fn settings(&self) -> &Settings {
        &self.settings
    }

    fn team(&self) -> &Arc<Team> {
        &self.team
    }

    fn report_mut(&mut self) -> (&mut u64, &mut Vec<PhaseTime>) {
        (&mut self.report.pairs, &mut self.report.phases)
    }

    fn search(&mut self, query: &Query<'_>, work: Work<'_>) -> Result<(), Error> {
        let Self { settings, profile, device, framed, species, skin_controller, team, buffers, report } =
            self;
        let settings = &*settings;
        report.begin(query.len());
        let (prepared, stats) = team.pass(query.len(), |threads| {
            let preparation =
                Preparation { settings, wraps: false, has_same_species: false, uses_only_radii: true };
            let prepared = buffers.prepare(query, preparation, threads, &mut report.phases)?;
            let start = Instant::now();
            let table = settings.interactions.as_ref().filter(|_| prepared.frame.is_none());
            let stats = InputStats::new(prepared.spheres, table, threads)
                .or_else(|error| check_valid(query, threads).and(Err(error)))?;
            report.phases.push(PhaseTime::new("choice", start.elapsed()));
            Ok((prepared, stats))
        })?;
        let requested = settings.algorithm;
        let classes = stats.occupied().count();
        let (spheres, split) = (query.len() as u32, prepared.split.map(|split| split as u32));
        let (algorithm, reason) = choice::algorithm(
            requested,
            CallSize { spheres, split, classes },
            profile.crossover,
            profile.how,
        );
        log::debug!("{reason}");
        (report.algorithm, report.reason) = (algorithm, reason);
        let present = prepared.present_species().filter(|_| !has_empty_set(split, spheres));
        if let (None, Some(present)) = (prepared.frame, present) {
            device.search_species(species, query, present, settings)?;
        }
        let device = match prepared.frame {
            Some(_) if !settings.is_framed() => Device::framed(framed, device, settings)?,
            _ => device,
        };
        let space = prepared.frame.map_or(settings.space, SearchFrame::space);
        let Device { search, interactions } = device;
        search.session.set_space(space)?;
        if let Skin::Fixed(distance) = settings.skin {
            let distance = distance * prepared.frame.map_or(1.0, SearchFrame::scale);
            search.session.update_skin(Some(distance as f32).filter(|skin| SKIN_RANGE.contains(skin)))?;
        }
        let filter = prepared.candidate_filter();
        let request = SearchRequest {
            spheres: prepared.spheres.without_groups(),
            split,
            interactions: interactions.as_ref(),
            space,
            algorithm,
            filter: filter.as_ref().map(|filter| (filter, &**team)),
        };
        let may_use_skin = split.is_none() && search.is_bound_at_once(&request);
        let mut skin_controller = skin_controller.as_mut().filter(|_| may_use_skin);
        if let Some(skin_controller) = skin_controller.as_deref_mut() {
            let skin = match choice::can_use_skin(requested, algorithm, spheres, &profile.skin) {
                Ok(()) => skin_controller.next(&request, &profile.skin)?,
                Err(why) => {
                    log::debug!("no candidates: {why}");
                    *skin_controller = SkinController::default();
                    None
                }
            };
            search.session.update_skin(skin)?;
        }
        search.has_searched = false;
        work(&mut SlabPairSource { search, request: &request })?;
        // Otherwise the session describes an earlier call.
        if search.has_searched {
            complete_report(report, search);
        }
        if let Some(skin_controller) = skin_controller {
            skin_controller.record_call(query.len(), report.candidates, search.session.last_rebuild());
        }
        Ok(())
    }
}

#[derive(Debug, Default)]
struct DeviceSpecies {
    searched: SearchedSpecies,
    frequent_species: FrequentSpecies,
}

#[derive(Debug)]
struct Device {
    search: SlabSearch,
    interactions: Option<Interactions>,
}

impl Device {
    /// Omits absent species if that reduces radii of others, and follows the most frequent one, if memory suffices.
    fn search_species(
        &mut self,
        species: &mut DeviceSpecies,
        query: &Query<'_>,
        present: &SpeciesGroups,
        settings: &Settings,
    ) -> Result<(), Error> {
        let Some(all) = &settings.interactions else { return Ok(()) };
        match self.replace_interactions(species, query, present, all) {
            Err(error) if !species.searched.lacks(present) => {
                log::info!("the searched species stay: {error}");
                species.searched.keep(present);
                Ok(())
            }
            replaced => replaced,
        }
    }

    fn replace_interactions(
        &mut self,
        species: &mut DeviceSpecies,
        query: &Query<'_>,
        present: &SpeciesGroups,
        all: &Interactions,
    ) -> Result<(), Error> {
        let Some(searched) = &self.interactions else { return Ok(()) };
        let DeviceSpecies { searched: searched_species, frequent_species } = species;
        let new = searched_species.next(present, all, searched)?;
        let table = new.as_ref().unwrap_or(searched).clone();
        let new_species = frequent_species.next(query, &table)?;
        if new.is_some() || new_species.is_some() {
            let of_sides = new_species.or(frequent_species.searched());
            self.search.session = self.search.session.with_interactions(Some(table.clone()), of_sides)?;
            if new.is_some() {
                searched_species.record(present, table.species());
            }
            new_species.into_iter().for_each(|species| frequent_species.record(species));
            self.interactions = Some(table);
        }
        Ok(())
    }

    fn framed<'d>(
        framed: &'d mut Option<Box<Self>>,
        unframed: &Self,
        settings: &Settings,
    ) -> Result<&'d mut Self, Error> {
        match framed {
            Some(framed) => Ok(framed),
            none => {
                let interactions = searched_table(settings, true)?;
                let session = unframed.search.session.with_interactions(interactions.clone(), None)?;
                Ok(none.insert(Box::new(Self { search: SlabSearch::new(session), interactions })))
            }
        }
    }
}

/// In a frame, spheres of effective radii are candidates if they touch and their species can pair.
fn searched_table(settings: &Settings, is_framed: bool) -> Result<Option<Interactions>, Error> {
    let Some(table) = &settings.interactions else { return Ok(None) };
    Ok(Some(if is_framed { table.contact_only()? } else { table.clone() }))
}

/// Returns the periodic axes of all calls; each call sets the lengths.
fn searched_space(space: &Space) -> Space {
    let lengths = match space.triclinic_cell() {
        None => space.lengths_f32(),
        Some(cell) => [0, 1, 2].map(|axis| (axis < cell.rank()).then_some(1.0)),
    };
    let in_range = |length: f32| f64::from(length.clamp(f32::MIN_POSITIVE, f32::MAX));
    Space::periodic(lengths.map(|length| length.map(in_range))).unwrap_or_default()
}

fn complete_report(report: &mut Report, search: &SlabSearch) {
    let session = &search.session;
    report.cost = session.cost();
    let ran = session.algorithm();
    if ran != report.algorithm {
        let instead = choice::one_level(ran, report.algorithm);
        log::info!("{instead}");
        report.algorithm = ran;
        report.reason += &format!("; {instead}");
    }
    if let Some(refusal) = session.subgroup_refusal() {
        report.reason += &format!("; without subgroup operations: {refusal}");
    }
    if search.slabs != 1 {
        report.reason += &format!("; in {} slabs: the device cannot bind all spheres at once", search.slabs);
    }
    report.candidates = session.candidate_list_stats();
    if let Some(CandidateListStats { count, age, rebuilt, .. }) = report.candidates {
        report.reason += &match rebuilt {
            None => format!("; {count} candidates of {age} calls ago"),
            Some(why) => format!("; {count} candidates were found: {why}"),
        };
    }
    report.phases.extend_from_slice(&search.timings);
}

fn cell_ratio(requested: Option<f32>) -> Result<f32, Error> {
    let ratio = requested.unwrap_or(GpuConfig::CELL_RATIO);
    if Config::CELL_RATIOS.contains(&ratio) {
        return Ok(ratio.max(GpuConfig::MIN_CELL_RATIO));
    }
    let range = "choose between 0.5 and 16";
    Err(Error::InvalidSetting { name: "cell_ratio", value: ratio.to_string(), range })
}
