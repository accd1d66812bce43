use crate::Random;

pub type ElementSeed = [u32; 12];

/// Random words for the whole scene, and for each element (mostly a sphere).
///
/// A scene shrinks by removing elements. Smaller words make simpler elements.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SceneSeed {
    pub setup: ElementSeed,
    pub elements: Vec<ElementSeed>,
}

impl SceneSeed {
    pub fn drawn(random: &mut Random, elements: usize) -> Self {
        let mut element = || [(); 12].map(|()| random.word());
        Self { setup: element(), elements: (0..elements).map(|_| element()).collect() }
    }

    pub fn reader(&self) -> SeedReader<'_> {
        SeedReader::new(&self.setup)
    }

    pub fn each<T>(&self, mut reader: impl FnMut(&mut SeedReader<'_>) -> T) -> Vec<T> {
        self.elements.iter().map(|words| reader(&mut SeedReader::new(words))).collect()
    }
}

/// Draws each choice from the next word, and zeros when the words are used up.
#[derive(Debug)]
pub struct SeedReader<'a> {
    words: std::slice::Iter<'a, u32>,
}

impl<'a> SeedReader<'a> {
    pub fn new(words: &'a [u32]) -> Self {
        Self { words: words.iter() }
    }

    fn word(&mut self) -> u32 {
        self.words.next().copied().unwrap_or(0)
    }

    pub fn below(&mut self, limit: u32) -> u32 {
        ((u64::from(self.word()) * u64::from(limit)) >> 32) as u32
    }

    /// Draws one of `values`, the first for small words.
    ///
    /// # Panics
    /// If `values` is empty.
    pub fn pick<T: Copy>(&mut self, values: &[T]) -> T {
        values[self.below(values.len() as u32) as usize]
    }

    /// Returns `true` with probability `1 / times`.
    pub fn once_in(&mut self, times: u32) -> bool {
        self.below(times) + 1 == times
    }

    /// Draws from `-most` to `most`, near zero for small words.
    pub fn within(&mut self, most: i32) -> i32 {
        let number = self.below(2 * most as u32 + 1) as i32;
        if number % 2 == 0 { number / 2 } else { -(number / 2) - 1 }
    }

    /// Draws from `low` to `high`, whose difference must be finite.
    pub fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (self.word() >> 8) as f32 / (1 << 24) as f32 * (high - low)
    }

    /// Draws a nearly log-uniform number below the float with these bits.
    pub fn float_below(&mut self, bits: u32) -> f32 {
        f32::from_bits(self.below(bits))
    }

    pub fn signed(&mut self, x: f32) -> f32 {
        if self.below(2) == 0 { x } else { -x }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_words_are_simple_and_large_words_reach_the_limit() {
        let mut least = SeedReader::new(&[]);
        assert_eq!(
            (least.below(7), least.within(3), least.pick(&[5, 6]), least.once_in(2)),
            (0, 0, 5, false)
        );
        assert_eq!((least.between(-1.0, 1.0), least.float_below(9), least.signed(2.0)), (-1.0, 0.0, 2.0));
        let words = [u32::MAX; 5];
        let mut most = SeedReader::new(&words);
        assert_eq!((most.below(7), most.within(3), most.pick(&[5, 6]), most.once_in(2)), (6, 3, 6, true));
        assert_eq!(most.float_below(9).to_bits(), 8);
        let all = SceneSeed::drawn(&mut Random(1), 99).each(|c| c.within(3));
        assert!((-3..=3).all(|x| all.contains(&x)), "{all:?}");
    }
}
