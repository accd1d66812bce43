//! Error scopes, which hide this library's errors from a host application's handlers.

use crate::Error;

pub(crate) fn with_error_scope<T>(
    device: &wgpu::Device,
    what: &'static str,
    bytes: u64,
    work: impl FnOnce() -> T,
) -> Result<T, Error> {
    let scopes = push(device);
    let result = work();
    pop(scopes, what, bytes)?;
    Ok(result)
}

// Separate from `with_error_scope`, which is compiled for each `work`.
fn push(device: &wgpu::Device) -> [wgpu::ErrorScopeGuard; 3] {
    use wgpu::ErrorFilter::{Internal, OutOfMemory, Validation};
    [OutOfMemory, Validation, Internal].map(|filter| device.push_error_scope(filter))
}

fn pop(scopes: [wgpu::ErrorScopeGuard; 3], what: &'static str, bytes: u64) -> Result<(), Error> {
    // Scopes are popped in reverse order. On native devices the futures are ready at once.
    let [memory, validation, internal] = scopes;
    let errors = [internal, validation, memory].map(|scope| pollster::block_on(scope.pop()));
    match errors.into_iter().flatten().next() {
        None => Ok(()),
        Some(wgpu::Error::OutOfMemory { .. }) => Err(Error::DeviceOutOfMemory { what, bytes }),
        Some(wgpu::Error::Validation { description, .. } | wgpu::Error::Internal { description, .. }) => {
            Err(lost_or_refused(what, description))
        }
    }
}

fn lost_or_refused(what: &'static str, reason: String) -> Error {
    let text = reason.to_lowercase();
    if text.contains("device") && text.contains("lost") {
        return Error::DeviceLost { reason };
    }
    Error::DeviceRejected { what, reason }
}
