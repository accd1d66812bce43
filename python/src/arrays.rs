//! NumPy arrays of whole numbers, read in place, and arrays that calls return.

use std::ffi::c_int;
use std::fmt::Display;
use std::ptr;

use bytemuck::NoUninit;
use lazygrid::{InputError, Pair};
use numpy::ndarray::{Dim, Dimension};
use numpy::npyffi::{self, NpyTypes, PY_ARRAY_API, npy_intp};
use numpy::{
    Element, PyArray, PyArray1, PyArray2, PyArrayDescrMethods, PyArrayMethods, PyReadonlyArray,
    PyReadonlyArray1, PyReadonlyArray2, PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyModule;

use crate::error;

/// Borrows a contiguous array of `u32`, or a copy.
///
/// # Errors
/// `TypeError` for values that are not whole numbers; `InputError` for values out of range, and for another shape.
pub(crate) fn whole<'py>(
    argument: &Bound<'py, PyAny>,
    name: impl Display,
) -> PyResult<PyReadonlyArray1<'py, u32>> {
    array_of_type(argument, name, "whole")
}

pub(crate) fn whole_pairs<'py>(
    argument: &Bound<'py, PyAny>,
    name: &str,
) -> PyResult<PyReadonlyArray2<'py, u32>> {
    let checked = package(argument.py())?.call_method1(intern!(argument.py(), "pairs"), (argument, name))?;
    readable(checked.cast::<PyArray2<u32>>()?, name)
}

pub(crate) fn offsets<'py>(argument: &Bound<'py, PyAny>, name: &str) -> PyResult<PyReadonlyArray1<'py, u64>> {
    array_of_type(argument, name, "offsets")
}

fn array_of_type<'py, T: Element>(
    argument: &Bound<'py, PyAny>,
    name: impl Display,
    copy: &str,
) -> PyResult<PyReadonlyArray1<'py, T>> {
    if is_plain(argument)
        && let Ok(array) = argument.cast::<PyArray1<T>>()
        && in_one_piece(array)
    {
        return readable(array, name);
    }
    let copied = package(argument.py())?.call_method1(copy, (argument, name.to_string()))?;
    readable(copied.cast::<PyArray1<T>>()?, name)
}

/// Returns `false` for subclasses of arrays, which may be masked.
pub(crate) fn is_plain(argument: &Bound<'_, PyAny>) -> bool {
    argument.is_exact_instance_of::<PyUntypedArray>()
}

fn in_one_piece<T: Element, D: Dimension>(array: &Bound<'_, PyArray<T, D>>) -> bool {
    array.is_c_contiguous() && array.is_aligned()
}

/// An `InputError` if another call is writing to it.
pub(crate) fn readable<'py, T: Element, D: Dimension>(
    array: &Bound<'py, PyArray<T, D>>,
    name: impl Display,
) -> PyResult<PyReadonlyArray<'py, T, D>> {
    array.try_readonly().map_err(|_| error::array(format!("`{name}` is being written to by another call")))
}

pub(crate) fn package(py: Python<'_>) -> PyResult<&Bound<'_, PyModule>> {
    static MODULE: PyOnceLock<Py<PyModule>> = PyOnceLock::new();
    let module =
        MODULE.get_or_try_init(py, || PyModule::import(py, "lazygrid._arrays").map(Bound::unbind))?;
    Ok(module.bind(py))
}

/// Leaves values uninitialized.
pub(crate) fn empty<T: Element, const N: usize>(
    py: Python<'_>,
    shape: [usize; N],
) -> PyResult<Bound<'_, PyArray<T, Dim<[usize; N]>>>>
where
    Dim<[usize; N]>: Dimension,
{
    let mut shape = shape.map(|length| length as npy_intp);
    // SAFETY: the arguments are those of `PyArray_NewFromDescr`: the type of arrays, a new reference to a type of values, which
    // the call takes, and a shape of `N` lengths; without strides and data it allocates memory in one piece. It returns a
    // new reference, or NULL with an exception.
    let array = unsafe {
        let array = PY_ARRAY_API.PyArray_NewFromDescr(
            py,
            npyffi::get_type_object(py, NpyTypes::PyArray_Type),
            numpy::dtype::<T>(py).into_dtype_ptr(),
            N as c_int,
            shape.as_mut_ptr(),
            ptr::null_mut(),
            ptr::null_mut(),
            0,
            ptr::null_mut(),
        );
        Bound::from_owned_ptr_or_err(py, array)?
    };
    Ok(array.cast_into()?)
}

pub(crate) fn copied<'py, T: Element + Copy, const N: usize>(
    py: Python<'py>,
    shape: [usize; N],
    values: &[T],
) -> PyResult<Bound<'py, PyArray<T, Dim<[usize; N]>>>>
where
    Dim<[usize; N]>: Dimension,
{
    assert_eq!(shape.iter().product::<usize>(), values.len(), "a shape of all values");
    let array = empty(py, shape)?;
    // SAFETY: the array is new, so no other code reads or writes its memory, which holds as many values in one piece.
    unsafe { ptr::copy_nonoverlapping(values.as_ptr(), array.data(), values.len()) };
    Ok(array)
}

/// Returns pairs as an array of shape `(m, 2)`: a new one, or the first rows of `out`.
pub(crate) fn pairs<'py>(
    py: Python<'py>,
    found: &[Pair],
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let Some(out) = out else {
        return Ok(copied::<u32, 2>(py, [found.len(), 2], bytemuck::cast_slice(found))?.into_any());
    };
    let refused = || error::array(refused_output(out));
    let array = out.cast::<PyArray2<u32>>().map_err(|_| refused())?;
    if array.shape()[1] != 2 || !in_one_piece(array) {
        return Err(refused());
    }
    let capacity = array.shape()[0];
    if capacity < found.len() {
        let message = format!(
            "`out` has room for {capacity} pairs and {} were found; nothing was written",
            found.len()
        );
        return Err(error::too_many(message, [found.len(), capacity]));
    }
    let mut writable = array.try_readwrite().map_err(|_| refused())?;
    writable.as_slice_mut()?[..2 * found.len()].copy_from_slice(bytemuck::cast_slice(found));
    drop(writable);
    out.get_item(pyo3::types::PySlice::new(py, 0, found.len() as isize, 1))
}

fn refused_output(out: &Bound<'_, PyAny>) -> String {
    let found = match out.cast::<PyUntypedArray>() {
        Ok(array) => format!("{} of shape {:?}", array.dtype(), array.shape()),
        Err(_) => out.get_type().to_string(),
    };
    format!("`out` must be a writable array of numpy.uint32, in one piece, of shape (k, 2); this is {found}")
}

/// Returns records of `width` numbers as rows of an array, without a copy if the array can own their memory.
pub(crate) fn rows<'py, S: NoUninit + bytemuck::AnyBitPattern, T: Element + bytemuck::Pod>(
    py: Python<'py>,
    records: Vec<S>,
    width: usize,
) -> PyResult<Bound<'py, PyArray2<T>>> {
    let count = records.len();
    let flat = match bytemuck::allocation::try_cast_vec::<S, T>(records) {
        Ok(numbers) => PyArray1::from_vec(py, numbers),
        Err((_, records)) => {
            let numbers = bytemuck::cast_slice(&records);
            copied(py, [numbers.len()], numbers)?
        }
    };
    flat.reshape([count, width])
}

pub(crate) fn same_length(what: &'static str, length: usize, expected: usize) -> PyResult<()> {
    match length == expected {
        true => Ok(()),
        false => Err(error::input(InputError::Lengths { what, length, expected })),
    }
}
