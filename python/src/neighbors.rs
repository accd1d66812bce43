//! Neighbour lists in double precision, as ASE has them.
//!
//! The search runs in `f32`, with reaches that are wider than all its rounding can be; what it finds is then decided in
//! `f64`, with the operations of ASE in their order, so that the results are the same to the last bit.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use lazygrid::glam::Vec3;
use lazygrid::{
    Backend, Config, Detector, Error, Interaction, Interactions, Neighbors, Space, Sphere, Spheres,
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
use crate::images::{Bond, Edge, Images, length};
use crate::{error, fork};

/// Atoms per piece of work.
const PIECE: usize = 1 << 10;

/// How far `f32` may be off, per length of the largest coordinate or of all edges: on each of three axes two coordinates
/// are rounded by 2⁻²⁴ of theirs or less, and so is each edge, of which no more than one lies between atoms that were
/// brought near the origin; this is more than twice their sum.
const ROUNDING: f64 = 1.0 / (1 << 20) as f64;

/// The same of `f64`, for bringing atoms there, per length of the largest coordinate they had.
const ROUNDING_OF_FAR: f64 = 1.0 / (1_u64 << 48) as f64;

/// Atoms, the box they are in, and who is whose neighbour.
struct Atoms<'a> {
    positions: &'a [[f64; 3]],
    images: Images,
    cutoffs: Cutoffs<'a>,
    /// The largest cutoff, of any atom with itself included.
    largest: f64,
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

    /// The atoms as spheres around the origin that overlap wherever atoms are neighbours, and the space they are in.
    fn spheres(&self) -> Result<(Vec<Sphere>, Space, f64), Error> {
        let ([mut low, mut high], mut far) = ([[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]], 0.0_f64);
        for &position in self.positions {
            let wrapped = self.images.wrap(position);
            // What is not finite is refused by the search, and must not make others look so.
            for axis in (0..3).filter(|&axis| wrapped[axis].is_finite()) {
                low[axis] = low[axis].min(wrapped[axis]);
                high[axis] = high[axis].max(wrapped[axis]);
                far = far.max(position[axis].abs());
            }
        }
        let middle: [f64; 3] = std::array::from_fn(|axis| 0.5 * (low[axis] + high[axis]));
        let half = (0..3).map(|axis| 0.5 * (high[axis] - low[axis]));
        let edges: f64 = self.images.edges().map(length).sum();
        let size = half.fold(self.largest.max(edges), f64::max);
        let slack = ROUNDING * size + ROUNDING_OF_FAR * far;
        let bytes = size_of_val(self.positions) as u64;
        let mut spheres = Vec::new();
        spheres
            .try_reserve_exact(self.positions.len())
            .map_err(|_| Error::OutOfMemory { what: "spheres", bytes })?;
        spheres.extend(self.positions.iter().enumerate().map(|(i, position)| {
            let radius = match self.cutoffs {
                Cutoffs::One(cutoff) => 0.5 * (cutoff + slack),
                Cutoffs::Radii(radii) => radii[i] + 0.5 * slack,
                Cutoffs::Kinds { .. } => 0.0,
            };
            let wrapped = self.images.wrap(*position);
            let near = [0, 1, 2].map(|axis| (wrapped[axis] - middle[axis]) as f32);
            Sphere::new(near, (radius as f32).next_up())
        }));
        let mut edges = [None; 3];
        for (slot, edge) in edges.iter_mut().zip(self.images.edges()) {
            *slot = Some(Vec3::from(edge.map(|x| x as f32)));
        }
        Ok((spheres, Space::sheared(edges)?, slack))
    }

    /// A detector that finds all neighbours, and some that are none.
    fn detector(&self, space: Space, slack: f64, stop: Arc<AtomicBool>) -> Result<Detector, Error> {
        let config = Config::default().backend(Backend::Cpu).space(space).stop(stop);
        let Cutoffs::Kinds { table, count, .. } = self.cutoffs else { return Detector::new(config) };
        let mut interactions = Interactions::new(count as u32, Interaction::Never)?;
        for a in 0..count {
            for b in 0..=a {
                let cutoff = table[a * count + b];
                if cutoff > 0.0 {
                    let reach = ((cutoff + slack) as f32).next_up();
                    interactions.set(a as u32, b as u32, Interaction::Within(reach))?;
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
    let largest = cutoffs.largest();
    let images = Images::new(cell, edges, largest);
    let atoms = Atoms { positions, images, cutoffs, largest, with_itself };
    let stop = Arc::new(AtomicBool::new(false));
    let count = positions.len();
    let (spheres, space, slack) = atoms.spheres().map_err(error::engine)?;
    let spheres = match atoms.cutoffs {
        Cutoffs::Kinds { of, .. } => Spheres::from(&spheres).with_species(of).map_err(error::input)?,
        _ => Spheres::from(&spheres),
    };
    let mut detector = atoms.detector(space, slack, stop.clone()).map_err(error::engine)?;
    let candidates = call(py, count, &stop, || detector.neighbors(spheres))?.map_err(error::engine)?;
    let counts = call(py, count, &stop, || tally(&atoms, &candidates))?;
    let found = counts.iter().sum();
    let arrays = Arrays::new(py, quantities, found)?;
    arrays.write(|slots| call(py, count, &stop, || fill(&atoms, &candidates, &counts, slots)))?;
    arrays.named(py)
}
