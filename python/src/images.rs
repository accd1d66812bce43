//! Images of atoms in a periodic cell of any shape: the nearest one, in `f64`.

use pyo3::prelude::*;

/// The cell, and what is nearer than the cutoff in it.
pub(crate) struct Images {
    /// Vectors of the cell; where it is not periodic they are zero.
    cell: [[f64; 3]; 3],
    /// The edges along which images lie, which are nearly orthogonal.
    edges: Vec<Edge>,
}

/// An edge of the reduced cell.
pub(crate) struct Edge {
    /// How many of each vector of the cell it is.
    of_cell: [i64; 3],
    /// How many of this edge lie between two points: the scalar product of their difference with this.
    dual: [f64; 3],
    /// How many of this edge, at most, lie between points that are nearer than the cutoff.
    reach: f64,
}

/// As Python says it.
impl<'py> FromPyObject<'_, 'py> for Edge {
    type Error = PyErr;

    fn extract(given: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        let (of_cell, dual) = given.extract()?;
        Ok(Self { of_cell, dual, reach: 0.0 })
    }
}

/// From an atom to an image of another.
pub(crate) struct Bond {
    /// How many of each vector of the cell lie between.
    pub(crate) shift: [i64; 3],
    pub(crate) vector: [f64; 3],
    pub(crate) distance: f64,
}

impl Images {
    /// Images of atoms whose neighbours are nearer than `cutoff`. No edge, nor a sum of edges, is shorter than two cutoffs.
    pub(crate) fn new(cell: [[f64; 3]; 3], mut edges: Vec<Edge>, cutoff: f64) -> Self {
        for edge in &mut edges {
            edge.reach = cutoff * length(edge.dual);
        }
        Self { cell, edges }
    }

    /// To the nearest image of an atom that is so far away; none where no image can be nearer than the cutoff. As edges are,
    /// a second image never is.
    pub(crate) fn nearest(&self, difference: [f64; 3]) -> Option<Bond> {
        let mut turns = [(0, 0); 3];
        for (turns, Edge { dual, reach, .. }) in turns.iter_mut().zip(&self.edges) {
            let between = dot(*dual, difference);
            // A little more, since this is rounded.
            let reach = reach + (1e-6 + 1e-14 * between.abs()).min(1.0);
            *turns = ((-between - reach).ceil() as i64, (reach - between).floor() as i64);
        }
        let [of_a, of_b, of_c] = turns.map(|(first, last)| first..=last);
        let mut nearest: Option<Bond> = None;
        for a in of_a {
            for b in of_b.clone() {
                for c in of_c.clone() {
                    let bond = self.image(difference, [a, b, c]);
                    if nearest.as_ref().is_none_or(|nearest| bond.distance < nearest.distance) {
                        nearest = Some(bond);
                    }
                }
            }
        }
        nearest
    }

    /// To the image that is so many edges away, with the operations of ASE.
    fn image(&self, difference: [f64; 3], turns: [i64; 3]) -> Bond {
        let mut shift = [0; 3];
        for (turns, Edge { of_cell, .. }) in turns.into_iter().zip(&self.edges) {
            for axis in 0..3 {
                shift[axis] += turns * of_cell[axis];
            }
        }
        let moved = |axis: usize| (0..3).map(|k| shift[k] as f64 * self.cell[k][axis]).sum::<f64>();
        let vector: [f64; 3] = std::array::from_fn(|axis| difference[axis] + moved(axis));
        Bond { shift, vector, distance: length(vector) }
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn length(vector: [f64; 3]) -> f64 {
    dot(vector, vector).sqrt()
}
