//! Where particles may be: unbounded space, walls that reflect, or periodic images, axis by axis.

use lazygrid::Space;

use crate::Error;

/// What bounds an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Axis {
    /// Nothing.
    #[default]
    Open,
    /// Walls at both coordinates, in µm; what passes one comes back mirrored.
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
                let y = x - low;
                let y = y - 2.0 * length * (y / (2.0 * length)).floor();
                (low + (length - (length - y).abs())).clamp(low, high)
            }
            Self::Periodic { low, high } => {
                let length = high - low;
                let shifted = x - length * ((x - low) / length).floor();
                if shifted >= low && shifted < high { shifted } else { low }
            }
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

/// What bounds space.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Boundary {
    /// Axis by axis.
    pub axes: [Axis; 3],
}

impl Boundary {
    /// Walls that reflect on all sides of a box.
    pub fn reflecting(low: [f32; 3], high: [f32; 3]) -> Self {
        Self { axes: std::array::from_fn(|k| Axis::Reflecting { low: low[k], high: high[k] }) }
    }

    /// A box that repeats along all axes.
    pub fn periodic(low: [f32; 3], high: [f32; 3]) -> Self {
        Self { axes: std::array::from_fn(|k| Axis::Periodic { low: low[k], high: high[k] }) }
    }

    /// Whether space is unbounded.
    pub fn is_open(&self) -> bool {
        self.axes == [Axis::Open; 3]
    }

    /// The space that the detector searches.
    ///
    /// # Errors
    /// [`Error::Detection`] for a box without extent.
    pub fn space(&self) -> Result<Space, Error> {
        let lengths = self.axes.map(|axis| match axis {
            Axis::Periodic { low, high } => Some(high - low),
            _ => None,
        });
        Ok(Space::periodic(lengths).map_err(lazygrid::Error::from)?)
    }

    /// A position, put back where it may be.
    #[inline(always)]
    pub fn place(&self, p: [f32; 3]) -> [f32; 3] {
        [self.axes[0].place(p[0]), self.axes[1].place(p[1]), self.axes[2].place(p[2])]
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
