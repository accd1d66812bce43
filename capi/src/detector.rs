use std::ffi::{CString, c_char};
use std::sync::{Mutex, TryLockError};

use engine::Detector;

use crate::pointer::check;
use crate::settings::CSettings;
use crate::status::{
    BUSY, INTERNAL, OK, PANICKED, Status, c_text, guarded, guarded_without_detector, last_without_detector,
    without_detector,
};
use crate::{Failure, OutPtr};

/// `lazygrid_detector`: a detector and the texts that C has pointers to.
///
/// A second thread and a stream's callback get [`BUSY`] by `try_lock`. A panic poisons the mutex, so all later calls
/// fail.
#[derive(Debug)]
pub struct DetectorHandle(Mutex<HandleState>);

#[derive(Debug)]
pub struct HandleState {
    pub detector: Detector,
    pub report: CString,
    /// Number of pairs that C has a pointer to, if neighbor lists would have too many.
    pub found: u64,
    /// Empty if the last call succeeded.
    message: CString,
}

// Any thread may use a handle, one at a time.
const _: () = {
    const fn crosses_threads<T: Send + Sync>() {}
    crosses_threads::<DetectorHandle>();
};

/// Runs a call with a detector and stores its error message.
///
/// # Safety
/// The header's conditions: `handle` is NULL or a detector that is not destroyed before this returns.
pub unsafe fn with_detector(
    handle: *const DetectorHandle,
    work: impl FnOnce(&mut HandleState) -> Result<(), Failure>,
) -> Status {
    if let Err(failure) = check(handle, "detector") {
        return without_detector(|| Err(failure));
    }
    // SAFETY: `lazygrid_create` made it, and no code has a `&mut` to it: all code locks its mutex.
    let DetectorHandle(state) = unsafe { &*handle };
    guarded(|| {
        let mut state = match state.try_lock() {
            Ok(state) => state,
            Err(TryLockError::WouldBlock) => return BUSY,
            Err(TryLockError::Poisoned(_)) => return INTERNAL,
        };
        let (status, message) = match work(&mut state) {
            Ok(()) => (OK, CString::default()),
            Err(failure) => (failure.status, c_text(failure.message)),
        };
        state.message = message;
        status
    })
}

/// Creates a detector.
///
/// # Safety
/// The header's conditions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lazygrid_create(
    settings: *const CSettings,
    detector: *mut *mut DetectorHandle,
) -> Status {
    without_detector(|| {
        // SAFETY: by this function's condition.
        let out = unsafe { OutPtr::new(detector, "detector", std::ptr::null_mut()) }?;
        // SAFETY: by this function's condition.
        let config = unsafe { CSettings::config(settings) }?;
        let detector = Detector::new(config)?;
        let state =
            HandleState { detector, report: CString::default(), found: 0, message: CString::default() };
        out.put(Box::into_raw(Box::new(DetectorHandle(Mutex::new(state)))));
        Ok(())
    })
}

/// Frees a detector.
///
/// # Safety
/// The header's conditions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lazygrid_destroy(detector: *mut DetectorHandle) -> Status {
    guarded_without_detector(|| {
        if detector.is_null() {
            return OK;
        }
        // SAFETY: `lazygrid_create` made it, and it was not destroyed before.
        if matches!(unsafe { &*detector }.0.try_lock(), Err(TryLockError::WouldBlock)) {
            return BUSY;
        }
        // SAFETY: made by `Box::into_raw` and freed once. No search is running, and none begins by this function's
        // condition.
        drop(unsafe { Box::from_raw(detector) });
        OK
    })
}

/// Returns the error message of the last call.
///
/// # Safety
/// The header's conditions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lazygrid_last_error(detector: *const DetectorHandle) -> *const c_char {
    if detector.is_null() {
        return last_without_detector();
    }
    // SAFETY: `lazygrid_create` made it, and no code has a `&mut` to it.
    match unsafe { &*detector }.0.try_lock() {
        Ok(state) => state.message.as_ptr(),
        Err(TryLockError::WouldBlock) => c"the detector is in use; wait until its call has returned".as_ptr(),
        Err(TryLockError::Poisoned(_)) => PANICKED.as_ptr(),
    }
}
