use std::time::Instant;

use lazygrid_host::{
    ContactTest, FoundPairs, HostDetector, ListOptions, NeighborList, NeighborListBuilder, Order,
    PeriodicImages, PhaseTime, SearchBackend, Settings, Skin, check,
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
        finder: &mut BackendFinder,
        query: &Query<'_>,
        options: ListOptions,
    ) -> Result<NeighborList<'_>, Error> {
        self.report = None;
        if PeriodicImages::are_needed(&contact(query, finder.backend().settings())) {
            return self.list_among_images(finder, query, options);
        }
        finder.list(query, Order::Canonical)?;
        let start = Instant::now();
        let backend = finder.backend();
        let contact = contact(query, backend.settings());
        let found = FoundPairs { pairs: finder.last_pairs(), images: None };
        let list = self.builder.build(contact, found, options, backend.team())?;
        PhaseTime::add(finder.phases_mut(), "neighbors", start.elapsed());
        Ok(list)
    }

    fn list_among_images(
        &mut self,
        finder: &BackendFinder,
        query: &Query<'_>,
        options: ListOptions,
    ) -> Result<NeighborList<'_>, Error> {
        let Self { builder, images, image_search, report } = self;
        let (settings, team) = (finder.backend().settings(), finder.backend().team());
        let contact = contact(query, settings);
        team.pass(query.len(), |threads| Ok(check(query, contact.table, threads)?))?;
        let start = Instant::now();
        images.build(&contact)?;
        let image_time = start.elapsed();
        let detector = match image_search {
            Some(detector) => detector,
            None => image_search.insert(HostDetector::new(image_search_settings(settings))?),
        };
        detector.list(&images.query(), Order::Canonical)?;
        let start = Instant::now();
        let found = FoundPairs { pairs: detector.last_pairs(), images: Some(images) };
        let list = builder.build(contact, found, options, team)?;
        PhaseTime::add(detector.phases_mut(), "images", image_time);
        PhaseTime::add(detector.phases_mut(), "neighbors", start.elapsed());
        let found = Report::from(detector.report());
        let reason = format!("{}; images beyond the minimum image are within the cutoff", found.reason);
        *report = Some(Report { spheres: query.len() as u64, reason, ..found });
        Ok(list)
    }

    pub(crate) fn clear_report(&mut self) {
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

fn image_search_settings(settings: &Settings) -> Settings {
    Settings {
        algorithm: Algorithm::Auto,
        interactions: None,
        space: Space::UNBOUNDED,
        skin: Skin::Off,
        ..settings.clone()
    }
}
