use lazygrid::Space;

use crate::Error;
use crate::model::vessel::Vessel;

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Axis {
    #[default]
    Open,
    /// Walls, in µm, that reflect the surfaces of spheres.
    Reflecting { low: f32, high: f32 },
    /// Periodic: `high` is the same position as `low`, in µm.
    Periodic { low: f32, high: f32 },
    /// Absent: every coordinate is 0.
    Frozen,
}

impl Axis {
    /// Returns the interval for centers of spheres of this radius.
    #[inline(always)]
    pub fn inset(self, radius: f32) -> Self {
        match self {
            Self::Reflecting { low, high } => Self::Reflecting { low: low + radius, high: high - radius },
            other => other,
        }
    }

    #[inline(always)]
    pub fn confine(self, x: f32) -> f32 {
        match self {
            Self::Open => x,
            Self::Frozen => 0.0,
            // Coordinates inside are unchanged, bit for bit.
            Self::Reflecting { low, high } if x >= low && x <= high => x,
            Self::Periodic { low, high } if x >= low && x < high => x,
            Self::Reflecting { low, high } => {
                let length = high - low;
                let y = round_trip(x - low, length);
                (low + (length - (length - y).abs())).clamp(low, high)
            }
            Self::Periodic { low, high } => {
                let length = high - low;
                let shifted = x - length * ((x - low) / length).floor();
                // A comparison with NaN is false, so paths beyond the range of `f32` stay non-finite.
                if shifted < low || shifted >= high { low } else { shifted }
            }
        }
    }

    /// Returns `true` if an odd number of reflections reverses a path that would end at `x` without walls.
    #[inline(always)]
    pub fn reverses(self, x: f32) -> bool {
        match self {
            Self::Reflecting { low, high } if x < low || x > high => {
                let length = high - low;
                round_trip(x - low, length) > length
            }
            _ => false,
        }
    }

    /// Returns the length of a periodic axis, in µm, or 0 for another.
    #[inline]
    pub(crate) fn period(self) -> f32 {
        match self {
            Self::Periodic { low, high } => high - low,
            _ => 0.0,
        }
    }

    #[inline]
    pub(crate) fn plane_images(self, position: f32) -> impl Iterator<Item = f32> {
        let images: &[f32] = match self {
            Self::Periodic { .. } => &[-1.0, 0.0, 1.0],
            _ => &[0.0],
        };
        let period = self.period();
        images.iter().map(move |image| position + image * period)
    }

    /// Returns the minimum image of a displacement.
    pub(crate) fn displacement_exact(self, d: f64) -> f64 {
        match self {
            Self::Periodic { low, high } => {
                let length = f64::from(high - low);
                // Few displacements need the slow division.
                if 2.0 * d.abs() < length { d } else { d - length * (d / length).round() }
            }
            _ => d,
        }
    }

    /// Returns the minimum image of a displacement.
    #[inline(always)]
    pub fn displacement(self, d: f32) -> f32 {
        match self {
            Self::Periodic { low, high } => {
                let length = high - low;
                d - length * (d / length + 0.5).floor()
            }
            _ => d,
        }
    }
}

/// Reduces a displacement modulo `2 * length`; results above `length` are on the return path.
#[inline(always)]
fn round_trip(displacement: f32, length: f32) -> f32 {
    displacement - 2.0 * length * (displacement / (2.0 * length)).floor()
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Boundary {
    pub axes: [Axis; 3],
    /// Vessel around all particles. Axes across it must be open.
    pub vessel: Option<Vessel>,
}

impl Boundary {
    pub fn reflecting(low: [f32; 3], high: [f32; 3]) -> Self {
        let axes = std::array::from_fn(|k| Axis::Reflecting { low: low[k], high: high[k] });
        Self { axes, vessel: None }
    }

    /// Returns the length of the shortest periodic axis, in µm.
    pub(crate) fn shortest_period(&self) -> Option<f32> {
        self.axes.map(Axis::period).into_iter().filter(|&period| period > 0.0).min_by(f32::total_cmp)
    }

    pub fn periodic(low: [f32; 3], high: [f32; 3]) -> Self {
        let axes = std::array::from_fn(|k| Axis::Periodic { low: low[k], high: high[k] });
        Self { axes, vessel: None }
    }

    pub fn is_unbounded(&self) -> bool {
        self.axes == [Axis::Open; 3] && self.vessel.is_none()
    }

    pub(crate) fn faulty_axis(&self) -> Option<String> {
        let is_faulty = |axis: &Axis| match *axis {
            Axis::Reflecting { low, high } | Axis::Periodic { low, high } => {
                !(low < high && (high - low).is_finite())
            }
            Axis::Open | Axis::Frozen => false,
        };
        self.axes.iter().find(|axis| is_faulty(axis)).map(|axis| {
            format!("the boundary has the axis {axis:?}; make its ends and their distance finite, and `high` larger")
        })
    }

    pub fn dimensions(&self) -> usize {
        self.axes.iter().filter(|axis| **axis != Axis::Frozen).count()
    }

    pub(crate) fn along(&self) -> Option<usize> {
        self.vessel.and_then(|vessel| vessel.along)
    }

    pub(crate) fn flattened(&self, v: [f32; 3]) -> [f32; 3] {
        std::array::from_fn(|k| if self.axes[k] == Axis::Frozen { 0.0 } else { v[k] })
    }

    /// Projects a uniform direction onto the dimensions of the run, in which it stays uniform.
    pub(crate) fn direction_within(&self, direction: [f32; 3]) -> [f32; 3] {
        if self.dimensions() == 3 {
            return direction;
        }
        let flat = self.flattened(direction);
        let length = flat.iter().map(|c| c * c).sum::<f32>().sqrt().max(f32::MIN_POSITIVE);
        flat.map(|c| c / length)
    }

    /// Returns the space that the detector searches.
    ///
    /// # Errors
    /// [`Error::Detection`] if a periodic box has no extent.
    pub fn space(&self) -> Result<Space, Error> {
        let lengths = self.axes.map(|axis| match axis {
            Axis::Periodic { low, high } => Some(f64::from(high - low)),
            _ => None,
        });
        Ok(Space::periodic(lengths).map_err(lazygrid::Error::from)?)
    }

    #[inline(always)]
    pub fn inset(&self, radius: f32) -> Self {
        Self {
            axes: self.axes.map(|axis| axis.inset(radius)),
            vessel: self.vessel.map(|vessel| vessel.inset(radius)),
        }
    }

    /// Returns the first direction too narrow for a sphere of this radius, and the distance of its walls in µm.
    pub fn too_narrow(&self, radius: f32) -> Option<(&'static str, f32)> {
        let inset = self.inset(radius);
        let walls = ["along x", "along y", "along z"].into_iter().zip(self.axes.into_iter().zip(inset.axes));
        let narrow = walls.into_iter().find_map(|(name, axes)| match axes {
            (Axis::Reflecting { low, high }, Axis::Reflecting { low: from, high: to }) if from >= to => {
                Some((name, high - low))
            }
            _ => None,
        });
        let vessel = || self.vessel.filter(|vessel| vessel.radius <= radius);
        narrow.or_else(|| Some(("across the vessel", 2.0 * vessel()?.radius)))
    }

    #[inline(always)]
    pub fn confine(&self, p: [f32; 3]) -> [f32; 3] {
        let p = [self.axes[0].confine(p[0]), self.axes[1].confine(p[1]), self.axes[2].confine(p[2])];
        match &self.vessel {
            None => p,
            Some(vessel) => vessel.confine(p),
        }
    }

    /// Returns `true` if a point is inside all walls, or outside by no more than rounding.
    pub(crate) fn is_inside_walls(&self, p: [f32; 3]) -> bool {
        let is_between = |(axis, x): (Axis, f32)| match axis {
            Axis::Reflecting { low, high } => {
                let rounding = 1e-6 * low.abs().max(high.abs());
                (low - rounding..=high + rounding).contains(&x)
            }
            _ => true,
        };
        self.axes.into_iter().zip(p).all(is_between)
            && self.vessel.is_none_or(|vessel| vessel.distance(p) as f32 <= vessel.radius * (1.0 + 1e-6))
    }

    /// Returns the vector from `p` to the nearest periodic image of `q`.
    #[inline(always)]
    pub fn displacement(&self, p: [f32; 3], q: [f32; 3]) -> [f32; 3] {
        [
            self.axes[0].displacement(q[0] - p[0]),
            self.axes[1].displacement(q[1] - p[1]),
            self.axes[2].displacement(q[2] - p[2]),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Model;

    #[test]
    fn walls_mirror() {
        let axis = Axis::Reflecting { low: -1.0, high: 3.0 };
        for (from, to) in
            [(0.5, 0.5), (-1.5, -0.5), (3.5, 2.5), (7.5, -0.5), (-6.0, 2.0), (3.0, 3.0), (-1.0, -1.0)]
        {
            assert_eq!(axis.confine(from), to, "{from}");
        }
    }

    #[test]
    fn odd_number_of_reflections_reverses_the_path() {
        let axis = Axis::Reflecting { low: -1.0, high: 3.0 };
        for (to, reverses) in [
            (0.5, false),
            (3.0, false),
            (-1.0, false),
            (-1.5, true),
            (3.5, true),
            (7.5, false),
            (-6.0, false),
            (-9.5, true),
        ] {
            assert_eq!(axis.reverses(to), reverses, "{to}");
        }
        assert!(!Axis::Open.reverses(9.0) && !Axis::Periodic { low: 0.0, high: 1.0 }.reverses(1.5));
    }

    #[test]
    fn axes_without_a_finite_extent_are_refused() {
        let check = |low: f32, high: f32| {
            let refused = [Boundary::reflecting, Boundary::periodic].map(|boundary| {
                let boundary = boundary([0.0, low, 0.0], [1.0, high, 1.0]);
                Model { time_step: 0.1, boundary, ..Model::default() }.check().is_err()
            });
            assert_eq!(refused[0], refused[1]);
            refused[0]
        };
        assert!(!check(-1.0, 1.0) && !check(-1.5e38, 1.5e38));
        for [low, high] in [[f32::NAN, 1.0], [0.0, f32::NAN], [0.0, f32::INFINITY], [1.0, 1.0], [2.0, 1.0]] {
            assert!(check(low, high), "{low} {high}");
        }
        assert!(check(-3e38, 3e38), "minimum images in it are not numbers");
    }

    #[test]
    fn walls_act_on_the_surface() {
        let walls = Boundary::reflecting([-1.0; 3], [1.0, 2.0, 3.0]);
        assert_eq!(walls.inset(0.25).confine([0.875, 1.875, -1.0]), [0.625, 1.625, -0.5]);
        assert_eq!(walls.too_narrow(0.999), None);
        assert_eq!(walls.too_narrow(1.0), Some(("along x", 2.0)));
        let vessel = Vessel { along: Some(2), center: [0.0; 3], radius: 1.0 };
        let vessel = Boundary { vessel: Some(vessel), ..Boundary::default() };
        assert_eq!(vessel.inset(0.25).confine([0.0, 1.0, 9.0]), [0.0, 0.5, 9.0]);
        assert_eq!(
            (vessel.too_narrow(0.9), vessel.too_narrow(1.0)),
            (None, Some(("across the vessel", 2.0)))
        );
        assert!(!vessel.is_unbounded());
        let periodic = Boundary::periodic([-1.0; 3], [1.0; 3]);
        assert_eq!((periodic.inset(9.0), periodic.too_narrow(9.0)), (periodic, None));
    }

    #[test]
    fn coordinates_are_wrapped_into_the_period() {
        let axis = Axis::Periodic { low: -1.0, high: 3.0 };
        for (from, to) in
            [(0.5, 0.5), (-1.5, 2.5), (3.0, -1.0), (7.5, -0.5), (-1.0, -1.0), (-1.0 - 1e-9, -1.0)]
        {
            assert_eq!(axis.confine(from), to, "{from}");
        }
        let below = (-1.0_f32).next_down();
        assert!((-1.0..3.0).contains(&axis.confine(below)));
        assert_eq!(axis.displacement(3.5), -0.5);
        assert_eq!(axis.displacement(-1.5), -1.5);
    }
}
