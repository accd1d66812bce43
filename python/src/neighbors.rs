//! Neighbor lists in double precision, as ASE has them.
//!
//! The search finds all pairs of atoms at most the cutoff apart, in `f64`. The operations of ASE, in their order, then decide,
//! so that the results are the same to the last bit.
//!
//! # Correctness
//!
//! 1. With a cutoff `c`, ASE keeps atoms if `√d < c` for the sum of squares `d` of the vector `v` between them. The search
//!    keeps them if `d ≤ c·c`, and computes `v` from the given cell by the same expression.
//! 2. The root is rounded to nearest. If it is below `c`, so is the exact root, hence `d < c²`. Rounding `c²` to nearest does
//!    not take it below `d`, which is a number of the same type.
//! 3. No image of an atom is nearer to another one than two cutoffs. So both expressions choose the same image of a pair that
//!    ASE keeps, or two images that are equally far apart.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use lazygrid::{
    Backend, Config, Detector, Error, InputError, Interaction, Interactions, Neighbors, Radii, Space, Spheres,
};
use numpy::ndarray::{Dimension, Ix1, Ix2};
use numpy::{
    Element, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadwriteArray,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;

use crate::arrays::{empty, same_length};
use crate::call::call;
use crate::images::{Bond, Edge, Images};
use crate::{error, fork};

/// Atoms per piece of work.
const PIECE: usize = 1 << 10;

/// Atoms, the box they are in, and who is whose neighbour.
struct Atoms<'a> {
    positions: &'a [[f64; 3]],
    images: Images,
    cutoffs: Cutoffs<'a>,
    /// Whether every atom is its own neighbour.
    with_itself: bool,
}

/// Neighbours are nearer than this.
enum Cutoffs<'a> {
    /// The same for all.
    One(f64),
    /// The sum of the radii of the two.
    Radii(&'a [f64]),
    /// By the kinds of the two; there are so many kinds.
    Kinds { of: &'a [u32], table: &'a [f64], count: usize },
}

impl Cutoffs<'_> {
    fn between(&self, i: usize, j: usize) -> f64 {
        match *self {
            Self::One(cutoff) => cutoff,
            Self::Radii(radii) => radii[i] + radii[j],
            Self::Kinds { of, table, count } => table[of[i] as usize * count + of[j] as usize],
        }
    }

    /// The largest, of any atom with itself included.
    fn largest(&self) -> f64 {
        match *self {
            Self::One(cutoff) => cutoff,
            Self::Radii(radii) => 2.0 * radii.iter().copied().fold(0.0, f64::max),
            Self::Kinds { table, .. } => table.iter().copied().fold(0.0, f64::max),
        }
    }
}

impl Atoms<'_> {
    /// Calls `take` with the neighbours of an atom, ascending.
    fn neighbors(&self, candidates: &Neighbors<'_>, i: usize, mut take: impl FnMut(usize, Bond)) {
        let others = candidates.of(i);
        let own = if self.with_itself { others.partition_point(|&j| (j as usize) < i) } else { usize::MAX };
        for at in 0..=others.len() {
            let itself = (at == own).then_some(i);
            for j in itself.into_iter().chain(others.get(at).map(|&j| j as usize)) {
                let (from, to) = (self.positions[i], self.positions[j]);
                let bond = self.images.nearest(std::array::from_fn(|axis| to[axis] - from[axis]));
                if let Some(bond) = bond.filter(|bond| bond.distance < self.cutoffs.between(i, j)) {
                    take(j, bond);
                }
            }
        }
    }

    /// Spheres that touch if atoms are at most their cutoff apart.
    fn spheres(&self) -> Result<Spheres<'_>, InputError> {
        match self.cutoffs {
            Cutoffs::One(cutoff) => Spheres::points(self.positions, Radii::All(0.5 * cutoff)),
            Cutoffs::Radii(radii) => Spheres::points(self.positions, Radii::Each(radii)),
            Cutoffs::Kinds { of, .. } => Spheres::points(self.positions, Radii::All(0.0))?.with_species(of),
        }
    }

    /// A detector that finds all atoms at most their cutoff apart.
    fn detector(&self, space: Space, stop: Arc<AtomicBool>) -> Result<Detector, Error> {
        let config = Config::default().backend(Backend::Cpu).space(space).stop(stop);
        let Cutoffs::Kinds { table, count, .. } = self.cutoffs else { return Detector::new(config) };
        let mut interactions = Interactions::new(count as u32, Interaction::Never)?;
        for a in 0..count {
            for b in 0..=a {
                let cutoff = table[a * count + b];
                if cutoff > 0.0 {
                    interactions.set(a as u32, b as u32, Interaction::Within(cutoff))?;
                }
            }
        }
        Detector::new(config.interactions(interactions))
    }
}

/// Where the quantities go; those that nobody asked for have no room.
#[derive(Default)]
struct Slots<'s> {
    i: &'s mut [i64],
    j: &'s mut [i64],
    distance: &'s mut [f64],
    vector: &'s mut [[f64; 3]],
    shift: &'s mut [[i64; 3]],
}

impl<'s> Slots<'s> {
    /// The first so many, and what remains.
    fn split(self, at: usize) -> (Self, Self) {
        fn part<T>(all: &mut [T], at: usize) -> (&mut [T], &mut [T]) {
            all.split_at_mut(at.min(all.len()))
        }
        let Self { i, j, distance, vector, shift } = self;
        let (i, j, distance) = (part(i, at), part(j, at), part(distance, at));
        let (vector, shift) = (part(vector, at), part(shift, at));
        let first = Self { i: i.0, j: j.0, distance: distance.0, vector: vector.0, shift: shift.0 };
        (first, Self { i: i.1, j: j.1, distance: distance.1, vector: vector.1, shift: shift.1 })
    }

    fn put(&mut self, at: usize, [i, j]: [usize; 2], bond: &Bond) {
        fn put<T>(slots: &mut [T], at: usize, value: T) {
            if let Some(slot) = slots.get_mut(at) {
                *slot = value;
            }
        }
        put(self.i, at, i as i64);
        put(self.j, at, j as i64);
        put(self.distance, at, bond.distance);
        put(self.vector, at, bond.vector);
        put(self.shift, at, bond.shift);
    }
}

/// The arrays that are returned.
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
            i: wanted('i').then(|| empty::<i64, Ix1>(py, (found,))).transpose()?,
            j: wanted('j').then(|| empty::<i64, Ix1>(py, (found,))).transpose()?,
            distance: wanted('d').then(|| empty::<f64, Ix1>(py, (found,))).transpose()?,
            vector: wanted('D').then(|| empty::<f64, Ix2>(py, (found, 3))).transpose()?,
            shift: wanted('S').then(|| empty::<i64, Ix2>(py, (found, 3))).transpose()?,
        })
    }

    /// Lends the arrays to `fill`.
    fn write(&self, fill: impl FnOnce(Slots<'_>) -> PyResult<()>) -> PyResult<()> {
        let mut i = self.i.as_ref().map(|array| array.readwrite());
        let mut j = self.j.as_ref().map(|array| array.readwrite());
        let mut distance = self.distance.as_ref().map(|array| array.readwrite());
        let mut vector = self.vector.as_ref().map(|array| array.readwrite());
        let mut shift = self.shift.as_ref().map(|array| array.readwrite());
        fill(Slots {
            i: slots(&mut i)?,
            j: slots(&mut j)?,
            distance: slots(&mut distance)?,
            vector: slots(&mut vector)?.as_chunks_mut().0,
            shift: slots(&mut shift)?.as_chunks_mut().0,
        })
    }

    fn named(self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let Self { i, j, distance, vector, shift } = self;
        let [i, j] = [i, j].map(|array| array.map(Bound::into_any));
        let (distance, vector) = (distance.map(Bound::into_any), vector.map(Bound::into_any));
        let named = PyDict::new(py);
        for (name, array) in
            [("i", i), ("j", j), ("d", distance), ("D", vector), ("S", shift.map(Bound::into_any))]
        {
            if let Some(array) = array {
                named.set_item(name, array)?;
            }
        }
        Ok(named)
    }
}

fn slots<'s, T: Element, D: Dimension>(
    array: &'s mut Option<PyReadwriteArray<'_, T, D>>,
) -> PyResult<&'s mut [T]> {
    match array {
        None => Ok(&mut []),
        Some(array) => Ok(array.as_slice_mut()?),
    }
}

/// How many neighbours the atoms of each piece have.
fn tally(atoms: &Atoms<'_>, candidates: &Neighbors<'_>) -> Vec<usize> {
    let count = |piece: usize| {
        let mut count = 0;
        of_piece(piece, candidates.len()).for_each(|i| atoms.neighbors(candidates, i, |_, _| count += 1));
        count
    };
    (0..candidates.len().div_ceil(PIECE)).into_par_iter().map(count).collect()
}

/// Writes the neighbours, of which each piece has so many.
fn fill(atoms: &Atoms<'_>, candidates: &Neighbors<'_>, counts: &[usize], mut slots: Slots<'_>) {
    let mut pieces = Vec::with_capacity(counts.len());
    for &count in counts {
        let (own, rest) = slots.split(count);
        pieces.push(own);
        slots = rest;
    }
    pieces.par_iter_mut().enumerate().for_each(|(piece, slots)| {
        let mut at = 0;
        for i in of_piece(piece, candidates.len()) {
            atoms.neighbors(candidates, i, |j, bond| {
                slots.put(at, [i, j], &bond);
                at += 1;
            });
        }
    });
}

fn of_piece(piece: usize, atoms: usize) -> std::ops::Range<usize> {
    piece * PIECE..atoms.min((piece + 1) * PIECE)
}

/// Cutoffs as Python says them: a number, a radius for each atom, or a kind for each atom and a table for two kinds.
#[derive(FromPyObject)]
pub(crate) enum Said<'py> {
    Radii(PyReadonlyArray1<'py, f64>),
    Kinds(PyReadonlyArray1<'py, u32>, PyReadonlyArray2<'py, f64>),
    /// The last, since an array of one number is a number too.
    One(f64),
}

impl Said<'_> {
    fn cutoffs(&self, atoms: usize) -> PyResult<Cutoffs<'_>> {
        match self {
            Self::One(cutoff) => Ok(Cutoffs::One(*cutoff)),
            Self::Radii(radii) => {
                same_length("cutoff", radii.len(), atoms)?;
                Ok(Cutoffs::Radii(radii.as_slice()?))
            }
            Self::Kinds(of, table) => {
                same_length("numbers", of.len(), atoms)?;
                let (of, count) = (of.as_slice()?, table.shape()[0]);
                if table.shape()[1] != count || of.iter().any(|&kind| kind as usize >= count) {
                    return Err(error::array("the table of cutoffs does not have every kind"));
                }
                Ok(Cutoffs::Kinds { of, table: table.as_slice()?, count })
            }
        }
    }
}

/// Return the neighbours of atoms by quantity. See :func:`lazygrid.neighbor_list`.
#[pyfunction]
#[pyo3(signature = (quantities, positions, cutoffs, *, cell, edges, with_itself))]
#[expect(clippy::too_many_arguments, reason = "keywords in Python")]
pub(crate) fn neighbors_within<'py>(
    py: Python<'py>,
    quantities: &str,
    positions: PyReadonlyArray2<'py, f64>,
    cutoffs: Said<'py>,
    cell: [[f64; 3]; 3],
    edges: Vec<Edge>,
    with_itself: bool,
) -> PyResult<Bound<'py, PyDict>> {
    fork::use_threads()?;
    let positions = positions.as_slice()?.as_chunks::<3>().0;
    let cutoffs = cutoffs.cutoffs(positions.len())?;
    let images = Images::new(cell, edges, cutoffs.largest());
    let atoms = Atoms { positions, images, cutoffs, with_itself };
    let stop = Arc::new(AtomicBool::new(false));
    let count = positions.len();
    let repeats = |edge: &[f64; 3]| (*edge != [0.0; 3]).then_some(*edge);
    let space = Space::sheared(cell.each_ref().map(repeats)).map_err(error::input)?;
    let spheres = atoms.spheres().map_err(error::input)?;
    let mut detector = atoms.detector(space, stop.clone()).map_err(error::engine)?;
    let candidates = call(py, count, &stop, || detector.neighbors(spheres))?.map_err(error::engine)?;
    let counts = call(py, count, &stop, || tally(&atoms, &candidates))?;
    let found = counts.iter().sum();
    let arrays = Arrays::new(py, quantities, found)?;
    arrays.write(|slots| call(py, count, &stop, || fill(&atoms, &candidates, &counts, slots)))?;
    arrays.named(py)
}
