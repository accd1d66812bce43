//! Arrays of `float32` and `float64`, read in place.

use std::fmt;
use std::mem::MaybeUninit;

use lazygrid::Real;
use numpy::ndarray::{Dimension, Ix1};
use numpy::{
    Element, PyArray, PyArrayMethods, PyReadonlyArray, PyReadonlyArray1, PyReadonlyArray2,
    PyUntypedArrayMethods,
};
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::types::PyFloat;

use crate::arrays::{is_plain, package, readable};

/// The name of an array in messages: an argument, or a member of a tuple.
#[derive(Clone, Copy)]
pub(crate) struct Name(pub(crate) &'static str, pub(crate) Option<usize>);

impl Name {
    pub(crate) fn member(self, index: usize) -> Self {
        Self(self.0, Some(index))
    }
}

impl fmt::Display for Name {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.1 {
            None => to.write_str(self.0),
            Some(index) => write!(to, "{}[{index}]", self.0),
        }
    }
}

pub(crate) trait Number: Element + Real + Copy {}

impl Number for f32 {}
impl Number for f64 {}

/// An array of either coordinate type, borrowed for reading. Its strides are non-negative whole numbers of values.
pub(crate) enum Floats<'py, D: Dimension> {
    F32(PyReadonlyArray<'py, f32, D>),
    F64(PyReadonlyArray<'py, f64, D>),
}

impl<'py, D: Dimension> Floats<'py, D> {
    /// Borrows an array of shape `(n, width)`, or `(n,)` if the width is 0. Copies an array only if its layout cannot
    /// be read in place.
    ///
    /// # Errors
    /// `TypeError` for values that are not `float32` or `float64`; `InputError` for another shape.
    pub(crate) fn new(argument: &Bound<'py, PyAny>, name: Name, width: usize) -> PyResult<Self> {
        if let Some(array) = Self::in_place(argument, name, width)? {
            return Ok(array);
        }
        let py = argument.py();
        let read = package(py)?.call_method1(intern!(py, "floats"), (argument, name.to_string(), width))?;
        Self::from_package(&read, name, width)
    }

    fn from_package(read: &Bound<'py, PyAny>, name: Name, width: usize) -> PyResult<Self> {
        let array = Self::in_place(read, name, width)?;
        array.ok_or_else(|| crate::error::array(format!("`{name}` cannot be read as an array")))
    }

    fn in_place(argument: &Bound<'py, PyAny>, name: Name, width: usize) -> PyResult<Option<Self>> {
        if !is_plain(argument) {
            return Ok(None);
        }
        if let Ok(array) = argument.cast::<PyArray<f32, D>>() {
            if is_readable(array, width) {
                return Ok(Some(Self::F32(readable(array, name)?)));
            }
        } else if let Ok(array) = argument.cast::<PyArray<f64, D>>()
            && is_readable(array, width)
        {
            return Ok(Some(Self::F64(readable(array, name)?)));
        }
        Ok(None)
    }

    /// Returns the array as `float64`, copied without loss from `float32`.
    pub(crate) fn widened(self, name: Name) -> PyResult<PyReadonlyArray<'py, f64, D>> {
        match self {
            Self::F64(array) => Ok(array),
            Self::F32(array) => {
                let py = array.py();
                let wide = package(py)?.call_method1(intern!(py, "widened"), (&*array,))?;
                readable(wide.cast::<PyArray<f64, D>>()?, name)
            }
        }
    }
}

fn is_readable<T: Element, D: Dimension>(array: &Bound<'_, PyArray<T, D>>, width: usize) -> bool {
    let is_whole = |&stride: &isize| stride >= 0 && (stride as usize).is_multiple_of(size_of::<T>());
    (width == 0 || array.shape()[1] == width)
        && array.is_aligned()
        && (array.is_c_contiguous() || array.strides().iter().all(is_whole))
}

pub(crate) enum RadiiArg<'py> {
    One(f64),
    Each(Floats<'py, Ix1>),
}

impl<'py> RadiiArg<'py> {
    /// Reads a number or an array of shape `(n,)`. A number that `float64` cannot hold is a `TypeError`.
    pub(crate) fn new(argument: &Bound<'py, PyAny>, name: Name) -> PyResult<Self> {
        if let Ok(number) = argument.cast::<PyFloat>() {
            return Ok(Self::One(number.extract()?));
        }
        if let Some(array) = Floats::in_place(argument, name, 0)? {
            return Ok(Self::Each(array));
        }
        let py = argument.py();
        let read = package(py)?.call_method1(intern!(py, "radii"), (argument, name.to_string()))?;
        match read.cast::<PyFloat>() {
            Ok(number) => Ok(Self::One(number.extract()?)),
            Err(_) => Ok(Self::Each(Floats::from_package(&read, name, 0)?)),
        }
    }
}

/// A column of an array: its memory from the first value to the last, the step between values, and the number of rows.
#[derive(Clone, Copy)]
pub(crate) struct Column<'a, T> {
    pub(crate) memory: &'a [MaybeUninit<T>],
    pub(crate) step: usize,
    pub(crate) rows: usize,
}

impl<'a, T: Number> Column<'a, T> {
    pub(crate) fn from_array(array: &'a PyReadonlyArray1<'_, T>) -> Self {
        Self::new(array, 0)
    }

    pub(crate) fn from_table<const N: usize>(array: &'a PyReadonlyArray2<'_, T>) -> [Self; N] {
        let stride = array.strides()[1] as usize / size_of::<T>();
        std::array::from_fn(|k| {
            assert!(k < array.shape()[1], "column {k} of {}", array.shape()[1]);
            Self::new(array, k * stride)
        })
    }

    fn new<D: Dimension>(array: &'a PyReadonlyArray<'_, T, D>, offset: usize) -> Self {
        let rows = array.shape()[0];
        if rows == 0 {
            return Self { memory: &[], step: 1, rows };
        }
        // An array with one row may have any stride.
        let step = if rows == 1 { 1 } else { array.strides()[0] as usize / size_of::<T>() };
        // SAFETY: the array is aligned, its strides are not negative, and `offset` is in the first row, so the slice
        // begins and ends with a value of the array, within one allocation. The values between them need not be
        // initialized, which `MaybeUninit` allows. The array is borrowed for `'a`, and nothing writes to it meanwhile:
        // this module because of `PyReadonlyArray`, other threads by the contract of the package.
        let memory =
            unsafe { std::slice::from_raw_parts(array.data().add(offset).cast(), (rows - 1) * step + 1) };
        Self { memory, step, rows }
    }

    pub(crate) fn as_slice(&self) -> Option<&'a [T]> {
        // SAFETY: without gaps all values belong to the array, hence are initialized.
        (self.step == 1).then(|| unsafe { &*(std::ptr::from_ref(self.memory) as *const [T]) })
    }
}
