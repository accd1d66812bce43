//! NumPy arrays: those that are given, read where they lie, and those that are returned.

use std::sync::Arc;

use bytemuck::NoUninit;
use lazygrid::{InputError, Pair, Spheres};
use numpy::ndarray::{Dimension, Ix1, Ix2};
use numpy::{
    Element, PyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray, PyReadonlyArray1,
    PyReadonlyArray2, PyUntypedArrayMethods,
};
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyModule, PyTuple};

use crate::error;
use crate::exclusions::Exclusions;

/// What is said of spheres besides where they are.
#[derive(Clone, Copy, Default)]
pub(crate) struct Said<'a, 'py> {
    pub(crate) species: Option<&'a Bound<'py, PyAny>>,
    pub(crate) groups: Option<&'a Bound<'py, PyAny>>,
    pub(crate) exclusions: Option<&'a Bound<'py, Exclusions>>,
}

/// The spheres of a call, borrowed from the arrays that were given.
pub(crate) struct Given<'py> {
    spheres: Layout<'py>,
    species: Option<PyReadonlyArray1<'py, u32>>,
    groups: Option<PyReadonlyArray1<'py, u32>>,
    exclusions: Option<Arc<lazygrid::Exclusions>>,
}

enum Layout<'py> {
    Rows(PyReadonlyArray2<'py, f32>),
    Columns([PyReadonlyArray1<'py, f32>; 4]),
}

impl<'py> Given<'py> {
    /// Rows of shape `(n, 4)`, or a tuple of four columns; and what is said of each.
    ///
    /// # Errors
    /// `TypeError` for values that would have to be rounded where `cast` does not say so; `InputError` for another
    /// shape.
    pub(crate) fn new(spheres: &Bound<'py, PyAny>, said: Said<'_, 'py>, cast: bool) -> PyResult<Self> {
        Self::named(spheres, said, cast, ["spheres", "x", "y", "z", "r", "species", "groups"])
    }

    /// The first of two sets, and the second, as [`new`](Self::new); messages name the set.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub(crate) fn two(
        [given_a, given_b]: [&Bound<'py, PyAny>; 2],
        [of_a, of_b]: [Said<'_, 'py>; 2],
        cast: bool,
    ) -> PyResult<[Self; 2]> {
        let a = ["a", "a[0]", "a[1]", "a[2]", "a[3]", "species_a", "groups_a"];
        let b = ["b", "b[0]", "b[1]", "b[2]", "b[3]", "species_b", "groups_b"];
        Ok([Self::named(given_a, of_a, cast, a)?, Self::named(given_b, of_b, cast, b)?])
    }

    fn named(
        spheres: &Bound<'py, PyAny>,
        said: Said<'_, 'py>,
        cast: bool,
        [all, x, y, z, r, ids, groups]: [&str; 7],
    ) -> PyResult<Self> {
        let layout = match spheres.cast::<PyTuple>() {
            Ok(columns) if columns.len() == 4 => {
                let column = |k: usize, name| floats::<Ix1>(&columns.get_item(k)?, name, cast);
                Layout::Columns([column(0, x)?, column(1, y)?, column(2, z)?, column(3, r)?])
            }
            _ => {
                let rows = floats::<Ix2>(spheres, all, cast)?;
                let width = rows.shape()[1];
                if width != 4 {
                    let message = format!(
                        "`{all}` has {width} columns where 4 are needed: x, y, z and r; for points of one radius see \
                         lazygrid.pairs"
                    );
                    return Err(error::array(message));
                }
                Layout::Rows(rows)
            }
        };
        let species = said.species.map(|given| whole(given, ids)).transpose()?;
        let groups = said.groups.map(|given| whole(given, groups)).transpose()?;
        let exclusions = said.exclusions.map(|given| given.get().list());
        Ok(Self { spheres: layout, species, groups, exclusions })
    }

    /// The pairs that are left out, for as long as they are needed.
    pub(crate) fn exclusions(&self) -> Option<Arc<lazygrid::Exclusions>> {
        self.exclusions.clone()
    }

    /// The spheres where they lie.
    ///
    /// # Errors
    /// `InputError` for columns or ids of different lengths.
    pub(crate) fn spheres(&self) -> PyResult<Spheres<'_>> {
        self.borrowed()?.map_err(error::input)
    }

    /// The same of the second of two sets, which is named.
    ///
    /// # Errors
    /// As [`spheres`](Self::spheres).
    pub(crate) fn second(&self) -> PyResult<Spheres<'_>> {
        self.borrowed()?.map_err(|wrong| error::input(InputError::Second(Box::new(wrong))))
    }

    fn borrowed(&self) -> PyResult<Result<Spheres<'_>, InputError>> {
        let spheres = match &self.spheres {
            Layout::Rows(rows) => Ok(Spheres::from(rows.as_slice()?.as_chunks::<4>().0)),
            Layout::Columns([x, y, z, r]) => {
                Spheres::columns(x.as_slice()?, y.as_slice()?, z.as_slice()?, r.as_slice()?)
            }
        };
        let species = self.species.as_ref().map(|ids| ids.as_slice()).transpose()?;
        let groups = self.groups.as_ref().map(|ids| ids.as_slice()).transpose()?;
        let labelled = || {
            let spheres = spheres?;
            let spheres = species.map_or(Ok(spheres), |ids| spheres.with_species(ids))?;
            let spheres = groups.map_or(Ok(spheres), |ids| spheres.with_groups(ids))?;
            self.exclusions.as_deref().map_or(Ok(spheres), |pairs| spheres.with_exclusions(pairs))
        };
        Ok(labelled())
    }
}

/// An array of `f32` in one piece: the one that is given if it is such, else a copy.
fn floats<'py, D: Dimension>(
    given: &Bound<'py, PyAny>,
    what: &str,
    cast: bool,
) -> PyResult<PyReadonlyArray<'py, f32, D>> {
    if let Ok(array) = given.cast::<PyArray<f32, D>>()
        && in_one_piece(array)
    {
        return readable(array, what);
    }
    let dimensions = D::NDIM.unwrap_or_default();
    let copied = of_package(given.py())?
        .call_method1(intern!(given.py(), "floats"), (given, what, dimensions, cast))?;
    readable(copied.cast::<PyArray<f32, D>>()?, what)
}

/// An array of `u32` in one piece: the one that is given if it is such, else a copy.
///
/// # Errors
/// `TypeError` for what are no whole numbers; `InputError` for those that do not fit, and for another shape.
pub(crate) fn whole<'py>(given: &Bound<'py, PyAny>, what: &str) -> PyResult<PyReadonlyArray1<'py, u32>> {
    of_type(given, what, "whole")
}

/// The same of shape `(m, 2)`.
///
/// # Errors
/// As [`whole`].
pub(crate) fn whole_pairs<'py>(
    given: &Bound<'py, PyAny>,
    what: &str,
) -> PyResult<PyReadonlyArray2<'py, u32>> {
    // The package looks at the shape.
    let checked = of_package(given.py())?.call_method1(intern!(given.py(), "pairs"), (given, what))?;
    readable(checked.cast::<PyArray2<u32>>()?, what)
}

/// An array of `u64` in one piece: the one that is given if it is such, else a copy.
///
/// # Errors
/// As [`whole`].
pub(crate) fn offsets<'py>(given: &Bound<'py, PyAny>, what: &str) -> PyResult<PyReadonlyArray1<'py, u64>> {
    of_type(given, what, "offsets")
}

/// An array of one type, in one piece; `copy` is the function of the package that makes one.
fn of_type<'py, T: Element>(
    given: &Bound<'py, PyAny>,
    what: &str,
    copy: &str,
) -> PyResult<PyReadonlyArray1<'py, T>> {
    if let Ok(array) = given.cast::<PyArray1<T>>()
        && in_one_piece(array)
    {
        return readable(array, what);
    }
    let copied = of_package(given.py())?.call_method1(copy, (given, what))?;
    readable(copied.cast::<PyArray1<T>>()?, what)
}

/// Whether an array can be read as a slice.
fn in_one_piece<T: Element, D: Dimension>(array: &Bound<'_, PyArray<T, D>>) -> bool {
    array.is_c_contiguous() && array.is_aligned()
}

fn readable<'py, T: Element, D: Dimension>(
    array: &Bound<'py, PyArray<T, D>>,
    what: &str,
) -> PyResult<PyReadonlyArray<'py, T, D>> {
    array.try_readonly().map_err(|_| error::array(format!("`{what}` is being written to by another call")))
}

/// What Python says better about arrays.
fn of_package(py: Python<'_>) -> PyResult<&Bound<'_, PyModule>> {
    static MODULE: PyOnceLock<Py<PyModule>> = PyOnceLock::new();
    let module =
        MODULE.get_or_try_init(py, || PyModule::import(py, "lazygrid._arrays").map(Bound::unbind))?;
    Ok(module.bind(py))
}

/// An array that is made here, with nothing in it yet.
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

/// A copy of values as an array.
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

/// Pairs as an array of shape `(m, 2)`: a new one, or the first rows of `out`.
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

/// Records of `width` numbers each as an array with a row for each, without a copy where their memory can be taken over.
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

/// Whether the lengths of `columns` are those of the spheres; for messages that name the column.
pub(crate) fn same_length(what: &'static str, length: usize, expected: usize) -> PyResult<()> {
    match length == expected {
        true => Ok(()),
        false => Err(error::input(InputError::Lengths { what, length, expected })),
    }
}
