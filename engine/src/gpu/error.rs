use lazygrid_kernels::Algorithm;
use thiserror::Error;

/// Why the GPU engine gave no result. Every message names the value, the limit and the remedy.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum GpuError {
    /// No adapter answered.
    #[error(
        "no GPU adapter was found ({reason}); install a Vulkan, Metal or DirectX 12 driver, or use the CPU"
    )]
    NoAdapter {
        /// What was asked and what came back.
        reason: String,
    },
    /// No adapter, or more than one, is what was asked for.
    #[error(
        "{} by '{asked}'; give the index or a part of one name only: {there_are}",
        match .fitting {
            0 => "no adapter is meant".to_owned(),
            several => format!("{several} adapters are meant"),
        }
    )]
    UnknownAdapter {
        /// The index or name.
        asked: String,
        /// How many adapters fit it.
        fitting: usize,
        /// Index, name and API of each adapter.
        there_are: String,
    },
    /// The adapter refused to open a device.
    #[error("adapter {adapter} refused a device: {reason}")]
    NoDevice {
        /// The adapter's name.
        adapter: String,
        /// What it said.
        reason: String,
    },
    /// Something would not fit the device. Nothing was allocated.
    #[error("{what} needs {needed} where the device's limit is {limit}; {remedy}")]
    LimitExceeded {
        /// Which buffer or number.
        what: &'static str,
        /// What would be needed, in bytes unless `what` says otherwise.
        needed: u64,
        /// What there is.
        limit: u64,
        /// What to do.
        remedy: &'static str,
    },
    /// The device has no memory left.
    #[error(
        "the device has no room for {bytes} bytes ({what}); use fewer spheres or a smaller pair capacity"
    )]
    OutOfMemory {
        /// What it was for.
        what: &'static str,
        /// How many bytes were asked for.
        bytes: u64,
    },
    /// The system refused memory on the host's side.
    #[error("no memory for {what}: {bytes} bytes were refused; use fewer spheres or stream the pairs")]
    NoHostMemory {
        /// What it was for.
        what: &'static str,
        /// How many bytes were asked for.
        bytes: u64,
    },
    /// The device is gone: unplugged, reset by its driver, or destroyed by its owner.
    #[error("the device was lost ({reason}); make a new device and a new detector")]
    DeviceLost {
        /// What the driver said.
        reason: String,
    },
    /// The device refused a call: a fault of this library or of a buffer that was handed over.
    #[error("the device refused {what}: {reason}")]
    Validation {
        /// What was being done.
        what: &'static str,
        /// What the device said.
        reason: String,
    },
    /// The device did not finish in time.
    #[error(
        "the device did not finish within {seconds} seconds; use fewer spheres per call or raise the time-out"
    )]
    Timeout {
        /// How long was waited.
        seconds: u64,
    },
    /// As many calls are in flight as a session can hold, or the ticket is of a call that failed.
    #[error("{calls} calls are in flight, or this one failed; finish a call before beginning the next")]
    Busy {
        /// How many may be in flight.
        calls: usize,
    },
    /// A list would hold more pairs than allowed. The count is exact; nothing was truncated.
    #[error("{found} pairs are more than the limit of {limit} for a list; count them, or take them in parts")]
    TooManyPairs {
        /// How many pairs there are.
        found: u64,
        /// The limit that was set.
        limit: u64,
    },
    /// A buffer that was handed over does not fit what was asked for.
    #[error("the `{what}` buffer has {size} bytes where {needed} are needed{usage}")]
    Buffer {
        /// Which buffer.
        what: &'static str,
        /// Its size.
        size: u64,
        /// What is needed.
        needed: u64,
        /// The usage that is missing, if any.
        usage: &'static str,
    },
    /// The algorithm has no GPU kernels.
    #[error("{0} does not run on the GPU; choose auto, naive, array-grid, eager-grid or lazy-grid")]
    NotOnGpu(Algorithm),
    /// A setting outside its range.
    #[error("{name} = {value} is out of range; {range}")]
    Setting {
        /// Which setting.
        name: &'static str,
        /// Its value.
        value: String,
        /// What is allowed.
        range: &'static str,
    },
    /// An interaction table is set but no species buffer was given, or the other way round.
    #[error("interactions and species ids go together; give both or neither")]
    Species,
}

/// Makes room for so many values behind those that a buffer on the host has.
///
/// # Errors
/// [`GpuError::NoHostMemory`].
pub(super) fn make_room<T>(buffer: &mut Vec<T>, count: usize, what: &'static str) -> Result<(), GpuError> {
    let bytes = (buffer.len() + count) as u64 * size_of::<T>() as u64;
    buffer.try_reserve(count).map_err(|_| GpuError::NoHostMemory { what, bytes })
}
