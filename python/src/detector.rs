//! The class `Detector`.

use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{self, Given, Said};
use crate::call::call;
use crate::chunks::Chunks;
use crate::engines::Engines;
use crate::exclusions::Exclusions;
use crate::interactions::Interactions;
use crate::settings::Settings;
use crate::{error, report};

/// Finds all pairs of overlapping spheres, call after call, reusing its buffers.
///
/// Two spheres are a pair where their centres are at most ``ri + rj`` apart; touching counts. Spheres are
///
/// - an array of float32 and of shape ``(n, 4)``, with rows ``x, y, z, r``; or
/// - a tuple of four arrays of float32, of shape ``(n,)``: ``x``, ``y``, ``z`` and ``r``,
///
/// all in one length unit, anywhere in space. Arrays in one piece are read where they lie; others are copied first.
/// Whatever float32 cannot hold, such as float64, is a ``TypeError``, unless ``cast=True`` has it rounded.
///
/// Any number of threads may use one detector at a time: while a call runs the interpreter's lock is released. The
/// arrays of a call must not be written to before it returns. Ctrl-C ends a long call on the CPU.
///
/// Parameters
/// ----------
/// backend
///     Where to run. ``"auto"`` takes a GPU where there is one; ``"cpu"`` and ``"gpu"`` never fall back.
/// algorithm
///     How to search; all find the same pairs.
/// threads
///     Threads of the CPU; by default all.
/// periodic
///     The length of each periodic axis, in the unit of the spheres, as float32; ``None`` for one that is unbounded:
///     ``(10.0, 10.0, None)``. Coordinates need not lie in the box. Of a box that leans, the edges:
///     ``((10.0, 0.0, 0.0), (4.0, 10.0, 0.0), None)``, or the cell of ASE as it is where it is periodic along all edges.
/// order
///     ``"canonical"``: by ``i``, then ``j``. ``"unordered"`` spares the ordering.
/// interactions
///     Which species pair, and at which distance; spheres then need species ids.
/// max_pairs
///     The most pairs a list may hold, by default 2**29 (4 GiB); more are an error with the exact number.
/// adapter
///     On which GPU: its index, or a part of its name, as ``python -m lazygrid devices`` lists them.
/// skin
///     Whether candidates, pairs that may soon overlap, are kept from call to call; an answer never depends
///     on it. ``"auto"`` keeps them where spheres move so little that it is expected to take less time;
///     ``"off"`` never. A number keeps the pairs that are up to this distance too far apart, until some sphere has
///     moved by half of it.
///
/// Raises
/// ------
/// SettingError
///     For a setting outside its range; for an algorithm that does not run on the backend.
/// Error
///     Where a GPU is asked for and cannot be used.
#[pyclass(frozen, module = "lazygrid")]
pub(crate) struct Detector {
    engines: Arc<Engines>,
}

#[pymethods]
impl Detector {
    #[new]
    #[pyo3(signature = (*, backend="auto", algorithm="auto", threads=None, periodic=None, order="canonical",
                        interactions=None, max_pairs=None, adapter=None, skin=None),
           text_signature = "(*, backend='auto', algorithm='auto', threads=None, periodic=None, order='canonical', \
                             interactions=None, max_pairs=None, adapter=None, skin='auto')")]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn new(
        py: Python<'_>,
        backend: &str,
        algorithm: &str,
        threads: Option<usize>,
        periodic: Option<&Bound<'_, PyAny>>,
        order: &str,
        interactions: Option<&Bound<'_, Interactions>>,
        max_pairs: Option<u64>,
        adapter: Option<&Bound<'_, PyAny>>,
        skin: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let config = Settings { backend, algorithm, threads, periodic, order, max_pairs, skin }.config()?;
        let config = match interactions {
            None => config,
            Some(table) => config.interactions(table.get().table()),
        };
        let config = match adapter {
            None => config,
            Some(adapter) => config.adapter(crate::settings::adapter(adapter)?),
        };
        // The backend is decided here, which may take a driver some time.
        let engines = py.detach(|| Engines::new(config, threads == Some(1))).map_err(error::engine)?;
        Ok(Self { engines })
    }

    /// Return the overlapping pairs, each once, ``i < j``, in the order that was asked for.
    ///
    /// Parameters
    /// ----------
    /// spheres
    ///     Rows of shape ``(n, 4)``, or four columns; see the class.
    /// species
    ///     Where the detector has interactions: a species id per sphere, uint32 of shape ``(n,)``.
    /// out
    ///     Where to write the pairs: uint32 in one piece, of shape ``(k, 2)``, with room for all of them.
    /// groups
    ///     A number per sphere, uint32 of shape ``(n,)``, such as that of its molecule: two spheres of one group are
    ///     never a pair, but for those of ``lazygrid.NO_GROUP``.
    /// exclusions
    ///     Pairs that are never reported, such as bonds.
    /// cast
    ///     Whether values of another type may be rounded to float32.
    ///
    /// Returns
    /// -------
    /// numpy.ndarray
    ///     uint32 of shape ``(m, 2)``: indices of spheres. With ``out`` a view of its first ``m`` rows.
    ///
    /// Raises
    /// ------
    /// InputError
    ///     For values that are not finite and negative radii, with the ``index``, ``value`` and ``count``; for other
    ///     shapes and unknown species.
    /// TypeError
    ///     For values that are not float32 where ``cast`` is not set.
    /// TooManyPairs
    ///     For more than ``max_pairs``, or than ``out`` has room for, with the exact number as ``found``.
    /// OutOfMemory, MemoryError
    ///     Where memory is refused.
    /// KeyboardInterrupt
    ///     After Ctrl-C.
    #[pyo3(signature = (spheres, species=None, out=None, *, groups=None, exclusions=None, cast=false))]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn pairs<'py>(
        &self,
        spheres: &Bound<'py, PyAny>,
        species: Option<&Bound<'py, PyAny>>,
        out: Option<&Bound<'py, PyAny>>,
        groups: Option<&Bound<'py, PyAny>>,
        exclusions: Option<&Bound<'py, Exclusions>>,
        cast: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = spheres.py();
        let given = Given::new(spheres, Said { species, groups, exclusions }, cast)?;
        let spheres = given.spheres()?;
        let mut lease = self.engines.lease()?;
        let (detector, stop) = lease.parts();
        let found = call(py, spheres.len(), stop, || detector.pairs(spheres))?.map_err(error::engine)?;
        arrays::pairs(py, found, out)
    }

    /// Return neighbour lists: for every sphere all that it overlaps, ascending; each pair stands in both lists.
    ///
    /// Returns
    /// -------
    /// offsets
    ///     uint64 of shape ``(n + 1,)``.
    /// indices
    ///     uint32 of shape ``(2 * m,)``. The neighbours of sphere ``k`` are ``indices[offsets[k]:offsets[k + 1]]``.
    ///
    /// Raises
    /// ------
    /// InputError, TypeError, TooManyPairs, OutOfMemory, MemoryError, KeyboardInterrupt
    ///     As :meth:`pairs`.
    #[pyo3(signature = (spheres, species=None, *, groups=None, exclusions=None, cast=false))]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn neighbors<'py>(
        &self,
        spheres: &Bound<'py, PyAny>,
        species: Option<&Bound<'py, PyAny>>,
        groups: Option<&Bound<'py, PyAny>>,
        exclusions: Option<&Bound<'py, Exclusions>>,
        cast: bool,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let py = spheres.py();
        let given = Given::new(spheres, Said { species, groups, exclusions }, cast)?;
        let spheres = given.spheres()?;
        let mut lease = self.engines.lease()?;
        let (detector, stop) = lease.parts();
        let lists = call(py, spheres.len(), stop, || detector.neighbors(spheres))?.map_err(error::engine)?;
        let (offsets, indices) = (arrays::copied(py, lists.offsets)?, arrays::copied(py, lists.indices)?);
        Ok((offsets.into_any(), indices.into_any()))
    }

    /// Return how many pairs there are, in memory that does not depend on their number.
    ///
    /// Raises
    /// ------
    /// InputError, TypeError, OutOfMemory, KeyboardInterrupt
    ///     As :meth:`pairs`.
    #[pyo3(signature = (spheres, species=None, *, groups=None, exclusions=None, cast=false))]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn count(
        &self,
        spheres: &Bound<'_, PyAny>,
        species: Option<&Bound<'_, PyAny>>,
        groups: Option<&Bound<'_, PyAny>>,
        exclusions: Option<&Bound<'_, Exclusions>>,
        cast: bool,
    ) -> PyResult<u64> {
        let py = spheres.py();
        let given = Given::new(spheres, Said { species, groups, exclusions }, cast)?;
        let spheres = given.spheres()?;
        let mut lease = self.engines.lease()?;
        let (detector, stop) = lease.parts();
        call(py, spheres.len(), stop, || detector.count(spheres))?.map_err(error::engine)
    }

    /// Iterate over the pairs in arrays of at most ``chunk`` pairs, however many there are.
    ///
    /// The spheres are copied first, so that they may be moved meanwhile, and the detector may be called. In canonical
    /// order the detector holds up to ``max_pairs`` pairs, and searches once more for every so many; unordered chunks
    /// come as they are found, and no more than four are in memory.
    ///
    /// >>> detector = lazygrid.Detector(order="unordered")
    /// >>> for pairs in detector.stream(spheres, 1_000_000):
    /// ...     histogram += numpy.bincount(pairs[:, 0], minlength=n)
    ///
    /// Raises
    /// ------
    /// InputError, TypeError, OutOfMemory, KeyboardInterrupt
    ///     As :meth:`pairs`; what is wrong with values is raised by the first ``next``.
    #[pyo3(signature = (spheres, chunk=65536, species=None, *, groups=None, exclusions=None, cast=false))]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn stream(
        &self,
        spheres: &Bound<'_, PyAny>,
        chunk: usize,
        species: Option<&Bound<'_, PyAny>>,
        groups: Option<&Bound<'_, PyAny>>,
        exclusions: Option<&Bound<'_, Exclusions>>,
        cast: bool,
    ) -> PyResult<Chunks> {
        check_chunk(chunk)?;
        let given = Given::new(spheres, Said { species, groups, exclusions }, cast)?;
        let lease = self.engines.lease()?;
        Chunks::start(lease, &given, None, chunk)
    }

    /// Return the pairs of one sphere of ``a`` and one of ``b``, in the order that was asked for.
    ///
    /// No two spheres of one set are ever compared: particles against receivers, say. On the CPU only with
    /// the algorithms ``"auto"``, ``"cell-list"`` and ``"naive"``.
    ///
    /// Parameters
    /// ----------
    /// a, b
    ///     The two sets, each as the spheres of :meth:`pairs`.
    /// species_a, species_b
    ///     Where the detector has interactions: a species id per sphere of each set.
    /// groups_a, groups_b
    ///     A group per sphere of each set; the groups of both are the same where their numbers are.
    /// exclusions
    ///     Pairs that are never reported, made by :meth:`Exclusions.between`.
    /// out, cast
    ///     As in :meth:`pairs`.
    ///
    /// Returns
    /// -------
    /// numpy.ndarray
    ///     uint32 of shape ``(m, 2)``: an index in ``a`` and one in ``b``. With ``out`` a view of its first ``m`` rows.
    ///
    /// Raises
    /// ------
    /// InputError, TypeError, TooManyPairs, OutOfMemory, MemoryError, KeyboardInterrupt
    ///     As :meth:`pairs`; an ``InputError`` about values of ``b`` has ``second`` set.
    /// SettingError
    ///     On the CPU for another algorithm.
    #[pyo3(signature = (a, b, species_a=None, species_b=None, out=None, *, groups_a=None, groups_b=None,
                        exclusions=None, cast=false))]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn between<'py>(
        &self,
        a: &Bound<'py, PyAny>,
        b: &Bound<'py, PyAny>,
        species_a: Option<&Bound<'py, PyAny>>,
        species_b: Option<&Bound<'py, PyAny>>,
        out: Option<&Bound<'py, PyAny>>,
        groups_a: Option<&Bound<'py, PyAny>>,
        groups_b: Option<&Bound<'py, PyAny>>,
        exclusions: Option<&Bound<'py, Exclusions>>,
        cast: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = a.py();
        let of_a = Said { species: species_a, groups: groups_a, exclusions };
        let of_b = Said { species: species_b, groups: groups_b, exclusions: None };
        let [first, second] = Given::two([a, b], [of_a, of_b], cast)?;
        let (a, b) = (first.spheres()?, second.second()?);
        let mut lease = self.engines.lease()?;
        let (detector, stop) = lease.parts();
        let count = a.len() + b.len();
        let found = call(py, count, stop, || detector.between(a, b))?.map_err(error::engine)?;
        arrays::pairs(py, found, out)
    }

    /// Return for every sphere of ``a`` those of ``b`` that it overlaps, ascending.
    ///
    /// Returns
    /// -------
    /// offsets
    ///     uint64 of shape ``(len(a) + 1,)``.
    /// indices
    ///     uint32 of shape ``(m,)``. The neighbours of sphere ``k`` are ``indices[offsets[k]:offsets[k + 1]]``.
    ///
    /// Raises
    /// ------
    /// InputError, TypeError, TooManyPairs, OutOfMemory, MemoryError, KeyboardInterrupt, SettingError
    ///     As :meth:`between`.
    #[pyo3(signature = (a, b, species_a=None, species_b=None, *, groups_a=None, groups_b=None, exclusions=None,
                        cast=false))]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn neighbors_between<'py>(
        &self,
        a: &Bound<'py, PyAny>,
        b: &Bound<'py, PyAny>,
        species_a: Option<&Bound<'py, PyAny>>,
        species_b: Option<&Bound<'py, PyAny>>,
        groups_a: Option<&Bound<'py, PyAny>>,
        groups_b: Option<&Bound<'py, PyAny>>,
        exclusions: Option<&Bound<'py, Exclusions>>,
        cast: bool,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let py = a.py();
        let of_a = Said { species: species_a, groups: groups_a, exclusions };
        let of_b = Said { species: species_b, groups: groups_b, exclusions: None };
        let [first, second] = Given::two([a, b], [of_a, of_b], cast)?;
        let (a, b) = (first.spheres()?, second.second()?);
        let mut lease = self.engines.lease()?;
        let (detector, stop) = lease.parts();
        let count = a.len() + b.len();
        let lists = call(py, count, stop, || detector.neighbors_between(a, b))?.map_err(error::engine)?;
        let (offsets, indices) = (arrays::copied(py, lists.offsets)?, arrays::copied(py, lists.indices)?);
        Ok((offsets.into_any(), indices.into_any()))
    }

    /// Return how many pairs of one sphere of ``a`` and one of ``b`` there are.
    ///
    /// Raises
    /// ------
    /// InputError, TypeError, OutOfMemory, KeyboardInterrupt, SettingError
    ///     As :meth:`between`.
    #[pyo3(signature = (a, b, species_a=None, species_b=None, *, groups_a=None, groups_b=None, exclusions=None,
                        cast=false))]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn count_between<'py>(
        &self,
        a: &Bound<'py, PyAny>,
        b: &Bound<'py, PyAny>,
        species_a: Option<&Bound<'py, PyAny>>,
        species_b: Option<&Bound<'py, PyAny>>,
        groups_a: Option<&Bound<'py, PyAny>>,
        groups_b: Option<&Bound<'py, PyAny>>,
        exclusions: Option<&Bound<'py, Exclusions>>,
        cast: bool,
    ) -> PyResult<u64> {
        let py = a.py();
        let of_a = Said { species: species_a, groups: groups_a, exclusions };
        let of_b = Said { species: species_b, groups: groups_b, exclusions: None };
        let [first, second] = Given::two([a, b], [of_a, of_b], cast)?;
        let (a, b) = (first.spheres()?, second.second()?);
        let mut lease = self.engines.lease()?;
        let (detector, stop) = lease.parts();
        let count = a.len() + b.len();
        call(py, count, stop, || detector.count_between(a, b))?.map_err(error::engine)
    }

    /// Iterate over the pairs of one sphere of ``a`` and one of ``b``, as :meth:`stream` does. Both are copied.
    ///
    /// Raises
    /// ------
    /// InputError, TypeError, OutOfMemory, KeyboardInterrupt, SettingError
    ///     As :meth:`between`; what is wrong with values or the algorithm is raised by the first ``next``.
    #[pyo3(signature = (a, b, chunk=65536, species_a=None, species_b=None, *, groups_a=None, groups_b=None,
                        exclusions=None, cast=false))]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn stream_between<'py>(
        &self,
        a: &Bound<'py, PyAny>,
        b: &Bound<'py, PyAny>,
        chunk: usize,
        species_a: Option<&Bound<'py, PyAny>>,
        species_b: Option<&Bound<'py, PyAny>>,
        groups_a: Option<&Bound<'py, PyAny>>,
        groups_b: Option<&Bound<'py, PyAny>>,
        exclusions: Option<&Bound<'py, Exclusions>>,
        cast: bool,
    ) -> PyResult<Chunks> {
        check_chunk(chunk)?;
        let of_a = Said { species: species_a, groups: groups_a, exclusions };
        let of_b = Said { species: species_b, groups: groups_b, exclusions: None };
        let [first, second] = Given::two([a, b], [of_a, of_b], cast)?;
        let lease = self.engines.lease()?;
        Chunks::start(lease, &first, Some(&second), chunk)
    }

    /// Return an estimate of the bytes that the detector holds for so many spheres, besides the result.
    fn memory_for(&self, spheres: u64) -> PyResult<u64> {
        let mut lease = self.engines.lease()?;
        Ok(lease.parts().0.memory_for(spheres))
    }

    /// What the call that ended last did and why; before the first, what is known by then. Times in seconds.
    #[getter]
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        report::dict(py, &self.engines.report())
    }

    fn __repr__(&self) -> String {
        let report = self.engines.report();
        format!("<lazygrid.Detector: {} on {}>", report.algorithm, report.adapter.as_deref().unwrap_or("cpu"))
    }
}

/// Refuses chunks without pairs.
fn check_chunk(chunk: usize) -> PyResult<()> {
    match chunk {
        0 => Err(error::setting("chunk = 0 is out of range; choose at least one pair per chunk")),
        _ => Ok(()),
    }
}
