//! Search frames: `f32` coordinates for `f64` spheres, and for lengths and distances beyond `f32`. A search in a frame
//! finds candidates; [`Space::touch`] decides on the given numbers.
//!
//! # Correctness
//!
//! A frame has an origin `o` and a power of two `s`. It searches a sphere `c, r` as `u = f32((c − o)·s)` with the
//! radius `R = r·s·(1 + 2⁻²⁰) + 2⁻²³`, rounded up.
//!
//! 1. `s` makes all `|c − o|·s` along unbounded axes, and all lengths `L·s`, less than 1. Rounding `u` moves a
//!    center by up to 2⁻²⁵ along an axis, so two centers seem at most √3·2⁻²⁴ farther apart. Rounding `L·s` to a period
//!    adds 2⁻²⁵. The two radii compensate for 4·2⁻²⁴.
//! 2. The relative part of the radii compensates for rounding of the radii, for 5 ulp of error on a GPU, and for
//!    roundings of the decision in `f64`.
//! 3. The decision rounds `cⱼ − cᵢ` by 2⁻⁵³ of itself. Along periodic axes, `s` makes it less than 2²⁰, and the
//!    rounding less than 2⁻³³.
//! 4. A radius above 4 touches everything in the frame, so radii are limited to 4.
//!
//! So every pair that touches in space touches in the frame. Conversely, in an orthogonal frame a pair that touches by
//! more than the [slack](SearchFrame::slack) touches in space and needs no decision:
//!
//! 5. By 1. a distance in the frame is at most √3·3·2⁻²⁵ less than in space. The error of the search's filter, whose
//!    slack in a periodic space is 2⁻²² of the longest axis, is less than that.
//! 6. Two radii together have grown by at most 2⁻²⁰ + 2⁻²² of the cutoff `ρ` (the second term for rounding up) and
//!    1.01·2⁻²². Effective radii that decide may exceed their distance by 2⁻²³ of it.
//! 7. All absolute parts together are at most 2.7·2⁻²²; the slack has 2⁻²⁰. For the relative ones it has 2⁻¹⁹ of the
//!    largest cutoff, of which the decision's own rounding is less than 2⁻⁴⁹.
//!
//! A *trimmed* frame excludes a few far spheres, which would make `s` small and enlarge all radii:
//!
//! 8. Coordinates along unbounded axes are clamped to ±1. Clamping never moves two spheres apart, hence 1. holds.
//!    Differences of clamped coordinates are rounded in proportion to `ρ` if the spheres touch: 2. compensates for it.
//! 9. Clamped spheres that touch in the frame may be far apart in space, so every candidate is decided.
//!
//! In a triclinic frame, `compare::TriclinicFilter` decides most candidates.

mod bounds;
mod map;
mod trim;

use lazygrid_kernels::{Orthogonalization, Space, Sphere, TriclinicCell};

pub(crate) use bounds::Bounds;
pub(crate) use map::FrameMap;
pub(crate) use trim::RowsByIndex;

/// Relative and absolute growth of radii.
const GROWTH: [f64; 2] = [1.0 + 1.0 / (1 << 20) as f64, 1.0 / (1 << 23) as f64];
const MAX_RADIUS: f64 = 4.0;
/// Smallest size of a frame as a fraction of the distance between spheres along a periodic axis.
const MIN_SPREAD: f64 = 1.0 / (1 << 20) as f64;
/// Absolute part of the slack, and the part relative to the largest radius.
const SLACK: [f32; 2] = [1.0 / (1 << 20) as f32, 1.0 / (1 << 18) as f32];
/// Distance from the origin, in lengths of a periodic axis, up to which one subtraction wraps a center.
pub(crate) const MAX_LENGTHS: f64 = 1.5;
/// Filled fraction below which a frame is replaced. A kept frame preserves the radii of moving spheres.
const MIN_FILLED: f64 = 1.0 / 8.0;

/// A map from the given numbers to `f32` coordinates for a search.
#[derive(Clone, Debug, PartialEq)]
pub struct SearchFrame {
    origin: [f64; 3],
    scale: f64,
    axes: Axes,
    is_trimmed: bool,
    /// `true` if the rounding of centers in a triclinic space enlarges radii as little as possible.
    has_least_growth: bool,
}

#[derive(Clone, Debug, PartialEq)]
enum Axes {
    /// Given length, and period in the frame.
    Orthogonal([Option<(f64, f32)>; 3]),
    Triclinic(Orthogonalization),
    /// Axes of `f32` spheres, whose rounding does not depend on bounds.
    TriclinicF32(Orthogonalization),
}

impl SearchFrame {
    pub(crate) fn new(bounds: &Bounds, space: &Space) -> Self {
        let periodic = Self::periodic_axes(space);
        let origin = [0, 1, 2].map(|axis| if periodic[axis] { 0.0 } else { bounds.middle(axis) });
        Self::at(origin, scale_of(Self::size(bounds, space, &origin)), space)
    }

    /// Returns `true` if spheres in `bounds` fit, and fill enough of the frame.
    pub(crate) fn fits(&self, bounds: &Bounds, space: &Space) -> bool {
        (MIN_FILLED..1.0).contains(&(Self::size(bounds, space, &self.origin) * self.scale))
    }

    /// Sets [`has_least_growth`](Self::has_least_growth) for spheres in `bounds`.
    pub(crate) fn with_growth_in(mut self, bounds: &Bounds) -> Self {
        self.has_least_growth = self.grows_least(bounds);
        self
    }

    fn grows_least(&self, bounds: &Bounds) -> bool {
        let largest = [0, 1, 2].map(|axis| bounds.largest_offset(axis, self.origin[axis]));
        self.orthogonalization().is_some_and(|cell| cell.has_least_growth(largest))
    }

    pub(crate) fn has_least_growth(&self) -> bool {
        self.has_least_growth
    }

    /// Returns `None` unless the space is triclinic.
    pub(crate) fn orthogonalization(&self) -> Option<&Orthogonalization> {
        self.cell().map(|(cell, _)| cell)
    }

    /// Returns `true` if the frame represents spheres in `bounds` and all that its map [contains](FrameMap::contains), and
    /// the exact test can decide their pairs. They may fill little of it.
    pub(crate) fn holds(&self, bounds: &Bounds, space: &Space) -> bool {
        if self.has_least_growth && !self.grows_least(bounds) {
            return false;
        }
        if self.is_triclinic_f32() {
            return true;
        }
        if bounds.check_range(space).is_err() {
            return false;
        }
        let mut bounds = if self.is_trimmed { self.without_free_axes(bounds, space) } else { *bounds };
        let periodic = Self::periodic_axes(space);
        for (axis, length) in space.lengths().into_iter().enumerate() {
            if let Some(length) = length.filter(|_| periodic[axis]) {
                let contained = (MAX_LENGTHS * length).min(f64::MAX);
                bounds.min[axis] = bounds.min[axis].min(-contained);
                bounds.max[axis] = bounds.max[axis].max(contained);
            }
        }
        Self::size(&bounds, space, &self.origin) * self.scale < 1.0
    }

    fn periodic_axes(space: &Space) -> [bool; 3] {
        space.triclinic_cell().map_or(space.lengths().map(|length| length.is_some()), |_| [false; 3])
    }

    fn size(bounds: &Bounds, space: &Space, origin: &[f64; 3]) -> f64 {
        let periodic = Self::periodic_axes(space);
        let free =
            |axis: &usize| !periodic[*axis] && space.triclinic_cell().is_none_or(|cell| cell.rank() < 3);
        let extent =
            (0..3).filter(free).map(|axis| bounds.largest_offset(axis, origin[axis])).fold(0.0, f64::max);
        let spread = (0..3).map(|axis| 0.5 * bounds.max[axis] - 0.5 * bounds.min[axis]).fold(0.0, f64::max);
        let box_size = space.triclinic_cell().map_or(0.0, TriclinicCell::longest);
        let lengths = space.lengths().into_iter().flatten().fold(box_size, f64::max);
        let spread = if space.is_periodic() { 2.0 * MIN_SPREAD * spread } else { 0.0 };
        extent.max(lengths).max(spread)
    }

    pub(crate) fn triclinic_f32(cell: &TriclinicCell) -> Self {
        let axes = Axes::TriclinicF32(cell.orthogonal_space(Orthogonalization::SCALE));
        Self {
            origin: [0.0; 3],
            scale: Orthogonalization::SCALE,
            axes,
            is_trimmed: false,
            has_least_growth: false,
        }
    }

    pub(crate) fn is_triclinic_f32(&self) -> bool {
        matches!(self.axes, Axes::TriclinicF32(_))
    }

    fn at(origin: [f64; 3], scale: f64, space: &Space) -> Self {
        let period = |length: f64| ((length * scale) as f32).max(f32::MIN_POSITIVE);
        let axes = match space.triclinic_cell() {
            Some(cell) => Axes::Triclinic(cell.orthogonal_space(scale)),
            None => {
                Axes::Orthogonal(space.lengths().map(|length| length.map(|length| (length, period(length)))))
            }
        };
        Self { origin, scale, axes, is_trimmed: false, has_least_growth: false }
    }

    pub fn space(&self) -> Space {
        match &self.axes {
            Axes::Orthogonal(axes) => {
                let lengths = axes.map(|axis| axis.map(|(_, period)| f64::from(period)));
                Space::periodic(lengths).unwrap_or_default()
            }
            Axes::Triclinic(cell) | Axes::TriclinicF32(cell) => cell.space(),
        }
    }

    /// Returns the cell of a triclinic frame and the largest radius in it.
    fn cell(&self) -> Option<(&Orthogonalization, f64)> {
        match &self.axes {
            Axes::Orthogonal(_) => None,
            Axes::Triclinic(cell) => Some((cell, 2.0 * MAX_RADIUS)),
            Axes::TriclinicF32(cell) => Some((cell, f64::from(f32::MAX))),
        }
    }

    fn is_orthogonal(&self) -> bool {
        matches!(self.axes, Axes::Orthogonal(_))
    }

    /// Returns `true` if spheres that touch by more than the [slack](Self::slack) touch in space.
    pub(crate) fn has_certain_contacts(&self) -> bool {
        self.is_orthogonal() && !self.is_trimmed
    }

    pub fn scale(&self) -> f64 {
        self.scale
    }

    /// Returns `None` if the radius depends on the center.
    pub(crate) fn radius(&self, radius: f64) -> Option<f32> {
        self.is_orthogonal().then(|| searched_radius(radius * self.scale))
    }

    /// Returns the overlap beyond which radii up to `largest` touch in space.
    pub(crate) fn slack(largest: f32) -> f32 {
        let [absolute, relative] = SLACK;
        absolute + relative * largest
    }

    /// Cold, so that loops over vectors keep their registers around the call.
    #[cold]
    #[inline(never)]
    pub(crate) fn sphere(&self, [x, y, z, radius]: [f64; 4]) -> Sphere {
        let [x0, y0, z0] = self.origin;
        let center = [x - x0, y - y0, z - z0];
        let is_valid = (x + y + z).is_finite() && radius.is_finite() && radius >= 0.0;
        // Spheres of other frames are checked by their bounds.
        let is_checked = is_valid || !self.is_triclinic_f32();
        match (&self.axes, self.cell()) {
            (Axes::Orthogonal(axes), _) => {
                let coordinate = |axis: usize| match axes[axis] {
                    None if self.is_trimmed => (center[axis] * self.scale).clamp(-1.0, 1.0) as f32,
                    None => (center[axis] * self.scale) as f32,
                    Some((length, period)) => {
                        let half = 0.5 * period;
                        ((wrap(center[axis], length) * self.scale) as f32).clamp(-half, half)
                    }
                };
                Sphere::new([0, 1, 2].map(coordinate), searched_radius(radius * self.scale))
            }
            (_, Some((cell, limit))) if is_checked => cell.sphere(center, radius, limit),
            _ => Sphere::new([f32::NAN; 3], f32::NAN),
        }
    }
}

#[inline]
fn searched_radius(radius: f64) -> f32 {
    let [relative, absolute] = GROWTH;
    let radius = if radius < MAX_RADIUS { radius } else { MAX_RADIUS };
    // The next larger number of a positive, finite one.
    f32::from_bits(((radius * relative + absolute) as f32).to_bits() + 1)
}

/// Returns a power of two that scales `size` to at least one half and below 1.
fn scale_of(size: f64) -> f64 {
    const FRACTION: u64 = (1 << 52) - 1;
    const EXPONENTS: u64 = 2047;
    if size == 0.0 {
        return 1.0;
    }
    // The smallest sizes stay below one half: their inverse is infinite.
    let exponent = (size.max(4.0 * f64::MIN_POSITIVE).to_bits() & !FRACTION) >> 52;
    // A quarter of twice the inverse, because the inverse is subnormal for the largest sizes.
    0.25 * f64::from_bits((EXPONENTS - exponent) << 52)
}

/// Wraps to within half a length of the origin, without rounding.
#[inline]
fn wrap(x: f64, length: f64) -> f64 {
    let half = 0.5 * length;
    if x.abs() <= MAX_LENGTHS * length {
        // Exact by Sterbenz's lemma: the operands are within a factor of two.
        let image = x - length.copysign(x);
        return if x.abs() <= half { x } else { image };
    }
    let rest = x % length;
    if rest.abs() > half { rest - length.copysign(rest) } else { rest }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_bring_sizes_to_between_one_half_and_one() {
        for exponent in -1019..1024 {
            let size = 2.0_f64.powi(exponent / 2) * 2.0_f64.powi(exponent - exponent / 2);
            for size in [size, 1.3 * size, size.next_down()] {
                let filled = size * scale_of(size);
                assert!((0.5..1.0).contains(&filled), "{size:e}: {filled}");
            }
        }
        assert!((0.5..1.0).contains(&(f64::MAX * scale_of(f64::MAX))));
        assert!(f64::from_bits(1) * scale_of(f64::from_bits(1)) < 1.0);
    }

    #[test]
    fn a_frame_of_no_spheres_represents_later_ones() {
        let cell_vectors = [Some([7.0, 0.0, 0.0]), Some([2.0, 6.0, 0.0]), None];
        for space in [
            Space::UNBOUNDED,
            Space::periodic([Some(10.0), None, None]).expect("a length"),
            Space::triclinic(cell_vectors).expect("two vectors"),
        ] {
            let frame = SearchFrame::new(&Bounds::EMPTY, &space);
            let Sphere { center, radius } = frame.sphere([0.25, -0.5, 0.125, 0.01]);
            assert!(
                center.is_finite() && center != glam::Vec3::ZERO && radius < 0.02,
                "{space:?}: {center} {radius}"
            );
        }
    }

    #[test]
    fn frames_hold_no_spheres_too_far_apart_for_their_cell() {
        let cell_vectors = [[1.0, 0.0, 0.0], [0.5, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let space = Space::triclinic(cell_vectors.map(Some)).expect("a cell");
        let limit = space.triclinic_cell().expect("triclinic").max_component();
        let bounds = |to: f64| {
            let mut bounds = Bounds::EMPTY;
            [0.0, to].into_iter().for_each(|x| bounds.add([x, 0.0, 0.0, 0.0]));
            bounds
        };
        let frame = SearchFrame::new(&bounds(0.9 * limit), &space);
        assert!(frame.holds(&bounds(0.95 * limit), &space) && !frame.holds(&bounds(1.05 * limit), &space));
    }

    #[test]
    fn wrapping_rounds_nothing() {
        for (x, length, expected) in [
            (0.3, 1.0, 0.3),
            (0.75, 1.0, -0.25),
            (-7.5, 10.0, 2.5),
            (1e300, 0.1, 1e300 % 0.1),
            (10.1 * 3.0, 10.1, 10.1 * 3.0 % 10.1),
        ] {
            let wrapped = wrap(x, length);
            let is_image = wrapped == expected || wrapped == expected - length;
            assert!(is_image && wrapped.abs() <= 0.5 * length, "{x} in {length}: {wrapped}");
        }
    }
}
