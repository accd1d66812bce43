//! NumPy arrays of whole numbers, read where they lie, and arrays that calls return.

use std::fmt::Display;

use bytemuck::NoUninit;
use lazygrid::{InputError, Pair};
use numpy::ndarray::{Dimension, Ix1, Ix2};
use numpy::{
    Element, PyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray, PyReadonlyArray1,
    PyReadonlyArray2, PyUntypedArrayMethods,
};
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyModule;

use crate::error;

/// Borrows an array of `u32` in one piece: the given one if it is such, else a copy.
///
/// # Errors
/// `TypeError` for values that are not whole numbers; `InputError` for values out of range, and for another shape.
pub(crate) fn whole<'py>(
    given: &Bound<'py, PyAny>,
    name: impl Display,
) -> PyResult<PyReadonlyArray1<'py, u32>> {
    of_type(given, name, "whole")
}

/// Borrows an array of `u32` of shape `(m, 2)` in one piece.
///
/// # Errors
/// The same as [`whole`].
pub(crate) fn whole_pairs<'py>(
    given: &Bound<'py, PyAny>,
    name: &str,
) -> PyResult<PyReadonlyArray2<'py, u32>> {
    // The package checks the shape.
    let checked = package(given.py())?.call_method1(intern!(given.py(), "pairs"), (given, name))?;
    readable(checked.cast::<PyArray2<u32>>()?, name)
}

/// Borrows an array of `u64` in one piece: the given one if it is such, else a copy.
///
/// # Errors
/// The same as [`whole`].
pub(crate) fn offsets<'py>(given: &Bound<'py, PyAny>, name: &str) -> PyResult<PyReadonlyArray1<'py, u64>> {
    of_type(given, name, "offsets")
}

/// Borrows an array of one type, in one piece; `copy` is the function of the package that makes one.
fn of_type<'py, T: Element>(
    given: &Bound<'py, PyAny>,
    name: impl Display,
    copy: &str,
) -> PyResult<PyReadonlyArray1<'py, T>> {
    if let Ok(array) = given.cast::<PyArray1<T>>()
        && in_one_piece(array)
    {
        return readable(array, name);
    }
    let copied = package(given.py())?.call_method1(copy, (given, name.to_string()))?;
    readable(copied.cast::<PyArray1<T>>()?, name)
}

/// Returns `true` if an array can be read as a slice.
fn in_one_piece<T: Element, D: Dimension>(array: &Bound<'_, PyArray<T, D>>) -> bool {
    array.is_c_contiguous() && array.is_aligned()
}

/// Borrows an array for reading.
///
/// # Errors
/// `InputError` if another call is writing to it.
pub(crate) fn readable<'py, T: Element, D: Dimension>(
    array: &Bound<'py, PyArray<T, D>>,
    name: impl Display,
) -> PyResult<PyReadonlyArray<'py, T, D>> {
    array.try_readonly().map_err(|_| error::array(format!("`{name}` is being written to by another call")))
}

/// The module `lazygrid._arrays`, which converts what cannot be read in place.
pub(crate) fn package(py: Python<'_>) -> PyResult<&Bound<'_, PyModule>> {
    static MODULE: PyOnceLock<Py<PyModule>> = PyOnceLock::new();
    let module =
        MODULE.get_or_try_init(py, || PyModule::import(py, "lazygrid._arrays").map(Bound::unbind))?;
    Ok(module.bind(py))
}

/// Creates an array with uninitialized values.
///
/// # Errors
/// `MemoryError`.
pub(crate) fn empty<'py, T: Element, D: Dimension>(
    py: Python<'py>,
    shape: impl IntoPyObject<'py>,
) -> PyResult<Bound<'py, PyArray<T, D>>> {
    static EMPTY: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    let empty =
        EMPTY.get_or_try_init(py, || PyModule::import(py, "numpy")?.getattr("empty").map(Bound::unbind))?;
    Ok(empty.bind(py).call1((shape, numpy::dtype::<T>(py)))?.cast_into()?)
}

/// Copies values into a new array.
///
/// # Errors
/// `MemoryError`.
pub(crate) fn copied<'py, T: Element + Copy>(
    py: Python<'py>,
    values: &[T],
) -> PyResult<Bound<'py, PyArray1<T>>> {
    let array = empty::<T, Ix1>(py, (values.len(),))?;
    array.try_readwrite()?.as_slice_mut()?.copy_from_slice(values);
    Ok(array)
}

/// Returns pairs as an array of shape `(m, 2)`: a new one, or the first rows of `out`.
///
/// # Errors
/// `MemoryError`; `InputError` for an `out` that cannot be written to, `TooManyPairs` for one that is too small.
pub(crate) fn pairs<'py>(
    py: Python<'py>,
    found: &[Pair],
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let Some(out) = out else {
        let array = empty::<u32, Ix2>(py, (found.len(), 2))?;
        array.try_readwrite()?.as_slice_mut()?.copy_from_slice(bytemuck::cast_slice(found));
        return Ok(array.into_any());
    };
    let refused = "`out` must be a writable array of numpy.uint32, in one piece, of shape (k, 2)";
    let array = out.cast::<PyArray2<u32>>().map_err(|_| error::array(refused))?;
    if array.shape()[1] != 2 || !in_one_piece(array) {
        return Err(error::array(refused));
    }
    let room = array.shape()[0];
    if room < found.len() {
        let message =
            format!("`out` has room for {room} pairs and {} were found; nothing was written", found.len());
        return Err(error::too_many(message, [found.len(), room]));
    }
    let mut writable = array.try_readwrite().map_err(|_| error::array(refused))?;
    writable.as_slice_mut()?[..2 * found.len()].copy_from_slice(bytemuck::cast_slice(found));
    drop(writable);
    out.get_item(pyo3::types::PySlice::new(py, 0, found.len() as isize, 1))
}

/// Returns records of `width` numbers as an array with a row for each, without a copy if the array can own their memory.
///
/// # Errors
/// `MemoryError`.
pub(crate) fn rows<'py, S: NoUninit + bytemuck::AnyBitPattern, T: Element + bytemuck::Pod>(
    py: Python<'py>,
    records: Vec<S>,
    width: usize,
) -> PyResult<Bound<'py, PyArray2<T>>> {
    let count = records.len();
    let flat = match bytemuck::allocation::try_cast_vec::<S, T>(records) {
        Ok(numbers) => PyArray1::from_vec(py, numbers),
        Err((_, records)) => copied(py, bytemuck::cast_slice(&records))?,
    };
    flat.reshape([count, width])
}

/// Checks the length of a column.
///
/// # Errors
/// `InputError`, which names the column.
pub(crate) fn same_length(what: &'static str, length: usize, expected: usize) -> PyResult<()> {
    match length == expected {
        true => Ok(()),
        false => Err(error::input(InputError::Lengths { what, length, expected })),
    }
}
