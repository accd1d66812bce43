use std::path::PathBuf;

use lazygrid::{Error, Exclusions, InputError, Query, Spheres};
use lazygrid_io::read::{self, Frame};

use crate::args::Detect;
use crate::error::CliError;

pub(crate) struct Excluded {
    path: PathBuf,
    pairs: Vec<(i64, i64)>,
    by_id: bool,
}

impl Excluded {
    pub(crate) fn read(args: &Detect) -> Result<Option<Self>, CliError> {
        let Some(path) = &args.exclude else { return Ok(None) };
        Ok(Some(Self { path: path.clone(), pairs: read::pairs(path)?, by_id: args.ids }))
    }

    /// Ids of a frame ascend. Absent spheres are in no pair.
    pub(crate) fn of(&self, frame: &Frame, number: usize) -> Result<Exclusions, CliError> {
        let refused = |reason: Error| CliError::Excluded {
            path: self.path.clone(),
            frame: number,
            reason: Box::new(reason),
        };
        let spheres = frame.spheres.len();
        match frame.ids.as_deref().filter(|_| self.by_id) {
            Some(ids) => {
                let row = |id| ids.binary_search(&id).ok().map(|row| row as u32);
                let rows = self.pairs.iter().filter_map(|&(i, j)| row(i).zip(row(j)));
                Exclusions::new(spheres, rows).map_err(refused)
            }
            None => {
                let row = |row: i64| u32::try_from(row).unwrap_or(u32::MAX);
                Exclusions::new(spheres, self.pairs.iter().map(|&(i, j)| (row(i), row(j)))).map_err(refused)
            }
        }
    }
}

pub(crate) fn query<'a>(
    frame: &'a Frame,
    exclusions: Option<&'a Exclusions>,
) -> Result<Query<'a>, InputError> {
    let spheres = Spheres::from(&frame.spheres);
    let spheres = frame.groups.as_ref().map_or(Ok(spheres), |groups| spheres.with_groups(groups))?;
    let query = Query::new(spheres);
    Ok(exclusions.map_or(query, |exclusions| query.without(exclusions)))
}
