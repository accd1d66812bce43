use std::ops::ControlFlow;

use lazygrid_host::{HostBackend, Neighbors};
use lazygrid_kernels::{MAX_SPHERES, Pair, Query};

use crate::backend::BackendFinder;
#[cfg(feature = "gpu")]
use crate::backend::DetectorBackend;
use crate::geometry::Geometry;
#[cfg(feature = "gpu")]
use crate::gpu::SoftwareAdapter;
#[cfg(feature = "gpu")]
use crate::gpu_backend::{AutoBackend, GpuBackend};
use crate::{Config, Error, ListOptions, NeighborList, Report, choice};

/// Returns all overlapping pairs in canonical order, with default settings.
///
/// Programs with more than one call should keep a [`Detector`].
///
/// # Errors
/// See [`Detector::pairs`].
pub fn detect<'a>(query: impl Into<Query<'a>>) -> Result<Vec<Pair>, Error> {
    let mut detector = Detector::new(Config::default())?;
    detector.pairs(query)?;
    Ok(detector.into_pairs())
}

/// Finds overlapping pairs and reuses its buffers between calls.
#[derive(Debug)]
pub struct Detector {
    finder: BackendFinder,
    backend_reason: String,
    geometry: Box<Geometry>,
}

#[cfg(feature = "gpu")]
fn finder(config: Config) -> Result<(BackendFinder, String), Error> {
    let open = |allows_software: bool| {
        let software = if allows_software { SoftwareAdapter::Allow } else { SoftwareAdapter::Refuse };
        config.shared_device(software).map(|gpu| (gpu.adapter.name.clone(), gpu))
    };
    let requested = choice::resolve_backend(config.backend, config.adapter.as_ref())?;
    choice::check_timeout(requested, config.timeout)?;
    let (gpu, mut reason) = choice::backend(requested, config.settings.algorithm, open)?;
    if gpu.is_none() && config.timeout.is_some() {
        reason += ", where the timeout of GPU submissions has no effect";
    }
    let backend: Box<dyn DetectorBackend> = match gpu {
        Some(gpu) if choice::is_per_call(requested, config.settings.algorithm) => {
            Box::new(AutoBackend::new(gpu, config)?)
        }
        Some(gpu) => Box::new(GpuBackend::new(gpu, config)?),
        None => Box::new(HostBackend::new(config.settings)?),
    };
    Ok((BackendFinder::on(backend), reason))
}

#[cfg(not(feature = "gpu"))]
fn finder(config: Config) -> Result<(BackendFinder, String), Error> {
    let none = |_| Err::<(String, ()), _>(Error::WithoutGpu);
    let (_, reason) = choice::backend(config.backend, config.settings.algorithm, none)?;
    Ok((BackendFinder::on(Box::new(HostBackend::new(config.settings)?)), reason))
}

impl Detector {
    /// Creates a detector. With [`Backend::Auto`](crate::Backend::Auto) and a GPU, each call chooses its backend.
    ///
    /// # Errors
    /// [`Error::GpuUnavailable`] if a requested GPU cannot be used; [`Error::NotOnBackend`] if the backend lacks the
    /// algorithm; [`Error::InvalidSetting`]; [`Error::UnknownAdapter`]; [`Error::AdapterOnCpu`] if an adapter is named
    /// for the CPU, and [`Error::TimeoutOnCpu`] for a time limit; [`Error::ThreadPool`]; [`Error::LimitExceeded`] for a
    /// table of interactions above a limit of the device.
    pub fn new(config: Config) -> Result<Self, Error> {
        let (finder, backend_reason) = finder(config)?;
        log::info!("{backend_reason}");
        Ok(Self { finder, backend_reason, geometry: Box::default() })
    }

    /// Returns the overlapping pairs, each once, in the configured order.
    ///
    /// For two sets, only pairs across them are found: `i` is an index of the first set, `j` of the second.
    ///
    /// ```
    /// use lazygrid::{Config, Detector, Pair, Sphere};
    ///
    /// let carriers = [0.0, 0.1, 9.0].map(|x| Sphere::new([x, 0.0, 0.0], 0.05));
    /// let receivers = [8.0, 0.0].map(|x| Sphere::new([x, 0.0, 0.0], 0.1));
    /// let mut detector = Detector::new(Config::default())?;
    /// assert_eq!(detector.pairs(&carriers)?, [Pair { i: 0, j: 1 }]);
    /// assert_eq!(detector.pairs((&carriers, &receivers))?, [Pair { i: 0, j: 1 }, Pair { i: 1, j: 1 }]);
    /// # Ok::<(), lazygrid::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Input`] names the first invalid sphere, in [`InputError::SecondSet`](crate::InputError::SecondSet) if
    /// it is in the second set, and spheres too far apart for a triclinic cell; [`Error::TooManyPairs`] above
    /// [`Config::max_pairs`], with the exact number; [`Error::OutOfMemory`]. On a GPU also [`Error::LimitExceeded`],
    /// [`Error::DeviceOutOfMemory`], [`Error::DeviceLost`] and [`Error::Timeout`].
    pub fn pairs<'a>(&mut self, query: impl Into<Query<'a>>) -> Result<&[Pair], Error> {
        self.finder().pairs(query)
    }

    /// Returns the neighbors of every sphere, ascending; each pair is in both lists. For two sets, spheres of the first
    /// list their neighbors in the second.
    ///
    /// # Errors
    /// See [`pairs`](Self::pairs).
    pub fn neighbors<'a>(&mut self, query: impl Into<Query<'a>>) -> Result<Neighbors<'_>, Error> {
        self.finder().neighbors(query)
    }

    /// Returns neighbor lists with the shifts, vectors and distances that `options` request.
    ///
    /// Unlike other searches, this one finds all images within the cutoff, in a smaller box also a sphere's own.
    /// Exclusions apply to all images. `i` and `j` are neighbors at shift `S` if `v = (cⱼ − cᵢ) + (S₁e₁ + S₂e₂ + S₃e₃)`
    /// is at most their cutoff long. `v` is computed in `f64` on any backend, but a GPU decides `f32` pairs as for
    /// [`pairs`](Self::pairs). The order is canonical.
    ///
    /// ```
    /// use lazygrid::{Config, Detector, ListOptions, Radii, Space, Spheres};
    ///
    /// // One atom of a cubic crystal with 6 neighbors, all of which are its own images.
    /// let mut detector = Detector::new(Config::default().space(Space::periodic([Some(2.5); 3])?))?;
    /// let atom = [[0.0_f64; 3]];
    /// let within_3 = Spheres::points(&atom, Radii::All(1.5))?;
    /// let list = detector.neighbor_list(within_3, ListOptions::full().shifts().distances())?;
    /// assert_eq!((list.shifts()[0], list.distances()), ([-1, 0, 0], &[2.5; 6][..]));
    /// # Ok::<(), lazygrid::Error>(())
    /// ```
    ///
    /// # Errors
    /// See [`pairs`](Self::pairs); [`Config::max_pairs`] also limits the examined pairs of a sphere and an image.
    /// [`InputError::Images`](crate::InputError::Images) and [`InputError::Shift`](crate::InputError::Shift) for
    /// cutoffs or coordinates too large for the box.
    pub fn neighbor_list<'a>(
        &mut self,
        query: impl Into<Query<'a>>,
        options: ListOptions,
    ) -> Result<NeighborList<'_>, Error> {
        self.geometry.neighbor_list(&mut self.finder, &query.into(), options)
    }

    /// Returns the number of pairs.
    ///
    /// # Errors
    /// See [`pairs`](Self::pairs), except [`Error::TooManyPairs`].
    pub fn count<'a>(&mut self, query: impl Into<Query<'a>>) -> Result<u64, Error> {
        self.finder().count(query)
    }

    /// Passes the pairs to `consume` in chunks of at most `chunk` pairs, in bounded memory, and returns their number.
    /// `consume` may stop the search with `ControlFlow::Break`.
    ///
    /// In canonical order the whole stream is sorted; each further [`Config::max_pairs`] pairs then cost one more
    /// search. If that would be more than 16 searches, parts are larger, up to a quarter of the number of spheres.
    /// Unordered chunks may arrive from another thread, one at a time. `consume` must not wait for work of the same
    /// rayon pool, whose threads may wait for it; a detector with its own pool may search.
    ///
    /// # Errors
    /// See [`count`](Self::count).
    pub fn stream<'a, F>(
        &mut self,
        query: impl Into<Query<'a>>,
        chunk: usize,
        consume: F,
    ) -> Result<u64, Error>
    where
        F: FnMut(&[Pair]) -> ControlFlow<()> + Send,
    {
        self.finder().stream(query, chunk, consume)
    }

    /// Returns the report of the last call; before the first call, the backend and its reason.
    pub fn report(&self) -> Report {
        let geometry = self.geometry.report().cloned();
        let mut report = geometry.unwrap_or_else(|| self.finder.backend().report());
        report.prepend_reason(&self.backend_reason);
        report
    }

    fn finder(&mut self) -> &mut BackendFinder {
        self.geometry.clear_report();
        &mut self.finder
    }

    /// Estimates the bytes that this detector holds for `spheres` spheres (at most
    /// [`MAX_SPHERES`](crate::MAX_SPHERES)), without the result. On the CPU this is an upper bound for one set in `f32`
    /// rows or columns, apart from 16 KiB. Copies of two sets, `f64` and strided input take up to 23 bytes more per
    /// sphere. On a GPU, the estimate includes the host's copy in a triclinic cell or a box whose lengths are no `f32`
    /// numbers. Neighbor lists take memory in proportion to the neighbors.
    ///
    /// Unless the skin is [`Off`](crate::Skin::Off), the estimate includes the maximum number of candidates: on the CPU
    /// 96 per sphere (768 bytes), although few scenes exceed ten.
    ///
    /// On a GPU the estimate has eight (cell, sphere) entries of 16 bytes per sphere, the maximum on one level. Crowded
    /// spheres of many sizes may need more (ten sizes at one point: about 44), which later estimates include.
    pub fn memory_for(&self, spheres: u64) -> u64 {
        self.finder.backend().memory_for(spheres.min(MAX_SPHERES), false)
    }

    /// Estimates the bytes for `f64` spheres in rows or columns like [`memory_for`](Self::memory_for).
    #[doc(hidden)]
    pub fn memory_for_f64(&self, spheres: u64) -> u64 {
        self.finder.backend().memory_for(spheres.min(MAX_SPHERES), true)
    }

    /// Returns the list of the last call, if that was [`pairs`](Self::pairs), without a copy.
    pub fn into_pairs(self) -> Vec<Pair> {
        self.finder.into_pairs()
    }
}
