//! Where particles may be: unbounded space, walls that reflect, or periodic images, axis by axis.

use lazygrid::Space;

use crate::Error;
use crate::vessel::Vessel;

/// What bounds an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Axis {
    /// Nothing.
    #[default]
    Open,
    /// Walls at both coordinates, in µm; a sphere whose surface passes one comes back mirrored.
    Reflecting {
        /// The lower wall.
        low: f32,
        /// The upper wall.
        high: f32,
    },
    /// Space repeats: `high` is the same place as `low`, in µm.
    Periodic {
        /// The lower end, which belongs to the box.
        low: f32,
        /// The upper end, which does not.
        high: f32,
    },
}

impl Axis {
    /// Where the centres of spheres of this radius may be: their surfaces stay between walls.
    #[inline(always)]
    pub fn inset(self, radius: f32) -> Self {
        match self {
            Self::Reflecting { low, high } => Self::Reflecting { low: low + radius, high: high - radius },
            other => other,
        }
    }

    /// A coordinate, put back where it may be.
    #[inline(always)]
    pub fn place(self, x: f32) -> f32 {
        match self {
            Self::Open => x,
            // What is inside stays as it is, to the last bit.
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
                if shifted >= low && shifted < high { shifted } else { low }
            }
        }
    }

    /// Whether walls turn round what moves along the axis and would end at `x` without them.
    #[inline(always)]
    pub fn turns(self, x: f32) -> bool {
        match self {
            Self::Reflecting { low, high } if x < low || x > high => {
                let length = high - low;
                round_trip(x - low, length) > length
            }
            _ => false,
        }
    }

    /// [`offset`](Self::offset) in `f64`.
    pub(crate) fn offset_exact(self, d: f64) -> f64 {
        match self {
            Self::Periodic { low, high } => {
                let length = f64::from(high - low);
                d - length * (d / length).round()
            }
            _ => d,
        }
    }

    /// A difference of two coordinates, that of the nearest images where space repeats.
    #[inline(always)]
    pub fn offset(self, d: f32) -> f32 {
        match self {
            Self::Periodic { low, high } => {
                let length = high - low;
                d - length * (d / length + 0.5).floor()
            }
            _ => d,
        }
    }
}

/// A way along an axis, less whole trips from the lower wall to the upper one and back: up to `length` it is on the way
/// there.
#[inline(always)]
fn round_trip(way: f32, length: f32) -> f32 {
    way - 2.0 * length * (way / (2.0 * length)).floor()
}

/// What bounds space.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Boundary {
    /// Axis by axis.
    pub axes: [Axis; 3],
    /// A vessel around everything, across which axes are open.
    pub vessel: Option<Vessel>,
}

impl Boundary {
    /// Walls that reflect on all sides of a box.
    pub fn reflecting(low: [f32; 3], high: [f32; 3]) -> Self {
        let axes = std::array::from_fn(|k| Axis::Reflecting { low: low[k], high: high[k] });
        Self { axes, vessel: None }
    }

    /// A box that repeats along all axes.
    pub fn periodic(low: [f32; 3], high: [f32; 3]) -> Self {
        let axes = std::array::from_fn(|k| Axis::Periodic { low: low[k], high: high[k] });
        Self { axes, vessel: None }
    }

    /// Whether space is unbounded.
    pub fn is_open(&self) -> bool {
        self.axes == [Axis::Open; 3] && self.vessel.is_none()
    }

    /// The space that the detector searches.
    ///
    /// # Errors
    /// [`Error::Detection`] for a box without extent.
    pub fn space(&self) -> Result<Space, Error> {
        let lengths = self.axes.map(|axis| match axis {
            Axis::Periodic { low, high } => Some(f64::from(high - low)),
            _ => None,
        });
        Ok(Space::periodic(lengths).map_err(lazygrid::Error::from)?)
    }

    /// Where the centres of spheres of this radius may be: their surfaces stay between walls.
    #[inline(always)]
    pub fn inset(&self, radius: f32) -> Self {
        Self {
            axes: self.axes.map(|axis| axis.inset(radius)),
            vessel: self.vessel.map(|vessel| vessel.inset(radius)),
        }
    }

    /// The first axis between whose walls a sphere of this radius has no room, or the vessel, and how wide that is.
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
        narrow.or_else(|| Some(("across the cylinder", 2.0 * vessel()?.radius)))
    }

    /// A position, put back where it may be.
    #[inline(always)]
    pub fn place(&self, p: [f32; 3]) -> [f32; 3] {
        let p = [self.axes[0].place(p[0]), self.axes[1].place(p[1]), self.axes[2].place(p[2])];
        match &self.vessel {
            None => p,
            Some(vessel) => vessel.place(p),
        }
    }

    /// The vector from `p` to the nearest image of `q`.
    #[inline(always)]
    pub fn offset(&self, p: [f32; 3], q: [f32; 3]) -> [f32; 3] {
        [self.axes[0].offset(q[0] - p[0]), self.axes[1].offset(q[1] - p[1]), self.axes[2].offset(q[2] - p[2])]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn walls_mirror() {
        let axis = Axis::Reflecting { low: -1.0, high: 3.0 };
        for (from, to) in
            [(0.5, 0.5), (-1.5, -0.5), (3.5, 2.5), (7.5, -0.5), (-6.0, 2.0), (3.0, 3.0), (-1.0, -1.0)]
        {
            assert_eq!(axis.place(from), to, "{from}");
        }
    }

    #[test]
    fn an_odd_number_of_walls_turns_round() {
        let axis = Axis::Reflecting { low: -1.0, high: 3.0 };
        for (to, turns) in [
            (0.5, false),
            (3.0, false),
            (-1.0, false),
            (-1.5, true),
            (3.5, true),
            (7.5, false),
            (-6.0, false),
            (-9.5, true),
        ] {
            assert_eq!(axis.turns(to), turns, "{to}");
        }
        assert!(!Axis::Open.turns(9.0) && !Axis::Periodic { low: 0.0, high: 1.0 }.turns(1.5));
    }

    #[test]
    fn walls_act_on_the_surface() {
        let walls = Boundary::reflecting([-1.0; 3], [1.0, 2.0, 3.0]);
        assert_eq!(walls.inset(0.25).place([0.875, 1.875, -1.0]), [0.625, 1.625, -0.5]);
        assert_eq!(walls.too_narrow(0.999), None);
        assert_eq!(walls.too_narrow(1.0), Some(("along x", 2.0)));
        let vessel = Vessel { along: 2, center: [0.0; 3], radius: 1.0 };
        let vessel = Boundary { vessel: Some(vessel), ..Boundary::default() };
        assert_eq!(vessel.inset(0.25).place([0.0, 1.0, 9.0]), [0.0, 0.5, 9.0]);
        assert_eq!(
            (vessel.too_narrow(0.9), vessel.too_narrow(1.0)),
            (None, Some(("across the cylinder", 2.0)))
        );
        assert!(!vessel.is_open());
        let periodic = Boundary::periodic([-1.0; 3], [1.0; 3]);
        assert_eq!((periodic.inset(9.0), periodic.too_narrow(9.0)), (periodic, None));
    }

    #[test]
    fn images_are_one_place() {
        let axis = Axis::Periodic { low: -1.0, high: 3.0 };
        for (from, to) in
            [(0.5, 0.5), (-1.5, 2.5), (3.0, -1.0), (7.5, -0.5), (-1.0, -1.0), (-1.0 - 1e-9, -1.0)]
        {
            assert_eq!(axis.place(from), to, "{from}");
        }
        let below = (-1.0_f32).next_down();
        assert!((-1.0..3.0).contains(&axis.place(below)));
        assert_eq!(axis.offset(3.5), -0.5);
        assert_eq!(axis.offset(-1.5), -1.5);
    }
}
