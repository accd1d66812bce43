use bytemuck::{Pod, Zeroable};

/// The positions of spheres in four `f32` arrays `x`, `y`, `z` and `r`: sphere `i` is at `first + i · stride`. The
/// default is for dense arrays.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct ColumnLayout {
    /// Position of the first sphere.
    pub first: [u32; 4],
    /// Distance between consecutive spheres; 0 if all share one number, such as a radius.
    pub stride: [u32; 4],
}

impl Default for ColumnLayout {
    fn default() -> Self {
        Self { first: [0; 4], stride: [1; 4] }
    }
}

impl ColumnLayout {
    /// Returns the bytes of each array for `spheres` spheres.
    pub fn bytes(&self, spheres: u32) -> [u64; 4] {
        let last = u64::from(spheres.max(1)) - 1;
        let bytes = |(first, stride)| 4 * (u64::from(first) + last * u64::from(stride) + 1);
        std::array::from_fn(|column| bytes((self.first[column], self.stride[column])))
    }
}
