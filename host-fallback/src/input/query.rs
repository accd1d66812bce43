//! Prepares a query for a search: checks it, appends the second set to the first, and wraps spheres into a periodic space or
//! maps them to a frame. Both backends start here.

use std::time::Instant;

use lazygrid_kernels::{Interactions, MAX_SPHERES, Query, Space, Sphere, Spheres};

use super::validate::{check_species, check_valid};
use crate::compare::{PairFilter, PairTest};
use crate::executor::Executor;
use crate::frame::{BLOCK_SPHERES, Bounds, SearchFrame};
use crate::memory::{try_collect, try_resize};
use crate::{Error, InputError, PhaseTime, Settings};

/// Spheres per chunk of a copy.
const CHUNK_SPHERES: usize = 1 << 14;

/// Buffers for spheres that cannot be searched in place, and the last frame. They are reused between calls.
#[derive(Debug, Default)]
pub struct QueryBuffers {
    spheres: Vec<Sphere>,
    species: Vec<u32>,
    frame: Option<SearchFrame>,
    /// Half the largest distance of each species, and whether it pairs with any species by contact.
    reaches: Vec<(f64, bool)>,
}

/// A query that is ready for a search.
#[derive(Debug)]
pub struct PreparedQuery<'a> {
    /// The spheres of the first set, followed by those of the second, with their species if both sets have them.
    pub spheres: Spheres<'a>,
    /// The number of spheres of the first set if there are two.
    pub split: Option<usize>,
    /// The frame of the spheres, whose radii are then effective radii; `None` for spheres as given.
    pub frame: Option<&'a SearchFrame>,
    /// The exact filter after the search; `None` if contact decides.
    pub filter: Option<PairFilter<'a>>,
}

impl PreparedQuery<'_> {
    /// The contact test of the query. In a frame spheres have the effective radius of their species.
    pub(crate) fn test<'q>(&'q self, settings: &'q Settings) -> PairTest<'q> {
        let test = match self.frame {
            Some(frame) => PairTest::new(self.spheres, None).in_space(frame.space()),
            None => PairTest::new(self.spheres, settings.interactions.as_ref()).in_space(settings.space),
        };
        test.filtered(self.filter.as_ref(), self.frame)
    }
}

impl QueryBuffers {
    /// Checks a query and prepares its spheres. Validity of spheres is checked only if they need a frame. `wraps` requests
    /// wrapping into an orthogonal periodic space. The time of a copy is added to `phases`.
    ///
    /// # Errors
    /// [`Error::Input`] for too many spheres, species outside the table, exclusions made for other numbers of spheres, and
    /// spheres that are not valid; [`Error::OutOfMemory`].
    pub fn prepare<'a>(
        &'a mut self,
        query: &Query<'a>,
        (settings, wraps): (&'a Settings, bool),
        executor: Executor,
        phases: &mut Vec<PhaseTime>,
    ) -> Result<PreparedQuery<'a>, Error> {
        let Settings { space, interactions, .. } = settings;
        let interactions = interactions.as_ref();
        check_query(query, interactions, executor)?;
        query.check_exclusions()?;
        let split = query.split();
        let is_f64 = query.first().is_f64() || query.second().is_some_and(|set| set.is_f64());
        let is_framed = is_f64 || settings.is_framed();
        let filter = PairFilter::new(*query, is_framed.then_some((space, interactions)));
        let is_wrapped = wraps && space.is_periodic();
        let are_in_place = query.first().is_narrow() && split.is_none();
        if are_in_place && !is_wrapped && !is_framed {
            return Ok(PreparedQuery { spheres: query.first(), split, frame: None, filter });
        }
        let start = Instant::now();
        try_resize(&mut self.spheres, query.len(), "copies of spheres")?;
        if is_framed {
            self.choose_frame(query, (space, !is_f64 && settings.is_narrow()), executor)?;
            self.fill_frame(query, interactions, executor)?;
        } else {
            self.copy(query, is_wrapped.then_some(space), executor);
        }
        let Self { spheres, species, frame, .. } = self;
        let spheres = with_species((spheres, species), query)?;
        PhaseTime::add(phases, "copy", start.elapsed());
        let frame = frame.as_ref().filter(|_| is_framed);
        Ok(PreparedQuery { spheres, split, frame, filter })
    }

    /// Chooses the frame of a call.
    ///
    /// # Errors
    /// [`Error::Input`] for spheres that are not valid.
    fn choose_frame(
        &mut self,
        query: &Query<'_>,
        (space, is_narrow): (&Space, bool),
        executor: Executor,
    ) -> Result<(), Error> {
        self.frame = Some(match space.triclinic_cell().filter(|_| is_narrow) {
            Some(shear) => {
                let last = self.frame.take().filter(SearchFrame::is_narrow);
                last.unwrap_or_else(|| SearchFrame::narrow(shear))
            }
            None => {
                let bounds = Bounds::of(query, executor);
                if !bounds.are_valid {
                    check_valid(query, executor)?;
                }
                SearchFrame::of(&bounds, space, self.frame.take())
            }
        });
        Ok(())
    }

    /// Maps the spheres to the frame.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    fn fill_frame(
        &mut self,
        query: &Query<'_>,
        table: Option<&Interactions>,
        executor: Executor,
    ) -> Result<(), Error> {
        let Self { spheres, frame, reaches, .. } = self;
        let Some(frame) = frame else { return Ok(()) };
        if let Some(table) = table.filter(|table| table.species() as usize != reaches.len()) {
            *reaches =
                try_collect((0..table.species()).map(|of| table.largest_half(of)), "reaches of species")?;
        }
        let reaches = table.map(|_| &**reaches);
        let (first, second) = spheres.split_at_mut(query.first().len());
        fill((query.first(), first), frame, reaches, executor);
        if let Some(set) = query.second() {
            fill((set, second), frame, reaches, executor);
        }
        Ok(())
    }

    /// Copies both sets, wrapped into `space` if one is given.
    fn copy(&mut self, query: &Query<'_>, space: Option<&Space>, executor: Executor) {
        let (first, second) = self.spheres.split_at_mut(query.first().len());
        copy(query.first(), space, first, executor);
        if let Some(set) = query.second() {
            copy(set, space, second, executor);
        }
    }
}

/// The copied spheres with their species.
fn with_species<'a>(
    (spheres, species): (&'a [Sphere], &'a mut Vec<u32>),
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

/// Refuses more spheres than indices, and species outside the table.
fn check_query(
    query: &Query<'_>,
    table: Option<&Interactions>,
    executor: Executor,
) -> Result<(), InputError> {
    if query.len() as u64 > MAX_SPHERES {
        return Err(InputError::TooManySpheres { count: query.len() as u64 });
    }
    query.check_each(|spheres| check_species(spheres, table, executor))
}

/// Checks a query as a search does.
///
/// # Errors
/// The [`InputError`] with which a search would refuse the query.
pub fn check(query: &Query<'_>, table: Option<&Interactions>, executor: Executor) -> Result<(), InputError> {
    check_query(query, table, executor)?;
    query.check_exclusions()?;
    check_valid(query, executor)
}

/// Copies spheres, wrapped into `space` if one is given.
fn copy(spheres: Spheres<'_>, space: Option<&Space>, targets: &mut [Sphere], executor: Executor) {
    executor.for_each_chunk(targets, CHUNK_SPHERES, |piece, targets| {
        for (target, k) in targets.iter_mut().zip(piece * CHUNK_SPHERES..) {
            let Sphere { center, radius } = spheres.get(k);
            *target = Sphere { center: space.map_or(center, |space| space.wrap(center)), radius };
        }
    });
}

/// Maps spheres to a frame, with effective radii by species.
fn fill(
    (spheres, targets): (Spheres<'_>, &mut [Sphere]),
    frame: &SearchFrame,
    reaches: Option<&[(f64, bool)]>,
    executor: Executor,
) {
    let species = spheres.species().zip(reaches);
    executor.for_each_chunk(targets, CHUNK_SPHERES, |piece, targets| {
        let mut block = [[0.0; 4]; BLOCK_SPHERES];
        for (targets, from) in
            targets.chunks_mut(BLOCK_SPHERES).zip((piece * CHUNK_SPHERES..).step_by(BLOCK_SPHERES))
        {
            let block = &mut block[..targets.len()];
            spheres.read(from, block);
            if let Some((species, reaches)) = species {
                for (numbers, &species) in block.iter_mut().zip(&species[from..]) {
                    let (half, touches) = reaches[species as usize];
                    let radius = numbers[3];
                    // The validity check finds other radii.
                    if (0.0..f64::INFINITY).contains(&radius) {
                        numbers[3] = if touches { half.max(radius) } else { half };
                    }
                }
            }
            frame.spheres(block, targets);
        }
    });
}
