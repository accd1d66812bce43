//! Statistics of the channels between transmitters and receivers, and their tables.

use std::io::{self, Write};
use std::path::Path;

use crate::bit_errors::BitErrors;
use crate::log::Log;
use crate::mean::RunningStats;
use crate::response::{Link, Response};
use crate::symbols::{Interference, SymbolSlots, messages};
use lazygrid_sim::model::message::Message;
use lazygrid_sim::{Error, Model};

/// The results of one run or of several replicas that logged arrivals.
#[derive(Clone, Debug, Default)]
pub struct Channels {
    /// Impulse responses of all links with arrivals.
    pub responses: Vec<Response>,
    /// Interference on the links with messages.
    pub interference: Vec<Interference>,
    /// Bit errors of all messages at all absorbing receivers, for several delays of the slots.
    pub bit_errors: Vec<BitErrors>,
}

/// Bins of a response without a message.
const BINS: u32 = 100;
/// Bins of a symbol.
const PER_SYMBOL: f64 = 20.0;
/// Symbols covered by a response, and slots of interference.
const SYMBOLS: usize = 8;

impl Channels {
    /// Reads the logs of runs of `steps` steps, each given by its seed and its directory.
    ///
    /// # Errors
    /// The same as [`Log::read`].
    pub fn of<'a>(
        model: &Model,
        steps: u32,
        runs: impl IntoIterator<Item = (u64, &'a Path)>,
    ) -> Result<Self, Error> {
        let sent: Vec<_> = messages(model)
            .map(|(place, message)| (place, message, SymbolSlots::new(message, model.time_step, 0, steps)))
            .collect();
        let links = Link::all(model);
        let mut channels = Self::default();
        for &link in &links {
            let symbol = sent.iter().find(|sent| sent.0 == link.transmitter).map(|sent| sent.1.symbol_time);
            let width = symbol.map_or_else(
                || steps.div_ceil(BINS),
                |time| (time / model.time_step / PER_SYMBOL).round() as u32,
            );
            let width = width.max(1);
            let most = if symbol.is_some() { SYMBOLS * PER_SYMBOL as usize } else { BINS as usize };
            channels.responses.push(Response::new(link, width, most.min((steps / width) as usize)));
            if symbol.is_some() {
                channels.interference.push(Interference::new(link, SYMBOLS));
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
                if let Some(slots) = slots(interference.link.transmitter) {
                    interference.add(&log, slots);
                }
            }
            for errors in &mut channels.bit_errors {
                if let Some((_, message, _)) = sent.iter().find(|sent| sent.0 == errors.transmitter) {
                    let slots = SymbolSlots::new(message, model.time_step, errors.delay, steps);
                    errors.add(&log, model, seed, &slots);
                }
            }
        }
        channels.responses.retain(Response::is_any);
        let arrives = |link: Link| channels.responses.iter().any(|response| response.link == link);
        channels.bit_errors.retain(|errors| errors.bits > 0);
        channels.interference.retain(|interference| arrives(interference.link));
        Ok(channels)
    }

    /// Returns of each message at each receiver the errors at the delay that makes the fewest, the first of several.
    pub fn least_errors(&self) -> impl Iterator<Item = &BitErrors> {
        let same = |a: &BitErrors, b: &BitErrors| (a.transmitter, a.receiver) == (b.transmitter, b.receiver);
        self.bit_errors
            .chunk_by(same)
            .filter_map(|all| all.iter().min_by(|a, b| a.least().total_cmp(&b.least())))
    }

    /// Writes the fraction of the particles that arrives in each bin after the release, the cumulative fraction, and
    /// their standard errors.
    ///
    /// # Errors
    /// Fails if the writer fails.
    pub fn write_responses(&self, out: &mut impl Write, model: &Model) -> io::Result<()> {
        writeln!(
            out,
            "transmitter,receiver,species,from,until,replicas,part mean,part error,so far mean,so far error"
        )?;
        for response in &self.responses {
            let bin = f64::from(response.width) * model.time_step;
            for (k, (part, cumulative)) in response.parts.iter().zip(&response.cumulative).enumerate() {
                let [from, until] = [k, k + 1].map(|k| k as f64 * bin);
                let name = names(response.link, model);
                let values = [value(part), value(cumulative)].join(",");
                writeln!(out, "{name},{from},{until},{},{values}", part.count())?;
            }
        }
        Ok(())
    }

    /// Writes the fraction of the particles that arrives in each slot after the release.
    ///
    /// # Errors
    /// Fails if the writer fails.
    pub fn write_interference(&self, out: &mut impl Write, model: &Model) -> io::Result<()> {
        writeln!(out, "transmitter,receiver,species,slot,replicas,part mean,part error")?;
        for interference in &self.interference {
            for (slot, part) in interference.by_lag.iter().enumerate() {
                let name = names(interference.link, model);
                writeln!(out, "{name},{slot},{},{}", part.count(), value(part))?;
            }
        }
        Ok(())
    }

    /// Writes number of errors, number of bits and error rate for each delay of the slots: for every value of a single
    /// threshold, or for the thresholds with the fewest errors.
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

/// Returns the delays of slots after symbols, in steps: multiples of a quarter of a symbol, up to two symbols.
fn delays(message: &Message, time_step: f64) -> impl Iterator<Item = u32> {
    let quarter = message.symbol_time / time_step / 4.0;
    let mut delays: Vec<u32> = (0..=8).map(|k| (f64::from(k) * quarter).round() as u32).collect();
    delays.dedup();
    delays.into_iter()
}

/// Returns the name of a link on pages: `tx to rx: A`.
pub fn link_name(link: Link, model: &Model) -> String {
    format!(
        "{} to {}: {}",
        model.transmitters[link.transmitter].name,
        model.receivers[link.receiver].name,
        model.species[link.species].name
    )
}

fn names(link: Link, model: &Model) -> String {
    let [transmitter, receiver, species] = [
        &model.transmitters[link.transmitter].name,
        &model.receivers[link.receiver].name,
        &model.species[link.species].name,
    ];
    format!("{transmitter},{receiver},{species}")
}

/// Formats thresholds as one field.
pub fn spaced(thresholds: &[u64]) -> String {
    thresholds.iter().map(u64::to_string).collect::<Vec<_>>().join(" ")
}

fn value(moments: &RunningStats) -> String {
    let mean = if moments.count() == 0 { String::new() } else { moments.mean().to_string() };
    format!("{mean},{}", moments.standard_error().map_or(String::new(), |error| error.to_string()))
}
