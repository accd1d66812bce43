use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};

use lazygrid::Sphere;
use lazygrid_io::read::{self, Options};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;

use crate::arrays;
use crate::error;
use crate::settings::space;

/// An iterator over the frames of a file, with one in memory. :func:`lazygrid.read` reads one frame.
///
/// Raises
/// ------
/// FileError
///     For a file that does not follow its format, with line or row and text.
/// OSError
///     If the system refuses the file.
#[pyclass(frozen, module = "lazygrid")]
pub(crate) struct Frames {
    path: PathBuf,
    frames: Mutex<read::Frames>,
}

/// The spheres of one moment of a file, in the file's length unit.
#[pyclass(frozen, get_all, module = "lazygrid")]
pub(crate) struct Frame {
    /// Rows ``x, y, z, r``, of shape ``(n, 4)``.
    spheres: Py<PyArray2<f32>>,
    /// A species id per sphere, of shape ``(n,)``, if the file has species.
    species: Option<Py<PyArray1<u32>>>,
    /// An id per sphere, of shape ``(n,)``, if ids were requested.
    ids: Option<Py<PyArray1<i64>>>,
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
    #[pyo3(signature = (path, *, format=None, radii=None, periodic=None, ids=false))]
    fn new(
        path: PathBuf,
        format: Option<&str>,
        radii: Option<BTreeMap<String, f32>>,
        periodic: Option<&Bound<'_, PyAny>>,
        ids: bool,
    ) -> PyResult<Self> {
        let format = format.map(str::parse).transpose().map_err(error::unknown)?;
        let space = match periodic {
            None => None,
            Some(word) if word.extract::<&str>().is_ok_and(|word| word == "none") => Some(space(None)?),
            lengths => Some(space(lengths)?),
        };
        let options = Options { format, radii: radii.unwrap_or_default(), space, ids, groups: false };
        let frames = read::Frames::open(&path, options).map_err(error::file)?;
        Ok(Self { path, frames: Mutex::new(frames) })
    }

    fn __iter__(this: Py<Self>) -> Py<Self> {
        this
    }

    fn __next__(&self, py: Python<'_>) -> PyResult<Option<Frame>> {
        let read = py.detach(|| {
            let mut frames = self.lock();
            let frame = frames.next()?;
            Some(frame.map(|frame| (frame, frames.species().names().to_vec())))
        });
        let Some((frame, names)) = read.transpose().map_err(error::file)? else { return Ok(None) };
        Frame::new(py, frame, names).map(Some)
    }

    /// Return ``True`` after the last frame.
    fn at_end(&self, py: Python<'_>) -> PyResult<bool> {
        py.detach(|| self.lock().at_end()).map_err(error::file)
    }

    /// The format of the file.
    #[getter]
    fn format(&self) -> String {
        self.lock().format().to_string()
    }

    /// The file, a ``pathlib.Path``.
    #[getter]
    fn path(&self) -> PathBuf {
        self.path.clone()
    }
}

impl Frames {
    fn lock(&self) -> MutexGuard<'_, read::Frames> {
        self.frames.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Frame {
    fn new(py: Python<'_>, frame: read::Frame, names: Vec<String>) -> PyResult<Self> {
        let is_triclinic = frame.space.triclinic_cell().is_some();
        let (lengths, edges) = (frame.space.lengths(), frame.space.cell_vectors());
        let [x, y, z] = [0, 1, 2].map(|k| match is_triclinic {
            false => lengths[k].map(CellVector::Length),
            true => edges[k].map(|edge| CellVector::Vector(edge.into())),
        });
        let species = frame.species.map(|ids| PyArray1::from_vec(py, ids).unbind());
        Ok(Self {
            spheres: arrays::rows::<Sphere, f32>(py, frame.spheres, 4)?.unbind(),
            names: if species.is_some() { names } else { Vec::new() },
            species,
            ids: frame.ids.map(|ids| PyArray1::from_vec(py, ids).unbind()),
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
