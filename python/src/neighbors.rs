//! Neighbor lists of atoms in NumPy arrays of ASE's types.
//!
//! ASE keeps pairs with `√d < c`, for the cutoff `c` and the squared distance `d`. This is exactly the
//! [open](lazygrid::ListOptions::open) list of spheres whose radii add up to the cutoff.

use std::sync::{Arc, Mutex, PoisonError};

use lazygrid::{
    Backend, Config, Error, InputError, Interaction, Interactions, ListOptions, NeighborList, Radii, Space,
    Spheres,
};
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use rayon::prelude::*;

use crate::arrays::same_length;
use crate::interruptible::{Work, interruptible};
use crate::pool::DetectorPool;
use crate::{error, fork, result_memory};

/// At or below this number of entries, one thread fills the arrays.
const CHUNK_ENTRIES: usize = 1 << 14;

enum Cutoffs<'a> {
    /// A single distance for all.
    One(f64),
    /// The sum of both radii.
    Radii(&'a [f64]),
    /// A table by the kinds of both.
    Kinds { kinds: &'a [u32], table: &'a [f64], count: usize },
}

impl Cutoffs<'_> {
    /// Spheres that touch if atoms are at most their cutoff apart.
    fn spheres<'s>(&'s self, positions: &'s [[f64; 3]]) -> Result<Spheres<'s>, InputError> {
        match *self {
            Self::One(cutoff) => Spheres::points(positions, Radii::All(0.5 * cutoff)),
            Self::Radii(radii) => Spheres::points(positions, Radii::Each(radii)),
            Self::Kinds { kinds, .. } => Spheres::points(positions, Radii::All(0.0))?.with_species(kinds),
        }
    }

    fn config(&self, space: Space) -> Result<Config, Error> {
        let config = Config::default().backend(Backend::Cpu).space(space);
        let Self::Kinds { table, count, .. } = *self else { return Ok(config) };
        let mut interactions = Interactions::new(count as u32, Interaction::Never)?;
        for a in 0..count {
            for b in 0..=a {
                let cutoff = table[a * count + b];
                if cutoff > 0.0 {
                    interactions.set(a as u32, b as u32, Interaction::Within(cutoff))?;
                }
            }
        }
        Ok(config.interactions(interactions))
    }

    /// Returns at least the largest cutoff.
    fn largest(&self) -> f64 {
        let (cutoffs, factor) = match *self {
            Self::One(cutoff) => return cutoff,
            Self::Radii(radii) => (radii, 2.0),
            Self::Kinds { table, .. } => (table, 1.0),
        };
        factor * cutoffs.iter().copied().fold(0.0, f64::max)
    }

    fn table(&self) -> &[f64] {
        if let Self::Kinds { table, .. } = self { table } else { &[] }
    }
}

/// Detectors of larger lists drop their buffers, beyond a few hundred MB.
const MAX_KEPT_ENTRIES: usize = 1 << 23;

/// The detectors of the last call. New memory would take a third of the next call's time.
static LAST_DETECTORS: Mutex<Option<LastDetectors>> = Mutex::new(None);

struct LastDetectors {
    cell: [[f64; 3]; 3],
    table: Vec<f64>,
    detectors: Arc<DetectorPool>,
}

/// Returns the last call's detectors, if their settings fit, or new ones.
fn detectors(cell: [[f64; 3]; 3], cutoffs: &Cutoffs<'_>) -> PyResult<Arc<DetectorPool>> {
    let last = LAST_DETECTORS.lock().unwrap_or_else(PoisonError::into_inner).take();
    let fitting = last.filter(|last| last.cell == cell && last.table == cutoffs.table());
    if let Some(LastDetectors { detectors, .. }) = fitting {
        return Ok(detectors);
    }
    let vectors = cell.map(|vector| (vector != [0.0; 3]).then_some(vector));
    let space = match vectors == [None; 3] {
        true => Ok(Space::UNBOUNDED),
        false => Space::triclinic(vectors),
    };
    let config = cutoffs.config(space.map_err(error::input)?).map_err(error::engine)?;
    DetectorPool::new(config, None)
}

fn keep(cell: [[f64; 3]; 3], cutoffs: &Cutoffs<'_>, detectors: Arc<DetectorPool>) {
    let last = LastDetectors { cell, table: cutoffs.table().to_vec(), detectors };
    *LAST_DETECTORS.lock().unwrap_or_else(PoisonError::into_inner) = Some(last);
}

/// Returns the number of spheres whose search takes about as long. Beyond half a height of the cell, the number of
/// atoms does not bound the work, because each atom has several images within the cutoff.
fn comparable_spheres(atoms: usize, cell: &[[f64; 3]; 3], cutoff: f64) -> usize {
    let heights = (0..3).filter(|&axis| cell[axis] != [0.0; 3]).map(|axis| height(cell, axis));
    let ratios = heights.map(|height| cutoff / height);
    match ratios.clone().any(|ratio| ratio > 0.5) {
        false => atoms,
        // `as` saturates.
        true => {
            ratios.map(|ratio| 2.0 * ratio + 1.0).fold((atoms as f64).powi(2), |all, images| all * images)
                as usize
        }
    }
}

/// Returns the length of a cell vector's component that is orthogonal to the other two.
fn height(cell: &[[f64; 3]; 3], axis: usize) -> f64 {
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let without = |vector: [f64; 3], along: [f64; 3]| {
        let factor = if along == [0.0; 3] { 0.0 } else { dot(vector, along) / dot(along, along) };
        [0, 1, 2].map(|k| vector[k] - factor * along[k])
    };
    let (first, second) = (cell[(axis + 1) % 3], cell[(axis + 2) % 3]);
    let rest = without(without(cell[axis], first), without(second, first));
    dot(rest, rest).sqrt()
}

struct Arrays<'py> {
    i: Option<Bound<'py, PyArray1<i64>>>,
    j: Option<Bound<'py, PyArray1<i64>>>,
    distance: Option<Bound<'py, PyArray1<f64>>>,
    vector: Option<Bound<'py, PyArray2<f64>>>,
    shift: Option<Bound<'py, PyArray2<i64>>>,
}

impl<'py> Arrays<'py> {
    fn new(py: Python<'py>, quantities: &str, found: usize) -> PyResult<Self> {
        let wanted = |quantity| quantities.contains(quantity);
        Ok(Self {
            i: wanted('i').then(|| result_memory::array::<i64, 1>(py, [found])).transpose()?,
            j: wanted('j').then(|| result_memory::array::<i64, 1>(py, [found])).transpose()?,
            distance: wanted('d').then(|| result_memory::array::<f64, 1>(py, [found])).transpose()?,
            vector: wanted('D').then(|| result_memory::array::<f64, 2>(py, [found, 3])).transpose()?,
            shift: wanted('S').then(|| result_memory::array::<i64, 2>(py, [found, 3])).transpose()?,
        })
    }

    fn fill(&self, py: Python<'_>, list: &NeighborList<'_>, threads: Threads) -> PyResult<()> {
        let (mut i, mut j) =
            (self.i.as_ref().map(|array| array.readwrite()), self.j.as_ref().map(|array| array.readwrite()));
        let (mut distance, mut vector, mut shift) = (
            self.distance.as_ref().map(|array| array.readwrite()),
            self.vector.as_ref().map(|array| array.readwrite()),
            self.shift.as_ref().map(|array| array.readwrite()),
        );
        let i = i.as_mut().map(|array| array.as_slice_mut()).transpose()?;
        let j = j.as_mut().map(|array| array.as_slice_mut()).transpose()?;
        let distance = distance.as_mut().map(|array| array.as_slice_mut()).transpose()?;
        let vector = vector.as_mut().map(|array| array.as_slice_mut()).transpose()?;
        let shift = shift.as_mut().map(|array| array.as_slice_mut()).transpose()?;
        py.detach(|| {
            let (vector, shift) =
                (vector.map(|all| all.as_chunks_mut::<3>().0), shift.map(|all| all.as_chunks_mut::<3>().0));
            threads.put(i, list.pairs(), |pair| i64::from(pair.i));
            threads.put(j, list.pairs(), |pair| i64::from(pair.j));
            threads.put(distance, list.distances(), |&distance| distance);
            threads.put(vector, list.vectors(), |&vector| vector);
            threads.put(shift, list.shifts(), |shift| shift.map(i64::from));
        });
        Ok(())
    }

    /// Returns one array for one letter, else a tuple. A repeated letter is the same array.
    fn in_order(self, py: Python<'py>, quantities: &str) -> PyResult<Bound<'py, PyAny>> {
        let Self { i, j, distance, vector, shift } = self;
        let [i, j] = [i, j].map(|array| array.map(Bound::into_any));
        let (distance, vector) = (distance.map(Bound::into_any), vector.map(Bound::into_any));
        let shift = shift.map(Bound::into_any);
        let array_for = |quantity| match quantity {
            'i' => i.clone(),
            'j' => j.clone(),
            'd' => distance.clone(),
            'D' => vector.clone(),
            _ => shift.clone(),
        };
        let all: Vec<_> = quantities.chars().filter_map(array_for).collect();
        match <[_; 1]>::try_from(all) {
            Ok([array]) => Ok(array),
            Err(all) => Ok(PyTuple::new(py, all)?.into_any()),
        }
    }
}

/// The threads that fill arrays.
#[derive(Clone, Copy)]
enum Threads {
    Caller,
    Global,
}

impl Threads {
    /// Starts the global threads, unless `is_single_threaded` or the list is short.
    fn start(is_single_threaded: bool, entries: usize) -> PyResult<Self> {
        if is_single_threaded || entries <= CHUNK_ENTRIES {
            return Ok(Self::Caller);
        }
        fork::use_global_threads()?;
        Ok(Self::Global)
    }

    /// Writes a quantity of all entries, if it has an array.
    fn put<T: Send, U: Sync>(self, array: Option<&mut [T]>, values: &[U], value: impl Fn(&U) -> T + Sync) {
        let Some(array) = array else { return };
        let fill = |(array, values): (&mut [T], &[U])| {
            array.iter_mut().zip(values).for_each(|(target, from)| *target = value(from));
        };
        match self {
            Self::Caller => fill((array, values)),
            Self::Global => {
                let chunks = array.par_chunks_mut(CHUNK_ENTRIES).zip(values.par_chunks(CHUNK_ENTRIES));
                chunks.for_each(fill);
            }
        }
    }
}

/// Cutoffs: a number, a radius per atom, or a kind per atom and a table for two kinds.
#[derive(FromPyObject)]
pub(crate) enum CutoffArg<'py> {
    Radii(PyReadonlyArray1<'py, f64>),
    Kinds(PyReadonlyArray1<'py, u32>, PyReadonlyArray2<'py, f64>),
    /// Last, because an array of one number is also a number.
    One(f64),
}

impl CutoffArg<'_> {
    fn cutoffs(&self, atoms: usize) -> PyResult<Cutoffs<'_>> {
        match self {
            Self::One(cutoff) => Ok(Cutoffs::One(*cutoff)),
            Self::Radii(radii) => {
                same_length("cutoff", radii.len(), atoms)?;
                Ok(Cutoffs::Radii(radii.as_slice()?))
            }
            Self::Kinds(kinds, table) => {
                same_length("numbers", kinds.len(), atoms)?;
                let (kinds, count) = (kinds.as_slice()?, table.shape()[0]);
                if table.shape()[1] != count || kinds.iter().any(|&kind| kind as usize >= count) {
                    return Err(error::array("the table of cutoffs does not have every kind"));
                }
                Ok(Cutoffs::Kinds { kinds, table: table.as_slice()?, count })
            }
        }
    }
}

const QUANTITIES: &str = "ijdDS";

/// Adds quantities to the options.
///
/// # Errors
/// `InputError` for unknown quantities.
pub(crate) fn options(quantities: &str, options: ListOptions) -> PyResult<ListOptions> {
    if quantities.is_empty() || quantities.contains(|letter| !QUANTITIES.contains(letter)) {
        let message = format!("quantities = '{quantities}'; choose some of the letters {QUANTITIES}");
        return Err(error::array(message));
    }
    let wanted = |quantity| quantities.contains(quantity);
    let options = if wanted('S') { options.shifts() } else { options };
    let options = if wanted('D') { options.vectors() } else { options };
    Ok(if wanted('d') { options.distances() } else { options })
}

/// Returns the quantities of a list as an array or a tuple of arrays. The list of a single-threaded detector, which
/// serves forked processes, uses no other threads.
pub(crate) fn arrays<'py>(
    py: Python<'py>,
    quantities: &str,
    list: &NeighborList<'_>,
    is_single_threaded: bool,
) -> PyResult<Bound<'py, PyAny>> {
    let threads = Threads::start(is_single_threaded, list.len())?;
    let arrays = Arrays::new(py, quantities, list.len())?;
    arrays.fill(py, list, threads)?;
    arrays.in_order(py, quantities)
}

/// Return the neighbors of atoms by quantity: an array, or a tuple of arrays. See :func:`lazygrid.neighbor_list`.
#[pyfunction]
#[pyo3(signature = (quantities, positions, cutoffs, *, cell, with_itself))]
#[expect(clippy::needless_pass_by_value, clippy::too_many_arguments, reason = "arguments of Python")]
pub(crate) fn neighbors_within<'py>(
    py: Python<'py>,
    quantities: &str,
    positions: PyReadonlyArray2<'py, f64>,
    cutoffs: CutoffArg<'py>,
    cell: [[f64; 3]; 3],
    with_itself: bool,
) -> PyResult<Bound<'py, PyAny>> {
    fork::use_global_threads()?;
    let positions = positions.as_slice()?.as_chunks::<3>().0;
    let cutoffs = cutoffs.cutoffs(positions.len())?;
    let spheres = cutoffs.spheres(positions).map_err(error::input)?;
    let wanted = ListOptions::full().open();
    let options = options(quantities, if with_itself { wanted.with_self() } else { wanted })?;
    let detectors = detectors(cell, &cutoffs)?;
    let mut lease = detectors.lease()?;
    let (detector, cancel) = lease.detector_and_cancel();
    let spheres_of_work = comparable_spheres(positions.len(), &cell, cutoffs.largest());
    let work = Work { spheres: spheres_of_work, can_hold_lock: true };
    let found = interruptible(py, work, cancel, || detector.neighbor_list(spheres, options))?;
    let list = found.map_err(error::engine)?;
    let (length, arrays) = (list.len(), arrays(py, quantities, &list, false)?);
    drop(lease);
    if length <= MAX_KEPT_ENTRIES {
        keep(cell, &cutoffs, detectors);
    }
    Ok(arrays)
}
