//! The arguments of a search, borrowed from Python's arrays.

use std::mem::MaybeUninit;
use std::sync::Arc;

use lazygrid::{InputError, Query, Spheres, Strided};
use numpy::ndarray::{Ix1, Ix2};
use numpy::{PyArray1, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyTypeError;
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use crate::arrays::{package, readable, whole};
use crate::error;
use crate::exclusions::Exclusions;
use crate::floats::{Column, Floats, Name, Number, RadiiArg};

#[derive(Clone, Copy)]
pub(crate) struct Arguments<'a, 'py> {
    pub(crate) spheres: &'a Bound<'py, PyAny>,
    pub(crate) second: Option<&'a Bound<'py, PyAny>>,
    /// An array, or a tuple of two for two sets.
    pub(crate) species: Option<&'a Bound<'py, PyAny>>,
    /// Groups in the form of `species`.
    pub(crate) groups: Option<&'a Bound<'py, PyAny>>,
    pub(crate) exclusions: Option<&'a Bound<'py, Exclusions>>,
}

pub(crate) struct BorrowedQuery<'py> {
    first: BorrowedSpheres<'py>,
    second: Option<BorrowedSpheres<'py>>,
    exclusions: Option<Arc<lazygrid::Exclusions>>,
}

impl<'py> BorrowedQuery<'py> {
    pub(crate) fn new(arguments: Arguments<'_, 'py>) -> PyResult<Self> {
        let Arguments { spheres, second, species, groups, exclusions } = arguments;
        let exclusions = exclusions.map(|argument| argument.get().list());
        let Some(second) = second else {
            let labels = [labels(species, Name("species", None))?, labels(groups, Name("groups", None))?];
            let first = BorrowedSpheres::new(spheres, Name("spheres", None), labels)?;
            return Ok(Self { first, second: None, exclusions });
        };
        let [species, species_of_second] = labels_of_two(species, "species")?;
        let [groups, groups_of_second] = labels_of_two(groups, "groups")?;
        let first = BorrowedSpheres::new(spheres, Name("spheres", None), [species, groups])?;
        let labels = [species_of_second, groups_of_second];
        let second = Some(BorrowedSpheres::new(second, Name("second", None), labels)?);
        Ok(Self { first, second, exclusions })
    }

    pub(crate) fn query(&self) -> PyResult<Query<'_>> {
        let first = self.first.spheres().map_err(error::input)?;
        let query = match &self.second {
            None => Query::new(first),
            Some(second) => {
                let in_second = |wrong| error::input(InputError::SecondSet(Box::new(wrong)));
                Query::new((first, second.spheres().map_err(in_second)?))
            }
        };
        Ok(self.exclusions.as_deref().map_or(query, |pairs| query.without(pairs)))
    }

    pub(crate) fn exclusions(&self) -> Option<Arc<lazygrid::Exclusions>> {
        self.exclusions.clone()
    }
}

type Labels<'py> = Option<PyReadonlyArray1<'py, u32>>;

fn labels<'py>(argument: Option<&Bound<'py, PyAny>>, name: Name) -> PyResult<Labels<'py>> {
    argument.map(|argument| whole(argument, name)).transpose()
}

/// [`whole`] returns contiguous arrays.
fn slice<'a>(labels: &'a Labels<'_>) -> Option<&'a [u32]> {
    labels.as_ref().map(|ids| ids.as_slice().unwrap_or_default())
}

/// The labels of two sets: a tuple with an array or `None` for each.
fn labels_of_two<'py>(
    argument: Option<&Bound<'py, PyAny>>,
    name: &'static str,
) -> PyResult<[Labels<'py>; 2]> {
    let Some(argument) = argument else { return Ok([None, None]) };
    let Some(both) = argument.cast::<PyTuple>().ok().filter(|tuple| tuple.len() == 2) else {
        return Err(PyTypeError::new_err(format!(
            "with a second set `{name}` must be a tuple of two, one for each set: an array or None"
        )));
    };
    let of_set = |set: usize| {
        let argument = both.get_item(set)?;
        labels((!argument.is_none()).then_some(&argument), Name(name, Some(set)))
    };
    Ok([of_set(0)?, of_set(1)?])
}

struct BorrowedSpheres<'py> {
    numbers: Numbers<'py>,
    species: Labels<'py>,
    groups: Labels<'py>,
}

enum Numbers<'py> {
    F32(Layout<'py, f32>),
    F64(Layout<'py, f64>),
}

enum Layout<'py, T: Number> {
    Rows(PyReadonlyArray2<'py, T>),
    /// The first three have equal steps.
    Columns([PyReadonlyArray1<'py, T>; 4]),
    Points(PyReadonlyArray2<'py, T>, PyReadonlyArray1<'py, T>),
    EqualPoints(PyReadonlyArray2<'py, T>, MaybeUninit<T>),
}

impl<'py> BorrowedSpheres<'py> {
    /// Borrows rows of shape `(n, 4)`, a tuple of four columns, or a tuple of positions and radii.
    fn new(argument: &Bound<'py, PyAny>, name: Name, [species, groups]: [Labels<'py>; 2]) -> PyResult<Self> {
        let numbers = match argument.cast::<PyTuple>() {
            Err(_) => match Floats::new(argument, name, 4)? {
                Floats::F32(rows) => Numbers::F32(Layout::Rows(rows)),
                Floats::F64(rows) => Numbers::F64(Layout::Rows(rows)),
            },
            Ok(tuple) if tuple.len() == 4 => Numbers::from_columns(tuple, name)?,
            Ok(tuple) if tuple.len() == 2 => Numbers::from_points(tuple, name)?,
            Ok(tuple) => {
                let count = tuple.len();
                return Err(PyTypeError::new_err(format!(
                    "`{name}` is a tuple of {count}; give four columns (x, y, z, r), or (positions, radii)"
                )));
            }
        };
        Ok(Self { numbers, species, groups })
    }

    fn spheres(&self) -> Result<Spheres<'_>, InputError> {
        let spheres = match &self.numbers {
            Numbers::F32(layout) => layout.spheres(),
            Numbers::F64(layout) => layout.spheres(),
        }?;
        let spheres = slice(&self.species).map_or(Ok(spheres), |ids| spheres.with_species(ids))?;
        slice(&self.groups).map_or(Ok(spheres), |ids| spheres.with_groups(ids))
    }
}

impl<'py> Numbers<'py> {
    fn from_columns(tuple: &Bound<'py, PyTuple>, name: Name) -> PyResult<Self> {
        let column = |k: usize| Floats::<Ix1>::new(&tuple.get_item(k)?, name.member(k), 0);
        match [column(0)?, column(1)?, column(2)?, column(3)?] {
            [Floats::F32(x), Floats::F32(y), Floats::F32(z), Floats::F32(r)] => {
                Ok(Self::F32(Layout::from_columns([x, y, z, r], name)?))
            }
            [x, y, z, r] => {
                let wide = |column: Floats<'py, Ix1>, k| column.widened(name.member(k));
                Ok(Self::F64(Layout::from_columns(
                    [wide(x, 0)?, wide(y, 1)?, wide(z, 2)?, wide(r, 3)?],
                    name,
                )?))
            }
        }
    }

    fn from_points(tuple: &Bound<'py, PyTuple>, name: Name) -> PyResult<Self> {
        let points_name = name.member(0);
        let points = Floats::<Ix2>::new(&tuple.get_item(0)?, points_name, 3)?;
        let radii_name = name.member(1);
        Ok(match (points, RadiiArg::new(&tuple.get_item(1)?, radii_name)?) {
            (Floats::F32(points), RadiiArg::Each(Floats::F32(radii))) => {
                Self::F32(Layout::Points(points, radii))
            }
            // Numbers that `float32` holds need not widen the positions.
            (Floats::F32(points), RadiiArg::One(radius)) if f64::from(radius as f32) == radius => {
                Self::F32(Layout::EqualPoints(points, MaybeUninit::new(radius as f32)))
            }
            (points, RadiiArg::Each(radii)) => {
                Self::F64(Layout::Points(points.widened(points_name)?, radii.widened(radii_name)?))
            }
            (points, RadiiArg::One(radius)) => {
                Self::F64(Layout::EqualPoints(points.widened(points_name)?, MaybeUninit::new(radius)))
            }
        })
    }
}

impl<'py, T: Number> Layout<'py, T> {
    fn from_columns([x, y, z, r]: [PyReadonlyArray1<'py, T>; 4], name: Name) -> PyResult<Self> {
        let stride = x.strides()[0];
        if y.strides()[0] == stride && z.strides()[0] == stride {
            return Ok(Self::Columns([x, y, z, r]));
        }
        let py = x.py();
        let copied = |column: PyReadonlyArray1<'py, T>| -> PyResult<_> {
            let copy = package(py)?.call_method1(intern!(py, "in_one_piece"), (&*column,))?;
            readable(copy.cast::<PyArray1<T>>()?, name)
        };
        Ok(Self::Columns([copied(x)?, copied(y)?, copied(z)?, r]))
    }
}

impl<T: Number> Layout<'_, T>
where
    for<'a> Spheres<'a>: From<&'a [[T; 4]]>,
{
    /// Returns the spheres in place: as rows or columns if they are contiguous, which `float32` searches read.
    fn spheres(&self) -> Result<Spheres<'_>, InputError> {
        match self {
            Self::Rows(rows) if rows.is_c_contiguous() => match rows.as_slice() {
                Ok(values) => Ok(Spheres::from(values.as_chunks::<4>().0)),
                Err(_) => strided(Column::from_table(rows), "r"),
            },
            Self::Rows(rows) => strided(Column::from_table(rows), "r"),
            Self::Columns(columns) => strided(columns.each_ref().map(Column::from_array), "r"),
            Self::Points(points, radii) => {
                let [x, y, z] = Column::from_table(points);
                strided([x, y, z, Column::from_array(radii)], "radii")
            }
            Self::EqualPoints(points, radius) => {
                let [x, y, z] = Column::from_table(points);
                let memory = std::slice::from_ref(radius);
                strided([x, y, z, Column { memory, step: 0, rows: x.rows }], "radii")
            }
        }
    }
}

/// Returns spheres of these columns; the first three have equal steps. `radii` is the name of the last one in errors.
fn strided<'a, T: Number>(
    columns: [Column<'a, T>; 4],
    radii: &'static str,
) -> Result<Spheres<'a>, InputError> {
    let [x, y, z, r] = columns;
    for (what, column) in [("y", y), ("z", z), (radii, r)] {
        if column.rows != x.rows {
            return Err(InputError::Lengths { what, length: column.rows, expected: x.rows });
        }
    }
    if let [Some(x), Some(y), Some(z), Some(r)] = columns.map(|column| column.as_slice()) {
        return Spheres::columns(x, y, z, r);
    }
    assert_eq!([y.step, z.step], [x.step; 2], "columns with one step");
    // SAFETY: each column has `x.rows` values that are initialized, as many values apart as its step says.
    Ok(Spheres::strided(unsafe {
        Strided::from_parts(columns.map(|column| column.memory), [x.step, r.step], x.rows)
    }))
}
