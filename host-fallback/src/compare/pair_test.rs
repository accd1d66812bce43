use std::borrow::Cow;

use glam::{DVec3, Vec3};
use lazygrid_kernels::{Interaction, Interactions, Space, SpeciesRadius, Spheres};

use super::triclinic_filter::TriclinicFilter;
use super::{PairFilter, PeriodicBox, Xyzr};
use crate::frame::SearchFrame;
use crate::species_classes::SpeciesClasses;

/// Tests in `f64`, where differences of `f32` coordinates cannot overflow, underflow or lose deciding digits. Minimum
/// images are exact: wrapped centers are at most a length apart along an axis, and subtracting their distance from the
/// length does not round.
#[inline]
fn within(lengths: Option<DVec3>, a: Vec3, b: Vec3, cutoff: f64) -> bool {
    let mut d = a.as_dvec3() - b.as_dvec3();
    if let Some(lengths) = lengths {
        d = d.abs().min(lengths - d.abs());
    }
    d.x * d.x + d.y * d.y + d.z * d.z <= cutoff * cutoff
}

/// Largest radius for which contact may be certain: the square of twice this radius is finite in `f32`.
const MAX_CERTAIN_RADIUS: f32 = (1_u64 << 62) as f32;

/// Tests pairs or, with a skin margin, candidates.
#[derive(Clone, Debug)]
pub(crate) struct PairTest<'a> {
    spheres: Spheres<'a>,
    species: Option<Species<'a>>,
    space: Space,
    /// Infinite for an unbounded axis; `None` if all are unbounded.
    lengths: Option<DVec3>,
    margin: Option<SkinMargin<'a>>,
    filter: Option<&'a PairFilter<'a>>,
    frame: Option<&'a SearchFrame>,
    triclinic: Option<TriclinicFilter>,
    /// Certain contacts need no test.
    is_plain: bool,
    /// Squared cutoffs may be infinite in `f32`, so no contact is certain.
    overflows: bool,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct SphereRadii {
    pub(crate) center: Vec3,
    pub(crate) own: f32,
    pub(crate) effective: f32,
    pub(crate) margin: f32,
    pub(crate) widened: f32,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct SkinMargin<'a> {
    pub(crate) limits: &'a SpeciesClasses,
    /// `None` if columns contain ids instead of sorted positions.
    pub(crate) order: Option<&'a [u32]>,
}

#[derive(Clone, Debug)]
struct Species<'a> {
    table: &'a Interactions,
    ids: &'a [u32],
    species_radii: Cow<'a, [SpeciesRadius]>,
}

/// Rounds up, because candidates must include every possible pair.
#[inline(always)]
fn widened(radius: f32, margin: f32) -> f32 {
    (radius + margin).next_up()
}

impl<'a> PairTest<'a> {
    /// Species ids must have been checked.
    pub(crate) fn new(spheres: Spheres<'a>, interactions: Option<&'a Interactions>) -> Self {
        #[expect(clippy::disallowed_methods, reason = "a table has at most 4096 species")]
        let species_radii =
            |table: &Interactions| (0..table.species()).map(|s| table.species_radius(s)).collect();
        Self::with_species_radii(spheres, interactions.map(|table| (table, Cow::Owned(species_radii(table)))))
    }

    pub(crate) fn with_present_species(
        spheres: Spheres<'a>,
        table: Option<(&'a Interactions, &'a [SpeciesRadius])>,
    ) -> Self {
        Self::with_species_radii(
            spheres,
            table.map(|(table, species_radii)| (table, Cow::Borrowed(species_radii))),
        )
    }

    fn with_species_radii(
        spheres: Spheres<'a>,
        table: Option<(&'a Interactions, Cow<'a, [SpeciesRadius]>)>,
    ) -> Self {
        let with_ids = table.zip(spheres.species());
        let species = with_ids.map(|((table, species_radii), ids)| Species { table, ids, species_radii });
        let (space, is_plain) = (Space::UNBOUNDED, species.is_none());
        let (lengths, margin, filter, frame, triclinic) = Default::default();
        Self {
            spheres,
            species,
            space,
            lengths,
            margin,
            filter,
            frame,
            triclinic,
            is_plain,
            overflows: false,
        }
    }

    pub(crate) fn filtered(self, filter: Option<&'a PairFilter<'a>>, frame: Option<&'a SearchFrame>) -> Self {
        // Orthogonalized coordinates, trimmed frames and effective radii leave every contact uncertain.
        let is_by_radii = filter.is_none_or(PairFilter::is_contact_of_radii);
        let is_certain = frame.is_none_or(SearchFrame::has_certain_contacts) && is_by_radii;
        let triclinic = frame.and_then(|frame| TriclinicFilter::for_candidates(frame, filter));
        Self { filter, frame, triclinic, is_plain: self.is_plain && is_certain, ..self }
    }

    pub(crate) fn in_space(self, space: Space) -> Self {
        let lengths = space.lengths().map(|length| length.unwrap_or(f64::INFINITY));
        Self { space, lengths: space.is_periodic().then_some(lengths.into()), ..self }
    }

    pub(crate) fn with_radii_up_to(self, largest: f32) -> Self {
        let overflows = largest > MAX_CERTAIN_RADIUS;
        Self { overflows, is_plain: self.is_plain && !overflows, ..self }
    }

    pub(crate) fn widened(&self, margin: SkinMargin<'a>) -> Self {
        let largest = margin.limits.numbers().fold(0.0, f32::max);
        let triclinic = self.triclinic.map(|filter| filter.widened(largest));
        Self { margin: Some(margin), triclinic, ..self.clone() }
    }

    pub(crate) fn triclinic(&self) -> Option<&TriclinicFilter> {
        self.triclinic.as_ref()
    }

    pub(crate) fn space(&self) -> &Space {
        &self.space
    }

    pub(crate) fn periodic_box(&self, largest: f32) -> Option<PeriodicBox> {
        match self.frame.is_some_and(SearchFrame::has_certain_contacts) {
            true => Some(PeriodicBox::from_frame(&self.space, largest)),
            false => PeriodicBox::from_space(&self.space),
        }
    }

    /// Converts to search coordinates.
    pub(crate) fn searched(&self, distance: f64) -> f32 {
        (distance * self.frame.map_or(1.0, SearchFrame::scale)) as f32
    }

    pub(crate) fn lengths(&self) -> [Option<f32>; 3] {
        self.space.lengths_f32()
    }

    pub(crate) fn spheres(&self) -> Spheres<'a> {
        self.spheres
    }

    #[inline(always)]
    pub(crate) fn has_margin(&self) -> bool {
        self.margin.is_some()
    }

    #[inline(always)]
    pub(crate) fn species_radii(&self) -> Option<(&'a [u32], &[SpeciesRadius])> {
        self.species.as_ref().map(|species| (species.ids, &*species.species_radii))
    }

    pub(crate) fn species_count(&self) -> u32 {
        self.species.as_ref().map_or(0, |species| species.table.species())
    }

    #[inline(always)]
    pub(crate) fn species_of(&self, id: u32) -> u32 {
        self.species.as_ref().map_or(0, |species| species.ids[id as usize])
    }

    #[inline(always)]
    pub(crate) fn is_plain(&self) -> bool {
        self.is_plain
    }

    #[inline(always)]
    pub(crate) fn effective(&self, id: u32) -> (Vec3, f32) {
        let SphereRadii { center, widened, .. } = self.radii(id);
        (center, widened)
    }

    #[inline(always)]
    pub(crate) fn radii(&self, id: u32) -> SphereRadii {
        let sphere = self.spheres.get(id as usize);
        let (species, effective) = match &self.species {
            None => (0, sphere.radius),
            Some(s) => {
                let species = s.ids[id as usize];
                (species, s.species_radii[species as usize].effective.for_radius(sphere.radius))
            }
        };
        let (margin, widened) = match &self.margin {
            None => (0.0, effective),
            Some(margin) => {
                let margin = margin.limits.get(species, effective);
                (margin, widened(effective, margin))
            }
        };
        SphereRadii { center: sphere.center, own: sphere.radius, effective, margin, widened }
    }

    /// Returns a radius that covers the distances of `species_radius`, with the skin margin.
    #[inline]
    pub(crate) fn radius_within(&self, id: u32, species_radius: SpeciesRadius) -> f32 {
        let SphereRadii { own, effective, margin, widened: most, .. } = self.radii(id);
        let radius = match self.frame {
            // The own radius may grow while candidates are kept; in a frame it is unknown.
            _ if species_radius.effective.touches && (self.has_margin() || self.frame.is_some()) => effective,
            None => species_radius.effective.for_radius(own),
            Some(frame) => frame.radius(species_radius.largest_half).unwrap_or(effective),
        };
        if self.has_margin() { widened(radius, margin).min(most) } else { radius.min(most) }
    }

    /// Contact of effective radii decides, unless a filter or frame requires more.
    pub(crate) fn decided_by_radii(&mut self) {
        self.is_plain = !self.overflows
            && self.frame.is_none_or(SearchFrame::has_certain_contacts)
            && self.filter.is_none_or(PairFilter::is_contact);
    }

    pub(crate) fn frame(&self) -> Option<&'a SearchFrame> {
        self.frame
    }

    #[inline(always)]
    pub(crate) fn row(&self, id: u32) -> Xyzr {
        let (center, radius) = self.effective(id);
        [center.x, center.y, center.z, radius]
    }

    /// Returns `None` if the search is for pairs.
    #[inline(always)]
    pub(crate) fn is_candidate(&self, i: u32, j: u32) -> Option<bool> {
        let order = self.margin?.order?;
        let ids = |species: &Species<'_>| [i, j].map(|at| species.ids[order[at as usize] as usize]);
        Some(self.species.as_ref().is_none_or(|species| {
            let [i, j] = ids(species);
            species.table.get(i, j) != Interaction::Never
        }))
    }

    pub(crate) fn is_pair(&self, i: u32, j: u32) -> bool {
        match self.filter {
            None => self.touch(i, j),
            Some(filter) if filter.decides_contact() => filter.accepts(i, j),
            Some(filter) => self.touch(i, j) && filter.accepts(i, j),
        }
    }

    fn touch(&self, i: u32, j: u32) -> bool {
        let (a, b) = (self.spheres.get(i as usize), self.spheres.get(j as usize));
        let radii = f64::from(a.radius) + f64::from(b.radius);
        let cutoff = match &self.species {
            None => Some(radii),
            Some(s) => s.table.get(s.ids[i as usize], s.ids[j as usize]).cutoff(radii),
        };
        cutoff.is_some_and(|cutoff| within(self.lengths, a.center, b.center, cutoff))
    }
}
