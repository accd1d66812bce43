use thiserror::Error;

use crate::{Algorithm, Backend, MAX_SPHERES};

/// A fault of an input. Every message names the value, the limit and the remedy.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum InputError {
    /// Some spheres have a centre that is not finite, or a radius that is negative, infinite or NaN.
    #[error(
        "sphere {index} has centre ({x}, {y}, {z}) and radius {r}: {count} of {total} spheres are not finite \
         or have a negative radius; remove or mend them",
        x = .center[0], y = .center[1], z = .center[2], r = .radius
    )]
    Sphere {
        /// Index of the first such sphere.
        index: u32,
        /// Its center.
        center: [f64; 3],
        /// Its radius.
        radius: f64,
        /// The number of such spheres.
        count: u64,
        /// The number of all spheres.
        total: u64,
    },
    /// A fault of the second of two sets of spheres.
    #[error("of the second set, {0}")]
    SecondSet(Box<InputError>),
    /// Columns or ids of different lengths.
    #[error("`{what}` has {length} values where {expected} are needed: one per sphere")]
    Lengths {
        /// The column.
        what: &'static str,
        /// Its length.
        length: usize,
        /// The length of the others.
        expected: usize,
    },
    /// More spheres than indices.
    #[error("{count} spheres are more than the {MAX_SPHERES} that 32-bit indices can name; split the input")]
    TooManySpheres {
        /// The number that was given.
        count: u64,
    },
    /// A species id outside the interaction table.
    #[error(
        "species id {id}{at} is not below the {count} species of the interaction table",
        at = .index.map(|i| format!(" of sphere {i}")).unwrap_or_default()
    )]
    SpeciesId {
        /// The first sphere that has it; `None` where it was an argument.
        index: Option<u32>,
        /// The id.
        id: u32,
        /// The number of species of the table.
        count: u32,
    },
    /// Too large an interaction table.
    #[error("an interaction table for {count} species is above the limit of {limit}; merge species")]
    SpeciesCount {
        /// The requested number.
        count: u32,
        /// The most there may be.
        limit: u32,
    },
    /// An interaction table is set but the spheres carry no species ids.
    #[error(
        "interactions are set but the spheres have no species ids; add them with `Spheres::with_species`"
    )]
    SpeciesMissing,
    /// A length of a periodic axis that is no length.
    #[error(
        "the length {length} of the periodic axis {axis} must be finite and above 0; leave an unbounded axis out"
    )]
    PeriodicLength {
        /// Which axis: `x`, `y` or `z`.
        axis: char,
        /// The length given.
        length: f64,
    },
    /// Edges of a sheared space that span no box.
    #[error(
        "the edges {} must be finite and independent, and their box no thinner than 2^-24 of its longest edge; leave out \
         edges along which space does not repeat",
        .vectors.iter().flatten().map(|[x, y, z]| format!("({x}, {y}, {z})")).collect::<Vec<_>>().join(", ")
    )]
    CellVectors {
        /// The edges given.
        vectors: Box<[Option<[f64; 3]>; 3]>,
    },
    /// Too many images of spheres are within reach of another.
    #[error(
        "{images} images of spheres are within the reach {reach} of others, more than the {MAX_SPHERES} that 32-bit indices can \
         name; make the reach smaller, or the box larger"
    )]
    Images {
        /// The number of images, as far as `f64` can tell it.
        images: f64,
        /// The largest reach of two spheres.
        reach: f64,
    },
    /// A shift that 32 bits do not hold.
    #[error(
        "spheres {i} and {j} are 2^31 or more edges of the space apart, which no 32-bit shift can tell; bring the coordinates \
         nearer to the box"
    )]
    Shift {
        /// The sphere.
        i: u32,
        /// Its neighbor.
        j: u32,
    },
    /// A pair is to be left out of which there is no sphere.
    #[error(
        "the excluded pair ({i}, {j}) names a sphere that is none of the {first} and {second} there are; give indices of \
         spheres, from 0 on"
    )]
    ExcludedIndex {
        /// The first of the two.
        i: u32,
        /// The second.
        j: u32,
        /// The number of spheres of the first set.
        first: usize,
        /// The number of spheres of the second set.
        second: usize,
    },
    /// Compressed rows of excluded pairs that are none.
    #[error(
        "offset {at} of the excluded pairs is {offset}; {offsets} offsets must begin with 0, never fall, and end with the \
         number of indices, {indices}"
    )]
    ExcludedOffsets {
        /// Which offset is wrong.
        at: usize,
        /// Its value.
        offset: usize,
        /// The actual number.
        offsets: usize,
        /// The number of indices.
        indices: usize,
    },
    /// Excluded pairs were made for other numbers of spheres than the call has.
    #[error(
        "pairs are excluded among {} where the call has {}; make `Exclusions` anew when spheres come or go",
        sets(.made_for), sets(.given)
    )]
    ExclusionSizeMismatch {
        /// The numbers of spheres that they were made for, of one set or of each of two.
        made_for: (usize, Option<usize>),
        /// The actual number.
        given: (usize, Option<usize>),
    },
    /// An interaction distance that is negative or not finite.
    #[error("the interaction distance {distance} of species {a} and {b} must be finite and not negative")]
    Distance {
        /// One species.
        a: u32,
        /// The other.
        b: u32,
        /// The distance given.
        distance: f64,
    },
}

/// The failure of a call. Every message names the value, the limit and the remedy.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum Error {
    /// The input is refused: not finite, a negative radius, lengths that differ, unknown species.
    #[error(transparent)]
    Input(#[from] InputError),
    /// A setting outside its range.
    #[error("{name} = {value} is out of range; {range}")]
    InvalidSetting {
        /// The setting.
        name: &'static str,
        /// Its value.
        value: String,
        /// The valid values.
        range: &'static str,
    },
    /// The algorithm does not run on the backend.
    #[error("{algorithm} does not run on the {backend} backend; choose {}", runs_on(*backend))]
    NotOnBackend {
        /// The algorithm asked for.
        algorithm: Algorithm,
        /// The backend asked for.
        backend: Backend,
    },
    /// A list would hold more pairs than allowed. The count is exact; nothing was truncated.
    #[error(
        "{found} pairs are more than the limit of {limit} for a list; ask for the count only, stream the pairs \
         in chunks, or raise `max_pairs`"
    )]
    TooManyPairs {
        /// The number of pairs.
        found: u64,
        /// The limit that was set.
        limit: u64,
    },
    /// The caller told the search to stop.
    #[error(
        "the search was told to stop, by the flag that was given as `stop`; clear it before the next call"
    )]
    Cancelled,
    /// The system refused memory.
    #[error("no memory for {what}: {bytes} bytes were refused; use fewer spheres or stream the pairs")]
    OutOfMemory {
        /// The purpose of the memory.
        what: &'static str,
        /// The requested bytes.
        bytes: u64,
    },
    /// The thread pool could not be made.
    #[error("could not start {threads} threads: {reason}; ask for fewer")]
    ThreadPool {
        /// The requested number.
        threads: usize,
        /// The message of the system.
        reason: String,
    },
    /// The GPU was asked for by name and cannot be used. An explicit choice never falls back.
    #[error("the GPU backend is not available: {reason}; choose the `cpu` or `auto` backend")]
    GpuUnavailable {
        /// The reason.
        reason: String,
    },
    /// This build has no GPU path.
    #[error("lazygrid was built without its feature `gpu`; enable it, or use the CPU")]
    WithoutGpu,
    /// An adapter was named, and the CPU asked for.
    #[error("adapter '{adapter}' and the cpu backend were asked for together; leave one of them out")]
    AdapterOnCpu {
        /// The adapter that was named.
        adapter: String,
    },
    /// No adapter answered.
    #[error(
        "no GPU adapter was found ({reason}); install a Vulkan, Metal or DirectX 12 driver, or use the CPU"
    )]
    NoAdapter {
        /// The request and the answer.
        reason: String,
    },
    /// No adapter, or more than one, is what was asked for.
    #[error(
        "{} by '{requested}'; give the index or a part of one name only: {available}",
        match .matches {
            0 => "no adapter is meant".to_owned(),
            several => format!("{several} adapters are meant"),
        }
    )]
    UnknownAdapter {
        /// The index or name.
        requested: String,
        /// The number of adapters that match.
        matches: usize,
        /// Index, name and API of each adapter.
        available: String,
    },
    /// The adapter refused to open a device.
    #[error("adapter {adapter} refused a device: {reason}")]
    NoDevice {
        /// The adapter's name.
        adapter: String,
        /// The message of the device.
        reason: String,
    },
    /// Something would not fit the device. Nothing was allocated.
    #[error("{what} needs {needed} where the device's limit is {limit}; {remedy}")]
    LimitExceeded {
        /// Which buffer or number.
        what: &'static str,
        /// The required amount, in bytes unless `what` says otherwise.
        needed: u64,
        /// The available amount.
        limit: u64,
        /// The remedy.
        remedy: &'static str,
    },
    /// The device has no memory left.
    #[error(
        "the device has no room for {bytes} bytes ({what}); use fewer spheres or a smaller pair capacity"
    )]
    DeviceOutOfMemory {
        /// The purpose of the memory.
        what: &'static str,
        /// The requested bytes.
        bytes: u64,
    },
    /// The device is gone: unplugged, reset by its driver, or destroyed by its owner.
    #[error("the device was lost ({reason}); make a new device and a new detector")]
    DeviceLost {
        /// The message of the driver.
        reason: String,
    },
    /// The device refused a call: a fault of this library or of a buffer that was handed over.
    #[error("the device refused {what}: {reason}")]
    DeviceRejected {
        /// The operation.
        what: &'static str,
        /// The message of the device.
        reason: String,
    },
    /// The device did not finish in time.
    #[error(
        "the device did not finish within {seconds} seconds; use fewer spheres per call or raise the time-out"
    )]
    Timeout {
        /// The time limit.
        seconds: u64,
    },
    /// As many calls are in flight as a session can hold, or the ticket is of a call that failed.
    #[error("{calls} calls are in flight, or this one failed; finish a call before beginning the next")]
    TooManyInFlight {
        /// The number of calls that may be in flight.
        calls: usize,
    },
    /// A buffer that was handed over does not fit what was asked for.
    #[error("the `{what}` buffer has {size} bytes where {needed} are needed{usage}")]
    Buffer {
        /// The buffer.
        what: &'static str,
        /// Its size.
        size: u64,
        /// The required size.
        needed: u64,
        /// The usage that is missing, if any.
        usage: &'static str,
    },
    /// An interaction table is set but no species buffer was given, or the other way round.
    #[error("interactions and species ids go together; give both or neither")]
    SpeciesBuffer,
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

/// A name that is none of those known, as a `FromStr` of this library was given it.
///
/// ```
/// # use lazygrid_kernels::{Algorithm, UnknownName};
/// let unknown: UnknownName = "octree".parse::<Algorithm>().unwrap_err();
/// assert!(unknown.to_string().starts_with("unknown algorithm 'octree'; expected one of auto, naive, "));
/// ```
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("unknown {what} '{name}'; expected one of {known}")]
pub struct UnknownName {
    what: &'static str,
    name: String,
    known: String,
}

impl UnknownName {
    /// For a `name` that is no `what`, where these are `known`.
    pub fn new(what: &'static str, name: &str, known: &[&str]) -> Self {
        Self { what, name: name.to_owned(), known: known.join(", ") }
    }

    /// The name that was given.
    pub fn name(&self) -> &str {
        &self.name
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_runs_on_a_backend_is_named() {
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
    fn names_are_read_back_and_others_refused_by_name() {
        for backend in Backend::ALL {
            assert_eq!(backend.name().parse(), Ok(backend));
        }
        for &algorithm in Algorithm::ALL {
            assert_eq!(algorithm.name().parse(), Ok(algorithm));
        }
        let unknown = "CPU".parse::<Backend>().unwrap_err();
        assert_eq!(unknown.to_string(), "unknown backend 'CPU'; expected one of auto, cpu, gpu");
        assert_eq!(unknown.name(), "CPU");
    }
}
