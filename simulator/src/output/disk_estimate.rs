use super::{animation, frames, log_estimate, series, symbols};
use crate::output::options::Output;
use crate::{Model, ReceiverKind, RunView, State};

/// Remaining output, in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct DiskEstimate {
    /// Lower bound: particles disappear as soon as they can.
    pub(crate) min_bytes: u64,
    /// Upper bound: particles only decay, at the expected rate.
    pub(crate) max_bytes: u64,
    /// Bounds of the last checkpoint, included in both. The former one exists until it is complete.
    pub(crate) checkpoint: [u64; 2],
}

const SAMPLES: u32 = 1000;
/// Mean of a coordinate as text: eight digits, a point, half a sign.
const COORDINATE_BYTES: f64 = 9.7;

impl DiskEstimate {
    pub(crate) fn times(self, runs: u32) -> Self {
        let all = |bytes: u64| bytes.saturating_mul(runs.into());
        Self {
            min_bytes: all(self.min_bytes),
            max_bytes: all(self.max_bytes),
            checkpoint: self.checkpoint.map(all),
        }
    }

    pub(crate) fn new(run: &impl RunView, output: Output, steps: u32, scenario: &str) -> Self {
        let (model, from) = (run.model(), run.step_count());
        let counts = ParticleCounts::new(model, &run.totals().present, from, steps);
        let due = |every: u32| u64::from(steps / every - from / every);
        let frames = if output.xyz || output.npy { due(output.frames_every) } else { 0 };
        let rows = due(output.every) as f64 * row(model, &counts, [from, steps]);
        let mut empty = Vec::new();
        let mut header = 0;
        if output.xyz {
            drop(frames::xyz(&mut empty, model, &State { step: steps, ..State::default() }));
            header += empty.len();
        }
        header += if output.npy { frames::NPY_HEADER } else { 0 };
        let each = |species: usize| {
            let xyz = if output.xyz { text(model, species, counts.ids) } else { 0.0 };
            xyz + if output.npy { frames::NPY_ROW as f64 } else { 0.0 }
        };
        let frame: f64 = counts.mean.iter().enumerate().map(|(species, count)| count * each(species)).sum();
        let totals = 5 * (3 + model.receivers.len()) * model.species.len();
        let animation = output.animation.map_or(0.0, |animation| {
            let drawn = counts.mean.iter().sum::<f64>().min(u32::from(animation.particles).into());
            // Frames, and eight letters of the page per particle.
            due(animation.every) as f64 * (animation::bytes_of(model, drawn as u64) as f64 + 8.0 * drawn)
        });
        // Symbols are written when the run begins.
        let symbols = if from == 0 { symbols::expected_bytes(model) } else { 0.0 };
        let fixed = (scenario.len() + totals) as u64 + (rows + symbols) as u64 + frames * header as u64;
        let bytes_per_particle = if model.has_velocity() { 32.0 } else { 20.0 };
        let particles = |count: f64| (count * bytes_per_particle) as u64;
        let max_bytes = fixed + (frames as f64 * frame + animation) as u64 + particles(counts.last);
        let checkpoint = scenario.len() as u64 + particles(counts.last);
        let [min_bytes, min_checkpoint] =
            if loses(model) { [fixed, scenario.len() as u64] } else { [max_bytes, checkpoint] };
        let logs = log_estimate::remaining_bytes(
            model,
            [from, steps],
            [counts.ids, counts.mean.iter().sum()],
            output.every,
        );
        let max_bytes = max_bytes.saturating_add(logs as u64);
        Self { min_bytes, max_bytes, checkpoint: [min_checkpoint, checkpoint] }
    }
}

pub(crate) fn next_bytes(run: &impl RunView, output: Output) -> u64 {
    let model = run.model();
    let present = run.totals().present.iter().enumerate();
    let each = |species: usize| {
        let xyz = if output.xyz { text(model, species, 1e6) as u64 } else { 0 };
        xyz + if output.npy { frames::NPY_ROW } else { 0 } + 32
    };
    let all: u64 = run.totals().present.iter().sum();
    let animation = output
        .animation
        .map_or(0, |animation| animation::bytes_of(model, all.min(u32::from(animation.particles).into())));
    let frame: u64 = present.map(|(species, &count)| count * each(species)).sum();
    frame + animation + log_estimate::next(run) as u64 + (1 << 16)
}

fn loses(model: &Model) -> bool {
    let keeps = |kind: &ReceiverKind| matches!(kind, ReceiverKind::Transparent | ReceiverKind::Reflecting);
    model.decays.iter().any(|decay| decay.products[0].is_none())
        || model.reactions.iter().any(|reaction| reaction.products.contains(&None))
        || model.receivers.iter().any(|receiver| !keeps(&receiver.kind))
}

struct ParticleCounts {
    mean: Vec<f64>,
    last: f64,
    ids: f64,
}

impl ParticleCounts {
    fn new(model: &Model, present: &[u64], from: u32, steps: u32) -> Self {
        let mut now: Vec<f64> = present.iter().map(|&count| count as f64).collect();
        let mut ids = now.iter().sum();
        let mut mean = vec![0.0; now.len()];
        let moments = (steps - from.min(steps)).min(SAMPLES);
        let moment = |k: u32| from + (u64::from(steps - from) * u64::from(k) / u64::from(moments)) as u32;
        for k in 0..moments {
            let (begin, end) = (moment(k), moment(k + 1));
            for transmitter in &model.transmitters {
                let window = [begin, end].map(|step| step.saturating_add(1));
                for (species, count) in transmitter.mean_between(window, model.time_step) {
                    now[species as usize] += count;
                    ids += count;
                }
            }
            ids += decay(model, &mut now, f64::from(end - begin) * model.time_step);
            mean.iter_mut().zip(&now).for_each(|(mean, now)| *mean += now / f64::from(moments));
        }
        Self { mean, last: now.iter().sum(), ids }
    }
}

/// Returns the number of second products.
fn decay(model: &Model, now: &mut [f64], time: f64) -> f64 {
    let before = now.to_vec();
    let mut split = 0.0;
    for (species, count) in before.into_iter().enumerate() {
        let decays = || model.decays.iter().filter(|decay| decay.reactant as usize == species);
        let total: f64 = decays().map(|decay| decay.rate).sum();
        let decayed = -count * libm::expm1(-total * time);
        now[species] -= decayed;
        for decay in decays().filter(|_| total > 0.0) {
            let product_count = decayed * decay.rate / total;
            for product in decay.products.into_iter().flatten() {
                now[product as usize] += product_count;
            }
            split += if decay.splits() { product_count } else { 0.0 };
        }
    }
    split
}

fn text(model: &Model, species: usize, ids: f64) -> f64 {
    let kind = &model.species[species];
    let radius = kind.radius.to_string().len();
    digits(0.7 * ids) + (kind.name.len() + radius + 6) as f64 + 3.0 * COORDINATE_BYTES
}

fn row(model: &Model, counts: &ParticleCounts, [from, steps]: [u32; 2]) -> f64 {
    let moment = moment(model, [from, steps]);
    let species: f64 = counts.mean.iter().map(|&count| 1.0 + digits(count)).sum();
    let columns = model.reactions.len() + model.decays.len() + series::seen(model);
    let all: f64 = counts.mean.iter().sum();
    let pairs =
        if model.reactions.is_empty() && model.contact == Default::default() { 1.0 } else { digits(all) };
    moment + species + columns as f64 * (1.0 + digits(0.2 * all)) + 2.0 * (1.0 + pairs) + 1.0
}

pub(super) fn moment(model: &Model, [from, steps]: [u32; 2]) -> f64 {
    mean_length([from, steps], 16, |step| series::moment(step, model).len())
}

/// Averages over equally spaced numbers above `from`, the last of which is `to`.
pub(super) fn mean_length([from, to]: [u32; 2], numbers: u32, length: impl Fn(u32) -> usize) -> f64 {
    let number = |k: u32| from + (u64::from(to - from) * u64::from(k) / u64::from(numbers)) as u32;
    (1..=numbers).map(|k| length(number(k))).sum::<usize>() as f64 / f64::from(numbers)
}

pub(super) fn digits(count: f64) -> f64 {
    count.max(1.0).log10().floor() + 1.0
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;
    use std::path::Path;

    use lazygrid::Algorithm;

    use super::*;
    use crate::Simulation;
    use crate::run::Run;
    use crate::scenario::Scenario;

    fn foretold_and_written(text: &str) -> [u64; 3] {
        let scenario = Scenario::parse(Path::new("s.toml"), text.to_owned()).unwrap();
        let directory = tempfile::tempdir().unwrap();
        let run = Run::new(scenario.clone(), "s.toml", directory.path().join("out"));
        let mut forecast = None;
        run.run(|simulation| {
            forecast.get_or_insert_with(|| {
                DiskEstimate::new(simulation, scenario.output, scenario.steps, &scenario.text)
            });
            ControlFlow::Continue(())
        })
        .unwrap();
        let files = std::fs::read_dir(&run.directory).unwrap();
        let written = files.map(|file| file.unwrap().metadata().unwrap().len()).sum();
        let DiskEstimate { min_bytes, max_bytes, .. } = forecast.unwrap();
        [min_bytes, max_bytes, written]
    }

    const CLOUD: &str = "time-step = 0.01\nsteps = 400\n[[species]]\nname = 'A'\nradius = 0.01\ndiffusion = 2\n\
        [[transmitter]]\nname = 'tx'\ntimes = [0, 1, 2, 3]\nrelease = [{ species = 'A', count = 500 }]\n";

    #[test]
    fn estimate_is_within_half_of_the_output() {
        let decaying = "[[decay]]\nequation = 'A ->'\nrate = 5\n";
        let watched = "[[receiver]]\nname = 'rx'\ncenter = [1, 0, 0]\nradius = 1\nkind = 'transparent'\n";
        let mirrored = "[[receiver]]\nname = 'rx'\ncenter = [9, 0, 0]\nradius = 1\nkind = 'reflecting'\n";
        let message = "[[transmitter]]\nname = 'sender'\nrandom-bits = 20000\nsymbol-time = 0.1\n\
            release = [{ species = 'A', count = 1 }]\n";
        let frames = "[output]\nevery = 100\nframes-every = 20\nframes = ";
        for (what, more) in [
            ("rows", "[output]\nevery = 1\n".to_owned()),
            ("text", format!("{frames}['xyz']\n")),
            ("binary", format!("{frames}['npy']\n")),
            ("reflecting", format!("{mirrored}{frames}['npy']\n")),
            ("decay", format!("{decaying}{watched}{frames}['xyz', 'npy']\n")),
            ("symbols", format!("{message}[output]\nevery = 400\n")),
        ] {
            let [min_bytes, max_bytes, written] = foretold_and_written(&format!("{CLOUD}{more}"));
            let ratio = max_bytes as f64 / written as f64;
            assert!((1.0 / 1.5..1.5).contains(&ratio), "{what}: {max_bytes} foretold, {written} written");
            assert!(
                if what == "decay" { min_bytes < written } else { min_bytes == max_bytes },
                "{what}: {min_bytes}"
            );
        }
    }

    #[test]
    fn estimate_includes_the_logs() {
        let receiver = |kind: &str| {
            format!("[[receiver]]\nname = 'rx'\ncenter = [0, 0, 0]\nradius = 1e3\nkind = '{kind}'\n")
        };
        let steady = "[[transmitter]]\nname = 'steady'\nrelease = [{ species = 'A', rate = 1e3 }]\n";
        let output = |every: u32| format!("[output]\nevery = {every}\narrivals = true\n");
        for (what, more, limit) in [
            ("arrivals", receiver("endpoint") + &output(400), 2.0),
            ("releases", steady.to_owned() + &output(400), 3.0),
            ("occupancy", receiver("transparent") + &output(1), 3.0),
        ] {
            let [_, max_bytes, written] = foretold_and_written(&format!("{CLOUD}{more}"));
            let ratio = max_bytes as f64 / written as f64;
            assert!((1.0..limit).contains(&ratio), "{what}: {max_bytes} foretold, {written} written");
        }
    }

    #[test]
    fn longest_run_has_an_estimate() {
        let text = CLOUD.replace("0.01\nsteps = 400", "1e-9\nsteps = 4294967295");
        let scenario = Scenario::parse(Path::new("s.toml"), text).unwrap();
        let simulation = Simulation::new(scenario.model, 0, Algorithm::Auto).unwrap();
        let output = Output { every: u32::MAX, ..scenario.output };
        let estimate = DiskEstimate::new(&simulation, output, scenario.steps, &scenario.text);
        assert!((40_000..60_000).contains(&estimate.max_bytes), "{estimate:?}");
    }

    #[test]
    fn absorbed_particles_lower_the_estimate() {
        let absorbed = "[[receiver]]\nname = 'rx'\ncenter = [0.5, 0, 0]\nradius = 3\nkind = 'absorbing'\n\
                        [output]\nevery = 100\nframes-every = 10\nframes = ['xyz']\n";
        let [min_bytes, max_bytes, written] = foretold_and_written(&format!("{CLOUD}{absorbed}"));
        assert!(
            max_bytes > 4 * written && min_bytes <= written,
            "{min_bytes} to {max_bytes} foretold, {written} written"
        );
    }
}
