use std::cmp::Ordering;

use crate::SizeClass;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RankAndClass {
    pub rank: u32,
    pub class: SizeClass,
}

/// Returns `true` if `sphere` becomes a ghost at the owner of `other`, as exactly one of two spheres on different
/// ranks does.
#[inline]
pub fn becomes_ghost(sphere: RankAndClass, other: RankAndClass, ranks: u32) -> bool {
    if sphere.rank == other.rank {
        return false;
    }
    match sphere.class.cmp(&other.class) {
        Ordering::Equal => sends_ghosts(sphere.rank, other.rank, ranks),
        order => order.is_gt(),
    }
}

/// Returns `true` if ghosts of one class go from rank `from` to `to`, and not back.
///
/// Each of P ranks sends ghosts to the next (P − 1)/2 ranks, rounded down, cyclically. For even P, the
/// direction between ranks k and k + P/2 alternates with k.
#[inline]
pub fn sends_ghosts(from: u32, to: u32, ranks: u32) -> bool {
    let (from, to, ranks) = (u64::from(from), u64::from(to), u64::from(ranks.max(1)));
    let ahead = (to + ranks - from % ranks) % ranks;
    match (2 * ahead).cmp(&ranks) {
        Ordering::Equal => (from < to) == (from.min(to) % 2 == 0),
        order => order.is_lt() && ahead > 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_two_ranks_exactly_one_sends() {
        for ranks in 1..40 {
            for from in 0..ranks {
                assert!(!sends_ghosts(from, from, ranks));
                let received = (0..ranks).filter(|&to| sends_ghosts(to, from, ranks)).count() as u32;
                assert!(
                    received.abs_diff((ranks - 1) / 2) <= 1,
                    "{from} of {ranks} receives from {received}"
                );
                for to in (0..ranks).filter(|&to| to != from) {
                    let both = [sends_ghosts(from, to, ranks), sends_ghosts(to, from, ranks)];
                    assert_ne!(both[0], both[1], "{from}, {to} of {ranks}");
                }
            }
        }
    }

    #[test]
    fn larger_sphere_becomes_the_ghost() {
        let sphere = |rank, radius| RankAndClass { rank, class: SizeClass::from_radius(radius) };
        let becomes_ghost = |a, b| becomes_ghost(a, b, 8);
        for (a, b) in [(0, 1), (1, 0), (7, 3)] {
            assert!(becomes_ghost(sphere(a, 2.0), sphere(b, 1.0)));
            assert!(!becomes_ghost(sphere(a, 1.0), sphere(b, 2.0)));
            let (one, other) = (sphere(a, 1.0), sphere(b, 1.5));
            assert_ne!(becomes_ghost(one, other), becomes_ghost(other, one));
            assert!(!becomes_ghost(sphere(a, 2.0), sphere(a, 1.0)));
        }
    }
}
