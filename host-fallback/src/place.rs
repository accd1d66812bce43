//! The spheres of a query as a search takes them: checked, the second set after the first, and in a periodic space wrapped
//! or in a frame. Both backends start here.

use std::time::Instant;

use lazygrid_kernels::{Interactions, MAX_SPHERES, Query, Space, Sphere, Spheres};

use crate::frame::{BLOCK, Bounds, Frame};
use crate::memory::{collect, resize};
use crate::refinement::Refinement;
use crate::survey::{check_species, check_valid};
use crate::threads::Threads;
use crate::{Error, InputError, Phase, Settings};

/// Spheres per piece of a copy.
const PIECE: usize = 1 << 14;

/// Buffers for spheres that cannot be searched where they are, and the last frame, reused from call to call.
#[derive(Debug, Default)]
pub struct Places {
    spheres: Vec<Sphere>,
    species: Vec<u32>,
    frame: Option<Frame>,
    /// Half the largest distance of each species, and whether it ever pairs by touching.
    reaches: Vec<(f64, bool)>,
}

/// A query in place.
#[derive(Debug)]
pub struct Placed<'a> {
    /// The spheres of the first set, followed by those of the second, with their species if both sets have them.
    pub spheres: Spheres<'a>,
    /// The number of spheres of the first set if there are two.
    pub split: Option<usize>,
    /// The frame of the spheres, whose radii then are the reaches of their species; `None` if they are as given.
    pub frame: Option<&'a Frame>,
    /// The exact filter of what a search finds; `None` if touching is enough.
    pub refinement: Option<Refinement<'a>>,
}

impl Places {
    /// Checks a query and puts its spheres in place. Whether spheres are valid is only checked if they need a frame.
    /// `wraps` tells whether the spheres of an orthogonal periodic space are to be wrapped. The time of a copy is added to
    /// `phases`.
    ///
    /// # Errors
    /// [`Error::Input`] for too many spheres, species outside the table, exclusions made for other numbers of spheres, and
    /// spheres that are not valid; [`Error::OutOfMemory`].
    pub fn place<'a>(
        &'a mut self,
        query: &Query<'a>,
        (settings, wraps): (&'a Settings, bool),
        threads: Threads,
        phases: &mut Vec<Phase>,
    ) -> Result<Placed<'a>, Error> {
        let Settings { space, interactions, .. } = settings;
        let interactions = interactions.as_ref();
        check_query(query, interactions, threads)?;
        query.check_exclusions()?;
        let split = query.split();
        let is_f64 = query.first().is_f64() || query.second().is_some_and(|set| set.is_f64());
        let is_framed = is_f64 || settings.is_framed();
        let refinement = Refinement::new(*query, is_framed.then_some((space, interactions)));
        let is_wrapped = wraps && space.is_periodic();
        let are_in_place = query.first().is_narrow() && split.is_none();
        if are_in_place && !is_wrapped && !is_framed {
            return Ok(Placed { spheres: query.first(), split, frame: None, refinement });
        }
        let start = Instant::now();
        resize(&mut self.spheres, query.len(), "copies of spheres")?;
        if is_framed {
            self.choose_frame(query, (space, !is_f64 && settings.is_narrow()), threads)?;
            self.fill_frame(query, interactions, threads)?;
        } else {
            self.copy(query, is_wrapped.then_some(space), threads);
        }
        let Self { spheres, species, frame, .. } = self;
        let spheres = with_species((spheres, species), query)?;
        Phase::add(phases, "copy", start.elapsed());
        let frame = frame.as_ref().filter(|_| is_framed);
        Ok(Placed { spheres, split, frame, refinement })
    }

    /// Finds the frame of a call.
    ///
    /// # Errors
    /// [`Error::Input`] for spheres that are not valid.
    fn choose_frame(
        &mut self,
        query: &Query<'_>,
        (space, is_narrow): (&Space, bool),
        threads: Threads,
    ) -> Result<(), Error> {
        self.frame = Some(match space.shear().filter(|_| is_narrow) {
            Some(shear) => {
                let last = self.frame.take().filter(Frame::is_narrow);
                last.unwrap_or_else(|| Frame::narrow(shear))
            }
            None => {
                let bounds = Bounds::of(query, threads);
                if !bounds.are_valid {
                    check_valid(query, threads)?;
                }
                Frame::of(&bounds, space, self.frame.take())
            }
        });
        Ok(())
    }

    /// Writes the spheres as they are searched in the frame.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    fn fill_frame(
        &mut self,
        query: &Query<'_>,
        table: Option<&Interactions>,
        threads: Threads,
    ) -> Result<(), Error> {
        let Self { spheres, frame, reaches, .. } = self;
        let Some(frame) = frame else { return Ok(()) };
        if let Some(table) = table.filter(|table| table.species() as usize != reaches.len()) {
            *reaches = collect((0..table.species()).map(|of| table.largest_half(of)), "reaches of species")?;
        }
        let reaches = table.map(|_| &**reaches);
        let (first, second) = spheres.split_at_mut(query.first().len());
        fill((query.first(), first), frame, reaches, threads);
        if let Some(set) = query.second() {
            fill((set, second), frame, reaches, threads);
        }
        Ok(())
    }

    /// Writes both sets, wrapped into `space` if there is one.
    fn copy(&mut self, query: &Query<'_>, space: Option<&Space>, threads: Threads) {
        let (first, second) = self.spheres.split_at_mut(query.first().len());
        copy(query.first(), space, first, threads);
        if let Some(set) = query.second() {
            copy(set, space, second, threads);
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
    resize(species, all.len(), "species of spheres")?;
    let (of_first, of_second) = species.split_at_mut(ids.len());
    of_first.copy_from_slice(ids);
    of_second.copy_from_slice(others);
    Ok(all.with_species(species)?)
}

/// Refuses more spheres than indices, and species outside the table.
fn check_query(query: &Query<'_>, table: Option<&Interactions>, threads: Threads) -> Result<(), InputError> {
    if query.len() as u64 > MAX_SPHERES {
        return Err(InputError::TooManySpheres { count: query.len() as u64 });
    }
    query.check_each(|spheres| check_species(spheres, table, threads))
}

/// Refuses what a search refuses of a query.
///
/// # Errors
/// The errors of a search: [`InputError`].
pub fn check(query: &Query<'_>, table: Option<&Interactions>, threads: Threads) -> Result<(), InputError> {
    check_query(query, table, threads)?;
    query.check_exclusions()?;
    check_valid(query, threads)
}

/// Writes spheres, as their images nearest to the origin if a space is given.
fn copy(spheres: Spheres<'_>, space: Option<&Space>, targets: &mut [Sphere], threads: Threads) {
    threads.each_stretch(targets, PIECE, |piece, targets| {
        for (target, k) in targets.iter_mut().zip(piece * PIECE..) {
            let Sphere { center, radius } = spheres.get(k);
            *target = Sphere { center: space.map_or(center, |space| space.wrap(center)), radius };
        }
    });
}

/// Writes spheres as they are searched in a frame, with the reaches of their species as radii.
fn fill(
    (spheres, targets): (Spheres<'_>, &mut [Sphere]),
    frame: &Frame,
    reaches: Option<&[(f64, bool)]>,
    threads: Threads,
) {
    let species = spheres.species().zip(reaches);
    threads.each_stretch(targets, PIECE, |piece, targets| {
        let mut block = [[0.0; 4]; BLOCK];
        for (targets, from) in targets.chunks_mut(BLOCK).zip((piece * PIECE..).step_by(BLOCK)) {
            let block = &mut block[..targets.len()];
            spheres.read(from, block);
            if let Some((species, reaches)) = species {
                for (numbers, &species) in block.iter_mut().zip(&species[from..]) {
                    let (half, touches) = reaches[species as usize];
                    let radius = numbers[3];
                    // One that is not valid is left for the check to find.
                    if (0.0..f64::INFINITY).contains(&radius) {
                        numbers[3] = if touches { half.max(radius) } else { half };
                    }
                }
            }
            frame.spheres(block, targets);
        }
    });
}
