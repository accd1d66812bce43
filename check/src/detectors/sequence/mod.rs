//! Sequences of random calls of one detector. Most only move the spheres, so candidate lists are reused. Each
//! answer is compared with the definition and with a new detector.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use lazygrid::{Config, Detector, Interaction, Order, Skin, Space};

use crate::detectors::compare::FailedCase;
use crate::detectors::variant::{TargetDevice, text};
use crate::{DetectorVariant, Gpu, SpeciesSetup, TestInput, catch_panic};

mod definition;
mod draw;
mod events;
mod faults;
mod reduce;
mod request;
mod round;
#[cfg(test)]
mod tests;
mod verifier;

use request::{Answer, Output, Request};
use verifier::Verifier;

#[derive(Clone, Debug)]
pub struct Sequence {
    seed: u64,
    settings: Settings,
    steps: Vec<Step>,
}

#[derive(Clone, Debug)]
struct Settings {
    variant: DetectorVariant,
    skin: Skin,
    order: Order,
    max_pairs: u64,
    space: Space,
    rows: Option<Vec<Vec<Interaction>>>,
}

#[derive(Clone, Debug)]
struct Step {
    scenario: TestInput,
    changes: Vec<&'static str>,
    request: Request,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    pub sequences: u64,
    pub calls: u64,
    /// Calls that reused a candidate list.
    pub served: u64,
    pub refused: u64,
}

type Wrong = (usize, String);

impl Sequence {
    pub fn drawn(seed: u64, on_cpu: bool, on_gpu: bool) -> Self {
        draw::sequence(seed, |random| draw::variant(random, on_cpu, on_gpu))
    }

    /// Draws few calls with mostly unrelated scenes of all families.
    pub fn round(seed: u64, on_cpu: bool, on_gpu: bool) -> Self {
        round::round(seed, on_cpu, on_gpu)
    }

    pub fn drawn_for(seed: u64, variant: DetectorVariant) -> Self {
        draw::sequence(seed, |_| variant)
    }

    /// Shrinks a failure in at most `tries` further runs.
    pub fn check(self, gpu: Option<&Gpu>, tries: usize, tally: &mut Tally) -> Option<FailedCase> {
        let first = self.run_guarded(gpu, tally);
        tally.sequences += 1;
        let wrong = first.err()?;
        let again = |sequence: &Self| sequence.run_guarded(gpu, &mut Tally::default());
        let (sequence, (_, what)) = reduce::reduce(self, wrong, tries, again);
        let scenario = sequence.steps.last().map(|step| step.scenario.clone());
        let (name, options) = (sequence.to_string(), sequence.options(gpu));
        let environment = sequence.settings.variant.environment();
        Some(FailedCase { name, what, scenario, options, environment })
    }

    /// Returns the options of `lazygrid detect` that repeat a single call.
    fn options(&self, gpu: Option<&Gpu>) -> String {
        let Settings { variant, skin, order, max_pairs, rows, .. } = &self.settings;
        let options = variant.options(gpu);
        let [Step { scenario, request, .. }] = &self.steps[..] else { return String::new() };
        let has_table = rows.is_some() || scenario.mixture.is_some();
        if options.is_empty() || *skin != Skin::Auto || has_table || !request.is_plain() {
            return String::new();
        }
        let unordered = if *order == Order::Unordered { " --unordered" } else { "" };
        match request.output {
            Output::Count => options + " --count",
            Output::Neighbors => format!("{options} --neighbors --max-pairs {max_pairs} -o neighbors.csv"),
            Output::List | Output::Stream { .. } => {
                format!("{options}{unordered} --max-pairs {max_pairs} -o pairs.csv")
            }
        }
    }

    fn run_guarded(&self, gpu: Option<&Gpu>, tally: &mut Tally) -> Result<(), Wrong> {
        let mut at = 0;
        let run = catch_panic(|| self.run(gpu, &mut at, tally));
        run.map_err(|what| (at, format!("call {} of {}: {what}", at + 1, self.steps.len())))
    }

    fn run(&self, gpu: Option<&Gpu>, at: &mut usize, tally: &mut Tally) -> Result<(), String> {
        let stop = Arc::new(AtomicBool::new(false));
        let config = self.settings.config(gpu)?.cancel_flag(stop.clone());
        let mut detector = Detector::new(config.clone()).map_err(text)?;
        for (k, step) in self.steps.iter().enumerate() {
            *at = k;
            let verifier = Verifier::new(&self.settings, step);
            let answer = step.request.answer(&mut detector, &step.scenario, &stop)?;
            tally.calls += 1;
            tally.refused += u64::from(matches!(answer, Answer::Refused(_)));
            let report = detector.report();
            tally.served += u64::from(report.candidates.is_some_and(|stats| stats.rebuilt.is_none()));
            let verdict = verifier.verdict(&answer).and_then(|()| verifier.report(&answer, &report));
            let fresh = || {
                let mut fresh = Detector::new(self.settings.fresh(config.clone())).map_err(text)?;
                step.request.answer(&mut fresh, &step.scenario, &stop)
            };
            if let Err(what) = verdict {
                let of_new = match fresh().and_then(|answer| verifier.verdict(&answer)) {
                    Ok(()) => "a new detector is right".to_owned(),
                    Err(what) => format!("a new detector is wrong as well: {what}"),
                };
                return Err(format!("{what}; {of_new}; {}", report.reason));
            }
            if self.settings.compares_with_new(k, &answer) {
                verifier.alike(&answer, &fresh()?)?;
            }
        }
        Ok(())
    }
}

impl Settings {
    fn config(&self, gpu: Option<&Gpu>) -> Result<Config, String> {
        let config = self.variant.config(gpu).skin(self.skin).order(self.order).max_pairs(self.max_pairs);
        let config = if self.space.is_periodic() { config.space(self.space) } else { config };
        let Some(rows) = self.rows.clone() else { return Ok(config) };
        let table = SpeciesSetup { species: Vec::new(), rows }.interactions().map_err(text)?;
        Ok(config.interactions(table))
    }

    /// Uses one CPU thread: creating a pool takes longer than a call, and threads do not change the answer.
    fn fresh(&self, config: Config) -> Config {
        match self.variant.target {
            TargetDevice::Cpu { .. } => config.threads(1),
            TargetDevice::Gpu { .. } => config,
        }
    }

    /// Creating a detector on a GPU takes longer than many calls, so only some are compared.
    fn compares_with_new(&self, k: usize, answer: &Answer) -> bool {
        let is_on_cpu = matches!(self.variant.target, TargetDevice::Cpu { .. });
        is_on_cpu || k % 8 == 7 || matches!(answer, Answer::Refused(_))
    }
}

impl fmt::Display for Sequence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Settings { variant, skin, order, max_pairs, space, rows } = &self.settings;
        let space = match (space.is_periodic(), space.triclinic_cell().is_some()) {
            (_, true) => "triclinic",
            (true, false) => "periodic",
            (false, _) => "unbounded",
        };
        write!(f, "fuzz seed {}: {variant}, {skin:?}, {order:?}, at most {max_pairs} pairs, ", self.seed)?;
        write!(f, "{space} space")?;
        rows.as_ref().map_or(Ok(()), |rows| write!(f, ", interactions {rows:?}"))?;
        for (k, Step { scenario, changes, request }) in self.steps.iter().enumerate() {
            let with = if changes.is_empty() { String::new() } else { format!(" ({})", changes.join(", ")) };
            write!(f, "; {}. {request} of {}{with}", k + 1, scenario.spheres.len())?;
        }
        Ok(())
    }
}
