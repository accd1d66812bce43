use std::io::{self, Write};
use std::ops::RangeInclusive;

use super::series::moment;
use crate::random::philox::Key;
use crate::{Model, RunView};

pub(super) fn header(out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "step,time,receiver,species,id,transmitter,released")
}

/// Origins of inserted particles are empty.
pub(super) fn rows(out: &mut impl Write, simulation: &impl RunView) -> io::Result<()> {
    let model = simulation.model();
    for arrival in simulation.arrivals() {
        let receiver = &model.receivers[arrival.receiver as usize].name;
        let species = &model.species[arrival.species as usize].name;
        let moment = moment(arrival.step, model);
        write!(out, "{moment},{receiver},{species},{},", arrival.id)?;
        match arrival.origin {
            None => writeln!(out, ",")?,
            Some(origin) => {
                let released = f64::from(origin.step) * model.time_step;
                writeln!(out, "{},{released}", transmitter(model, origin.transmitter))?;
            }
        }
    }
    Ok(())
}

pub(super) fn header_of_releases(out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "step,time,transmitter,species,count")
}

pub(super) fn rows_of_releases(
    out: &mut impl Write,
    model: &Model,
    seed: u64,
    steps: RangeInclusive<u32>,
) -> io::Result<()> {
    for step in steps {
        for (from, species, count) in model.releases(step, Key::new(seed)).filter(|&(_, _, count)| count > 0)
        {
            let species = &model.species[species as usize].name;
            writeln!(out, "{},{},{species},{count}", moment(step, model), transmitter(model, from))?;
        }
    }
    Ok(())
}

fn transmitter(model: &Model, index: u32) -> &str {
    &model.transmitters[index as usize].name
}
