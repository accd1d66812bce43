use bytemuck::Pod;

/// The number type of wrapped spheres and their bounding boxes: `f32`, or `f64` for spheres, spaces and tables that
/// `f32` cannot represent.
pub trait Coordinate: Pod + PartialOrd + Into<f64> + Send + Sync {
    /// Smallest radius that limits no distance.
    const UNLIMITED: Self;
    /// `true` if wrapping into a periodic space enlarges radii.
    const GROWS: bool;

    /// Converts a species group for a message of numbers of this type.
    fn from_group(group: u32) -> Self;

    /// Inverse of [`from_group`](Self::from_group).
    fn to_group(self) -> u32;
}

impl Coordinate for f32 {
    // Larger effective radii are cut at this number.
    const UNLIMITED: Self = Self::MAX;
    const GROWS: bool = false;

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
    const GROWS: bool = true;

    #[inline]
    fn from_group(group: u32) -> Self {
        group.into()
    }

    #[inline]
    fn to_group(self) -> u32 {
        self as u32
    }
}
