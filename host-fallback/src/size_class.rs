/// Number of size classes, one per binary exponent of `f32`.
pub const SIZE_CLASSES: usize = 256;

/// Returns the biased exponent of a radius.
#[inline(always)]
pub(crate) fn class_of(radius: f32) -> usize {
    (radius.to_bits() >> 23) as usize & (SIZE_CLASSES - 1)
}
