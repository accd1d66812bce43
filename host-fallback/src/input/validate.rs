use lazygrid_kernels::{InputError, Interactions, Query, Spheres};

use crate::executor::{Chunks, Executor};

const CHUNK_SPHERES: usize = 1 << 13;

/// # Errors
/// [`InputError::Sphere`] for the first set, [`InputError::SecondSet`] for the second.
pub fn check_valid(query: &Query<'_>, executor: Executor) -> Result<(), InputError> {
    query.check_each(|spheres| check(spheres, executor))
}

pub(super) fn check(spheres: Spheres<'_>, executor: Executor) -> Result<(), InputError> {
    let total = spheres.len() as u64;
    match find(spheres.len(), executor, |i| !spheres.is_valid(i))? {
        (Some(index), count) => {
            let [x, y, z, radius] = spheres.get_f64(index as usize);
            Err(InputError::Sphere { index, center: [x, y, z], radius, count, total })
        }
        (None, _) => Ok(()),
    }
}

pub(super) fn check_species(
    spheres: Spheres<'_>,
    interactions: Option<&Interactions>,
    executor: Executor,
) -> Result<(), InputError> {
    let Some(table) = interactions else { return Ok(()) };
    let ids = spheres.species().ok_or(InputError::SpeciesMissing)?;
    match find(ids.len(), executor, |i| ids[i] >= table.species())? {
        (Some(i), _) => {
            Err(InputError::SpeciesId { index: Some(i), id: ids[i as usize], count: table.species() })
        }
        (None, _) => Ok(()),
    }
}

fn find(
    n: usize,
    executor: Executor,
    bad: impl Fn(usize) -> bool + Sync + Send,
) -> Result<(Option<u32>, u64), InputError> {
    let merge = |(a, m): (Option<u32>, u64), (b, n)| Ok((a.or(b), m + n));
    let fold_chunk = |sum, chunk: usize| {
        let range = chunk * CHUNK_SPHERES..n.min((chunk + 1) * CHUNK_SPHERES);
        // The count is nearly always 0, and a sum without a branch is vectorized.
        let count = range.clone().map(|i| u64::from(bad(i))).sum::<u64>();
        let first = if count == 0 { None } else { range.clone().find(|&i| bad(i)).map(|i| i as u32) };
        merge(sum, (first, count))
    };
    executor.fold(Chunks::unlimited(n.div_ceil(CHUNK_SPHERES)), || (None, 0), fold_chunk, merge)
}
