/// The binade of a radius. Radius 0 and subnormal radii share the lowest class.
///
/// ```
/// # use lazygrid_ranks::SizeClass;
/// assert_eq!(SizeClass::from_radius(1.0), SizeClass::from_radius(1.99));
/// assert!(SizeClass::from_radius(0.99) < SizeClass::from_radius(1.0));
/// assert_eq!(SizeClass::from_radius(-0.0), SizeClass::from_radius(1e-40));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SizeClass(u8);

impl SizeClass {
    pub const COUNT: usize = 256;

    /// `radius` must not be NaN or negative.
    #[inline]
    pub fn from_radius(radius: f32) -> Self {
        // The cast drops the sign of −0.
        Self((radius.to_bits() >> 23) as u8)
    }

    #[inline]
    pub fn index(self) -> usize {
        self.0.into()
    }
}
