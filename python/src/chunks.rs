//! The class `Chunks`: the pairs of a stream, a chunk at a time.
//!
//! A thread searches and sends chunks through a channel that holds two; when it is full the search waits. The thread
//! works on a copy of the spheres, since whoever takes the chunks may move the spheres meanwhile.

use std::ops::ControlFlow;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

use lazygrid::{Error, Exclusions, Pair, Sphere, Spheres};
use pyo3::prelude::*;

use crate::arrays::Given;
use crate::call::GLANCE;
use crate::engines::{Lease, Stopper};
use crate::{arrays, error};

/// Chunks that wait to be taken.
const AHEAD: usize = 2;

type Sent = Result<Vec<Pair>, Error>;

/// An iterator over chunks of pairs, uint32 of shape ``(k, 2)``, from :meth:`Detector.stream` and its like.
///
/// A thread searches ahead by some chunks. ``close``, the end of a ``with`` block, and dropping the iterator end it.
#[pyclass(frozen, module = "lazygrid")]
pub(crate) struct Chunks {
    /// `None` once there will be no more.
    chunks: Mutex<Option<Receiver<Sent>>>,
    stopper: Stopper,
}

impl Chunks {
    /// Begins the search, of one set or between two.
    pub(crate) fn start(
        lease: Lease,
        given: &Given<'_>,
        second: Option<&Given<'_>>,
        chunk: usize,
    ) -> PyResult<Self> {
        let copied = Copied::new(given.spheres()?, given.exclusions()).map_err(error::engine)?;
        let copy = |given: &Given<'_>| Copied::new(given.second()?, None).map_err(error::engine);
        let second = second.map(copy).transpose()?;
        lease.keep_report();
        let stopper = lease.stopper();
        let (to, chunks) = sync_channel(AHEAD);
        let thread = thread::Builder::new().name("lazygrid stream".into());
        let spawned = thread.spawn(move || search(lease, &copied, second.as_ref(), chunk, &to));
        spawned
            .map_err(|refused| error::engine(Error::Threads { threads: 1, reason: refused.to_string() }))?;
        Ok(Self { chunks: Mutex::new(Some(chunks)), stopper })
    }

    /// The next chunk; `None` where none has come yet.
    fn take(&self) -> Option<Option<Sent>> {
        let mut chunks = self.chunks.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(receiver) = &*chunks else { return Some(None) };
        match receiver.recv_timeout(GLANCE) {
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => {
                *chunks = None;
                Some(None)
            }
            Ok(sent) => Some(Some(sent)),
        }
    }

    fn end(&self) {
        // First the channel: who waits for room in it sees that nobody wants more.
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

    /// End the search. There are no more chunks.
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

/// Spheres of one's own.
struct Copied {
    rows: Vec<Sphere>,
    species: Option<Vec<u32>>,
    groups: Option<Vec<u32>>,
    exclusions: Option<Arc<Exclusions>>,
}

impl Copied {
    fn new(spheres: Spheres<'_>, exclusions: Option<Arc<Exclusions>>) -> Result<Self, Error> {
        let mut rows = room(spheres.len(), "copied spheres")?;
        match spheres.as_rows() {
            Some(given) => rows.extend_from_slice(given),
            None => rows.extend(spheres.iter()),
        }
        let copy = |ids: &[u32]| {
            let mut copied = room(ids.len(), "copied species and groups")?;
            copied.extend_from_slice(ids);
            Ok::<_, Error>(copied)
        };
        let species = spheres.species().map(copy).transpose()?;
        let groups = spheres.groups().map(copy).transpose()?;
        Ok(Self { rows, species, groups, exclusions })
    }

    fn spheres(&self) -> Result<Spheres<'_>, Error> {
        let spheres = Spheres::from(&self.rows);
        let spheres = self.species.as_ref().map_or(Ok(spheres), |ids| spheres.with_species(ids))?;
        let spheres = self.groups.as_ref().map_or(Ok(spheres), |ids| spheres.with_groups(ids))?;
        Ok(self.exclusions.as_ref().map_or(Ok(spheres), |pairs| spheres.with_exclusions(pairs))?)
    }
}

/// Room for so many values.
fn room<T>(count: usize, what: &'static str) -> Result<Vec<T>, Error> {
    let mut values = Vec::new();
    let bytes = (count * size_of::<T>()) as u64;
    values.try_reserve_exact(count).map_err(|_| Error::OutOfMemory { what, bytes })?;
    Ok(values)
}

/// Sends the pairs, and last of all why there are no more if that is an error.
fn search(mut lease: Lease, copied: &Copied, second: Option<&Copied>, chunk: usize, to: &SyncSender<Sent>) {
    let mut refused = None;
    let send = |pairs: &[Pair]| {
        let own = room(pairs.len(), "a chunk of pairs").map(|mut own| {
            own.extend_from_slice(pairs);
            own
        });
        let sent = own.map(|own| to.send(Ok(own)).is_ok());
        match sent {
            Ok(true) => ControlFlow::Continue(()),
            // Nobody wants more.
            Ok(false) => ControlFlow::Break(()),
            Err(error) => {
                refused = Some(error);
                ControlFlow::Break(())
            }
        }
    };
    let detector = lease.parts().0;
    let streamed = match second {
        None => copied.spheres().and_then(|spheres| detector.stream(spheres, chunk, send)),
        Some(second) => {
            copied.spheres().and_then(|a| detector.stream_between(a, second.spheres()?, chunk, send))
        }
    };
    // Whoever sees the end can use the engine again, and read its report.
    drop(lease);
    if let Some(error) = refused.or(streamed.err()) {
        // Where nobody listens nobody wants to know.
        let _ = to.send(Err(error));
    }
}
