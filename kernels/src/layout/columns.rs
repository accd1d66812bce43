use bytemuck::{Pod, Zeroable};

/// The layout of four `f32` arrays `x`, `y`, `z` and `r`: sphere `i` is at `first + i · stride`. The default is for
/// dense arrays.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct ColumnLayout {
    pub first: [u32; 4],
    /// Distance between consecutive spheres; 0 if all spheres share one number.
    pub stride: [u32; 4],
}

impl Default for ColumnLayout {
    fn default() -> Self {
        Self { first: [0; 4], stride: [1; 4] }
    }
}

impl ColumnLayout {
    /// Returns the bytes of each array for `spheres` spheres, at most `u64::MAX`.
    pub fn bytes(&self, spheres: u32) -> [u64; 4] {
        let last = u64::from(spheres.max(1)) - 1;
        let items = |first: u32, stride: u32| (last * u64::from(stride)).saturating_add(u64::from(first) + 1);
        let bytes = |(first, stride)| items(first, stride).saturating_mul(4);
        std::array::from_fn(|column| bytes((self.first[column], self.stride[column])))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_of_the_largest_layout_do_not_overflow() {
        assert_eq!(ColumnLayout::default().bytes(3), [12; 4]);
        let layout = ColumnLayout { first: [1, 0, 0, u32::MAX], stride: [4, 0, 1, u32::MAX] };
        assert_eq!(layout.bytes(3), [40, 4, 12, 4 * (3 * u64::from(u32::MAX) + 1)]);
        assert_eq!(layout.bytes(u32::MAX)[3], u64::MAX);
    }
}
