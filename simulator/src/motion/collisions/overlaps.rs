//! Bounces of overlapping pairs at the beginning of a step, in the order of their ids.
//!
//! # Correctness
//!
//! 1. A pair bounces after all earlier pairs of its particles, as in a sequential pass.
//! 2. In each round, a particle is in one pair at most, so its owner and the ranks with a ghost of it agree.
//! 3. The first remaining pair always bounces, so the rounds end.

use rayon::prelude::*;

use super::halo::Halo;
use super::mover::Mover;
use super::rounds::Adjacency;
use super::rules::Rules;

/// Lets overlapping pairs bounce if they approach and cannot react. Returns all ranks' bounces. The first `own_count`
/// movers are this rank's.
pub(super) fn bounce_overlaps<H: Halo>(
    rules: &Rules,
    movers: &mut [Mover],
    own_count: usize,
    candidates: &[[u32; 2]],
    halo: &mut H,
) -> Result<u64, H::Error> {
    let overlaps = |&pair: &[u32; 2]| {
        let mut pair = pair;
        pair.sort_unstable_by_key(|&at| movers[at as usize].id);
        let both = pair.map(|at| &movers[at as usize]);
        let bounces = !rules.may_react(both) && rules.overlap(both);
        bounces.then_some((both.map(|mover| mover.id), pair))
    };
    let mut pairs: Vec<_> = candidates.par_iter().filter_map(overlaps).collect();
    if halo.gather(pairs.len() as u64).iter().all(|&pairs| pairs == 0) {
        return Ok(0);
    }
    pairs.par_sort_unstable();
    let pairs: Vec<[u32; 2]> = pairs.into_iter().map(|(_, pair)| pair).collect();
    let mut partners = Adjacency::default();
    // Each particle's partners are in the order of pairs.
    partners.build(&pairs, movers.len());
    let mut resolved = vec![0; movers.len()];
    let mut changed: Vec<u32> = (0..movers.len() as u32).collect();
    let mut bounces = 0;
    loop {
        let next = |at: u32| partners.neighbors_of(at).get(resolved[at as usize]).copied();
        let pair = |&at: &u32| {
            let other = next(at).filter(|&other| next(other) == Some(at))?;
            let in_order = movers[at as usize].id < movers[other as usize].id;
            let is_own = (at.min(other) as usize) < own_count;
            is_own.then_some(if in_order { [at, other] } else { [other, at] })
        };
        let mut ready: Vec<_> = changed.iter().filter_map(pair).collect();
        ready.sort_unstable();
        ready.dedup();
        if halo.gather(ready.len() as u64).iter().sum::<u64>() == 0 {
            break;
        }
        changed.clear();
        for pair in ready {
            let mut both = pair.map(|at| movers[at as usize]);
            let has_collided = rules.collide(&mut both);
            bounces += u64::from(has_collided && (pair[0] as usize) < own_count);
            for (at, mover) in pair.into_iter().zip(both).filter(|&(at, _)| (at as usize) < own_count) {
                movers[at as usize] = mover;
                changed.push(at);
            }
        }
        halo.refresh(movers, &mut changed)?;
        changed.iter().for_each(|&at| resolved[at as usize] += 1);
    }
    Ok(halo.gather(bounces).iter().sum())
}
