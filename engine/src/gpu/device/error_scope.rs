//! Error scopes around this library's work, so that a host application's handlers do not receive its errors.

use crate::Error;

pub(crate) fn with_error_scope<T>(
    device: &wgpu::Device,
    what: &'static str,
    bytes: u64,
    work: impl FnOnce() -> T,
) -> Result<T, Error> {
    use wgpu::ErrorFilter::{Internal, OutOfMemory, Validation};
    let [memory, validation, internal] =
        [OutOfMemory, Validation, Internal].map(|filter| device.push_error_scope(filter));
    let result = work();
    // On native devices the futures are ready at once.
    let errors = [internal, validation, memory].map(|scope| pollster::block_on(scope.pop()));
    match errors.into_iter().flatten().next() {
        None => Ok(result),
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
