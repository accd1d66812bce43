use glam::Vec3;

#[derive(Clone, Copy, Debug)]
pub(crate) struct CenterBounds {
    pub(crate) min: Vec3,
    pub(crate) max: Vec3,
}

impl CenterBounds {
    pub(crate) const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    #[inline]
    pub(crate) fn add(&mut self, center: Vec3) {
        (self.min, self.max) = (self.min.min(center), self.max.max(center));
    }

    #[inline]
    pub(crate) fn merge(&mut self, other: Self) {
        (self.min, self.max) = (self.min.min(other.min), self.max.max(other.max));
    }
}
