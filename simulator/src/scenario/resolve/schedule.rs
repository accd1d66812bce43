use std::ops::Range;

use lazygrid_io::excerpt;

use lazygrid_scenario::{self as file, Finite, NotNegative};

use super::Names;
use super::checks::{refuse_keys, span_of};
use crate::model::message::{Message, Modulation, Symbols};
use crate::model::transmitter::Schedule;
use crate::scenario::Problem;

pub(super) fn schedule(
    transmitter: &file::Transmitter,
    names: &Names<'_>,
) -> Result<(Schedule, Vec<(u32, u32)>), Problem> {
    let span = transmitter.release.span();
    // A program may release by itself.
    let is_driven = transmitter.times.as_ref().is_some_and(|times| times.get_ref().is_empty());
    if transmitter.release.get_ref().is_empty() && !is_driven {
        let message = "the list is empty, so that nothing is released; name a species with a count or a rate, or write times = [] if a \
                       program releases";
        return Err(Problem::at(span, message.to_owned()));
    }
    let is_message = transmitter.bits.is_some() || transmitter.random_bits.is_some();
    let (mut counts, mut rates) = (Vec::new(), Vec::new());
    for one in transmitter.release.get_ref() {
        let species = names.get(&one.species)?;
        if is_message && counts.iter().any(|&(other, _)| other == species) {
            let message = format!(
                "species '{}' occurs twice in `release`, so arrivals cannot distinguish the entries; remove one",
                one.species.get_ref()
            );
            return Err(Problem::at(one.species.span(), message));
        }
        match (one.count, one.rate) {
            (Some(count), None) => counts.push((species, count)),
            (None, Some(rate)) => rates.push((species, rate.0)),
            _ => {
                let message = "each entry needs either a count, for a burst, or a rate in 1/s".to_owned();
                return Err(Problem::at(one.species.span(), message));
            }
        }
    }
    let schedule = match (rates.is_empty(), is_message) {
        (true, true) => Schedule::Message(message(transmitter, counts.len())?),
        (true, false) => {
            steady_only(transmitter)?;
            message_only(transmitter)?;
            Schedule::Times(times(transmitter))
        }
        (false, false) if counts.is_empty() => {
            message_only(transmitter)?;
            if let Some(times) = &transmitter.times {
                let message =
                    "a rate releases all the time; write from and until instead of times".to_owned();
                return Err(Problem::at(times.span(), message));
            }
            let [from, until] =
                [&transmitter.from, &transmitter.until].map(|time| time.as_ref().map(|t| t.get_ref().0));
            let (begin, end) = (from.unwrap_or(0.0), until.unwrap_or(f64::INFINITY));
            if begin >= end {
                let message = format!(
                    "the release is from {begin} s until {end} s; the end must be later than the beginning"
                );
                return Err(Problem::at(span_of(&transmitter.until).unwrap_or(span), message));
            }
            Schedule::Steady { from: begin, until: end, rates }
        }
        _ => {
            let message =
                "a rate releases all the time, and a count at times or for bits; use two transmitters";
            return Err(Problem::at(span, message.to_owned()));
        }
    };
    Ok((schedule, counts))
}

fn times(transmitter: &file::Transmitter) -> Vec<f64> {
    let explicit_times =
        transmitter.times.as_ref().map(|times| times.get_ref().iter().map(|time| time.0).collect());
    let mut times: Vec<f64> = explicit_times.unwrap_or_else(|| vec![0.0]);
    times.sort_unstable_by(f64::total_cmp);
    times
}

fn steady_only(transmitter: &file::Transmitter) -> Result<(), Problem> {
    let keys = [("from", span_of(&transmitter.from)), ("until", span_of(&transmitter.until))];
    refuse_keys(keys, |key| format!("{key} goes with release rates; remove it"))
}

fn message_only(transmitter: &file::Transmitter) -> Result<(), Problem> {
    let keys = [
        ("symbol-time", span_of(&transmitter.symbol_time)),
        ("start", span_of(&transmitter.start)),
        ("modulation", span_of(&transmitter.modulation)),
        ("levels", span_of(&transmitter.levels)),
    ];
    refuse_keys(keys, |key| format!("{key} goes with bits or random-bits; give one of them, or remove it"))
}

/// Limit of the bits of a transmitter, and of the symbols of all transmitters, which are the rows of symbols.csv.
pub(super) const MAX_BITS: usize = 1 << 22;

pub(super) fn bits_span(transmitter: &file::Transmitter) -> Range<usize> {
    span_of(&transmitter.bits).or_else(|| span_of(&transmitter.random_bits)).unwrap_or_default()
}

fn message(transmitter: &file::Transmitter, entries: usize) -> Result<Message, Problem> {
    steady_only(transmitter)?;
    if let Some(times) = &transmitter.times {
        let message = "bits say when to release; write start and symbol-time instead of times".to_owned();
        return Err(Problem::at(times.span(), message));
    }
    let span = bits_span(transmitter);
    let Some(symbol_time) = &transmitter.symbol_time else {
        return Err(Problem::at(span, "bits need a symbol-time".to_owned()));
    };
    let modulation = modulation(transmitter)?;
    let alphabet = modulation.alphabet(entries);
    if !alphabet.is_power_of_two() || alphabet < 2 {
        let message = format!(
            "the number of symbols is {alphabet} ({}), but must be a power of two of at least 2",
            if modulation == Modulation::Molecule { "one per entry of release" } else { "one per level" }
        );
        return Err(Problem::at(span, message));
    }
    let width = alphabet.ilog2();
    let whole = |bits: usize| match bits % width as usize {
        _ if bits > MAX_BITS => Err(Problem::at(
            span.clone(),
            format!("{bits} bits are more than the limit of {MAX_BITS}; send fewer"),
        )),
        0 => Ok(bits as u32 / width),
        _ => Err(Problem::at(
            span.clone(),
            format!("{bits} bits are not a multiple of {width} bits per symbol; add or remove some"),
        )),
    };
    let symbols = match (&transmitter.bits, &transmitter.random_bits) {
        (Some(bits), None) => {
            let text = bits.get_ref();
            if text.bytes().any(|byte| !b"01 _".contains(&byte)) {
                return Err(Problem::at(
                    span,
                    format!("'{}' may contain only 0, 1, spaces and '_'", excerpt(text.as_bytes())),
                ));
            }
            // Counted first, to bound the size of the vector.
            let mut bits = text.bytes().filter(|byte| b"01".contains(byte));
            let count = whole(bits.clone().count())?;
            if count == 0 {
                let message = "there are no bits, so that nothing is released; write some, or random-bits";
                return Err(Problem::at(span, message.to_owned()));
            }
            let mut symbol =
                || bits.by_ref().take(width as usize).fold(0, |all, bit| 2 * all + u32::from(bit - b'0'));
            Symbols::Given((0..count).map(|_| symbol()).collect())
        }
        (None, Some(count)) => {
            Symbols::Random { count: whole(count.get_ref().get() as usize)?, alphabet: alphabet as u32 }
        }
        _ => return Err(Problem::at(span, "give either bits or random-bits".to_owned())),
    };
    let start = transmitter.start.as_ref().map_or(0.0, |start| start.get_ref().0);
    Ok(Message { start, symbol_time: symbol_time.get_ref().0, symbols, modulation })
}

fn modulation(transmitter: &file::Transmitter) -> Result<Modulation, Problem> {
    let kind = transmitter.modulation.as_ref().map(|modulation| *modulation.get_ref()).unwrap_or_default();
    match (kind, &transmitter.levels) {
        (file::Modulation::Csk, Some(levels)) => {
            Ok(Modulation::Concentration(levels.get_ref().iter().map(|&NotNegative(level)| level).collect()))
        }
        (file::Modulation::Csk, None) => {
            let span = span_of(&transmitter.modulation).unwrap_or_default();
            let message =
                "csk needs levels: for each symbol the fraction of the release, as in [0, 0.5, 0.75, 1]";
            Err(Problem::at(span, message.to_owned()))
        }
        (_, Some(levels)) => {
            Err(Problem::at(levels.span(), "levels go with modulation = \"csk\"".to_owned()))
        }
        (file::Modulation::Ook, None) => Ok(Modulation::OnOff),
        (file::Modulation::Mosk, None) => Ok(Modulation::Molecule),
    }
}

pub(super) fn to_f32(center: [Finite; 3]) -> [f32; 3] {
    center.map(|Finite(x)| x as f32)
}

/// Refuses a radius above 0 that rounds to 0 in single precision.
pub(super) fn single_radius(radius: f64, span: Range<usize>) -> Result<f32, Problem> {
    let single = radius as f32;
    if radius > 0.0 && single == 0.0 {
        let message = format!(
            "the radius {radius:e} µm is 0 in single precision, whose smallest number is 1.4e-45; make it larger, or 0"
        );
        return Err(Problem::at(span, message));
    }
    Ok(single)
}
