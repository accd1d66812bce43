use std::sync::Arc;

use pyo3::prelude::*;

use crate::memory::try_collect;
use crate::{arrays, error};

/// Pairs that a search never reports, such as bonds.
///
/// They are for one number of spheres. To exclude whole molecules, ``groups`` cost less.
///
/// >>> bonds = lazygrid.Exclusions(len(spheres), [(0, 1), (1, 2)])
/// >>> detector.pairs(spheres, exclusions=bonds)
///
/// Parameters
/// ----------
/// spheres
///     The number of spheres.
/// pairs
///     Indices of spheres, whole numbers of shape ``(m, 2)``, in any order and possibly repeated.
///
/// Raises
/// ------
/// InputError
///     For an index out of range, and for a wrong shape.
#[pyclass(frozen, module = "lazygrid")]
pub(crate) struct Exclusions {
    list: Arc<lazygrid::Exclusions>,
}

impl Exclusions {
    /// Shared with running calls.
    pub(crate) fn list(&self) -> Arc<lazygrid::Exclusions> {
        self.list.clone()
    }

    fn made(
        py: Python<'_>,
        make: impl FnOnce() -> Result<lazygrid::Exclusions, lazygrid::Error> + Send,
    ) -> PyResult<Self> {
        Ok(Self { list: Arc::new(py.detach(make).map_err(error::engine)?) })
    }
}

#[pymethods]
impl Exclusions {
    #[new]
    fn new(py: Python<'_>, spheres: u32, pairs: &Bound<'_, PyAny>) -> PyResult<Self> {
        let array = arrays::whole_pairs(pairs, "pairs")?;
        let pairs = array.as_slice()?.as_chunks::<2>().0;
        Self::made(py, || lazygrid::Exclusions::new(spheres as usize, pairs.iter().map(|&[i, j]| (i, j))))
    }

    /// Return exclusions for two sets: pairs of one sphere of each.
    ///
    /// Parameters
    /// ----------
    /// first, second
    ///     The numbers of spheres.
    /// pairs
    ///     An index in the first set and one in the second, whole numbers of shape ``(m, 2)``.
    ///
    /// Raises
    /// ------
    /// InputError
    ///     See the class.
    #[staticmethod]
    fn across(py: Python<'_>, first: u32, second: u32, pairs: &Bound<'_, PyAny>) -> PyResult<Self> {
        let array = arrays::whole_pairs(pairs, "pairs")?;
        let pairs = array.as_slice()?.as_chunks::<2>().0.iter().map(|&[i, j]| (i, j));
        Self::made(py, || lazygrid::Exclusions::across(first as usize, second as usize, pairs))
    }

    /// Return the pairs of compressed rows, such as from :meth:`Detector.neighbors`.
    ///
    /// Parameters
    /// ----------
    /// offsets
    ///     Whole numbers of shape ``(n + 1,)`` for ``n`` spheres.
    /// indices
    ///     Whole numbers of shape ``(k,)``. Sphere ``i`` never pairs with ``indices[offsets[i]:offsets[i + 1]]``;
    ///     one of the two rows of a pair suffices.
    ///
    /// Raises
    /// ------
    /// InputError
    ///     See the class; also for offsets that do not begin with 0, decrease, or do not end with the number of indices.
    #[staticmethod]
    fn from_csr(py: Python<'_>, offsets: &Bound<'_, PyAny>, indices: &Bound<'_, PyAny>) -> PyResult<Self> {
        let offsets = arrays::offsets(offsets, "offsets")?;
        let indices = arrays::whole(indices, "indices")?;
        let (offsets, indices) = (offsets.as_slice()?, indices.as_slice()?);
        Self::made(py, || {
            let starts = offsets.iter().map(|&at| usize::try_from(at).unwrap_or(usize::MAX));
            lazygrid::Exclusions::from_csr(&try_collect(starts, "offsets of excluded pairs")?, indices)
        })
    }

    fn __len__(&self) -> usize {
        self.list.len()
    }

    fn __repr__(&self) -> String {
        let spheres = match self.list.spheres() {
            (one, None) => format!("{one} spheres"),
            (first, Some(second)) => format!("sets of {first} and {second} spheres"),
        };
        format!("<lazygrid.Exclusions: {} pairs of {spheres}>", self.list.len())
    }
}
