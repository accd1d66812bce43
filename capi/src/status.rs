use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

use engine::{Error, InputError};

/// The status of a call in C.
pub type Status = i32;

pub const OK: Status = 0;
pub const ARGUMENT: Status = 1;
pub const INPUT: Status = 2;
pub const SETTING: Status = 3;
pub const TOO_MANY_PAIRS: Status = 4;
pub const OUT_OF_MEMORY: Status = 5;
pub const THREADS: Status = 6;
pub const GPU_UNAVAILABLE: Status = 7;
pub const DEVICE_LIMIT: Status = 8;
pub const DEVICE_LOST: Status = 9;
pub const TIMEOUT: Status = 10;
pub const BUSY: Status = 11;
pub const INTERNAL: Status = 12;

pub const NAMES: [&CStr; 13] = [
    c"LAZYGRID_OK",
    c"LAZYGRID_ERROR_ARGUMENT",
    c"LAZYGRID_ERROR_INPUT",
    c"LAZYGRID_ERROR_SETTING",
    c"LAZYGRID_ERROR_TOO_MANY_PAIRS",
    c"LAZYGRID_ERROR_OUT_OF_MEMORY",
    c"LAZYGRID_ERROR_THREADS",
    c"LAZYGRID_ERROR_GPU_UNAVAILABLE",
    c"LAZYGRID_ERROR_DEVICE_LIMIT",
    c"LAZYGRID_ERROR_DEVICE_LOST",
    c"LAZYGRID_ERROR_TIMEOUT",
    c"LAZYGRID_ERROR_BUSY",
    c"LAZYGRID_ERROR_INTERNAL",
];

pub const PANICKED: &CStr =
    c"a bug in lazygrid ended this call or an earlier one; destroy the detector and create a new one";

pub const PANICKED_WITHOUT_DETECTOR: &CStr =
    c"a bug in lazygrid ended this call; objects of other calls remain usable";

/// The failure of a call.
#[derive(Debug)]
pub struct Failure {
    pub status: Status,
    pub message: String,
}

impl Failure {
    pub fn argument(message: impl Into<String>) -> Self {
        Self { status: ARGUMENT, message: message.into() }
    }

    pub fn setting(message: impl Into<String>) -> Self {
        Self { status: SETTING, message: message.into() }
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        let status = match &error {
            Error::Input(_) | Error::SpeciesBuffer => INPUT,
            Error::InvalidSetting { .. }
            | Error::NotOnBackend { .. }
            | Error::AdapterOnCpu { .. }
            | Error::TimeoutOnCpu { .. } => SETTING,
            Error::TooManyPairs { .. } => TOO_MANY_PAIRS,
            Error::OutOfMemory { .. } | Error::DeviceOutOfMemory { .. } => OUT_OF_MEMORY,
            Error::ThreadPool { .. } => THREADS,
            Error::GpuUnavailable { .. }
            | Error::WithoutGpu
            | Error::NoAdapter { .. }
            | Error::UnknownAdapter { .. }
            | Error::NoDevice { .. } => GPU_UNAVAILABLE,
            Error::LimitExceeded { .. } => DEVICE_LIMIT,
            Error::DeviceLost { .. } | Error::DeviceRejected { .. } => DEVICE_LOST,
            Error::Timeout { .. } => TIMEOUT,
            // Errors of GPU buffers, which only Rust programs pass, and errors that are newer than this list.
            _ => INTERNAL,
        };
        Self { status, message: error.to_string() }
    }
}

impl From<InputError> for Failure {
    fn from(error: InputError) -> Self {
        Error::from(error).into()
    }
}

/// Runs the body of a C function and turns a panic into [`INTERNAL`].
pub fn guarded(work: impl FnOnce() -> Status) -> Status {
    // A panic poisons the mutex of its detector. Functions without a detector keep no state between calls.
    catch_unwind(AssertUnwindSafe(work)).unwrap_or(INTERNAL)
}

/// Converts `text` to a C string without zero bytes, which would end it.
pub fn c_text(text: String) -> CString {
    let mut bytes = text.into_bytes();
    bytes.retain(|byte| *byte != 0);
    CString::new(bytes).unwrap_or_default()
}

thread_local! {
        static LAST_MESSAGE: RefCell<CString> = RefCell::default();
}

/// Like [`guarded`], for functions without a detector: a panic also replaces this thread's error message.
pub fn guarded_without_detector(work: impl FnOnce() -> Status) -> Status {
    let result = catch_unwind(AssertUnwindSafe(work));
    result.unwrap_or_else(|_| keep(INTERNAL, PANICKED_WITHOUT_DETECTOR.to_owned()))
}

/// Runs a function without a detector and stores its error message for this thread.
pub fn without_detector(work: impl FnOnce() -> Result<(), Failure>) -> Status {
    guarded_without_detector(|| match work() {
        Ok(()) => keep(OK, CString::default()),
        Err(failure) => keep(failure.status, c_text(failure.message)),
    })
}

fn keep(status: Status, message: CString) -> Status {
    // A thread that ends has no thread-local storage left, and no later call that reads the message.
    let _ = LAST_MESSAGE.try_with(|last| *last.borrow_mut() = message);
    status
}

/// Error message of this thread's last call without a detector.
pub fn last_without_detector() -> *const c_char {
    LAST_MESSAGE.try_with(|last| last.borrow().as_ptr()).unwrap_or(c"".as_ptr())
}

/// Returns the name of a status.
#[unsafe(no_mangle)]
pub extern "C" fn lazygrid_status_name(status: Status) -> *const c_char {
    let name = usize::try_from(status).ok().and_then(|number| NAMES.get(number));
    name.unwrap_or(&c"unknown status").as_ptr()
}

/// Returns the version of the library.
#[unsafe(no_mangle)]
pub extern "C" fn lazygrid_version() -> *const c_char {
    const VERSION: &CStr =
        match CStr::from_bytes_with_nul(concat!(env!("CARGO_PKG_VERSION"), "\0").as_bytes()) {
            Ok(version) => version,
            Err(_) => panic!("a version has no zero byte"),
        };
    VERSION.as_ptr()
}
