use std::io::{self, Write};
use std::path::Path;

use crate::bit_errors::{BitErrors, ReplicaFiles, SymbolDetector};
use crate::by_symbol::CountsBySymbol;
use crate::log::Log;
use crate::mean::RunningStats;
use crate::response::{Link, Response};
use crate::series::Series;
use crate::symbols::{Interference, SymbolSlots, messages};
use lazygrid_sim::model::message::Message;
use lazygrid_sim::{Error, Model, Receiver};

/// Statistics over replicas. Responses, interference and the errors of absorbing receivers need logged arrivals.
#[derive(Clone, Debug, Default)]
pub struct Channels {
    pub responses: Vec<Response>,
    pub interference: Vec<Interference>,
    /// Ordered by message, receiver, detector and delay.
    pub bit_errors: Vec<BitErrors>,
    pub by_symbol: Vec<CountsBySymbol>,
}

/// Bins of a response without a message.
const BINS: u32 = 100;
/// Bins per symbol of a response with a message.
const BINS_PER_SYMBOL: f64 = 20.0;
/// Symbols of a response with a message, and slots of interference.
const MAX_SYMBOLS: usize = 8;

impl Channels {
    /// Reads the logs of runs of `steps` steps, each as its seed and directory.
    ///
    /// # Errors
    /// See [`Log::read`].
    pub fn from_runs<'a>(
        model: &Model,
        steps: u32,
        runs: impl IntoIterator<Item = (u64, &'a Path)>,
    ) -> Result<Self, Error> {
        let mut channels = Self::empty(model, steps);
        for (seed, directory) in runs {
            let log = if model.logs_arrivals { Log::read(directory, model)? } else { Log::default() };
            let series = Series::read(&directory.join("series.csv"))?;
            channels.add(&ReplicaFiles { seed, log, series }, model, steps);
        }
        channels.responses.retain(Response::is_any);
        let arrives = |link: Link| channels.responses.iter().any(|response| response.link == link);
        channels.bit_errors.retain(|errors| errors.bits > 0);
        channels.interference.retain(|interference| arrives(interference.link));
        channels.by_symbol.retain(|counts| counts.is_any());
        Ok(channels)
    }

    fn empty(model: &Model, steps: u32) -> Self {
        let mut channels = Self::default();
        let link_message = |link: Link| messages(model).find(|&(index, _)| index == link.transmitter);
        for link in Link::all(model) {
            let message = link_message(link).map(|(_, message)| message);
            if message.is_some() {
                channels.by_symbol.push(CountsBySymbol::new(link));
            }
            if !model.logs_arrivals {
                continue;
            }
            let width = message.map_or_else(
                || steps.div_ceil(BINS),
                |message| (message.symbol_time / model.time_step / BINS_PER_SYMBOL).round() as u32,
            );
            let width = width.max(1);
            let max_bins =
                if message.is_some() { MAX_SYMBOLS * BINS_PER_SYMBOL as usize } else { BINS as usize };
            channels.responses.push(Response::new(
                link,
                link.source(model),
                width,
                max_bins.min((steps / width) as usize),
            ));
            if message.is_some() {
                channels.interference.push(Interference::new(link, link.source(model), MAX_SYMBOLS));
            }
        }
        for (index, message) in messages(model) {
            let release = &model.transmitters[index].release;
            let counts_some =
                |one: &&Receiver| release.iter().any(|&(species, _)| one.counts(species as usize));
            let receivers =
                model.receivers.iter().enumerate().filter(|(_, model_receiver)| counts_some(model_receiver));
            for (receiver, model_receiver) in receivers {
                let detectors: &[SymbolDetector] = match model_receiver.kind.absorbs() {
                    true if model.logs_arrivals => &[SymbolDetector::Arrivals],
                    false if model_receiver.is_momentary() => &SymbolDetector::MOMENTARY,
                    _ => &[],
                };
                for &detector in detectors {
                    let all = delays(message, model.time_step)
                        .map(|delay| BitErrors::new(model, message, [index, receiver], detector, delay));
                    channels.bit_errors.extend(all);
                }
            }
        }
        channels
    }

    fn add(&mut self, files: &ReplicaFiles, model: &Model, steps: u32) {
        let (log, rows) = (&files.log, &files.series.steps);
        let sent: Vec<_> = messages(model)
            .map(|(index, message)| (index, message, SymbolSlots::new(message, model.time_step, 0, steps)))
            .collect();
        let symbol_slots = |transmitter: usize| sent.iter().find(|sent| sent.0 == transmitter);
        let is_momentary = |link: Link| model.receivers[link.receiver].is_momentary();
        for response in &mut self.responses {
            match is_momentary(response.link) {
                true => response.add_momentary(log, rows),
                false => response.add(log, steps),
            }
        }
        for interference in &mut self.interference {
            let Some((_, _, slots)) = symbol_slots(interference.link.transmitter) else { continue };
            match is_momentary(interference.link) {
                true => interference.add_momentary(log, rows, slots),
                false => interference.add(log, slots),
            }
        }
        for counts in &mut self.by_symbol {
            if let Some((_, _, slots)) = symbol_slots(counts.link.transmitter) {
                counts.add(&files.series, model, files.seed, slots);
            }
        }
        for errors in &mut self.bit_errors {
            if let Some((_, message, _)) = symbol_slots(errors.transmitter) {
                let slots = SymbolSlots::new(message, model.time_step, errors.delay, steps);
                errors.add(files, model, &slots);
            }
        }
    }

    /// Returns the errors at the best delay, the first of equal ones.
    pub fn least_errors(&self) -> impl Iterator<Item = &BitErrors> {
        let is_same_link = |a: &BitErrors, b: &BitErrors| {
            (a.transmitter, a.receiver, a.detector) == (b.transmitter, b.receiver, b.detector)
        };
        self.bit_errors
            .chunk_by(is_same_link)
            .filter_map(|all| all.iter().min_by(|a, b| a.lowest_rate().total_cmp(&b.lowest_rate())))
    }

    /// Writes the fraction that arrives, or is inside, in each bin after the release.
    pub fn write_responses(&self, out: &mut impl Write, model: &Model) -> io::Result<()> {
        writeln!(
            out,
            "transmitter,receiver,species,from,until,replicas,fraction mean,fraction error,so far mean,so far error"
        )?;
        for response in &self.responses {
            let bin = f64::from(response.width) * model.time_step;
            for (k, fraction) in response.fractions.iter().enumerate() {
                // A momentary count has no sum.
                let cumulative = response.cumulative.get(k).copied().unwrap_or_default();
                let [from, until] = [k, k + 1].map(|k| k as f64 * bin);
                let name = names(response.link, model).join(",");
                let values = [value(fraction), value(&cumulative)].join(",");
                writeln!(out, "{name},{from},{until},{},{values}", fraction.count())?;
            }
        }
        Ok(())
    }

    /// Writes the fractions in slots after the release.
    pub fn write_interference(&self, out: &mut impl Write, model: &Model) -> io::Result<()> {
        writeln!(out, "transmitter,receiver,species,slot,replicas,fraction mean,fraction error")?;
        for interference in &self.interference {
            for (lag, fraction) in interference.by_lag.iter().enumerate() {
                let name = names(interference.link, model).join(",");
                writeln!(out, "{name},{lag},{},{}", fraction.count(), value(fraction))?;
            }
        }
        Ok(())
    }

    /// Writes error rates at each threshold where errors may change, or at the best thresholds of several.
    pub fn write_bit_errors(&self, out: &mut impl Write, model: &Model) -> io::Result<()> {
        writeln!(
            out,
            "transmitter,receiver,detector,delay,threshold,errors,bits,replicas,rate,rate low,rate high"
        )?;
        for errors in &self.bit_errors {
            let transmitter = &model.transmitters[errors.transmitter].name;
            let receiver = &model.receivers[errors.receiver].name;
            let delay = f64::from(errors.delay) * model.time_step;
            let all = match errors.thresholds() {
                1 => errors
                    .by_threshold()
                    .into_iter()
                    .map(|(threshold, wrong)| (vec![threshold], wrong))
                    .collect(),
                _ => {
                    let best = errors.best();
                    let wrong = errors.at(&best).1;
                    vec![(best, wrong)]
                }
            };
            let (detector, bits, replicas) = (errors.detector.name(), errors.bits, errors.replicas());
            for (thresholds, wrong) in all {
                let (threshold, rate) = (spaced(&thresholds), wrong as f64 / bits as f64);
                let [low, high] = errors.interval(wrong);
                writeln!(
                    out,
                    "{transmitter},{receiver},{detector},{delay},{threshold},{wrong},{bits},{replicas},{rate},{low},{high}"
                )?;
            }
        }
        Ok(())
    }

    pub fn write_by_symbol(&self, out: &mut impl Write, model: &Model) -> io::Result<()> {
        writeln!(out, "transmitter,receiver,species,symbol,time,slots,count mean,count error")?;
        for counts in &self.by_symbol {
            let name = names(counts.link, model).join(",");
            for (symbol, by_time) in &counts.symbols {
                for (&lag, sample) in by_time {
                    let time = f64::from(lag) * model.time_step;
                    let error = sample.standard_error().map_or(String::new(), |error| error.to_string());
                    let [slots, mean] = [sample.count().to_string(), sample.mean().to_string()];
                    writeln!(out, "{name},{symbol},{time},{slots},{mean},{error}")?;
                }
            }
        }
        Ok(())
    }
}

/// Returns multiples of a quarter symbol, up to two symbols, in steps.
fn delays(message: &Message, time_step: f64) -> impl Iterator<Item = u32> {
    let quarter = message.symbol_time / time_step / 4.0;
    let mut delays: Vec<u32> = (0..=8).map(|k| (f64::from(k) * quarter).round() as u32).collect();
    delays.dedup();
    delays.into_iter()
}

pub fn link_name(link: Link, model: &Model) -> String {
    let [transmitter, receiver, species] = names(link, model);
    format!("{transmitter} to {receiver}: {species}")
}

fn names(link: Link, model: &Model) -> [&str; 3] {
    [
        &model.transmitters[link.transmitter].name,
        &model.receivers[link.receiver].name,
        &model.species[link.species].name,
    ]
}

pub fn spaced(thresholds: &[u64]) -> String {
    thresholds.iter().map(u64::to_string).collect::<Vec<_>>().join(" ")
}

fn value(moments: &RunningStats) -> String {
    let mean = if moments.count() == 0 { String::new() } else { moments.mean().to_string() };
    format!("{mean},{}", moments.standard_error().map_or(String::new(), |error| error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bit_errors::tests::{arrivals, files};
    use crate::symbols::tests::{model, slots};

    #[test]
    fn bit_errors_leave_out_receivers_that_count_no_sent_species() {
        let mut model = model();
        model.logs_arrivals = true;
        let other = Receiver { name: "other".into(), sees: vec![false], ..model.receivers[0].clone() };
        model.receivers.insert(0, other);
        let receivers = Channels::empty(&model, 100).bit_errors.into_iter().map(|errors| errors.receiver);
        assert_eq!(receivers.collect::<std::collections::BTreeSet<_>>(), [1].into());
    }

    #[test]
    fn bit_errors_have_rows_for_thresholds_that_change_them() {
        let model = model();
        let (_, message) = messages(&model).next().unwrap();
        let mut errors = BitErrors::new(&model, message, [0, 0], SymbolDetector::Arrivals, 0);
        errors.add(&files(arrivals(&[&[3000], &[7], &[3000], &[20]])), &model, &slots(100));
        let channels = Channels { bit_errors: vec![errors], ..Channels::default() };
        let mut out = Vec::new();
        channels.write_bit_errors(&mut out, &model).unwrap();
        let text = String::from_utf8(out).unwrap();
        let rows =
            text.lines().skip(1).map(|row| row.split(',').skip(4).take(4).collect::<Vec<_>>().join(","));
        // Threshold, wrong bits, bits and replicas; the bits are 1011.
        assert_eq!(rows.collect::<Vec<_>>(), ["0,1,4,1", "8,0,4,1", "21,1,4,1", "3001,3,4,1"]);
    }
}
