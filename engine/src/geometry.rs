use std::time::Instant;

use lazygrid_host::{
    ContactTest, HostDetector, ListOptions, NeighborList, NeighborListBuilder, Order, PeriodicImages,
    PhaseTime, SearchBackend, Settings, Skin, check,
};
use lazygrid_kernels::{Algorithm, Query, Space};

use crate::backend::BackendFinder;
use crate::{Error, Report};

#[derive(Debug, Default)]
pub(crate) struct Geometry {
    builder: NeighborListBuilder,
    images: PeriodicImages,
    /// Runs on the CPU, because `f64` decides pairs.
    image_search: Option<HostDetector>,
    report: Option<Report>,
}

impl Geometry {
    pub(crate) fn neighbor_list(
        &mut self,
        engine: &mut BackendFinder,
        query: &Query<'_>,
        options: ListOptions,
    ) -> Result<NeighborList<'_>, Error> {
        self.report = None;
        if PeriodicImages::are_needed(&contact(query, engine.backend().settings())) {
            return self.among_images(engine, query, options);
        }
        engine.list(query, Order::Canonical)?;
        let start = Instant::now();
        let backend = engine.backend();
        let contact = contact(query, backend.settings());
        let list = self.builder.build(contact, (engine.last_pairs(), None), options, backend.team())?;
        PhaseTime::add(engine.phases_mut(), "neighbors", start.elapsed());
        Ok(list)
    }

    fn among_images(
        &mut self,
        engine: &BackendFinder,
        query: &Query<'_>,
        options: ListOptions,
    ) -> Result<NeighborList<'_>, Error> {
        let Self { builder, images, image_search, report } = self;
        let (settings, team) = (engine.backend().settings(), engine.backend().team());
        let contact = contact(query, settings);
        team.pass(query.len(), |threads| Ok(check(query, contact.table, threads)?))?;
        let start = Instant::now();
        images.build(&contact)?;
        let made = start.elapsed();
        let detector = match image_search {
            Some(detector) => detector,
            None => image_search.insert(HostDetector::new(among_images(settings))?),
        };
        detector.list(&images.query(), Order::Canonical)?;
        let start = Instant::now();
        let list = builder.build(contact, (detector.last_pairs(), Some(images)), options, team)?;
        PhaseTime::add(detector.phases_mut(), "images", made);
        PhaseTime::add(detector.phases_mut(), "neighbors", start.elapsed());
        let found = Report::from(detector.report());
        let reason = format!("{}; more than the nearest images are within reach", found.reason);
        *report = Some(Report { spheres: query.len() as u64, reason, ..found });
        Ok(list)
    }

    pub(crate) fn end(&mut self) {
        self.report = None;
    }

    pub(crate) fn report(&self) -> Option<&Report> {
        self.report.as_ref()
    }
}

fn contact<'a>(query: &'a Query<'a>, settings: &'a Settings) -> ContactTest<'a> {
    let Settings { space, interactions, stop, .. } = settings;
    ContactTest { query, space, table: interactions.as_ref(), stop: stop.as_deref() }
}

fn among_images(settings: &Settings) -> Settings {
    Settings {
        algorithm: Algorithm::Auto,
        interactions: None,
        space: Space::UNBOUNDED,
        skin: Skin::Off,
        ..settings.clone()
    }
}
