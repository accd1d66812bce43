/// The binade of a radius: all radii from one power of two to below the next. Radius 0 and subnormal radii share the
/// lowest class.
///
/// ```
/// # use lazygrid_ranks::Class;
/// assert_eq!(Class::of(1.0), Class::of(1.99));
/// assert!(Class::of(0.99) < Class::of(1.0));
/// assert_eq!(Class::of(-0.0), Class::of(1e-40));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Class(u8);

impl Class {
    /// The number of possible classes.
    pub const COUNT: usize = 256;

    /// The class of a radius that is finite and not negative.
    #[inline]
    pub fn of(radius: f32) -> Self {
        // The cast leaves the sign out, as −0 is a radius of 0.
        Self((radius.to_bits() >> 23) as u8)
    }

    /// From 0, of the smallest radii, to below [`COUNT`](Self::COUNT).
    #[inline]
    pub fn index(self) -> usize {
        self.0.into()
    }
}
