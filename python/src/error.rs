//! Errors as Python's exceptions, whose classes are in `package/lazygrid/_errors.py`.

use lazygrid::InputError;
use pyo3::exceptions::PyOSError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyModule;

fn exception(class: &str, message: String, attributes: &[(&str, Attribute)]) -> PyErr {
    Python::attach(|py| {
        let raised = || {
            static CLASSES: PyOnceLock<Py<PyModule>> = PyOnceLock::new();
            let classes = CLASSES
                .get_or_try_init(py, || PyModule::import(py, "lazygrid._errors").map(Bound::unbind))?;
            let raised = classes.bind(py).getattr(class)?.call1((message,))?;
            for (name, value) in attributes {
                match value {
                    Attribute::Whole(value) => raised.setattr(*name, value)?,
                    Attribute::Truth(value) => raised.setattr(*name, value)?,
                    Attribute::Numbers(values) => {
                        raised.setattr(*name, values.to_vec().into_pyobject(py)?)?
                    }
                }
            }
            Ok(PyErr::from_value(raised))
        };
        raised().unwrap_or_else(|error| error)
    })
}

enum Attribute {
    Whole(u64),
    Truth(bool),
    Numbers([f64; 4]),
}

pub(crate) fn engine(error: lazygrid::Error) -> PyErr {
    use lazygrid::Error;
    let message = error.to_string();
    match error {
        Error::Input(error) => input(error),
        Error::TooManyPairs { found, limit } => {
            let attributes = [("found", Attribute::Whole(found)), ("limit", Attribute::Whole(limit))];
            exception("TooManyPairs", message, &attributes)
        }
        Error::OutOfMemory { bytes, .. } | Error::DeviceOutOfMemory { bytes, .. } => {
            exception("OutOfMemory", message, &[("bytes", Attribute::Whole(bytes))])
        }
        Error::InvalidSetting { .. }
        | Error::NotOnBackend { .. }
        | Error::AdapterOnCpu { .. }
        | Error::TimeoutOnCpu { .. }
        | Error::UnknownAdapter { .. } => exception("SettingError", message, &[]),
        _ => exception("Error", message, &[]),
    }
}

pub(crate) fn input(error: InputError) -> PyErr {
    match error {
        InputError::SecondSet(error) => {
            let (message, mut attributes) = described(*error);
            attributes.push(("second", Attribute::Truth(true)));
            exception("InputError", format!("in the second set, {message}"), &attributes)
        }
        error => {
            let (message, attributes) = described(error);
            exception("InputError", message, &attributes)
        }
    }
}

fn described(error: InputError) -> (String, Vec<(&'static str, Attribute)>) {
    let message = match error {
        InputError::SpeciesMissing => {
            "interactions are set but the spheres have no species ids; add species=ids, for two sets \
             species=(ids, ids_of_second)"
                .to_owned()
        }
        ref error => error.to_string(),
    };
    let attributes = match error {
        InputError::Sphere { index, center: [x, y, z], radius, count, .. } => vec![
            ("index", Attribute::Whole(index.into())),
            ("value", Attribute::Numbers([x, y, z, radius])),
            ("count", Attribute::Whole(count)),
        ],
        InputError::SpeciesId { index: Some(index), id, .. } => {
            vec![("index", Attribute::Whole(index.into())), ("value", Attribute::Whole(id.into()))]
        }
        _ => Vec::new(),
    };
    (message, attributes)
}

pub(crate) fn other(message: impl ToString) -> PyErr {
    exception("Error", message.to_string(), &[])
}

pub(crate) fn setting(message: impl ToString) -> PyErr {
    exception("SettingError", message.to_string(), &[])
}

pub(crate) fn unknown(name: lazygrid::UnknownName) -> PyErr {
    setting(name)
}

pub(crate) fn array(message: impl ToString) -> PyErr {
    exception("InputError", message.to_string(), &[])
}

/// More pairs than an array can hold.
pub(crate) fn too_many(message: String, [found, limit]: [usize; 2]) -> PyErr {
    let attributes = [("found", Attribute::Whole(found as u64)), ("limit", Attribute::Whole(limit as u64))];
    exception("TooManyPairs", message, &attributes)
}

/// Renames the options of the command line as in Python.
pub(crate) fn file(error: lazygrid_io::Error) -> PyErr {
    use lazygrid_io::Error;
    let mut message = error.to_string();
    let options = [
        ("--radius", " (in Python: radii={species: radius})"),
        ("--periodic", " (in Python: periodic=(x, y, z) or periodic=\"none\")"),
        ("--format", " (in Python: format=)"),
        ("--ids", " (in Python: ids=True)"),
        ("--exclude-groups", " (in Python: groups=True)"),
    ];
    let named = options.into_iter().find(|(option, _)| message.contains(option));
    message.push_str(named.map_or("", |(_, remedy)| remedy));
    match &error {
        Error::Read { path, source } | Error::Write { path, source } => system(source, path, message),
        Error::Radius { .. } => setting(message),
        Error::Threads { .. } => other(message),
        _ => exception("FileError", message, &[]),
    }
}

pub(crate) fn simulator(error: lazygrid_sim::Error) -> PyErr {
    use lazygrid_sim::Error;
    let message = error.to_string();
    match error {
        Error::Read { path, source } | Error::Write { path, source } => system(&source, &path, message),
        Error::Scenario { .. } | Error::Model(_) | Error::NotOnGpu { .. } | Error::AlgorithmOnGpu { .. } => {
            exception("SettingError", message, &[])
        }
        Error::OutOfMemory { bytes, .. } | Error::TooLittleMemory { needed: bytes, .. } => {
            exception("OutOfMemory", message, &[("bytes", Attribute::Whole(bytes))])
        }
        Error::Detection(error) => engine(error),
        _ => exception("Error", message, &[]),
    }
}

/// `FileNotFoundError` and similar, by the system's error number.
fn system(error: &std::io::Error, path: &std::path::Path, message: String) -> PyErr {
    match error.raw_os_error() {
        Some(number) => {
            let text = error.to_string();
            let text = text.split(" (os error").next().unwrap_or_default().to_owned();
            PyOSError::new_err((number, text, path.to_owned()))
        }
        None => exception("FileError", message, &[]),
    }
}
