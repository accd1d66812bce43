use thiserror::Error;

use crate::{Algorithm, Backend, MAX_SPHERES};

/// An invalid input. Messages name the value, the limit and the remedy.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
#[allow(missing_docs, reason = "messages explain the fields")]
pub enum InputError {
    /// Spheres with a non-finite value or a negative radius.
    #[error(
        "sphere {index} has center ({x}, {y}, {z}) and radius {r}: {count} of {total} spheres are invalid \
         (non-finite value or negative radius); fix or remove them",
        x = short(.center[0]), y = short(.center[1]), z = short(.center[2]), r = short(*.radius)
    )]
    Sphere {
        /// First invalid sphere.
        index: u32,
        center: [f64; 3],
        radius: f64,
        count: u64,
        total: u64,
    },
    /// An error in the second of two sets of spheres.
    #[error("in the second set, {0}")]
    SecondSet(Box<InputError>),
    /// Columns or ids of different lengths.
    #[error("`{what}` has {length} values where {expected} are needed: one per sphere")]
    Lengths { what: &'static str, length: usize, expected: usize },
    /// More spheres than 32-bit indices can name.
    #[error("{count} spheres exceed the {MAX_SPHERES} that 32-bit indices can name; split the input")]
    TooManySpheres { count: u64 },
    /// A species id outside the interaction table.
    #[error(
        "species id {id}{at} is not below the {count} species of the interaction table",
        at = .index.map(|i| format!(" of sphere {i}")).unwrap_or_default()
    )]
    SpeciesId {
        /// First sphere with this id; `None` for an argument.
        index: Option<u32>,
        id: u32,
        count: u32,
    },
    /// An interaction table for too many species.
    #[error("an interaction table for {count} species exceeds the limit of {limit}; merge species")]
    SpeciesCount { count: u32, limit: u32 },
    /// The system refused memory for an interaction table.
    #[error(
        "no memory for an interaction table of {species} species: {bytes} bytes were refused; merge species"
    )]
    TableMemory { species: u32, bytes: u64 },
    /// Spheres without species ids, though an interaction table is set.
    #[error(
        "interactions are set but the spheres have no species ids; add them with `Spheres::with_species`"
    )]
    SpeciesMissing,
    /// A periodic length that is not finite or not above 0.
    #[error(
        "the length {} of the periodic axis {axis} must be finite and above 0; omit the length of an unbounded axis", short(*.length)
    )]
    PeriodicLength { axis: char, length: f64 },
    /// Cell vectors that do not span a box.
    #[error(
        "the cell vectors {} must be finite and independent, and their box at least 2^-24 as thick as its longest vector; omit \
         vectors along which space is not periodic",
        .vectors.iter().flatten().map(|vector| format!("({})", vector.map(short).join(", "))).collect::<Vec<_>>().join(", ")
    )]
    CellVectors { vectors: Box<[Option<[f64; 3]>; 3]> },
    /// More images within the cutoff than indices can name.
    #[error(
        "{images} images of spheres are within the cutoff {cutoff} of others, more than the {MAX_SPHERES} that 32-bit indices can \
         name; choose a smaller cutoff or a larger box, or wrap the coordinates into the box if they are far from it"
    )]
    Images {
        /// Number of images, rounded to `f64`.
        images: f64,
        /// Largest cutoff of two spheres.
        cutoff: f64,
    },
    /// Coordinates so far apart in a triclinic cell that the multiples of its vectors between them overflow.
    #[error(
        "the {axis} coordinates from {from:e} to {to:e} are more than {limit:e} apart, so that multiples of the cell vectors may overflow; \
         wrap the coordinates into the box"
    )]
    CoordinateRange { axis: char, from: f64, to: f64, limit: f64 },
    /// A shift of 2³¹ − 1 or more cell vectors.
    #[error(
        "spheres {i} and {j} are at least 2^31 - 1 cell vectors apart, above the limit of shifts; wrap the coordinates \
         into the box"
    )]
    Shift { i: u32, j: u32 },
    /// An excluded pair with an index out of range.
    #[error(
        "the excluded pair ({i}, {j}) is out of range ({first} and {second} spheres); indices start at 0"
    )]
    ExcludedIndex { i: u32, j: u32, first: usize, second: usize },
    /// Invalid offsets of compressed sparse rows of excluded pairs.
    #[error(
        "offset {at} of the excluded pairs is {offset}; the {offsets} offsets must begin with 0, never decrease, and end with the \
         number of indices, {indices}"
    )]
    ExcludedOffsets { at: usize, offset: usize, offsets: usize, indices: usize },
    /// Exclusions for other numbers of spheres.
    #[error(
        "the exclusions were made for {}, but the call has {}; create `Exclusions` again when the number of spheres changes",
        sets(.made_for), sets(.given)
    )]
    ExclusionSizeMismatch { made_for: (usize, Option<usize>), given: (usize, Option<usize>) },
    /// An interaction distance that is negative or not finite.
    #[error("the interaction distance {distance} of species {a} and {b} must be finite and not negative")]
    Distance { a: u32, b: u32, distance: f64 },
}

/// The failure of a call. Messages name the value, the limit and the remedy.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
#[allow(missing_docs, reason = "messages explain the fields")]
pub enum Error {
    #[error(transparent)]
    Input(InputError),
    #[error("{name} = {value} is out of range; {range}")]
    InvalidSetting { name: &'static str, value: String, range: &'static str },
    #[error("{algorithm} does not run on the {backend} backend; choose {}", runs_on(*backend))]
    NotOnBackend { algorithm: Algorithm, backend: Backend },
    /// More pairs than `max_pairs`. The count is exact; nothing was truncated.
    #[error(
        "{found} pairs exceed the limit of {limit} for a list; count or stream the pairs, or raise `max_pairs`"
    )]
    TooManyPairs { found: u64, limit: u64 },
    #[error("the search was cancelled by the caller's cancel flag; clear the flag before the next call")]
    Cancelled,
    /// The system refused memory.
    #[error(
        "out of memory: the system refused {bytes} bytes for {what}; use fewer spheres, or stream pairs that are listed"
    )]
    OutOfMemory {
        /// Purpose of the memory.
        what: &'static str,
        bytes: u64,
    },
    /// The system refused the threads of a thread pool.
    #[error("could not start {threads} threads: {reason}; request fewer")]
    ThreadPool { threads: usize, reason: String },
    /// The requested GPU backend cannot be used.
    #[error("the GPU backend is not available: {reason}; choose the `cpu` or `auto` backend")]
    GpuUnavailable { reason: String },
    /// This build lacks the feature `gpu`.
    #[error("lazygrid was built without its feature `gpu`; enable it, or use the CPU")]
    WithoutGpu,
    /// An adapter and the CPU backend were requested together.
    #[error("adapter '{adapter}' and the cpu backend exclude each other; omit one of them")]
    AdapterOnCpu { adapter: String },
    /// A time limit and the CPU backend were requested together.
    #[error(
        "a timeout of {seconds} seconds limits searches on a GPU and has no effect with the cpu backend; omit one of them"
    )]
    TimeoutOnCpu { seconds: f64 },
    #[error(
        "no GPU adapter was found ({reason}); install a Vulkan, Metal or DirectX 12 driver, or use the CPU"
    )]
    NoAdapter { reason: String },
    /// The request matches no adapter, or several.
    #[error(
        "{} '{requested}'; give an index or a part of one name only; available: {available}",
        match .matches {
            0 => "no adapter matches".to_owned(),
            several => format!("{several} adapters match"),
        }
    )]
    UnknownAdapter {
        requested: String,
        matches: usize,
        /// Index, name and API of each adapter.
        available: String,
    },
    #[error("adapter {adapter} refused a device: {reason}")]
    NoDevice { adapter: String, reason: String },
    /// A requirement exceeds a limit of the device. Nothing was allocated.
    #[error("{what} needs {needed}, but the device's limit is {limit}; {remedy}")]
    LimitExceeded {
        what: &'static str,
        /// Required amount, in bytes unless `what` says otherwise.
        needed: u64,
        limit: u64,
        remedy: &'static str,
    },
    /// The device has no memory left.
    #[error(
        "the device is out of memory: {bytes} bytes ({what}); use fewer spheres or a smaller pair capacity"
    )]
    DeviceOutOfMemory {
        /// Purpose of the memory.
        what: &'static str,
        bytes: u64,
    },
    /// The device was unplugged, reset by its driver, or destroyed by its owner.
    #[error("the device was lost ({reason}); create a new device and a new detector")]
    DeviceLost { reason: String },
    /// The device rejected a call because of an error in this library or in a given buffer.
    #[error("the device rejected {what}: {reason}")]
    DeviceRejected { what: &'static str, reason: String },
    /// The device did not finish in time.
    #[error(
        "the device did not finish within {seconds} seconds; use fewer spheres per call or raise the time-out"
    )]
    Timeout { seconds: f64 },
    /// All call slots of a session are in use, or the ticket's call has failed.
    #[error(
        "all {calls} call slots are in use, or this call failed; finish a call before beginning the next"
    )]
    TooManyInFlight { calls: usize },
    /// A ticket of another session.
    #[error("the ticket is that of another session; finish a call on the session that began it")]
    ForeignTicket,
    #[error("the `{what}` buffer has {size} bytes, but needs {needed}")]
    BufferSize { what: &'static str, size: u64, needed: u64 },
    /// A given buffer lacks a usage.
    #[error("the `{what}` buffer lacks {usage} usage; create it with this usage")]
    BufferUsage { what: &'static str, usage: &'static str },
    /// An interaction table without a species buffer, or the reverse.
    #[error("interactions and species ids go together; give both or neither")]
    SpeciesBuffer,
}

/// Returns a number for a message, with an exponent if it has many digits.
pub fn short(number: f64) -> String {
    let digits = number.to_string();
    if digits.len() > 24 { format!("{number:e}") } else { digits }
}

fn sets((first, second): &(usize, Option<usize>)) -> String {
    match second {
        None => format!("{first} spheres"),
        Some(second) => format!("sets of {first} and {second} spheres"),
    }
}

fn runs_on(backend: Backend) -> String {
    let names = |algorithms: &[Algorithm]| {
        let names = algorithms.iter().map(|algorithm| algorithm.name());
        std::iter::once("auto").chain(names).collect::<Vec<_>>().join(", ")
    };
    match backend {
        Backend::Auto => "auto".to_owned(),
        Backend::Cpu => names(Algorithm::CPU),
        Backend::Gpu => names(Algorithm::GPU),
    }
}

impl From<InputError> for Error {
    fn from(error: InputError) -> Self {
        match error {
            InputError::TableMemory { bytes, .. } => {
                Self::OutOfMemory { what: "an interaction table", bytes }
            }
            error => Self::Input(error),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn not_on_backend_lists_algorithms_of_the_backend() {
        let message = |algorithm, backend| Error::NotOnBackend { algorithm, backend }.to_string();
        assert_eq!(
            message(Algorithm::LazyGrid, Backend::Cpu),
            "lazy-grid does not run on the cpu backend; choose auto, naive, hash-grid, array-grid, recursive-grid, \
             cell-list"
        );
        assert_eq!(
            message(Algorithm::HashGrid, Backend::Gpu),
            "hash-grid does not run on the gpu backend; choose auto, naive, array-grid, eager-grid, lazy-grid, \
             cell-list"
        );
    }

    #[test]
    fn numbers_of_many_digits_have_an_exponent() {
        let center = [1e300, -5e-324, 0.1];
        let error = InputError::Sphere { index: 0, center, radius: f64::NAN, count: 1, total: 1 };
        assert!(
            error.to_string().starts_with("sphere 0 has center (1e300, -5e-324, 0.1) and radius NaN: "),
            "{error}"
        );
        let error = InputError::PeriodicLength { axis: 'x', length: -1e300 };
        assert!(error.to_string().starts_with("the length -1e300 of "), "{error}");
    }
}
