use bytemuck::{Pod, Zeroable};

/// The positions of spheres in four arrays of `f32`, for `x`, `y`, `z` and `r`: the number of sphere `i` is
/// `first + i · stride`. The default describes arrays that hold nothing else.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct ColumnLayout {
    /// The position of the first sphere.
    pub first: [u32; 4],
    /// The distance from a sphere to the next. With a stride of 0 all spheres share one number, such as a radius.
    pub stride: [u32; 4],
}

impl Default for ColumnLayout {
    fn default() -> Self {
        Self { first: [0; 4], stride: [1; 4] }
    }
}

impl ColumnLayout {
    /// Returns the bytes of each array that `spheres` spheres need.
    pub fn bytes(&self, spheres: u32) -> [u64; 4] {
        let last = u64::from(spheres.max(1)) - 1;
        let bytes = |(first, stride)| 4 * (u64::from(first) + last * u64::from(stride) + 1);
        std::array::from_fn(|column| bytes((self.first[column], self.stride[column])))
    }
}
