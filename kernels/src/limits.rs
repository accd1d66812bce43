/// The most spheres of one call: indices are `u32`, and the last two values are reserved.
pub const MAX_SPHERES: u64 = u32::MAX as u64 - 1;
