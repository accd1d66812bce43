use bytemuck::Pod;

/// The number type of wrapped spheres and bounding boxes.
pub trait Coordinate: Pod + PartialOrd + Into<f64> + Send + Sync {
    /// Smallest radius that limits no distance.
    const UNLIMITED: Self;
    /// `true` if wrapping into a periodic space enlarges radii.
    const WRAPPING_ENLARGES_RADII: bool;

    /// Converts a species group for messages.
    fn from_group(group: u32) -> Self;

    fn to_group(self) -> u32;
}

impl Coordinate for f32 {
    // Effective radii are cut at this number.
    const UNLIMITED: Self = Self::MAX;
    const WRAPPING_ENLARGES_RADII: bool = false;

    #[inline]
    fn from_group(group: u32) -> Self {
        Self::from_bits(group)
    }

    #[inline]
    fn to_group(self) -> u32 {
        self.to_bits()
    }
}

impl Coordinate for f64 {
    const UNLIMITED: Self = Self::INFINITY;
    const WRAPPING_ENLARGES_RADII: bool = true;

    #[inline]
    fn from_group(group: u32) -> Self {
        group.into()
    }

    #[inline]
    fn to_group(self) -> u32 {
        self as u32
    }
}
