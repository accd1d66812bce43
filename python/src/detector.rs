use std::sync::Arc;

use lazygrid::ListOptions;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays;
use crate::chunks::Chunks;
use crate::exclusions::Exclusions;
use crate::interactions::Interactions;
use crate::interruptible::{Work, interruptible};
use crate::pool::DetectorPool;
use crate::settings::{self, Settings};
use crate::spheres::{Arguments, BorrowedQuery};
use crate::{error, neighbors, report};

/// Default maximum of pairs per array of a stream.
const STREAM_CHUNK: usize = 65_536;

/// Finds all pairs of overlapping spheres and reuses its buffers between calls.
///
/// Two spheres are a pair if their centers are at most ``ri + rj`` apart. A set of spheres is
///
/// - an array of shape ``(n, 4)`` with rows ``x, y, z, r``; or
/// - a tuple of four arrays of shape ``(n,)``: ``(x, y, z, r)``; or
/// - a tuple ``(positions, radii)`` of an array of shape ``(n, 3)``, and an array of shape ``(n,)`` or one number. The
///   radius ``d / 2`` finds all points within a distance ``d``.
///
/// Arrays are float32 (faster) or float64 in native byte order, in one length unit; other types are a ``TypeError``. No
/// number is rounded. Arrays are read in place if their strides are multiples of the item size, as in columns of a
/// larger array; others are copied. With both types in one set, float32 values are copied to float64.
///
/// A call of 64 spheres or more releases the interpreter's lock, and any threads may use one detector at once. Its
/// arrays must not change before it returns. Ctrl-C ends a long call on the CPU.
///
/// Parameters
/// ----------
/// backend
///     ``"auto"`` uses a GPU if one exists and a call has enough spheres; ``"cpu"`` and ``"gpu"`` never fall back.
/// algorithm
///     The algorithm; all find the same pairs.
/// threads
///     The number of CPU threads; by default all.
/// periodic
///     The length of each periodic axis, as float64; ``None`` for an unbounded axis: ``(10.0, 10.0, None)``.
///     Coordinates need not lie in the box. For a triclinic box, its cell vectors: ``((10.0, 0.0, 0.0), (4.0, 10.0,
///     0.0), None)``, or the cell of ASE if it is periodic along all vectors.
/// order
///     ``"canonical"``: by ``i``, then ``j``. ``"unordered"`` omits the sort.
/// interactions
///     The species that pair, and their distances; spheres then need species ids.
/// max_pairs
///     The maximum number of pairs in a list, by default 2**29 (4 GiB).
/// adapter
///     The GPU: its index, or a part of its name, as listed by ``python -m lazygrid devices``.
/// skin
///     The skin of the candidate list kept between calls; no answer depends on it. ``"auto"`` keeps a list if spheres
///     move so little that it should save time; ``"off"`` never does. A number keeps the pairs with gaps up to this
///     distance, until a sphere has moved by half of it; only with the algorithms ``"auto"`` and ``"cell-list"``.
/// timeout
///     The time limit of each submission to the GPU in seconds; by default ten minutes. A call that is divided or
///     repeated has several submissions. Searches on the CPU have no limit: ``backend="cpu"`` refuses one, and with
///     ``backend="auto"`` it is unused if no GPU is found.
///
/// Raises
/// ------
/// SettingError
///     For a setting out of range, and for an algorithm that the backend lacks.
/// InputError
///     For lengths or cell vectors that no periodic box has.
/// Error
///     If ``backend="gpu"`` and no GPU can be used.
#[pyclass(frozen, module = "lazygrid")]
pub(crate) struct Detector {
    pool: Arc<DetectorPool>,
    is_periodic: bool,
}

#[pymethods]
impl Detector {
    #[new]
    #[pyo3(signature = (*, backend="auto", algorithm="auto", threads=None, periodic=None, order="canonical",
                        interactions=None, max_pairs=None, adapter=None, skin=None, timeout=None),
           text_signature = "(*, backend='auto', algorithm='auto', threads=None, periodic=None, order='canonical', \
                             interactions=None, max_pairs=None, adapter=None, skin='auto', timeout=None)")]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn new(
        py: Python<'_>,
        backend: &str,
        algorithm: &str,
        threads: Option<&Bound<'_, PyAny>>,
        periodic: Option<&Bound<'_, PyAny>>,
        order: &str,
        interactions: Option<&Bound<'_, Interactions>>,
        max_pairs: Option<&Bound<'_, PyAny>>,
        adapter: Option<&Bound<'_, PyAny>>,
        skin: Option<&Bound<'_, PyAny>>,
        timeout: Option<f64>,
    ) -> PyResult<Self> {
        let range = "choose at least one, or leave it unset";
        let threads = threads.map(|threads| settings::whole(threads, "threads", range)).transpose()?;
        let config =
            Settings { backend, algorithm, threads, periodic, order, max_pairs, skin, timeout }.config()?;
        let config = match interactions {
            None => config,
            Some(table) => config.interactions(table.get().table()),
        };
        let config = match adapter {
            None => config,
            Some(adapter) => config.adapter(settings::adapter(adapter)?),
        };
        // A driver may need some time.
        let pool = py.detach(|| DetectorPool::new(config, threads))?;
        Ok(Self { pool, is_periodic: periodic.is_some() })
    }

    /// Return the overlapping pairs, each once, in the detector's order.
    ///
    /// For one set, ``i < j``. For two sets only pairs across them count, ``i`` in the first and ``j`` in the second.
    ///
    /// >>> detector.pairs(spheres)
    /// >>> detector.pairs(carriers, receivers, species=(of_carriers, None))
    ///
    /// Parameters
    /// ----------
    /// spheres
    ///     The spheres, or the first of two sets; see the class.
    /// second
    ///     The second of two sets.
    /// species
    ///     With interactions: a species id per sphere, whole numbers of shape ``(n,)``; for two sets a tuple of two
    ///     arrays.
    /// groups
    ///     A group per sphere, such as its molecule, whole numbers of shape ``(n,)``: spheres of one group never pair,
    ///     unless it is ``lazygrid.NO_GROUP``. For two sets a tuple of two arrays or ``None``; equal numbers are one
    ///     group.
    /// exclusions
    ///     Pairs that are never reported, such as bonds; for two sets from :meth:`Exclusions.across`.
    /// out
    ///     The output: a contiguous uint32 array of shape ``(k, 2)`` with ``k`` at least the number of pairs.
    ///
    /// Returns
    /// -------
    /// numpy.ndarray
    ///     uint32 of shape ``(m, 2)``: indices of spheres. With ``out`` a view of its first ``m`` rows.
    ///
    /// Raises
    /// ------
    /// InputError
    ///     For values that are not finite and negative radii, with ``index``, ``value``, ``count`` and ``second``; for
    ///     wrong shapes and unknown species.
    /// TypeError
    ///     For arrays that are neither float32 nor float64, and labels that are not whole numbers.
    /// TooManyPairs
    ///     For more than ``max_pairs`` pairs, or more than ``out`` holds, with the exact number as ``found``.
    /// OutOfMemory, MemoryError
    ///     If memory is refused.
    /// KeyboardInterrupt
    ///     After Ctrl-C.
    #[pyo3(signature = (spheres, second=None, *, species=None, groups=None, exclusions=None, out=None))]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn pairs<'py>(
        &self,
        spheres: &Bound<'py, PyAny>,
        second: Option<&Bound<'py, PyAny>>,
        species: Option<&Bound<'py, PyAny>>,
        groups: Option<&Bound<'py, PyAny>>,
        exclusions: Option<&Bound<'py, Exclusions>>,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = spheres.py();
        let borrowed = BorrowedQuery::new(Arguments { spheres, second, species, groups, exclusions })?;
        let query = borrowed.query()?;
        let mut lease = self.pool.lease()?;
        let can_hold_lock = lease.is_on_cpu();
        let (detector, cancel) = lease.detector_and_cancel();
        let found = interruptible(py, Work { spheres: query.len(), can_hold_lock }, cancel, || {
            detector.pairs(query)
        })?
        .map_err(error::engine)?;
        arrays::pairs(py, found, out)
    }

    /// Return neighbor lists: the neighbors of every sphere, ascending; each pair is in both lists.
    ///
    /// For two sets, spheres of the first list indices in the second.
    ///
    /// Parameters
    /// ----------
    /// spheres, second, species, groups, exclusions
    ///     See :meth:`pairs`.
    ///
    /// Returns
    /// -------
    /// offsets
    ///     uint64 of shape ``(n + 1,)``.
    /// indices
    ///     uint32. The neighbors of sphere ``k`` are ``indices[offsets[k]:offsets[k + 1]]``.
    ///
    /// Raises
    /// ------
    /// InputError, TypeError, TooManyPairs, OutOfMemory, MemoryError, KeyboardInterrupt
    ///     See :meth:`pairs`.
    #[pyo3(signature = (spheres, second=None, *, species=None, groups=None, exclusions=None))]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn neighbors<'py>(
        &self,
        spheres: &Bound<'py, PyAny>,
        second: Option<&Bound<'py, PyAny>>,
        species: Option<&Bound<'py, PyAny>>,
        groups: Option<&Bound<'py, PyAny>>,
        exclusions: Option<&Bound<'py, Exclusions>>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let py = spheres.py();
        let borrowed = BorrowedQuery::new(Arguments { spheres, second, species, groups, exclusions })?;
        let query = borrowed.query()?;
        let mut lease = self.pool.lease()?;
        let can_hold_lock = lease.is_on_cpu();
        let (detector, cancel) = lease.detector_and_cancel();
        let lists = interruptible(py, Work { spheres: query.len(), can_hold_lock }, cancel, || {
            detector.neighbors(query)
        })?
        .map_err(error::engine)?;
        let (offsets, indices) = (lists.offsets(), lists.indices());
        let offsets = arrays::copied(py, [offsets.len()], offsets)?;
        let indices = arrays::copied(py, [indices.len()], indices)?;
        Ok((offsets.into_any(), indices.into_any()))
    }

    /// Return neighbors by quantity, with all periodic images within the cutoff, in a small box also a sphere's own.
    ///
    /// Exclusions apply to all images. The order is by ``i``, then ``j``, then ``S``. Geometry is computed in float64,
    /// also for a GPU's pairs. :func:`lazygrid.neighbor_list` has the same quantities for atoms of ASE.
    ///
    /// >>> i, j, d = detector.neighbor_list("ijd", spheres)
    ///
    /// Parameters
    /// ----------
    /// quantities
    ///     The returned arrays, in this order: ``i`` and ``j``, indices of the spheres, int64 of shape ``(m,)``; ``d``,
    ///     distances, float64 of shape ``(m,)``; ``D``, vectors from ``i`` to ``j``, float64 of shape ``(m, 3)``; ``S``,
    ///     the numbers of cell vectors between them, int64 of shape ``(m, 3)``.
    /// spheres, second, species, groups, exclusions
    ///     See :meth:`pairs`.
    /// half
    ///     If true, lists every pair once, ``i < j``, and of two opposite images of a sphere the one whose first nonzero
    ///     shift is positive; else also ``(j, i)``. Without effect on two sets.
    /// open
    ///     If true, only distances below the cutoff count, as in ASE; else touching counts.
    /// with_self
    ///     If true, every sphere is its own neighbor at distance zero. Without effect on two sets.
    ///
    /// Returns
    /// -------
    /// numpy.ndarray or tuple of numpy.ndarray
    ///     One array if ``quantities`` is one letter.
    ///
    /// Raises
    /// ------
    /// InputError
    ///     See :meth:`pairs`; also for unknown quantities, and for cutoffs or coordinates too large for the box.
    /// TypeError, TooManyPairs, OutOfMemory, MemoryError, KeyboardInterrupt
    ///     See :meth:`pairs`; ``max_pairs`` also limits the examined pairs of a sphere and an image.
    #[pyo3(signature = (quantities, spheres, second=None, *, half=false, open=false, with_self=false, species=None,
                        groups=None, exclusions=None))]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn neighbor_list<'py>(
        &self,
        quantities: &str,
        spheres: &Bound<'py, PyAny>,
        second: Option<&Bound<'py, PyAny>>,
        half: bool,
        open: bool,
        with_self: bool,
        species: Option<&Bound<'py, PyAny>>,
        groups: Option<&Bound<'py, PyAny>>,
        exclusions: Option<&Bound<'py, Exclusions>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = spheres.py();
        let options = if half { ListOptions::half() } else { ListOptions::full() };
        let options = if open { options.open() } else { options };
        let options = neighbors::options(quantities, if with_self { options.with_self() } else { options })?;
        let borrowed = BorrowedQuery::new(Arguments { spheres, second, species, groups, exclusions })?;
        let query = borrowed.query()?;
        let mut lease = self.pool.lease()?;
        // The number of spheres does not bound the number of images.
        let spheres = if self.is_periodic { usize::MAX } else { query.len() };
        let work = Work { spheres, can_hold_lock: lease.is_on_cpu() };
        let is_single_threaded = lease.is_single_threaded();
        let (detector, cancel) = lease.detector_and_cancel();
        let found = interruptible(py, work, cancel, || detector.neighbor_list(query, options))?;
        neighbors::arrays(py, quantities, &found.map_err(error::engine)?, is_single_threaded)
    }

    /// Return the number of pairs, in memory independent of that number.
    ///
    /// Parameters
    /// ----------
    /// spheres, second, species, groups, exclusions
    ///     See :meth:`pairs`.
    ///
    /// Raises
    /// ------
    /// InputError, TypeError, OutOfMemory, KeyboardInterrupt
    ///     See :meth:`pairs`.
    #[pyo3(signature = (spheres, second=None, *, species=None, groups=None, exclusions=None))]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn count<'py>(
        &self,
        spheres: &Bound<'py, PyAny>,
        second: Option<&Bound<'py, PyAny>>,
        species: Option<&Bound<'py, PyAny>>,
        groups: Option<&Bound<'py, PyAny>>,
        exclusions: Option<&Bound<'py, Exclusions>>,
    ) -> PyResult<u64> {
        let py = spheres.py();
        let borrowed = BorrowedQuery::new(Arguments { spheres, second, species, groups, exclusions })?;
        let query = borrowed.query()?;
        let mut lease = self.pool.lease()?;
        let can_hold_lock = lease.is_on_cpu();
        let (detector, cancel) = lease.detector_and_cancel();
        interruptible(py, Work { spheres: query.len(), can_hold_lock }, cancel, || detector.count(query))?
            .map_err(error::engine)
    }

    /// Iterate over the pairs in arrays of at most ``chunk`` pairs.
    ///
    /// The spheres are copied, and a stream has threads of its own, so you may move the spheres and call the detector
    /// meanwhile. In canonical order the detector holds up to ``max_pairs`` pairs, and searches again for every further
    /// ``max_pairs``; if that would be more than 16 searches, it holds more, up to a quarter of the number of spheres.
    /// Unordered chunks arrive as they are found, at most four in memory.
    ///
    /// >>> detector = lazygrid.Detector(order="unordered")
    /// >>> for pairs in detector.stream(spheres, chunk=1_000_000):
    /// ...     histogram += numpy.bincount(pairs[:, 0], minlength=n)
    ///
    /// Parameters
    /// ----------
    /// chunk
    ///     The maximum number of pairs per array.
    /// spheres, second, species, groups, exclusions
    ///     See :meth:`pairs`.
    ///
    /// Raises
    /// ------
    /// InputError, TypeError, OutOfMemory, KeyboardInterrupt
    ///     See :meth:`pairs`; errors about values at the first ``next``.
    #[pyo3(signature = (spheres, second=None, *, chunk=None, species=None, groups=None, exclusions=None),
           text_signature = "($self, spheres, second=None, *, chunk=65536, species=None, groups=None, exclusions=None)")]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn stream<'py>(
        &self,
        spheres: &Bound<'py, PyAny>,
        second: Option<&Bound<'py, PyAny>>,
        chunk: Option<&Bound<'py, PyAny>>,
        species: Option<&Bound<'py, PyAny>>,
        groups: Option<&Bound<'py, PyAny>>,
        exclusions: Option<&Bound<'py, Exclusions>>,
    ) -> PyResult<Chunks> {
        let range = "choose at least one pair per chunk";
        let chunk: usize = chunk.map_or(Ok(STREAM_CHUNK), |chunk| settings::whole(chunk, "chunk", range))?;
        if chunk == 0 {
            return Err(error::setting(format!("chunk = 0 is out of range; {range}")));
        }
        let borrowed = BorrowedQuery::new(Arguments { spheres, second, species, groups, exclusions })?;
        let lease = self.pool.lease_for_stream()?;
        Chunks::start(spheres.py(), lease, &borrowed, chunk)
    }

    /// Estimate the bytes that the detector holds for this number of spheres, without the result.
    fn memory_for(&self, spheres: &Bound<'_, PyAny>) -> PyResult<u64> {
        let spheres = settings::whole(spheres, "spheres", "choose a number from 0 to 2^32 - 2")?;
        Ok(self.pool.lease()?.memory_for(spheres))
    }

    /// The report of the last finished call; before the first call, of the detector. Times are in seconds.
    #[getter]
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        report::dict(py, &self.pool.report())
    }

    fn __repr__(&self) -> String {
        let report = self.pool.report();
        format!("<lazygrid.Detector: {} on {}>", report.algorithm, report.adapter.as_deref().unwrap_or("cpu"))
    }
}
