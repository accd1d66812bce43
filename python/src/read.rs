use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use lazygrid::Sphere;
use lazygrid_io::Error;
use lazygrid_io::arguments::unused_radius;
use lazygrid_io::read::{self, Format, Options, Precision};
use numpy::{PyArray1, PyArrayDescr, PyArrayDescrMethods};
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;

use crate::interruptible::poll_signals;
use crate::settings::space;
use crate::{arrays, error, fork, input};

/// Below these sizes of a regular file and of its previous frame, a read takes milliseconds and needs no thread of its
/// own.
const MIN_POLLED_BYTES: u64 = 1 << 16;
const MIN_POLLED_SPHERES: usize = 1 << 12;

/// An iterator over the frames of a file, with one in memory. :func:`lazygrid.read` reads one frame.
///
/// Numbers are rounded to float32, and the first that loses digits is a ``UserWarning``, unless ``dtype`` is float64. A
/// species of ``radii`` that no sphere has is a ``UserWarning`` at the end. If a filter turns a warning into an
/// exception, the next ``next`` returns the frame. Ctrl-C ends the iteration.
///
/// Raises
/// ------
/// FileError
///     For a file that does not follow its format, with line or row and text.
/// SettingError
///     For an unknown format, another ``dtype`` than float32 and float64, and for radii that are negative or not finite.
/// OSError
///     If the system refuses the file.
#[pyclass(frozen, module = "lazygrid")]
pub(crate) struct Frames {
    path: PathBuf,
    format: Format,
    is_regular: bool,
    /// `true` if the next read may take long.
    is_polled: AtomicBool,
    /// Ends a read.
    cancel: Arc<AtomicBool>,
    state: Mutex<State>,
}

/// A frame and the names of its species.
type NamedFrame = (read::Frame, Vec<String>);

struct State {
    frames: read::Frames,
    /// A frame that was read by a call whose warning was raised as an exception. The next call returns it.
    pending: Option<NamedFrame>,
    has_warned_of_rounding: bool,
    has_warned_of_radii: bool,
}

/// The spheres of one moment of a file, in the file's length unit.
#[pyclass(frozen, get_all, module = "lazygrid")]
pub(crate) struct Frame {
    /// Rows ``x, y, z, r``, of shape ``(n, 4)``, of the requested ``dtype``.
    spheres: Py<PyAny>,
    /// A species id per sphere, of shape ``(n,)``, if the file has species.
    species: Option<Py<PyArray1<u32>>>,
    /// An id per sphere, of shape ``(n,)``, if ids were requested.
    ids: Option<Py<PyArray1<i64>>>,
    /// A group per sphere, of shape ``(n,)``, for :meth:`Detector.pairs`, if groups were requested.
    groups: Option<Py<PyArray1<u32>>>,
    /// The names of the species, by id.
    names: Vec<String>,
    /// The simulator's time step, if the file has one.
    step: Option<i64>,
    /// The length of each periodic axis, or the cell vectors of a triclinic box, for :class:`Detector`; ``None`` in
    /// unbounded space.
    periodic: Option<(Option<CellVector>, Option<CellVector>, Option<CellVector>)>,
}

#[derive(Clone, Copy, IntoPyObject, IntoPyObjectRef)]
enum CellVector {
    Length(f64),
    Vector((f64, f64, f64)),
}

#[pymethods]
impl Frames {
    #[new]
    #[pyo3(signature = (path, *, format=None, radii=None, periodic=None, ids=false, groups=false, dtype=None),
           text_signature = "(path, *, format=None, radii=None, periodic=None, ids=False, groups=False, \
                             dtype='float32')")]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn new(
        py: Python<'_>,
        path: PathBuf,
        format: Option<&str>,
        radii: Option<BTreeMap<String, f64>>,
        periodic: Option<&Bound<'_, PyAny>>,
        ids: bool,
        groups: bool,
        dtype: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        fork::use_threads()?;
        let format = format.map(str::parse).transpose().map_err(error::unknown)?;
        let space = match periodic {
            None => None,
            Some(word) if word.extract::<&str>().is_ok_and(|word| word == "none") => Some(space(None)?),
            lengths => Some(space(lengths)?),
        };
        let precision = if dtype.map_or(Ok(false), is_float64)? { Precision::F64 } else { Precision::F32 };
        let options = Options { format, radii: radii.unwrap_or_default(), space, ids, groups, precision };
        let length = length(&path).map_err(error::file)?;
        let cancel = Arc::new(AtomicBool::new(false));
        let open = || {
            let input = input::open(path.clone(), length.is_some(), cancel.clone());
            let input = input.map_err(|source| Error::Read { path: path.clone(), source })?;
            read::Frames::new(&path, input, length, options)
        };
        let is_polled = length.is_none_or(|length| length >= MIN_POLLED_BYTES);
        let frames = interruptible(py, is_polled, &cancel, open)?.map_err(error::file)?;
        let format = frames.format();
        let state =
            State { frames, pending: None, has_warned_of_rounding: false, has_warned_of_radii: false };
        let is_polled = AtomicBool::new(is_polled);
        Ok(Self { path, format, is_regular: length.is_some(), is_polled, cancel, state: Mutex::new(state) })
    }

    fn __iter__(this: Py<Self>) -> Py<Self> {
        this
    }

    fn __next__(&self, py: Python<'_>) -> PyResult<Option<Frame>> {
        fork::use_threads()?;
        let (read, warnings) = self.interruptible(py, || self.lock().read(&self.path))?;
        let read = read.map_err(error::file)?;
        if let Err(raised) = warnings.into_iter().try_for_each(|warning| warn(py, warning)) {
            py.detach(|| self.lock().pending = read);
            return Err(raised);
        }
        let Some((frame, names)) = read else { return Ok(None) };
        self.is_polled.store(!self.is_regular || frame.len() >= MIN_POLLED_SPHERES, Ordering::Relaxed);
        Frame::new(py, frame, names).map(Some)
    }

    /// Return ``True`` after the last frame.
    fn at_end(&self, py: Python<'_>) -> PyResult<bool> {
        fork::use_threads()?;
        let at_end = || {
            let mut state = self.lock();
            if state.pending.is_some() { Ok(false) } else { state.frames.at_end() }
        };
        self.interruptible(py, at_end)?.map_err(error::file)
    }

    /// Return the species of ``radii`` that no frame so far has, probably misspelled.
    fn unused_radii(&self, py: Python<'_>) -> Vec<String> {
        py.detach(|| self.lock().frames.species().unused_radii().map(str::to_owned).collect())
    }

    /// Return the warnings of these species.
    #[pyo3(name = "_unused_radius_warnings")]
    fn radius_warnings(&self, py: Python<'_>) -> Vec<String> {
        py.detach(|| unused_radius_warnings(&self.lock().frames, &self.path))
    }

    /// The format of the file.
    #[getter]
    fn format(&self) -> String {
        self.format.to_string()
    }

    /// The file, a ``pathlib.Path``.
    #[getter]
    fn path(&self) -> PathBuf {
        self.path.clone()
    }
}

impl Frames {
    fn interruptible<R: Send>(&self, py: Python<'_>, read: impl FnOnce() -> R + Send) -> PyResult<R> {
        interruptible(py, self.is_polled.load(Ordering::Relaxed), &self.cancel, read)
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    /// Returns the next frame, and new warnings.
    fn read(&mut self, path: &Path) -> (Result<Option<NamedFrame>, Error>, Vec<String>) {
        if let Some(pending) = self.pending.take() {
            return (Ok(Some(pending)), Vec::new());
        }
        let frame = self.frames.next().transpose();
        let warnings = self.warnings(path, matches!(frame, Ok(None)));
        let names = |frame| (frame, self.frames.species().names().to_vec());
        (frame.map(|frame| frame.map(names)), warnings)
    }

    /// Returns warnings that no earlier call returned.
    fn warnings(&mut self, path: &Path, is_at_end: bool) -> Vec<String> {
        let mut warnings = Vec::new();
        if let Some(rounding) = self.frames.rounding().filter(|_| !self.has_warned_of_rounding) {
            warnings.push(rounding.to_owned());
            self.has_warned_of_rounding = true;
        }
        if is_at_end && !std::mem::replace(&mut self.has_warned_of_radii, true) {
            warnings.extend(unused_radius_warnings(&self.frames, path));
        }
        warnings
    }
}

/// Warns, or returns the exception into which a filter turns the warning.
fn warn(py: Python<'_>, warning: String) -> PyResult<()> {
    py.import("warnings")?.call_method1("warn", (warning, py.get_type::<PyUserWarning>()))?;
    Ok(())
}

/// Returns `true` for float64 and `false` for float32.
fn is_float64(argument: &Bound<'_, PyAny>) -> PyResult<bool> {
    let py = argument.py();
    let refused =
        |dtype: String| error::setting(format!("dtype = {dtype}; spheres are read as float32 or float64"));
    let dtype = PyArrayDescr::new(py, argument).map_err(|_| refused(argument.to_string()))?;
    match [numpy::dtype::<f64>(py), numpy::dtype::<f32>(py)].map(|supported| dtype.is_equiv_to(&supported)) {
        [true, _] => Ok(true),
        [_, true] => Ok(false),
        _ => Err(refused(dtype.to_string())),
    }
}

fn unused_radius_warnings(frames: &read::Frames, path: &Path) -> Vec<String> {
    frames.species().unused_radii().map(|species| unused_radius(path, species)).collect()
}

/// Returns the length of a regular file.
fn length(path: &Path) -> Result<Option<u64>, Error> {
    match path.metadata() {
        Ok(metadata) => Ok(metadata.is_file().then_some(metadata.len())),
        Err(source) => Err(Error::Read { path: path.to_owned(), source }),
    }
}

/// Reads without the interpreter's lock, and returns the exception of a signal's handler.
fn interruptible<R: Send>(
    py: Python<'_>,
    is_polled: bool,
    cancel: &AtomicBool,
    read: impl FnOnce() -> R + Send,
) -> PyResult<R> {
    match is_polled {
        true => py.detach(|| poll_signals(cancel, read)),
        false => Ok(py.detach(read)),
    }
}

impl Frame {
    fn new(py: Python<'_>, frame: read::Frame, names: Vec<String>) -> PyResult<Self> {
        let is_triclinic = frame.space.triclinic_cell().is_some();
        let (lengths, vectors) = (frame.space.lengths(), frame.space.cell_vectors());
        let [x, y, z] = [0, 1, 2].map(|k| match is_triclinic {
            false => lengths[k].map(CellVector::Length),
            true => vectors[k].map(|vector| CellVector::Vector(vector.into())),
        });
        let spheres = match frame.doubles {
            Some(doubles) => arrays::rows::<[f64; 4], f64>(py, doubles, 4)?.into_any().unbind(),
            None => arrays::rows::<Sphere, f32>(py, frame.spheres, 4)?.into_any().unbind(),
        };
        let species = frame.species.map(|ids| PyArray1::from_vec(py, ids).unbind());
        Ok(Self {
            spheres,
            names: if species.is_some() { names } else { Vec::new() },
            species,
            ids: frame.ids.map(|ids| PyArray1::from_vec(py, ids).unbind()),
            groups: frame.groups.map(|groups| PyArray1::from_vec(py, groups).unbind()),
            step: frame.step,
            periodic: frame.space.is_periodic().then_some((x, y, z)),
        })
    }
}

#[pymethods]
impl Frame {
    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let spheres = self.spheres.bind(py).len()?;
        let step = self.step.map(|step| format!(" at step {step}")).unwrap_or_default();
        Ok(format!("<lazygrid.Frame of {spheres} spheres{step}>"))
    }
}
