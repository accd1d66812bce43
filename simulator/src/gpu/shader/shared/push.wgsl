// 64-bit sums.
struct Push {
    low: array<atomic<u32>, 3>,
    high: array<atomic<u32>, 3>,
    count: atomic<u32>,
}

// Units of a displacement per largest contact distance.
const UNITS: f32 = 0x1p30;
