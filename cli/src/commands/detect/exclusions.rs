use std::path::PathBuf;

use lazygrid::{Error, Exclusions, InputError, Query};
use lazygrid_io::read::{self, Frame};

use crate::args::Detect;
use crate::error::CliError;

pub(crate) struct ExclusionFile {
    path: PathBuf,
    pairs: Vec<(i64, i64)>,
    by_id: bool,
    /// `true` for pairs of ids that a frame has.
    met: Vec<bool>,
}

impl ExclusionFile {
    pub(crate) fn read(args: &Detect) -> Result<Option<Self>, CliError> {
        let Some(path) = &args.exclude else { return Ok(None) };
        let pairs = read::pairs(path)?;
        let mut met = Vec::new();
        if args.ids {
            let refused = |_| CliError::NoMemoryForPairs { path: path.clone(), pairs: pairs.len() };
            met.try_reserve_exact(pairs.len()).map_err(refused)?;
            met.resize(pairs.len(), false);
        }
        Ok(Some(Self { path: path.clone(), pairs, by_id: args.ids, met }))
    }

    /// Requires ascending ids.
    pub(crate) fn exclusions(&mut self, frame: &Frame, number: usize) -> Result<Exclusions, CliError> {
        let refused = |reason: Error| CliError::Excluded {
            path: self.path.clone(),
            frame: number,
            reason: Box::new(reason),
        };
        let spheres = frame.len();
        match frame.ids.as_deref().filter(|_| self.by_id) {
            Some(ids) => {
                let row = |id| ids.binary_search(&id).ok().map(|row| row as u32);
                let rows = self.pairs.iter().zip(&mut self.met).filter_map(|(&(i, j), met)| {
                    let rows = row(i).zip(row(j))?;
                    *met = true;
                    Some(rows)
                });
                Exclusions::new(spheres, rows).map_err(refused)
            }
            None => {
                let row = |row: i64| u32::try_from(row).unwrap_or(u32::MAX);
                Exclusions::new(spheres, self.pairs.iter().map(|&(i, j)| (row(i), row(j)))).map_err(refused)
            }
        }
    }

    pub(crate) fn warn_of_unmet(&self) {
        let unmet = || self.pairs.iter().zip(&self.met).filter(|(_, met)| !**met);
        if let Some(((i, j), _)) = unmet().next() {
            let (path, count, pairs) = (self.path.display(), unmet().count(), self.pairs.len());
            log::warn!("{path}: no frame has both ids of {count} of {pairs} pairs, first of {i},{j}");
        }
    }
}

pub(crate) fn query<'a>(
    frame: &'a Frame,
    exclusions: Option<&'a Exclusions>,
) -> Result<Query<'a>, InputError> {
    let spheres = frame.as_spheres();
    let spheres = frame.groups.as_ref().map_or(Ok(spheres), |groups| spheres.with_groups(groups))?;
    let query = Query::new(spheres);
    Ok(exclusions.map_or(query, |exclusions| query.without(exclusions)))
}
