//! Prepares a query for both backends: checks it, appends the second set to the first, and wraps spheres into a
//! periodic space or maps them to a frame.

use std::time::Instant;

use lazygrid_kernels::{Interactions, MAX_SPHERES, Query, Space, SpeciesRadius, Sphere, Spheres};

use super::copy::{copy, map_to_frame};
use super::input_spheres::InputSpheres;
use super::species_groups::SpeciesGroups;
use super::validate::{check_species, check_valid};
use crate::compare::{CandidateFilter, PairFilter, PairTest};
use crate::executor::Executor;
use crate::frame::{Bounds, RowsByIndex, SearchFrame};
use crate::memory::{try_resize, with_growth};
use crate::{Error, InputError, PhaseTime, Settings, Simd};

/// Copies of spheres that cannot be searched in place, the last frame, and the species groups.
#[derive(Debug, Default)]
pub struct QueryBuffers {
    spheres: Vec<Sphere>,
    species: Vec<u32>,
    frame: Option<SearchFrame>,
    groups: SpeciesGroups,
}

#[derive(Debug)]
pub struct PreparedQuery<'a> {
    /// Both sets, with species if both have them.
    pub spheres: Spheres<'a>,
    pub split: Option<usize>,
    /// Frame of the spheres, whose radii are then effective.
    pub frame: Option<&'a SearchFrame>,
    /// Spheres not yet mapped to the frame.
    pub(crate) input: Option<InputSpheres<'a>>,
    /// `None` if contact alone decides.
    pub filter: Option<PairFilter<'a>>,
    /// `None` without interactions.
    pub(crate) groups: Option<&'a SpeciesGroups>,
}

#[derive(Clone, Copy, Debug)]
pub struct Preparation<'a> {
    pub settings: &'a Settings,
    /// Requests wrapping into an orthogonal periodic space.
    pub wraps: bool,
    /// `true` if the species of the spheres are those of the last query.
    pub has_same_species: bool,
    pub uses_only_radii: bool,
}

impl PreparedQuery<'_> {
    /// Returns `None` without interactions.
    pub fn present_species(&self) -> Option<&SpeciesGroups> {
        self.groups
    }

    /// Returns the filter of listed candidates; `None` if none is needed.
    pub fn candidate_filter(&self) -> Option<CandidateFilter<'_>> {
        self.filter.as_ref().map(|exact| CandidateFilter::new(exact, self.frame, self.spheres))
    }

    pub(crate) fn test<'q>(&'q self, settings: &'q Settings) -> PairTest<'q> {
        let table = settings.interactions.as_ref().zip(self.groups.map(SpeciesGroups::species_radii));
        let test = match self.frame {
            Some(frame) => PairTest::new(self.spheres, None).in_space(frame.space()),
            None => PairTest::with_present_species(self.spheres, table).in_space(settings.space),
        };
        test.filtered(self.filter.as_ref(), self.frame)
    }
}

impl QueryBuffers {
    /// Returns the most bytes of copies of one set. Framed spheres are copied, and, if the search `wraps`, those in an
    /// orthogonal periodic space.
    pub fn memory_for(spheres: u64, is_f64: bool, settings: &Settings, wraps: bool) -> u64 {
        let is_copied = is_f64 || settings.is_framed() || (wraps && settings.space.is_periodic());
        if is_copied { with_growth(spheres.saturating_mul(size_of::<Sphere>() as u64)) } else { 0 }
    }

    pub(crate) fn version(&self) -> u32 {
        self.groups.version()
    }

    /// Checks a query and prepares its spheres. Checks the validity only of spheres that need a frame. Adds the time of
    /// a copy to `phases`.
    ///
    /// # Errors
    /// [`Error::Input`] for too many spheres, unknown species, exclusions of other numbers of spheres, invalid spheres,
    /// and spheres too far apart for their triclinic cell; [`Error::OutOfMemory`].
    pub fn prepare<'a>(
        &'a mut self,
        query: &Query<'a>,
        Preparation { settings, wraps, has_same_species, uses_only_radii }: Preparation<'a>,
        executor: Executor,
        phases: &mut Vec<PhaseTime>,
    ) -> Result<PreparedQuery<'a>, Error> {
        let query = &with_ids(query, settings.interactions.as_ref());
        let (split, space) = (query.split(), &settings.space);
        let (is_framed, filter) = check_and_filter(query, settings, executor)?;
        if let Some(table) = settings.interactions.as_ref().filter(|_| !has_same_species) {
            self.groups.update(query, table, executor)?;
        }
        // Distances between groups are infinite in a triclinic frame.
        let uses_only_radii = uses_only_radii || space.triclinic_cell().is_some();
        let chooses = is_framed && uses_only_radii && !has_same_species;
        if let Some(table) = settings.interactions.as_ref().filter(|_| chooses) {
            self.groups.choose_radii(query, table)?;
        }
        let is_wrapped = wraps && space.is_periodic();
        let are_in_place = query.first().is_read_in_place() && split.is_none();
        if are_in_place && !is_wrapped && !is_framed {
            let groups = settings.interactions.as_ref().map(|_| &self.groups);
            let spheres = query.first();
            return Ok(PreparedQuery { spheres, split, frame: None, input: None, filter, groups });
        }
        let start = Instant::now();
        try_resize(&mut self.spheres, query.len(), "copies of spheres")?;
        if is_framed {
            self.map_to_frame(query, settings, executor)?;
        } else {
            self.copy(query, is_wrapped.then_some(space), settings.simd, executor);
        }
        let Self { spheres, species, frame, groups, .. } = self;
        let spheres = with_species(spheres, species, query)?;
        PhaseTime::add(phases, "copy", start.elapsed());
        let frame = frame.as_ref().filter(|_| is_framed);
        let groups = settings.interactions.as_ref().map(|_| &*groups);
        Ok(PreparedQuery { spheres, split, frame, input: None, filter, groups })
    }

    /// Prepares spheres to test candidates in the last frame. Their species must be those of the last query. Returns
    /// `None` without a frame, for two sets, and for another number type.
    pub(crate) fn prepare_in_place<'a>(
        &'a self,
        query: &Query<'a>,
        settings: &'a Settings,
        executor: Executor,
    ) -> Result<Option<PreparedQuery<'a>>, Error> {
        let Some(frame) = &self.frame else { return Ok(None) };
        let query = &with_ids(query, settings.interactions.as_ref());
        let (is_framed, filter) = check_and_filter(query, settings, executor)?;
        let is_of_kind = frame.is_triclinic_f32() == is_triclinic_f32(query, settings);
        if !is_framed || !is_of_kind || query.split().is_some() {
            return Ok(None);
        }
        let groups = settings.interactions.as_ref().map(|_| &self.groups);
        let spheres = query.first();
        let species_radii = frame_species_radii(&self.groups, settings, frame);
        let input = Some(InputSpheres::new(spheres, species_radii, frame, &settings.space));
        Ok(Some(PreparedQuery { spheres, split: None, frame: Some(frame), input, filter, groups }))
    }

    fn map_to_frame(
        &mut self,
        query: &Query<'_>,
        settings: &Settings,
        executor: Executor,
    ) -> Result<(), Error> {
        let last = self.frame.take();
        let frame = match settings.space.triclinic_cell().filter(|_| is_triclinic_f32(query, settings)) {
            Some(cell) => {
                let last = last.filter(SearchFrame::is_triclinic_f32);
                let frame = last.unwrap_or_else(|| SearchFrame::triclinic_f32(cell));
                let bounds = self.fill(query, &frame, settings, executor)?;
                frame.with_growth_in(&bounds)
            }
            None => self.map_to_wide_frame(last, query, settings, executor)?,
        };
        self.frame = Some(frame);
        Ok(())
    }

    /// Checks the spheres, and maps them. Keeps the `last` frame if it fits, unless it is a frame of `f32`
    /// spheres, which may be too small for radii of `f64` spheres.
    fn map_to_wide_frame(
        &mut self,
        last: Option<SearchFrame>,
        query: &Query<'_>,
        settings: &Settings,
        executor: Executor,
    ) -> Result<SearchFrame, Error> {
        let space = &settings.space;
        let check = |bounds: &Bounds| match bounds.are_valid() {
            true => bounds.check_range(space),
            false => check_valid(query, executor),
        };
        let last = last.filter(|last| !last.is_triclinic_f32());
        let mut checked = None;
        if let Some(last) = last.as_ref().filter(|last| !last.is_trimmed()) {
            let bounds = self.fill(query, last, settings, executor)?;
            check(&bounds)?;
            if last.fits(&bounds, space) {
                return Ok(last.clone().with_growth_in(&bounds));
            }
            checked = Some(bounds);
        }
        let bounds = checked.unwrap_or_else(|| Bounds::from_query(query, executor));
        check(&bounds)?;
        let frame = SearchFrame::new(&bounds, space);
        let trimmed = {
            let get = self.effective_rows(query, settings, &frame);
            let rows = RowsByIndex { count: query.len(), bounds: &bounds, get: &get };
            frame.trimmed(space, &rows, last.as_ref(), executor)
        };
        let frame = trimmed.unwrap_or(frame);
        self.fill(query, &frame, settings, executor)?;
        Ok(frame.with_growth_in(&bounds))
    }

    fn effective_rows(
        &self,
        query: &Query<'_>,
        settings: &Settings,
        frame: &SearchFrame,
    ) -> impl Fn(usize) -> [f64; 4] + Sync {
        let species_radii = frame_species_radii(&self.groups, settings, frame);
        let effective_row = move |set: Spheres<'_>, k| {
            InputSpheres::new(set, species_radii, frame, &settings.space).effective_row(k)
        };
        let first = query.first();
        move |k: usize| match query.second() {
            Some(second) if k >= first.len() => effective_row(second, k - first.len()),
            _ => effective_row(first, k),
        }
    }

    fn fill(
        &mut self,
        query: &Query<'_>,
        frame: &SearchFrame,
        settings: &Settings,
        executor: Executor,
    ) -> Result<Bounds, Error> {
        let Self { spheres, groups, .. } = self;
        let species_radii = frame_species_radii(groups, settings, frame);
        let (first, second) = spheres.split_at_mut(query.first().len());
        let map = |set: Spheres<'_>, targets| {
            let input = InputSpheres::new(set, species_radii, frame, &settings.space);
            map_to_frame(input, targets, settings.simd, executor.for_light_work(set.len()))
        };
        let bounds = map(query.first(), first)?;
        query.second().map_or(Ok(bounds), |set| Ok(bounds.merge(map(set, second)?)))
    }

    fn copy(&mut self, query: &Query<'_>, space: Option<&Space>, simd: Simd, executor: Executor) {
        let (first, second) = self.spheres.split_at_mut(query.first().len());
        copy(query.first(), first, space, simd, executor);
        if let Some(set) = query.second() {
            copy(set, second, space, simd, executor);
        }
    }
}

/// Limits unequal radii to an eighth of the shortest period, because slabs cannot divide a period of less than four
/// radii.
fn frame_species_radii<'g>(
    groups: &'g SpeciesGroups,
    settings: &Settings,
    frame: &SearchFrame,
) -> Option<&'g [SpeciesRadius]> {
    let lengths = frame.space().lengths().into_iter().flatten();
    let shortest = lengths.fold(f64::INFINITY, f64::min);
    let most = shortest / (8.0 * frame.scale());
    settings.interactions.as_ref().map(|_| groups.species_radii_in_frame(most))
}

/// Gives empty sets the required species ids.
fn with_ids<'a>(query: &Query<'a>, table: Option<&Interactions>) -> Query<'a> {
    let complete = |set: Spheres<'a>| match table.filter(|_| set.is_empty()) {
        Some(_) => set.with_species(&[]).unwrap_or(set),
        None => set,
    };
    let sets = match query.second() {
        None => Query::new(complete(query.first())),
        Some(second) => Query::new((complete(query.first()), complete(second))),
    };
    query.exclusions().map_or(sets, |exclusions| sets.without(exclusions))
}

fn with_species<'a>(
    spheres: &'a [Sphere],
    species: &'a mut Vec<u32>,
    query: &Query<'a>,
) -> Result<Spheres<'a>, Error> {
    let all = Spheres::from(spheres);
    let Some(second) = query.second() else {
        return Ok(query.first().species().map_or(Ok(all), |ids| all.with_species(ids))?);
    };
    let (Some(ids), Some(others)) = (query.first().species(), second.species()) else { return Ok(all) };
    try_resize(species, all.len(), "species of spheres")?;
    let (of_first, of_second) = species.split_at_mut(ids.len());
    of_first.copy_from_slice(ids);
    of_second.copy_from_slice(others);
    Ok(all.with_species(species)?)
}

fn is_triclinic_f32(query: &Query<'_>, settings: &Settings) -> bool {
    settings.space.triclinic_cell().is_some() && settings.fits_f32() && !is_f64(query)
}

fn is_f64(query: &Query<'_>) -> bool {
    query.first().is_f64() || query.second().is_some_and(|set| set.is_f64())
}

/// Checks a query except for the validity of its spheres. Returns `true` if they need a frame, and the exact filter.
fn check_and_filter<'a>(
    query: &Query<'a>,
    settings: &'a Settings,
    executor: Executor,
) -> Result<(bool, Option<PairFilter<'a>>), InputError> {
    let Settings { space, interactions, .. } = settings;
    check_query(query, interactions.as_ref(), executor)?;
    let is_framed = is_f64(query) || settings.is_framed();
    Ok((is_framed, PairFilter::new(*query, is_framed.then_some((space, interactions.as_ref())))))
}

fn check_query(
    query: &Query<'_>,
    table: Option<&Interactions>,
    executor: Executor,
) -> Result<(), InputError> {
    if query.len() as u64 > MAX_SPHERES {
        return Err(InputError::TooManySpheres { count: query.len() as u64 });
    }
    query.check_each(|spheres| check_species(spheres, table, executor))?;
    query.check_exclusions()
}

/// # Errors
/// The [`InputError`] of a search.
pub fn check(query: &Query<'_>, table: Option<&Interactions>, executor: Executor) -> Result<(), InputError> {
    let query = &with_ids(query, table);
    check_query(query, table, executor)?;
    check_valid(query, executor)
}
