//! Statistics of the channels between transmitters and receivers, and their tables.

use std::io::{self, Write};
use std::path::Path;

use super::bit_errors::BitErrors;
use super::log::Log;
use super::mean::Moments;
use super::response::{Response, Way};
use super::symbols::{Interference, Slots, messages};
use crate::model::message::Message;
use crate::{Error, Model};

/// The results of one run or of several replicas that logged arrivals.
#[derive(Clone, Debug, Default)]
pub struct Channels {
    /// Of all ways on which anybody arrives.
    pub responses: Vec<Response>,
    /// Of those among them on which messages are sent.
    pub interference: Vec<Interference>,
    /// Of all messages, at all receivers that take particles in, by several delays of the slots.
    pub bit_errors: Vec<BitErrors>,
}

/// Stretches of a response that is no message's.
const STRETCHES: u32 = 100;
/// Stretches of one symbol.
const PER_SYMBOL: f64 = 20.0;
/// Symbols that the response to one of them is followed through, and slots of interference.
const SYMBOLS: usize = 8;

impl Channels {
    /// From the logs of runs of so many steps, each given by its seed and its directory.
    ///
    /// # Errors
    /// The same as [`Log::read`].
    pub fn of<'a>(
        model: &Model,
        steps: u32,
        runs: impl IntoIterator<Item = (u64, &'a Path)>,
    ) -> Result<Self, Error> {
        let sent: Vec<_> = messages(model)
            .map(|(place, message)| (place, message, Slots::new(message, model.time_step, 0, steps)))
            .collect();
        let ways = Way::all(model);
        let mut channels = Self::default();
        for &way in &ways {
            let symbol = sent.iter().find(|sent| sent.0 == way.transmitter).map(|sent| sent.1.symbol_time);
            let width = symbol.map_or_else(
                || steps.div_ceil(STRETCHES),
                |time| (time / model.time_step / PER_SYMBOL).round() as u32,
            );
            let width = width.max(1);
            let most = if symbol.is_some() { SYMBOLS * PER_SYMBOL as usize } else { STRETCHES as usize };
            channels.responses.push(Response::new(way, width, most.min((steps / width) as usize)));
            if symbol.is_some() {
                channels.interference.push(Interference::new(way, SYMBOLS));
            }
        }
        for &(place, message, _) in &sent {
            let counts = |&receiver: &usize| model.receivers[receiver].kind.absorbs();
            let entries = model.transmitters[place].release.len();
            for receiver in (0..model.receivers.len()).filter(counts) {
                let all = delays(message, model.time_step)
                    .map(|delay| BitErrors::new(message, entries, [place, receiver], delay));
                channels.bit_errors.extend(all);
            }
        }
        let slots = |transmitter: usize| sent.iter().find(|sent| sent.0 == transmitter).map(|sent| &sent.2);
        for (seed, directory) in runs {
            let log = Log::read(directory, model)?;
            channels.responses.iter_mut().for_each(|response| response.add(&log, steps));
            for interference in &mut channels.interference {
                if let Some(slots) = slots(interference.way.transmitter) {
                    interference.add(&log, slots);
                }
            }
            for errors in &mut channels.bit_errors {
                if let Some((_, message, _)) = sent.iter().find(|sent| sent.0 == errors.transmitter) {
                    let slots = Slots::new(message, model.time_step, errors.delay, steps);
                    errors.add(&log, model, seed, &slots);
                }
            }
        }
        channels.responses.retain(Response::is_any);
        let arrives = |way: Way| channels.responses.iter().any(|response| response.way == way);
        channels.bit_errors.retain(|errors| errors.bits > 0);
        channels.interference.retain(|interference| arrives(interference.way));
        Ok(channels)
    }

    /// Writes the impulse responses: for each stretch of time after a release the part that arrives in it, and that up
    /// to its end, with their standard errors.
    ///
    /// # Errors
    /// Fails if the writer fails.
    pub fn write_responses(&self, out: &mut impl Write, model: &Model) -> io::Result<()> {
        writeln!(
            out,
            "transmitter,receiver,species,from,until,replicas,part mean,part error,so far mean,so far error"
        )?;
        for response in &self.responses {
            let stretch = f64::from(response.width) * model.time_step;
            for (k, (part, so_far)) in response.parts.iter().zip(&response.so_far).enumerate() {
                let [from, until] = [k, k + 1].map(|k| k as f64 * stretch);
                let name = names(response.way, model);
                let values = [value(part), value(so_far)].join(",");
                writeln!(out, "{name},{from},{until},{},{values}", part.count())?;
            }
        }
        Ok(())
    }

    /// Writes the interference: for each number of slots after a release the part that arrives in that slot.
    ///
    /// # Errors
    /// Fails if the writer fails.
    pub fn write_interference(&self, out: &mut impl Write, model: &Model) -> io::Result<()> {
        writeln!(out, "transmitter,receiver,species,slot,replicas,part mean,part error")?;
        for interference in &self.interference {
            for (slot, part) in interference.by_lag.iter().enumerate() {
                let name = names(interference.way, model);
                writeln!(out, "{name},{slot},{},{}", part.count(), value(part))?;
            }
        }
        Ok(())
    }

    /// Writes the bit errors: for each delay of the slots how many there are, of how many bits, and the rate; for every
    /// threshold if there is one, else for the thresholds that leave the fewest, or without any.
    ///
    /// # Errors
    /// Fails if the writer fails.
    pub fn write_bit_errors(&self, out: &mut impl Write, model: &Model) -> io::Result<()> {
        writeln!(out, "transmitter,receiver,delay,threshold,errors,bits,replicas,rate mean,rate error")?;
        for errors in &self.bit_errors {
            let transmitter = &model.transmitters[errors.transmitter].name;
            let receiver = &model.receivers[errors.receiver].name;
            let delay = f64::from(errors.delay) * model.time_step;
            let all = match errors.thresholds() {
                1 => (0..=errors.most() + 1).map(|threshold| vec![threshold]).collect(),
                _ => vec![errors.best()],
            };
            for thresholds in all {
                let (rate, wrong) = errors.at(&thresholds);
                let threshold = spaced(&thresholds);
                let [bits, replicas] = [errors.bits, rate.count()];
                writeln!(
                    out,
                    "{transmitter},{receiver},{delay},{threshold},{wrong},{bits},{replicas},{}",
                    value(&rate)
                )?;
            }
        }
        Ok(())
    }
}

/// How many steps later than a symbol its slot may begin: parts of a symbol's time, up to two of these.
fn delays(message: &Message, time_step: f64) -> impl Iterator<Item = u32> {
    let quarter = message.symbol_time / time_step / 4.0;
    let mut delays: Vec<u32> = (0..=8).map(|k| (f64::from(k) * quarter).round() as u32).collect();
    delays.dedup();
    delays.into_iter()
}

fn names(way: Way, model: &Model) -> String {
    let [transmitter, receiver, species] = [
        &model.transmitters[way.transmitter].name,
        &model.receivers[way.receiver].name,
        &model.species[way.species].name,
    ];
    format!("{transmitter},{receiver},{species}")
}

/// Thresholds in one field, in ascending order.
pub fn spaced(thresholds: &[u64]) -> String {
    thresholds.iter().map(u64::to_string).collect::<Vec<_>>().join(" ")
}

/// A mean and its standard error; what there is not is empty.
fn value(moments: &Moments) -> String {
    let mean = if moments.count() == 0 { String::new() } else { moments.mean().to_string() };
    format!("{mean},{}", moments.standard_error().map_or(String::new(), |error| error.to_string()))
}
