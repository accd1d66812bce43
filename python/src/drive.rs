//! A run that Python drives step by step; `lazygrid.Simulation` wraps it.
//!
//! # Correctness
//!
//! Arrays of particles view the columns of the simulation without a copy, and never change:
//!
//! 1. The base of each array is a [`ColumnsOwner`], which holds the simulation and the [`SharedColumns`] of the arrays.
//! 2. While no method changes the particles, the simulation owns the memory of the columns, and lives by step 1.
//! 3. Before a method changes particles, it calls [`Inner::detach`]. If an array is alive, that moves the columns into
//!    `SharedColumns` and leaves a copy in the simulation. Moving a `Vec` does not move its memory.
//! 4. Methods that change particles or create arrays hold the mutex.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, TryLockError, Weak};
use std::time::Instant;

use lazygrid::{Algorithm, Backend, thread_pool};
use lazygrid_sim::run::checkpoint::Checkpoint;
use lazygrid_sim::run::replicas::seed_of;
use lazygrid_sim::scenario::Scenario;
use lazygrid_sim::{AnySimulation, Arrival, Error, Particles, RunView, series};
use numpy::ndarray::{ArrayView1, Ix1};
use numpy::{Element, PyArray1, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::ThreadPool;

use crate::error;
use crate::fork::{self, Process};
use crate::interruptible::SIGNAL_POLL;
use crate::simulate::{Source, parse_scenario};

/// A run, step by step. See :class:`lazygrid.Simulation`.
#[pyclass(frozen, module = "lazygrid._lazygrid")]
pub(crate) struct SimulationCore {
    inner: Mutex<Inner>,
    /// The process that has the threads of the run.
    process: Process,
}

struct Inner {
    simulation: AnySimulation,
    scenario: Scenario,
    /// `None` for the global pool.
    pool: Option<ThreadPool>,
    /// The arrivals of the last `step` call.
    arrivals: Vec<Arrival>,
    /// The columns that arrays view.
    shared: Weak<SharedColumns>,
}

/// Columns that the simulation has given up because arrays view them.
#[derive(Default)]
struct SharedColumns(OnceLock<Particles>);

#[pyclass(frozen)]
#[expect(dead_code, reason = "the fields keep memory alive")]
struct ColumnsOwner {
    columns: Arc<SharedColumns>,
    simulation: Py<SimulationCore>,
}

#[pymethods]
impl SimulationCore {
    #[new]
    #[pyo3(signature = (source, *, seed, replica, backend, algorithm, threads, checkpoint))]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn new(
        py: Python<'_>,
        source: Source<'_>,
        seed: Option<u64>,
        replica: Option<u32>,
        backend: &str,
        algorithm: &str,
        threads: Option<usize>,
        checkpoint: Option<PathBuf>,
    ) -> PyResult<Self> {
        if threads.is_some() { fork::use_threads() } else { fork::use_global_threads() }?;
        let mut scenario = parse_scenario(source)?;
        let backend: Backend = backend.parse().map_err(error::unknown)?;
        let algorithm: Algorithm = algorithm.parse().map_err(error::unknown)?;
        scenario.seed = seed.unwrap_or(scenario.seed);
        if let Some(replica) = replica {
            scenario.seed = seed_of(scenario.seed, replica);
        }
        scenario.model.logs_arrivals |= AnySimulation::can_log_arrivals(&scenario.model, backend);
        let pool = threads.map(|threads| thread_pool(threads).map_err(error::engine));
        let pool = pool.transpose()?;
        let begun = py.detach(|| {
            let state = match checkpoint {
                None => None,
                Some(path) => {
                    let checkpoint = Checkpoint::read(&path)?;
                    if checkpoint.scenario != scenario.text {
                        let message =
                            "it is of another scenario; pass the scenario that it was written with".into();
                        return Err(Error::Checkpoint { path, message });
                    }
                    checkpoint.check_flow_field(&path, &scenario.model)?;
                    scenario.seed = checkpoint.seed;
                    Some(checkpoint.into_state(&path)?)
                }
            };
            AnySimulation::begin(&scenario.model, scenario.seed, backend, algorithm, state)
        });
        let simulation = begun.map_err(error::simulator)?;
        let inner = Inner { simulation, scenario, pool, arrivals: Vec::new(), shared: Weak::new() };
        Ok(Self { inner: Mutex::new(inner), process: Process::current() })
    }

    /// Does some steps. A signal stops the run at the step that it has reached.
    fn step(&self, py: Python<'_>, steps: u32) -> PyResult<()> {
        let mut inner = self.lock_with_threads()?;
        let inner = &mut *inner;
        inner.detach()?;
        inner.arrivals.clear();
        let step = inner.simulation.step_count();
        let Some(end) = step.checked_add(steps) else {
            return Err(error::setting(format!(
                "steps = {steps} after {step} steps; a run has at most 2**32 - 1 steps"
            )));
        };
        while inner.simulation.step_count() < end {
            py.detach(|| inner.advance(end)).map_err(error::simulator)?;
            py.check_signals()?;
        }
        Ok(())
    }

    fn insert<'py>(
        &self,
        py: Python<'py>,
        species: u32,
        positions: PyReadonlyArray2<'py, f32>,
    ) -> PyResult<Bound<'py, PyArray1<u32>>> {
        // `as_slice` also reads the other order of memory, column by column.
        if positions.shape()[1] != 3 || !positions.is_c_contiguous() {
            return Err(error::array(format!(
                "positions have shape {:?} where (n, 3) in C order is needed",
                positions.shape()
            )));
        }
        let mut inner = self.lock_with_threads()?;
        inner.detach()?;
        let positions = positions.as_slice()?.as_chunks::<3>().0;
        let ids = inner.simulation.add(species, positions).map_err(error::simulator)?;
        Ok(PyArray1::from_iter(py, ids))
    }

    fn remove(&self, ids: PyReadonlyArray1<'_, u32>) -> PyResult<usize> {
        let mut inner = self.lock_with_threads()?;
        inner.detach()?;
        inner.simulation.remove(ids.as_slice()?).map_err(error::simulator)
    }

    fn emit<'py>(
        &self,
        py: Python<'py>,
        transmitter: u32,
        species: u32,
        count: u32,
    ) -> PyResult<Bound<'py, PyArray1<u32>>> {
        let mut inner = self.lock_with_threads()?;
        inner.detach()?;
        let ids = inner.simulation.emit(transmitter, species, count).map_err(error::simulator)?;
        Ok(PyArray1::from_iter(py, ids))
    }

    /// The columns of all particles, as read-only arrays.
    fn particles<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyDict>> {
        let py = slf.py();
        let mut inner = slf.get().lock()?;
        let columns = PyDict::new(py);
        columns.set_item("step", inner.simulation.step_count())?;
        if let AnySimulation::Cpu(_) = inner.simulation {
            let shared = inner.shared.upgrade().unwrap_or_default();
            inner.shared = Arc::downgrade(&shared);
            let owner = Bound::new(py, ColumnsOwner { columns: shared, simulation: slf.clone().unbind() })?
                .into_any();
            let state = inner.simulation.state().map_err(error::simulator)?;
            let particles = &state.particles;
            let is_moving = particles.has_velocity();
            for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
                // SAFETY: the memory of a column lives and does not change while the owner lives; see the module.
                columns.set_item(name, unsafe { view(&particles.position[axis], &owner) }?)?;
            }
            for (axis, name) in ["vx", "vy", "vz"].into_iter().enumerate() {
                // SAFETY: as above.
                let velocity = is_moving.then(|| unsafe { view(&particles.velocity[axis], &owner) });
                columns.set_item(name, velocity.transpose()?)?;
            }
            // SAFETY: as above.
            unsafe {
                columns.set_item("radius", view(&particles.radius, &owner)?)?;
                columns.set_item("species", view(&particles.species, &owner)?)?;
                columns.set_item("id", view(&particles.id, &owner)?)?;
            }
            return Ok(columns);
        }
        let particles = inner.simulation.state().map_err(error::simulator)?.into_owned().particles;
        let is_moving = particles.has_velocity();
        for (name, column) in ["x", "y", "z"].into_iter().zip(particles.position) {
            columns.set_item(name, PyArray1::from_vec(py, column))?;
        }
        for (name, column) in ["vx", "vy", "vz"].into_iter().zip(particles.velocity) {
            columns.set_item(name, is_moving.then(|| PyArray1::from_vec(py, column)))?;
        }
        columns.set_item("radius", PyArray1::from_vec(py, particles.radius))?;
        columns.set_item("species", PyArray1::from_vec(py, particles.species))?;
        columns.set_item("id", PyArray1::from_vec(py, particles.id))?;
        Ok(columns)
    }

    /// The counts, named like the columns of a series.
    fn counts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let inner = self.lock()?;
        let counts = PyDict::new(py);
        let names = series::names(&inner.scenario.model);
        for (name, count) in names.into_iter().zip(series::counts(&inner.simulation)) {
            counts.set_item(name, count)?;
        }
        Ok(counts)
    }

    /// The arrivals of the last `step` call.
    fn arrivals<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let inner = self.lock()?;
        let model = &inner.scenario.model;
        if !model.logs_arrivals {
            return Err(error::setting(format!(
                "a GPU logs no arrivals for {} receivers and {} species, whose product exceeds its limit; choose the CPU",
                model.receivers.len(),
                model.species.len()
            )));
        }
        let arrivals = &inner.arrivals;
        let columns = PyDict::new(py);
        let origin = |field: fn(lazygrid_sim::Origin) -> u32| {
            let number =
                move |arrival: &Arrival| arrival.origin.map_or(-1, |origin| i64::from(field(origin)));
            PyArray1::from_iter(py, arrivals.iter().map(number))
        };
        columns.set_item("step", PyArray1::from_iter(py, arrivals.iter().map(|a| a.step)))?;
        columns.set_item("receiver", PyArray1::from_iter(py, arrivals.iter().map(|a| a.receiver)))?;
        columns.set_item("species", PyArray1::from_iter(py, arrivals.iter().map(|a| a.species)))?;
        columns.set_item("id", PyArray1::from_iter(py, arrivals.iter().map(|a| a.id)))?;
        columns.set_item("transmitter", origin(|origin| origin.transmitter))?;
        columns.set_item("released", origin(|origin| origin.step))?;
        Ok(columns)
    }

    fn checkpoint(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let inner = self.lock_with_threads()?;
        let inner = &*inner;
        py.detach(|| inner.write_checkpoint(path)).map_err(error::simulator)
    }

    #[getter]
    fn step_count(&self) -> PyResult<u32> {
        Ok(self.lock()?.simulation.step_count())
    }

    #[getter]
    fn time_step(&self) -> PyResult<f64> {
        Ok(self.lock()?.scenario.model.time_step)
    }

    #[getter]
    fn seed(&self) -> PyResult<u64> {
        Ok(self.lock()?.scenario.seed)
    }

    #[getter]
    fn species(&self) -> PyResult<Vec<String>> {
        Ok(self.lock()?.scenario.model.species.iter().map(|species| species.name.clone()).collect())
    }

    #[getter]
    fn transmitters(&self) -> PyResult<Vec<String>> {
        Ok(self.lock()?.scenario.model.transmitters.iter().map(|from| from.name.clone()).collect())
    }

    #[getter]
    fn receivers(&self) -> PyResult<Vec<String>> {
        Ok(self.lock()?.scenario.model.receivers.iter().map(|receiver| receiver.name.clone()).collect())
    }

    #[getter]
    fn warnings(&self) -> PyResult<Vec<String>> {
        Ok(self.lock()?.scenario.warnings.clone())
    }
}

impl SimulationCore {
    /// Locks the run for work that may need its threads; an `Error` in a forked process.
    fn lock_with_threads(&self) -> PyResult<MutexGuard<'_, Inner>> {
        self.process.check()?;
        self.lock()
    }

    /// Locks the run for reads. A forked process may read a run on the CPU.
    fn lock(&self) -> PyResult<MutexGuard<'_, Inner>> {
        let inner = self.try_lock()?;
        if !matches!(inner.simulation, AnySimulation::Cpu(_)) {
            self.process.check()?;
        }
        Ok(inner)
    }

    fn try_lock(&self) -> PyResult<MutexGuard<'_, Inner>> {
        // A waiting thread would hold the interpreter's lock, for which the other thread may wait.
        match self.inner.try_lock() {
            Ok(inner) => Ok(inner),
            Err(TryLockError::WouldBlock) => Err(error::other(
                "another thread or a signal's handler uses the simulation; wait until its call has returned",
            )),
            Err(TryLockError::Poisoned(_)) => {
                Err(error::other("an earlier call of the simulation panicked; create a new simulation"))
            }
        }
    }
}

impl Inner {
    /// Gives up the columns that arrays view, before particles change.
    fn detach(&mut self) -> PyResult<()> {
        if let Some(shared) = self.shared.upgrade()
            && let AnySimulation::Cpu(run) = &mut self.simulation
        {
            let columns = run.detach_particles().map_err(error::simulator)?;
            assert!(shared.0.set(columns).is_ok(), "shared columns are given up once");
        }
        self.shared = Weak::new();
        Ok(())
    }

    /// Does steps until the next poll for signals, at most up to step `end`.
    fn advance(&mut self, end: u32) -> Result<(), Error> {
        let began = Instant::now();
        while self.simulation.step_count() < end && began.elapsed() < SIGNAL_POLL {
            let before = self.simulation.step_count();
            let advanced = match &self.pool {
                Some(pool) => pool.install(|| self.simulation.advance(end - before)),
                None => self.simulation.advance(end - before),
            };
            // A GPU may have done steps before one that failed.
            let new_steps = before + 1..=self.simulation.step_count();
            self.arrivals.extend(self.simulation.arrivals().iter().filter(|a| new_steps.contains(&a.step)));
            advanced?;
        }
        Ok(())
    }

    fn write_checkpoint(&self, path: PathBuf) -> Result<(), Error> {
        let checkpoint = Checkpoint {
            scenario: self.scenario.text.clone(),
            seed: self.scenario.seed,
            flow_field: self.scenario.model.flow_field().map(|field| field.checksum()),
            backend: self.simulation.backend().name().to_owned(),
            every: [1, 1, 0],
            files: Vec::new(),
            parts: Vec::new(),
            state: self.simulation.state()?.into_owned(),
        };
        checkpoint.write(&path)
    }
}

/// A read-only array that views a column.
///
/// # Safety
/// The memory of the column lives and does not change while `owner` lives.
unsafe fn view<'py, T: Element>(
    column: &[T],
    owner: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray1<T>>> {
    // SAFETY: by this function's condition.
    let array =
        unsafe { numpy::PyArray::<T, Ix1>::borrow_from_array(&ArrayView1::from(column), owner.clone()) };
    drop(array.try_readwrite()?.make_nonwriteable());
    Ok(array)
}
