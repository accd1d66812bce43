//! Philox 4×32 with ten rounds (Salmon et al., *Parallel random numbers: as easy as 1, 2, 3*, SC 2011).
//!
//! A draw depends only on the seed, the ids, the step and the purpose. WGSL has the same operations.

use rand::TryRng;

/// Purposes share no random words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Purpose {
    Move = 0,
    /// Position at release.
    Release = 1,
    Velocity = 2,
    /// Hit, by particle and receiver.
    Receiver = 3,
    /// Priority, probability and direction of a pair, by both ids.
    Pair = 4,
    Decay = 5,
    /// Position within a step, by particle and segment of its path.
    Path = 6,
    Dissociation = 7,
    /// Events after a release.
    PartialStep = 8,
    /// Number, by transmitter.
    Count = 9,
    /// Symbol, by transmitter and index.
    Symbol = 10,
    Tumble = 11,
    ReceiverMotion = 12,
    Unbinding = 13,
    HitTime = 14,
    /// Extreme position near a wall.
    Wall = 15,
    /// Extreme position near a membrane, and its side.
    Membrane = 16,
    SurfaceDiffusion = 17,
    /// Seed of a replica.
    Replica = 100,
}

/// A seed: lower and upper half.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Key(pub [u32; 2]);

impl Key {
    pub const fn new(seed: u64) -> Self {
        Self([seed as u32, (seed >> 32) as u32])
    }

    pub const fn seed(self) -> u64 {
        self.0[0] as u64 | (self.0[1] as u64) << 32
    }

    /// Draws for particle `id`, and `other` or 0.
    #[inline(always)]
    pub fn draw(self, id: u32, other: u32, step: u32, purpose: Purpose) -> [u32; 4] {
        philox([id, other, step, purpose as u32], self.0)
    }

    /// Part 0 is [`draw`](Self::draw). Parts below 2²⁴ share no words with other parts and purposes.
    #[inline(always)]
    pub(crate) fn draw_part(self, [id, other]: [u32; 2], part: u32, step: u32, purpose: Purpose) -> [u32; 4] {
        philox([id, other, step, purpose as u32 | part << 8], self.0)
    }
}

#[derive(Clone, Copy, Debug)]
pub struct StepKey {
    pub key: Key,
    pub step: u32,
}

impl StepKey {
    #[inline(always)]
    pub fn for_particle(self, id: u32) -> DrawContext {
        let Self { key, step } = self;
        DrawContext { key, id, step }
    }
}

#[derive(Clone, Copy, Debug)]
pub struct DrawContext {
    pub key: Key,
    pub id: u32,
    pub step: u32,
}

impl DrawContext {
    #[inline(always)]
    pub(crate) fn draw(self, other: u32, purpose: Purpose) -> [u32; 4] {
        self.key.draw(self.id, other, self.step, purpose)
    }

    #[inline(always)]
    pub(crate) fn draw_part(self, other: u32, part: u32, purpose: Purpose) -> [u32; 4] {
        self.key.draw_part([self.id, other], part, self.step, purpose)
    }
}

/// A stream of random words.
#[derive(Clone, Debug)]
pub struct Draws {
    key: Key,
    /// Id, block, step, purpose.
    counter: [u32; 4],
    words: [u32; 4],
    used: usize,
}

impl Draws {
    /// Creates the stream of `id`, for a purpose without other draws.
    pub fn new(key: Key, id: u32, step: u32, purpose: Purpose) -> Self {
        Self { key, counter: [id, 0, step, purpose as u32], words: [0; 4], used: 4 }
    }

    pub(crate) fn unit(&mut self) -> f64 {
        fine_unit(self.word())
    }

    fn word(&mut self) -> u32 {
        if self.used == 4 {
            self.words = philox(self.counter, self.key.0);
            self.counter[1] += 1;
            self.used = 0;
        }
        self.used += 1;
        self.words[self.used - 1]
    }
}

impl TryRng for Draws {
    type Error = std::convert::Infallible;

    fn try_next_u32(&mut self) -> Result<u32, Self::Error> {
        Ok(self.word())
    }

    fn try_next_u64(&mut self) -> Result<u64, Self::Error> {
        let low = u64::from(self.word());
        Ok(low | u64::from(self.word()) << 32)
    }

    fn try_fill_bytes(&mut self, bytes: &mut [u8]) -> Result<(), Self::Error> {
        for chunk in bytes.chunks_mut(4) {
            chunk.copy_from_slice(&self.word().to_le_bytes()[..chunk.len()]);
        }
        Ok(())
    }
}

const MULTIPLIERS: [u32; 2] = [0xD251_1F53, 0xCD9E_8D57];
const WEYL: [u32; 2] = [0x9E37_79B9, 0xBB67_AE85];
const ROUNDS: usize = 10;

#[inline(always)]
pub fn philox(mut counter: [u32; 4], mut key: [u32; 2]) -> [u32; 4] {
    for _ in 0..ROUNDS {
        let [a, b, c, d] = counter;
        let (low0, high0) = multiply_wide(MULTIPLIERS[0], a);
        let (low1, high1) = multiply_wide(MULTIPLIERS[1], c);
        counter = [high1 ^ b ^ key[0], low1, high0 ^ d ^ key[1], low0];
        key = [key[0].wrapping_add(WEYL[0]), key[1].wrapping_add(WEYL[1])];
    }
    counter
}

#[inline(always)]
fn multiply_wide(a: u32, b: u32) -> (u32, u32) {
    let product = u64::from(a) * u64::from(b);
    (product as u32, (product >> 32) as u32)
}

/// One of 2²³ equally spaced numbers in (0, 1), symmetric around ½, exact in `f32`.
#[inline(always)]
pub fn open_unit(word: u32) -> f32 {
    ((word >> 9) as f32 + 0.5) * (1.0 / 8_388_608.0)
}

/// One of 2³² equally spaced numbers in (0, 1).
#[inline]
pub(crate) fn fine_unit(word: u32) -> f64 {
    (f64::from(word) + 0.5) / 4_294_967_296.0
}

/// Largest word at which an event of this probability, rounded to multiples of 2⁻³², happens; `None` for 0.
pub fn probability_threshold(probability: f64) -> Option<u32> {
    let count = (probability * 4_294_967_296.0).round().min(4_294_967_296.0);
    (count >= 1.0).then_some((count - 1.0) as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Random123's `kat_vectors`, `philox4x32 10`.
    #[test]
    fn known_answers() {
        assert_eq!(philox([0; 4], [0; 2]), [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]);
        assert_eq!(philox([!0; 4], [!0; 2]), [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]);
        let counter = [0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344];
        let answer = [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1];
        assert_eq!(philox(counter, [0xa409_3822, 0x299f_31d0]), answer);
    }

    #[test]
    fn uniform_numbers_stay_inside() {
        assert_eq!(open_unit(0), 0.5 / 8_388_608.0);
        assert_eq!(open_unit(u32::MAX), 1.0 - 0.5 / 8_388_608.0);
    }

    #[test]
    fn probabilities_as_words() {
        assert_eq!(probability_threshold(0.0), None);
        assert_eq!(probability_threshold(1.0), Some(u32::MAX));
        assert_eq!(probability_threshold(0.5), Some(u32::MAX / 2));
        assert_eq!(probability_threshold(1.0 / 4_294_967_296.0), Some(0));
    }
}
