use bytemuck::{Pod, Zeroable};

/// Finalizer of SplitMix64, a bijection.
pub(crate) fn mix(word: u64) -> u64 {
    let word = (word ^ (word >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let word = (word ^ (word >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    word ^ (word >> 31)
}

/// Returns a distinct hash for each id.
#[inline]
pub fn tie_breaker(id: u64) -> u64 {
    mix(id.wrapping_add(0x9E37_79B9_7F4A_7C15))
}

/// Hashes words in order. A sequence and its prefix differ.
pub(crate) fn sequence(words: impl IntoIterator<Item = u64>) -> u64 {
    let (hash, length) = words
        .into_iter()
        .fold((0, 0_u64), |(hash, length), word| (mix(mix(hash) ^ tie_breaker(word)), length + 1));
    mix(hash ^ tie_breaker(length))
}

/// A digest of ids in any order. Different sets collide with a probability of about 2⁻¹²⁸.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Digest {
    sums: [u64; 2],
}

impl Digest {
    pub fn from_ids(ids: impl IntoIterator<Item = u64>) -> Self {
        ids.into_iter().fold(Self::default(), |digest, id| {
            let one = mix(id ^ 0xA076_1D64_78BD_642F);
            let other = mix(one ^ 0xE703_7ED1_A0B4_28DB);
            digest.join(Self { sums: [one, other] })
        })
    }

    /// Requires disjoint sets.
    pub fn join(self, other: Self) -> Self {
        let sum = |k: usize| self.sums[k].wrapping_add(other.sums[k]);
        Self { sums: [sum(0), sum(1)] }
    }

    pub fn home_rank(id: u64, ranks: u32) -> u32 {
        ((u128::from(mix(id ^ 0x8EBC_6AF0_9C88_C6E3)) * u128::from(ranks.max(1))) >> 64) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digest_depends_on_the_set_only() {
        let whole = Digest::from_ids(0..1000);
        assert_eq!(whole, Digest::from_ids((0..1000).rev()));
        assert_eq!(whole, Digest::from_ids(0..300).join(Digest::from_ids(300..1000)));
        assert_ne!(whole, Digest::from_ids(1..1001));
        assert_ne!(whole, Digest::from_ids((0..999).chain([0])));
        assert_ne!(Digest::from_ids([1, 4]), Digest::from_ids([2, 3]));
        assert_ne!(Digest::from_ids([5, 5]), Digest::from_ids([7, 7]));
    }

    #[test]
    fn sequence_hash_depends_on_order_and_length() {
        let all = [&[][..], &[0], &[0, 0], &[1], &[1, 2], &[2, 1], &[1, 2, 0]];
        for (k, &one) in all.iter().enumerate() {
            assert!(all[..k].iter().all(|&other| sequence_of(other) != sequence_of(one)), "{one:?}");
        }
    }

    fn sequence_of(words: &[u64]) -> u64 {
        sequence(words.iter().copied())
    }

    #[test]
    fn home_ranks_have_equally_many_ids() {
        let mut of_rank = [0; 7];
        (0..70_000).for_each(|id| of_rank[Digest::home_rank(id, 7) as usize] += 1);
        assert!(of_rank.iter().all(|ids| (9_500..10_500).contains(ids)), "{of_rank:?}");
    }
}
