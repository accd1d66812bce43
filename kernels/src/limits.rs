/// Maximum spheres of a call: indices are `u32`, and two values are reserved.
pub const MAX_SPHERES: u64 = u32::MAX as u64 - 1;
