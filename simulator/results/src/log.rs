use std::path::Path;

use crate::BYTES_PER_FIELD;
use lazygrid_sim::table::{TableReader, TableRow};
use lazygrid_sim::{Error, Model, Receiver};

/// Entries in the order of steps.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Log {
    pub arrivals: Vec<LoggedArrival>,
    pub releases: Vec<LoggedRelease>,
    /// Particles inside or bound at each row of the series.
    pub inside: Vec<LoggedCount>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoggedArrival {
    pub step: u32,
    pub receiver: usize,
    pub species: usize,
    /// Transmitter, and completed steps at the release; `None` for inserted particles.
    pub origin: Option<(usize, u32)>,
}

/// Particles of one origin inside a receiver or bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoggedCount {
    pub step: u32,
    pub receiver: usize,
    pub species: usize,
    /// See [`LoggedArrival::origin`].
    pub origin: Option<(usize, u32)>,
    pub count: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoggedRelease {
    pub step: u32,
    pub transmitter: usize,
    pub species: usize,
    pub count: u64,
}

impl Log {
    /// Reads the log of a run of this model.
    ///
    /// # Errors
    /// [`Error::Read`] if a file cannot be read or is damaged, and [`Error::TooLittleMemory`].
    pub fn read(directory: &Path, model: &Model) -> Result<Self, Error> {
        let names = Names {
            receivers: model.receivers.iter().map(|receiver| &receiver.name[..]).collect(),
            species: model.species.iter().map(|species| &species.name[..]).collect(),
            transmitters: model.transmitters.iter().map(|transmitter| &transmitter.name[..]).collect(),
        };
        let mut log = Self::default();
        let path = directory.join("arrivals.csv");
        let begin = "step,time,receiver,species,id,transmitter,released";
        let mut lines = TableReader::open(&path, begin, BYTES_PER_FIELD)?;
        while let Some(line) = lines.next_row()? {
            let origin = names.origin(&line, 5, model)?;
            let receiver = index_of_name(&names.receivers, &line, 2)?;
            let species = index_of_name(&names.species, &line, 3)?;
            log.arrivals.push(LoggedArrival { step: line.number(0)?, receiver, species, origin });
        }
        let path = directory.join("releases.csv");
        let begin = "step,time,transmitter,species,count";
        let mut lines = TableReader::open(&path, begin, BYTES_PER_FIELD)?;
        while let Some(line) = lines.next_row()? {
            let transmitter = index_of_name(&names.transmitters, &line, 2)?;
            let species = index_of_name(&names.species, &line, 3)?;
            log.releases.push(LoggedRelease {
                step: line.number(0)?,
                transmitter,
                species,
                count: line.number(4)?,
            });
        }
        let path = directory.join("occupancy.csv");
        if model.receivers.iter().any(Receiver::is_momentary) {
            let begin = "step,time,receiver,species,transmitter,released,count";
            let mut lines = TableReader::open(&path, begin, BYTES_PER_FIELD)?;
            while let Some(line) = lines.next_row()? {
                let receiver = index_of_name(&names.receivers, &line, 2)?;
                let species = index_of_name(&names.species, &line, 3)?;
                let origin = names.origin(&line, 4, model)?;
                let (step, count) = (line.number(0)?, line.number(6)?);
                log.inside.push(LoggedCount { step, receiver, species, origin, count });
            }
        }
        Ok(log)
    }
}

struct Names<'a> {
    receivers: Vec<&'a str>,
    species: Vec<&'a str>,
    transmitters: Vec<&'a str>,
}

impl Names<'_> {
    fn origin(
        &self,
        line: &TableRow<'_>,
        column: usize,
        model: &Model,
    ) -> Result<Option<(usize, u32)>, Error> {
        if line.field(column).is_empty() {
            return Ok(None);
        }
        let step = (line.number::<f64>(column + 1)? / model.time_step).round() as u32;
        Ok(Some((index_of_name(&self.transmitters, line, column)?, step)))
    }
}

fn index_of_name(names: &[&str], line: &TableRow<'_>, column: usize) -> Result<usize, Error> {
    let name = line.field(column);
    names
        .iter()
        .position(|known| *known == name)
        .ok_or_else(|| line.damaged(&format!("the scenario has no '{name}'")))
}
