use std::time::Duration;

use lazygrid::gpu::AdapterId;
use lazygrid::{Backend, Config, Order, Skin, Space};
use pyo3::exceptions::{PyOverflowError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyBool;

use crate::error;

pub(crate) struct Settings<'s> {
    pub(crate) backend: &'s str,
    pub(crate) algorithm: &'s str,
    pub(crate) threads: Option<usize>,
    pub(crate) periodic: Option<&'s Bound<'s, PyAny>>,
    pub(crate) order: &'s str,
    pub(crate) max_pairs: Option<&'s Bound<'s, PyAny>>,
    pub(crate) skin: Option<&'s Bound<'s, PyAny>>,
    /// In seconds.
    pub(crate) timeout: Option<f64>,
}

impl Settings<'_> {
    pub(crate) fn config(self) -> PyResult<Config> {
        let config = Config::default()
            .backend(self.backend.parse().map_err(error::unknown)?)
            .algorithm(self.algorithm.parse().map_err(error::unknown)?)
            .order(order(self.order)?)
            .space(space(self.periodic)?)
            .skin(self.skin.map_or(Ok(Skin::Auto), skin)?);
        let config = self.threads.map_or(config.clone(), |threads| config.threads(threads));
        let config = match self.max_pairs {
            None => config,
            Some(most) => config.max_pairs(whole(most, "max_pairs", "choose a number from 0 to 2^64 - 1")?),
        };
        match self.timeout {
            None => Ok(config),
            Some(_) if self.backend == Backend::Cpu.name() => Err(error::setting(
                "timeout limits searches on a GPU and has no effect with backend=\"cpu\"; omit one of them",
            )),
            Some(seconds) => Ok(config.timeout(timeout(seconds)?)),
        }
    }
}

/// Reads a whole number; `range` says which one to choose.
pub(crate) fn whole<T: for<'a, 'py> FromPyObject<'a, 'py, Error = PyErr>>(
    argument: &Bound<'_, PyAny>,
    name: &str,
    range: &str,
) -> PyResult<T> {
    argument.extract::<T>().map_err(|error| match error.is_instance_of::<PyOverflowError>(argument.py()) {
        true => error::setting(format!("{name} = {argument} is out of range; {range}")),
        false => PyTypeError::new_err(format!("argument '{name}': {}", error.value(argument.py()))),
    })
}

fn timeout(seconds: f64) -> PyResult<Duration> {
    let time = Duration::try_from_secs_f64(seconds).ok().filter(|time| !time.is_zero());
    time.ok_or_else(|| {
        error::setting(format!("timeout = {seconds} is out of range; give a number of seconds above zero"))
    })
}

fn order(name: &str) -> PyResult<Order> {
    match name {
        "canonical" => Ok(Order::Canonical),
        "unordered" => Ok(Order::Unordered),
        _ => Err(error::setting(format!("unknown order '{name}'; expected one of canonical, unordered"))),
    }
}

/// Reads `"auto"`, `"off"` or a distance.
fn skin(argument: &Bound<'_, PyAny>) -> PyResult<Skin> {
    if let Ok(word) = argument.extract::<&str>() {
        return match word {
            "auto" => Ok(Skin::Auto),
            "off" => Ok(Skin::Off),
            _ => Err(error::setting(format!(
                "unknown skin '{word}'; expected one of auto, off, or a distance"
            ))),
        };
    }
    // Python takes `True` for the number 1.
    match argument.extract::<f64>() {
        Ok(distance) if !argument.is_instance_of::<PyBool>() => Ok(Skin::Fixed(distance)),
        _ => Err(PyTypeError::new_err("a skin is \"auto\", \"off\" or a distance")),
    }
}

/// Reads a space from the length of each periodic axis, or from cell vectors; `None` for an unbounded axis.
pub(crate) fn space(periodic: Option<&Bound<'_, PyAny>>) -> PyResult<Space> {
    let Some(argument) = periodic else { return Ok(Space::UNBOUNDED) };
    let items = argument.try_iter()?.collect::<PyResult<Vec<_>>>()?;
    let items: [_; 3] = items.try_into().map_err(|items: Vec<_>| {
        let count = items.len();
        PyTypeError::new_err(format!("periodic has {count} lengths where 3 are needed: (x, y, z)"))
    })?;
    let lengths = items.iter().map(|item| item.extract::<Option<f64>>()).collect::<PyResult<Vec<_>>>();
    if let Ok(&[x, y, z]) = lengths.as_deref() {
        return Space::periodic([x, y, z]).map_err(error::input);
    }
    let mut vectors = [None; 3];
    for (axis, (vector, item)) in vectors.iter_mut().zip(&items).enumerate() {
        *vector = match item.is_none() {
            true => None,
            false => Some(cell_vector(item, axis).map_err(|error| refused_axis(item, axis, error))?),
        };
    }
    Space::triclinic(vectors).map_err(error::input)
}

/// Reads the length of an axis, or a cell vector.
fn cell_vector(item: &Bound<'_, PyAny>, axis: usize) -> PyResult<[f64; 3]> {
    match item.extract::<f64>() {
        Ok(length) => Ok([0, 1, 2].map(|k| if k == axis { length } else { 0.0 })),
        Err(error) if error.is_instance_of::<PyOverflowError>(item.py()) => Err(error),
        Err(_) => item.extract(),
    }
}

/// Names the axis in an error of [`cell_vector`].
fn refused_axis(item: &Bound<'_, PyAny>, axis: usize, error: PyErr) -> PyErr {
    let (py, name) = (item.py(), ["x", "y", "z"][axis]);
    if error.is_instance_of::<PyOverflowError>(py) {
        error::array(format!(
            "periodic has a number along {name} that exceeds float64; choose a smaller number"
        ))
    } else if error.is_instance_of::<PyValueError>(py) {
        error::array(format!("periodic has {item} along {name}; a cell vector has three numbers: (x, y, z)"))
    } else if error.is_instance_of::<PyTypeError>(py) {
        PyTypeError::new_err(format!(
            "periodic has {item} along {name}; give a length, a cell vector (x, y, z) or None"
        ))
    } else {
        error
    }
}

/// Reads a GPU's index or a part of its name.
pub(crate) fn adapter(argument: &Bound<'_, PyAny>) -> PyResult<AdapterId> {
    match argument.extract::<usize>() {
        Ok(index) => Ok(AdapterId::Index(index)),
        Err(error) if error.is_instance_of::<PyOverflowError>(argument.py()) => Err(error::setting(format!(
            "adapter = {argument} is out of range; give an index from 0, or a part of a name"
        ))),
        Err(_) => match argument.extract::<&str>() {
            Ok(name) => Ok(AdapterId::from(name)),
            Err(_) => Err(PyTypeError::new_err(format!(
                "adapter is {argument}; give an index, or a part of a name"
            ))),
        },
    }
}
