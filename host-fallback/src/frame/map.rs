use bytemuck::cast;

use lazygrid_kernels::Orthogonalization;

use super::{Axes, GROWTH, MAX_LENGTHS, MAX_RADIUS, SearchFrame};

/// A map prepared for vectors. Its results equal [`SearchFrame::sphere`].
pub(crate) struct FrameMap<'f> {
    pub(crate) frame: &'f SearchFrame,
    /// Cell of a triclinic frame, and its largest radius.
    pub(crate) cell: Option<(&'f Orthogonalization, f64)>,
    pub(crate) origin: [f64; 4],
    /// Infinite for an unbounded axis and the radius. NaN in a triclinic space and a trimmed frame.
    pub(crate) lengths: [f64; 4],
    pub(crate) limit: [f64; 4],
    /// Scale times growth, and summand. The scale is a power of two, so the product rounds like two products in turn.
    pub(crate) growth: [[f64; 4]; 2],
    pub(crate) half: [f32; 4],
    /// Range of differences from the origin that the frame [contains](Self::contains).
    pub(crate) limits: [[f64; 4]; 2],
}

impl<'f> FrameMap<'f> {
    #[inline(always)]
    pub(crate) fn new(frame: &'f SearchFrame) -> Self {
        let ([x, y, z], scale, [factor, summand]) = (frame.origin, frame.scale, GROWTH);
        let mut map = Self {
            frame,
            cell: frame.cell(),
            origin: [x, y, z, 0.0],
            lengths: [f64::INFINITY; 4],
            limit: [f64::INFINITY, f64::INFINITY, f64::INFINITY, MAX_RADIUS / scale],
            growth: [[scale, scale, scale, scale * factor], [0.0, 0.0, 0.0, summand]],
            half: [f32::INFINITY; 4],
            limits: [[0.0; 4], [f64::MAX; 4]],
        };
        if let Axes::Orthogonal(axes) = &frame.axes {
            for (axis, &of_axis) in axes.iter().enumerate() {
                if let Some((length, period)) = of_axis {
                    (map.lengths[axis], map.half[axis]) = (length, 0.5 * period);
                }
            }
        }
        if !frame.has_certain_contacts() {
            map.lengths = [f64::NAN; 4];
        }
        for axis in 0..3 {
            let length = map.lengths[axis];
            // The inverse is infinite for the smallest scales.
            let limit =
                if length == f64::INFINITY { scale.recip().next_down() } else { MAX_LENGTHS * length };
            (map.limits[0][axis], map.limits[1][axis]) = (-limit, limit);
        }
        map
    }

    /// Returns `true` if the sphere is valid, inside along unbounded axes and within [`MAX_LENGTHS`] along periodic ones,
    /// so that the frame represents it independently of others. `false` in a triclinic space and a trimmed frame.
    #[inline(always)]
    pub(crate) fn contains(&self, row: [f64; 4]) -> bool {
        let [low, high] = &self.limits;
        (0..4).all(|component| {
            let at = row[component] - self.origin[component];
            at >= low[component] && at <= high[component]
        })
    }

    pub(crate) fn is_unbounded(&self) -> bool {
        self.lengths == [f64::INFINITY; 4]
    }

    #[inline(always)]
    pub(crate) fn map_to_cell(&self, (cell, limit): (&Orthogonalization, f64), row: [f64; 4]) -> [f32; 4] {
        let [x, y, z, radius] = row;
        let [x0, y0, z0, _] = self.origin;
        if (0.0..f64::INFINITY).contains(&radius)
            && let Some(sphere) = cell.near_sphere([x - x0, y - y0, z - z0], radius, limit)
        {
            return cast(sphere);
        }
        cast(self.frame.sphere(row))
    }

    /// `PERIODIC` may be `false` only if the map [is unbounded](Self::is_unbounded).
    #[inline(always)]
    pub(crate) fn map<const PERIODIC: bool>(&self, row: [f64; 4]) -> [f32; 4] {
        if PERIODIC && let Some(cell) = self.cell {
            return self.map_to_cell(cell, row);
        }
        let (mut mapped, mut is_near) = ([0.0_f32; 4], true);
        for component in 0..4 {
            let mut at = row[component] - self.origin[component];
            if PERIODIC {
                let (away, length) = (at.abs(), self.lengths[component]);
                let image = at - length.copysign(at);
                is_near &= away <= MAX_LENGTHS * length;
                at = if away <= 0.5 * length { at } else { image };
            }
            at = if at < self.limit[component] { at } else { self.limit[component] };
            mapped[component] = (at * self.growth[0][component] + self.growth[1][component]) as f32;
            if PERIODIC {
                let half = self.half[component];
                mapped[component] = if mapped[component] < -half { -half } else { mapped[component] };
                mapped[component] = if mapped[component] > half { half } else { mapped[component] };
            }
        }
        if PERIODIC && !is_near {
            // The image is wrong beyond `MAX_LENGTHS`, and where lengths are NaN.
            return cast(self.frame.sphere(row));
        }
        // The next larger number.
        mapped[3] = f32::from_bits(mapped[3].to_bits() + 1);
        mapped
    }
}
