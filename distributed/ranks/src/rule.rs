//! Which of two spheres travels: the larger one to the owner of the smaller; within a class, one way between two ranks.

use crate::Class;

/// Where a sphere is, and how large.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Side {
    /// The rank that owns it.
    pub rank: u32,
    /// The class of its effective radius.
    pub class: Class,
}

/// Returns `true` if `sphere` travels to the owner of `other`, which then reports the pair. Of two spheres on different
/// ranks exactly one travels to the other; on one rank none does.
#[inline]
pub fn travels(sphere: Side, other: Side, ranks: u32) -> bool {
    if sphere.rank == other.rank {
        return false;
    }
    match sphere.class.cmp(&other.class) {
        std::cmp::Ordering::Equal => sends(sphere.rank, other.rank, ranks),
        order => order.is_gt(),
    }
}

/// Returns `true` if spheres of one class travel from one rank to another, and not the other way round.
///
/// By round robin: a rank sends to those up to half the ranks ahead of it and receives from the others, so that all
/// have equally much of either, also where everybody meets everybody. Two that are exactly half of all ranks apart
/// take turns.
#[inline]
pub fn sends(from: u32, to: u32, ranks: u32) -> bool {
    let (from, to, ranks) = (u64::from(from), u64::from(to), u64::from(ranks.max(1)));
    let ahead = (to + ranks - from % ranks) % ranks;
    match (2 * ahead).cmp(&ranks) {
        std::cmp::Ordering::Equal => (from < to) == (from.min(to) % 2 == 0),
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
                assert!(!sends(from, from, ranks));
                let received = (0..ranks).filter(|&to| sends(to, from, ranks)).count() as u32;
                assert!(
                    received.abs_diff((ranks - 1) / 2) <= 1,
                    "{from} of {ranks} receives from {received}"
                );
                for to in (0..ranks).filter(|&to| to != from) {
                    assert_ne!(sends(from, to, ranks), sends(to, from, ranks), "{from}, {to} of {ranks}");
                }
            }
        }
    }

    #[test]
    fn the_larger_one_travels() {
        let side = |rank, radius| Side { rank, class: Class::of(radius) };
        for (a, b) in [(0, 1), (1, 0), (7, 3)] {
            assert!(travels(side(a, 2.0), side(b, 1.0), 8));
            assert!(!travels(side(a, 1.0), side(b, 2.0), 8));
            assert_ne!(travels(side(a, 1.0), side(b, 1.5), 8), travels(side(b, 1.5), side(a, 1.0), 8));
            assert!(!travels(side(a, 2.0), side(a, 1.0), 8));
        }
    }
}
