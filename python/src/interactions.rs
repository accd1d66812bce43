use std::sync::{Mutex, MutexGuard, PoisonError};

use lazygrid::Interaction;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

use crate::error;

/// A symmetric table of the condition for any two species to pair.
///
/// ``None``: never; ``"touch"``: within ``ri + rj``; a number: within this distance, for any radii.
///
/// >>> reactions = lazygrid.Interactions(2)
/// >>> reactions[0, 1] = 0.2
/// >>> lazygrid.Detector(interactions=reactions)
///
/// Parameters
/// ----------
/// species
///     The number of species, at most 4096; ids begin at 0.
/// default
///     The initial interaction of all species.
///
/// Raises
/// ------
/// InputError
///     For an unknown species, or a distance that is negative or not finite.
#[pyclass(frozen, module = "lazygrid")]
pub(crate) struct Interactions {
    table: Mutex<lazygrid::Interactions>,
}

impl Interactions {
    pub(crate) fn table(&self) -> lazygrid::Interactions {
        self.lock().clone()
    }

    fn lock(&self) -> MutexGuard<'_, lazygrid::Interactions> {
        // A panic never leaves a table incomplete.
        self.table.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[pymethods]
impl Interactions {
    #[new]
    #[pyo3(signature = (species, default=None))]
    fn new(species: u32, default: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let table = lazygrid::Interactions::new(species, interaction(default)?).map_err(refused)?;
        Ok(Self { table: Mutex::new(table) })
    }

    /// The number of species.
    #[getter]
    fn species(&self) -> u32 {
        self.lock().species()
    }

    fn __setitem__(&self, pair: (u32, u32), value: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        let value = interaction(value)?;
        let set = self.lock().set(pair.0, pair.1, value);
        set.map_err(refused)
    }

    fn __getitem__<'py>(&self, py: Python<'py>, pair: (u32, u32)) -> PyResult<Bound<'py, PyAny>> {
        // Python objects are made without the lock, because that may run other code of Python.
        let interaction = {
            let table = self.lock();
            let count = table.species();
            match [pair.0, pair.1].into_iter().find(|&id| id >= count) {
                Some(id) => Err(lazygrid::InputError::SpeciesId { index: None, id, count }),
                None => Ok(table.get(pair.0, pair.1)),
            }
        };
        match interaction.map_err(error::input)? {
            Interaction::Never => Ok(py.None().into_bound(py)),
            Interaction::Touch => Ok("touch".into_pyobject(py)?.into_any()),
            Interaction::Within(distance) => Ok(distance.into_pyobject(py)?.into_any()),
        }
    }

    fn __repr__(&self) -> String {
        format!("<lazygrid.Interactions of {} species>", self.lock().species())
    }
}

/// Refused memory is an `InputError` of the table, but no error of the input in Python.
fn refused(error: lazygrid::InputError) -> PyErr {
    error::engine(error.into())
}

fn interaction(argument: Option<&Bound<'_, PyAny>>) -> PyResult<Interaction> {
    let Some(argument) = argument else { return Ok(Interaction::Never) };
    if argument.extract::<&str>().is_ok_and(|word| word == "touch") {
        return Ok(Interaction::Touch);
    }
    let distance = argument.extract::<f64>();
    distance.map(Interaction::Within).map_err(|_| {
        PyTypeError::new_err("an interaction is None (never), \"touch\" (within ri + rj) or a distance")
    })
}
