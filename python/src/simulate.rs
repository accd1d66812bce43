//! Runs of the simulator, with counts and particles as arrays.

use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::time::Instant;

use lazygrid::{Algorithm, Backend, thread_pool};
use lazygrid_sim::model::transmitter::Schedule;
use lazygrid_sim::random::philox::Key;
use lazygrid_sim::scenario::Scenario;
use lazygrid_sim::{AnySimulation, Error, Model, Particles, RunView, check_available, series};
use numpy::PyArray1;
use pyo3::exceptions::{PyOverflowError, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict};
use rayon::ThreadPool;

use crate::arrays;
use crate::interruptible::SIGNAL_POLL;
use crate::{error, fork};

/// Levels of dictionaries and lists in a scenario, as the parser of TOML allows. A list may contain itself.
const MAX_DEPTH: u32 = 80;

/// A file, its text, or a dictionary.
#[derive(FromPyObject)]
pub(crate) enum Source<'py> {
    Dict(Bound<'py, PyDict>),
    Text(String),
    File(PathBuf),
}

pub(crate) struct Options {
    seed: Option<u64>,
    steps: Option<u32>,
    every: Option<u32>,
    frames_every: Option<u32>,
    backend: String,
    algorithm: String,
    threads: Option<usize>,
}

impl<'py> FromPyObject<'_, 'py> for Options {
    type Error = PyErr;

    fn extract(options: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        Ok(Self {
            seed: whole(&options, "seed")?,
            steps: whole(&options, "steps")?,
            every: whole(&options, "every")?,
            frames_every: whole(&options, "frames_every")?,
            backend: options.get_item("backend")?.extract()?,
            algorithm: options.get_item("algorithm")?.extract()?,
            threads: whole(&options, "threads")?,
        })
    }
}

/// Reads a whole number; a `SettingError` if `T` does not hold it.
fn whole<T>(options: &Bound<'_, PyAny>, name: &str) -> PyResult<Option<T>>
where
    Option<T>: for<'a, 'py> FromPyObject<'a, 'py, Error = PyErr>,
{
    let value = options.get_item(name)?;
    value.extract().map_err(|error: PyErr| match error.is_instance_of::<PyOverflowError>(value.py()) {
        true => error::setting(format!(
            "{name} = {value} is out of range; choose a whole number from 0 to 2**{} - 1",
            8 * size_of::<T>()
        )),
        false => PyTypeError::new_err(format!("{name} is {value}; give a whole number")),
    })
}

struct Run {
    scenario: Scenario,
    simulation: AnySimulation,
    every: u32,
    frames_every: Option<u32>,
    steps: Vec<u32>,
    counts: Vec<Vec<u64>>,
    frames: Vec<(u32, Particles)>,
    /// `None` for the global pool.
    pool: Option<ThreadPool>,
}

impl Run {
    fn new(mut scenario: Scenario, options: &Options) -> PyResult<Self> {
        let backend: Backend = options.backend.parse().map_err(error::unknown)?;
        let algorithm: Algorithm = options.algorithm.parse().map_err(error::unknown)?;
        scenario.seed = options.seed.unwrap_or(scenario.seed);
        scenario.steps = options.steps.unwrap_or(scenario.steps);
        let every = options.every.unwrap_or(scenario.output.every);
        for (name, steps) in [("every", Some(every)), ("frames_every", options.frames_every)] {
            if steps == Some(0) {
                return Err(error::setting(format!("{name} = 0 is out of range; choose at least one step")));
            }
        }
        let begun = AnySimulation::begin(&scenario.model, scenario.seed, backend, algorithm, None);
        let simulation = begun.map_err(error::simulator)?;
        let counts = vec![Vec::new(); series::names(&scenario.model).len()];
        check_series(&scenario, every, counts.len()).map_err(error::simulator)?;
        let pool = options.threads.map(|threads| thread_pool(threads).map_err(error::engine));
        let (steps, frames, frames_every) = (Vec::new(), Vec::new(), options.frames_every);
        let pool = pool.transpose()?;
        Ok(Self { scenario, simulation, every, frames_every, steps, counts, frames, pool })
    }

    fn finish(&mut self, py: Python<'_>) -> PyResult<()> {
        self.record().map_err(error::simulator)?;
        while self.simulation.step_count() < self.scenario.steps {
            py.detach(|| self.some_steps()).map_err(error::simulator)?;
            py.check_signals()?;
        }
        Ok(())
    }

    fn some_steps(&mut self) -> Result<(), Error> {
        let began = Instant::now();
        while self.simulation.step_count() < self.scenario.steps && began.elapsed() < SIGNAL_POLL {
            let step = self.simulation.step_count();
            let due = |every: u32| every - step % every;
            let most = due(self.every).min(self.frames_every.map_or(u32::MAX, due));
            let most = most.min(self.scenario.steps - step);
            match &self.pool {
                Some(pool) => pool.install(|| self.simulation.advance(most))?,
                None => self.simulation.advance(most)?,
            }
            self.record()?;
        }
        Ok(())
    }

    fn record(&mut self) -> Result<(), Error> {
        let step = self.simulation.step_count();
        if step.is_multiple_of(self.every) {
            self.steps.push(step);
            let counts = series::counts(&self.simulation);
            self.counts.iter_mut().zip(counts).for_each(|(column, count)| column.push(count));
        }
        if self.frames_every.is_some_and(|every| step.is_multiple_of(every)) {
            self.frames.push((step, particles_of(&self.simulation)?));
        }
        Ok(())
    }

    fn dict<'py>(self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let model = &self.scenario.model;
        let last = particles_of(&self.simulation).map_err(error::simulator)?;
        let named = PyDict::new(py);
        named.set_item("particles", particles(py, self.simulation.step_count(), last)?)?;
        named.set_item("symbols", symbols(py, model, self.scenario.seed)?)?;
        named.set_item("species", model.species.iter().map(|species| &species.name).collect::<Vec<_>>())?;
        named.set_item("seed", self.scenario.seed)?;
        named.set_item("time_step", model.time_step)?;
        let columns = PyDict::new(py);
        let times: Vec<_> = self.steps.iter().map(|&step| f64::from(step) * model.time_step).collect();
        columns.set_item("step", PyArray1::from_vec(py, self.steps))?;
        columns.set_item("time", PyArray1::from_vec(py, times))?;
        for (name, counts) in series::names(model).into_iter().zip(self.counts) {
            columns.set_item(name, PyArray1::from_vec(py, counts))?;
        }
        named.set_item("series", columns)?;
        let frames = self.frames.into_iter().map(|(step, frame)| particles(py, step, frame));
        named.set_item("frames", frames.collect::<PyResult<Vec<_>>>()?)?;
        Ok(named)
    }
}

/// Return the results of a run, and warnings. See :func:`lazygrid.simulate`.
#[pyfunction]
pub(crate) fn simulate<'py>(
    py: Python<'py>,
    source: Source<'py>,
    options: Options,
) -> PyResult<(Bound<'py, PyDict>, Vec<String>)> {
    if options.threads.is_some() { fork::use_threads() } else { fork::use_global_threads() }?;
    let mut run = Run::new(parse_scenario(source)?, &options)?;
    let advice = [run.scenario.warnings.clone(), run.scenario.run_warnings()].concat();
    run.finish(py)?;
    Ok((run.dict(py)?, advice))
}

pub(crate) fn parse_scenario(source: Source<'_>) -> PyResult<Scenario> {
    match source {
        Source::Dict(dict) => parse(toml::to_string(&table(&dict, MAX_DEPTH)?).map_err(error::setting)?),
        // A file name never has several lines.
        Source::Text(text) if text.contains('\n') => parse(text),
        Source::Text(path) => Scenario::read(Path::new(&path)).map_err(error::simulator),
        Source::File(path) => Scenario::read(&path).map_err(error::simulator),
    }
}

fn parse(text: String) -> PyResult<Scenario> {
    Scenario::parse(Path::new("scenario"), text).map_err(error::simulator)
}

/// Refuses a run whose counts at all rows do not fit the memory.
fn check_series(scenario: &Scenario, every: u32, columns: usize) -> Result<(), Error> {
    // A growing vector holds twice its elements at most. Steps and times are two more columns.
    let row = 2 * size_of::<u64>() * (columns + 2);
    let rows = u64::from(scenario.steps / every) + 1;
    let remedy = "record fewer rows (every=), or raise the limit";
    check_available(&format!("the counts of {rows} rows"), rows.saturating_mul(row as u64), remedy)
}

/// Returns a copy, or an error if memory is short.
fn particles_of(simulation: &AnySimulation) -> Result<Particles, Error> {
    match simulation.state()? {
        Cow::Borrowed(state) => state.particles.try_clone(),
        Cow::Owned(state) => Ok(state.particles),
    }
}

/// In the order of ids.
fn particles<'py>(py: Python<'py>, step: u32, particles: Particles) -> PyResult<Bound<'py, PyDict>> {
    let mut ordered = Particles::default();
    ordered.reserve(particles.len() as u64, particles.has_velocity()).map_err(error::simulator)?;
    for at in particles.by_id() {
        ordered.push(particles.get(at as usize), particles.has_velocity());
    }
    drop(particles);
    let rows = |columns: &[Vec<f32>; 3]| {
        let [x, y, z] = columns;
        let rows: Vec<[f32; 3]> = x.iter().zip(y).zip(z).map(|((&x, &y), &z)| [x, y, z]).collect();
        arrays::rows::<[f32; 3], f32>(py, rows, 3)
    };
    let named = PyDict::new(py);
    named.set_item("step", step)?;
    named.set_item("position", rows(&ordered.position)?)?;
    let velocity = ordered.has_velocity().then(|| rows(&ordered.velocity)).transpose()?;
    named.set_item("velocity", velocity)?;
    named.set_item("radius", PyArray1::from_vec(py, ordered.radius))?;
    named.set_item("species", PyArray1::from_vec(py, ordered.species))?;
    named.set_item("id", PyArray1::from_vec(py, ordered.id))?;
    Ok(named)
}

/// The sent symbols, one per row, like `symbols.csv`.
fn symbols<'py>(py: Python<'py>, model: &Model, seed: u64) -> PyResult<Bound<'py, PyDict>> {
    let (mut times, mut names, mut sent) = (Vec::new(), Vec::new(), Vec::new());
    for (index, transmitter) in (0..).zip(&model.transmitters) {
        let Schedule::Message(message) = &transmitter.schedule else { continue };
        for k in 0..message.symbols.len() {
            times.push(message.time_of(k));
            names.push(transmitter.name.clone());
            sent.push(message.symbol(k, index, Key::new(seed)));
        }
    }
    let columns = PyDict::new(py);
    columns.set_item("time", PyArray1::from_vec(py, times))?;
    columns.set_item("transmitter", names)?;
    columns.set_item("symbol", PyArray1::from_vec(py, sent))?;
    Ok(columns)
}

/// Has at most `depth` levels.
fn table(dict: &Bound<'_, PyDict>, depth: u32) -> PyResult<toml::Table> {
    let entry = |(key, value): (Bound<'_, PyAny>, Bound<'_, PyAny>)| {
        Ok((key.extract::<String>()?, toml_value(&value, depth)?))
    };
    // `None` omits a key of the scenario.
    dict.iter().filter(|(_, value)| !value.is_none()).map(entry).collect()
}

/// Has at most `depth` levels below it.
fn toml_value(value: &Bound<'_, PyAny>, depth: u32) -> PyResult<toml::Value> {
    let too_deep = || {
        error::setting(format!(
            "the scenario has more than {MAX_DEPTH} levels of dictionaries and lists, or one that contains itself; nest fewer"
        ))
    };
    let inner = || depth.checked_sub(1).ok_or_else(too_deep);
    if let Ok(dict) = value.cast::<PyDict>() {
        return Ok(toml::Value::Table(table(dict, inner()?)?));
    }
    if let Ok(word) = value.extract::<String>() {
        return Ok(toml::Value::String(word));
    }
    if let Ok(truth) = value.cast::<PyBool>() {
        return Ok(toml::Value::Boolean(truth.is_true()));
    }
    if let Ok(whole) = value.extract::<i64>() {
        return Ok(toml::Value::Integer(whole));
    }
    if let Ok(number) = value.extract::<f64>() {
        return Ok(toml::Value::Float(number));
    }
    // Lists, tuples and arrays.
    match value.try_iter() {
        Ok(items) => {
            let depth = inner()?;
            let values = items.map(|item| toml_value(&item?, depth));
            Ok(toml::Value::Array(values.collect::<PyResult<_>>()?))
        }
        Err(_) => Err(PyTypeError::new_err(format!("a scenario cannot hold {}", value.repr()?))),
    }
}
