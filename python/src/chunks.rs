//! A thread searches and sends chunks through a channel that holds two. It copies the spheres, because the caller may
//! move them between chunks.

use std::ops::ControlFlow;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

use lazygrid::{Error, Exclusions, Pair, Query, Sphere, Spheres, start_thread};
use pyo3::prelude::*;

use crate::fork::Process;
use crate::interruptible::SIGNAL_POLL;
use crate::memory::try_collect;
use crate::pool::{DetectorLease, StreamStopper};
use crate::spheres::BorrowedQuery;
use crate::{arrays, error};

const AHEAD: usize = 2;

type ChunkResult = Result<Vec<Pair>, Error>;

/// An iterator over chunks of pairs, uint32 of shape ``(k, 2)``, from :meth:`Detector.stream`.
///
/// A thread searches some chunks ahead. ``close``, the end of a ``with`` block, and dropping the iterator end it.
#[pyclass(frozen, module = "lazygrid")]
pub(crate) struct Chunks {
    chunks: Mutex<Option<Receiver<ChunkResult>>>,
    stopper: StreamStopper,
    process: Process,
}

impl Chunks {
    pub(crate) fn start(
        py: Python<'_>,
        mut lease: DetectorLease,
        borrowed: &BorrowedQuery<'_>,
        chunk: usize,
    ) -> PyResult<Self> {
        let query = borrowed.query()?;
        let exclusions = borrowed.exclusions();
        let owned = py.detach(|| OwnedQuery::new(&query, exclusions)).map_err(error::engine)?;
        let stopper = lease.stopper();
        let (to, chunks) = sync_channel(AHEAD);
        let thread = thread::Builder::new().name("lazygrid stream".into());
        start_thread(|| thread.spawn(move || search(lease, &owned, chunk, &to))).map_err(error::engine)?;
        Ok(Self { chunks: Mutex::new(Some(chunks)), stopper, process: Process::current() })
    }

    /// The next chunk; the outer `None` if none has arrived yet.
    fn take(&self) -> Option<Option<ChunkResult>> {
        let mut chunks = self.chunks.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(receiver) = &*chunks else { return Some(None) };
        match receiver.recv_timeout(SIGNAL_POLL) {
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => {
                *chunks = None;
                Some(None)
            }
            Ok(sent) => Some(Some(sent)),
        }
    }

    fn end(&self) {
        // A forked process does not have the thread, and the lock may have been held during the fork.
        if !self.process.is_current() {
            return;
        }
        // The channel first: a search that waits to send then ends.
        drop(self.chunks.lock().unwrap_or_else(PoisonError::into_inner).take());
        self.stopper.stop();
    }
}

#[pymethods]
impl Chunks {
    fn __iter__(this: Py<Self>) -> Py<Self> {
        this
    }

    fn __next__<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.process.check()?;
        loop {
            match py.detach(|| self.take()) {
                None => py.check_signals()?,
                Some(None) => return Ok(None),
                Some(Some(Ok(pairs))) => {
                    let array = arrays::rows::<Pair, u32>(py, pairs, 2)?;
                    return Ok(Some(array.into_any()));
                }
                Some(Some(Err(failed))) => return Err(error::engine(failed)),
            }
        }
    }

    /// End the search and the iteration.
    fn close(&self, py: Python<'_>) {
        py.detach(|| self.end());
    }

    fn __enter__(this: Py<Self>) -> Py<Self> {
        this
    }

    #[pyo3(signature = (*_raised))]
    fn __exit__(&self, py: Python<'_>, _raised: &Bound<'_, pyo3::types::PyTuple>) {
        self.close(py);
    }
}

impl Drop for Chunks {
    fn drop(&mut self) {
        self.end();
    }
}

struct OwnedQuery {
    first: OwnedSpheres,
    second: Option<OwnedSpheres>,
    exclusions: Option<Arc<Exclusions>>,
}

impl OwnedQuery {
    fn new(query: &Query<'_>, exclusions: Option<Arc<Exclusions>>) -> Result<Self, Error> {
        let first = OwnedSpheres::new(query.first())?;
        Ok(Self { first, second: query.second().map(OwnedSpheres::new).transpose()?, exclusions })
    }

    fn query(&self) -> Result<Query<'_>, Error> {
        let first = self.first.spheres()?;
        let query = match &self.second {
            None => Query::new(first),
            Some(second) => Query::new((first, second.spheres()?)),
        };
        Ok(self.exclusions.as_deref().map_or(query, |pairs| query.without(pairs)))
    }
}

struct OwnedSpheres {
    rows: Rows,
    species: Option<Vec<u32>>,
    groups: Option<Vec<u32>>,
}

enum Rows {
    F32(Vec<Sphere>),
    F64(Vec<[f64; 4]>),
}

impl OwnedSpheres {
    fn new(spheres: Spheres<'_>) -> Result<Self, Error> {
        const WHAT: &str = "copied spheres";
        let rows = match spheres.is_f64() {
            true => Rows::F64(try_collect((0..spheres.len()).map(|i| spheres.get_f64(i)), WHAT)?),
            false => Rows::F32(try_collect(spheres.iter(), WHAT)?),
        };
        let copy = |ids: &[u32]| try_collect(ids.iter().copied(), "copied species and groups");
        let species = spheres.species().map(copy).transpose()?;
        Ok(Self { rows, species, groups: spheres.groups().map(copy).transpose()? })
    }

    fn spheres(&self) -> Result<Spheres<'_>, Error> {
        let spheres = match &self.rows {
            Rows::F32(rows) => Spheres::from(rows),
            Rows::F64(rows) => Spheres::from(rows),
        };
        let spheres = self.species.as_ref().map_or(Ok(spheres), |ids| spheres.with_species(ids))?;
        Ok(self.groups.as_ref().map_or(Ok(spheres), |ids| spheres.with_groups(ids))?)
    }
}

fn search(mut lease: DetectorLease, owned: &OwnedQuery, chunk: usize, to: &SyncSender<ChunkResult>) {
    let mut refused = None;
    let send = |pairs: &[Pair]| {
        let sent =
            try_collect(pairs.iter().copied(), "a chunk of pairs").map(|chunk| to.send(Ok(chunk)).is_ok());
        match sent {
            Ok(true) => ControlFlow::Continue(()),
            Ok(false) => ControlFlow::Break(()),
            Err(error) => {
                refused = Some(error);
                ControlFlow::Break(())
            }
        }
    };
    let detector = lease.detector_and_cancel().0;
    let streamed = owned.query().and_then(|query| detector.stream(query, chunk, send));
    // Lets a caller that sees the end use the detector again and read its report.
    drop(lease);
    if let Some(error) = refused.or(streamed.err()) {
        let _ = to.send(Err(error));
    }
}
