//! Neighbor lists with geometry: chooses the search that finds their pairs, and owns the buffers of the lists.

use std::time::Instant;

use lazygrid_host::{
    Contact, HostDetector, Images, ListOptions, NeighborList, NeighborListBuilder, Order, Phase, Settings,
    Skin, check,
};
use lazygrid_kernels::{Algorithm, Query, Space};

use crate::detector::Engine;
use crate::{Error, Report};

/// The buffers of neighbor lists, and the search for pairs of spheres and images.
#[derive(Debug, Default)]
pub(crate) struct Geometry {
    builder: NeighborListBuilder,
    images: Images,
    /// Finds the pairs of spheres and images. It runs on the CPU, where pairs are decided in `f64` anyway; boxes that need it
    /// rarely hold many spheres.
    image_search: Option<HostDetector>,
    report: Option<Report>,
}

impl Geometry {
    /// Finds the pairs of a query with all images within reach, and builds their list.
    pub(crate) fn neighbor_list(
        &mut self,
        engine: &mut Engine,
        query: &Query<'_>,
        options: ListOptions,
    ) -> Result<NeighborList<'_>, Error> {
        self.report = None;
        let Settings { space, interactions, .. } = engine.settings();
        let contact = Contact { query, space, table: interactions.as_ref() };
        let are_needed = Images::are_needed(&contact);
        if are_needed {
            return self.among_images(engine, query, options);
        }
        engine.list(query)?;
        let start = Instant::now();
        let Settings { space, interactions, .. } = engine.settings();
        let contact = Contact { query, space, table: interactions.as_ref() };
        let list = self.builder.build(contact, (engine.last_pairs(), None), options, engine.team())?;
        Phase::add(engine.phases_mut(), "neighbors", start.elapsed());
        Ok(list)
    }

    /// The same of a box in which more than the nearest image of a sphere may be within reach.
    fn among_images(
        &mut self,
        engine: &Engine,
        query: &Query<'_>,
        options: ListOptions,
    ) -> Result<NeighborList<'_>, Error> {
        let Self { builder, images, image_search, report } = self;
        let settings = engine.settings();
        let contact = Contact { query, space: &settings.space, table: settings.interactions.as_ref() };
        engine.team().pass(query.len(), |threads| Ok(check(query, contact.table, threads)?))?;
        let start = Instant::now();
        images.build(&contact)?;
        let made = start.elapsed();
        let detector = match image_search {
            Some(detector) => detector,
            None => image_search.insert(HostDetector::new(among_images(settings))?),
        };
        detector.list(&images.query(), Order::Canonical)?;
        let start = Instant::now();
        let list = builder.build(contact, (detector.last_pairs(), Some(images)), options, engine.team())?;
        Phase::add(detector.phases_mut(), "images", made);
        Phase::add(detector.phases_mut(), "neighbors", start.elapsed());
        let found = Report::from(detector.report());
        let reason = format!("{}; more than the nearest images are within reach", found.reason);
        *report = Some(Report { spheres: query.len() as u64, reason, ..found });
        Ok(list)
    }

    /// Forgets the report: another call begins.
    pub(crate) fn end(&mut self) {
        self.report = None;
    }

    /// What the last call did, if it was answered with more than the nearest images.
    pub(crate) fn report(&self) -> Option<&Report> {
        self.report.as_ref()
    }
}

/// The settings of the search between spheres and images: that of `settings` in unbounded space.
fn among_images(settings: &Settings) -> Settings {
    let Settings { order, simd, threads, tau, raster_ratio, max_pairs, stop, .. } = settings;
    Settings {
        algorithm: Algorithm::Auto,
        order: *order,
        simd: *simd,
        threads: *threads,
        tau: *tau,
        raster_ratio: *raster_ratio,
        max_pairs: *max_pairs,
        interactions: None,
        space: Space::UNBOUNDED,
        skin: Skin::Off,
        stop: stop.clone(),
    }
}
