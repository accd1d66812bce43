//! Normal numbers of particles, in blocks that the compiler vectorizes.

use crate::random::gaussian::normals;
use crate::random::philox::{Key, Purpose, StepKey};

pub(crate) const BLOCK: usize = 64;

pub(crate) fn draw(StepKey { key, step }: StepKey, ids: &[u32], random: &mut [[f32; BLOCK]; 3]) {
    let mut block = [0; BLOCK];
    block[..ids.len()].copy_from_slice(ids);
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has AVX2.
        return unsafe { draw_avx2(key, &block, step, random) };
    }
    draw_block(key, &block, step, random);
}

/// No operation is fused, so wider vectors give equal results.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn draw_avx2(key: Key, ids: &[u32; BLOCK], step: u32, random: &mut [[f32; BLOCK]; 3]) {
    draw_block(key, ids, step, random);
}

#[inline(always)]
fn draw_block(key: Key, ids: &[u32; BLOCK], step: u32, random: &mut [[f32; BLOCK]; 3]) {
    let [a, b, c] = random;
    for k in 0..BLOCK {
        [a[k], b[k], c[k]] = normals(key.draw(ids[k], 0, step, Purpose::Move));
    }
}
