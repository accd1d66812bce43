//! Separation of overlaps whose particles are on several ranks.
//!
//! # Correctness
//! 1. One rank reports a pair. It knows both positions, and sends the ghost's displacement to the owner.
//! 2. Displacements are integers, so their sum at the owner does not depend on ranks.

use bytemuck::{Pod, Zeroable};
use lazygrid::Pair;
use lazygrid_ranks::{Communicator, Ghosts, send_to_ranks};

use crate::Simulation;
use crate::motion::contact::{PASSES, Push};
use crate::random::philox::StepKey;

/// Ghosts follow `own_count` particles, and `sent` are ghosts on each rank.
#[derive(Clone, Copy, Debug)]
pub(super) struct SharedParticles<'a> {
    pub(super) own_count: usize,
    pub(super) ghosts: &'a Ghosts,
    pub(super) sent: &'a [Vec<u32>],
}

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct GhostState {
    position: [f32; 3],
    /// 1 if the particle has not reacted.
    free: u32,
}

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct PushMessage {
    at: u64,
    push: [i64; 3],
}

/// Skips particles that `reacted`.
pub(super) fn separate<C: Communicator>(
    communicator: &mut C,
    run: &mut Simulation,
    shared: SharedParticles<'_>,
    pairs: &[Pair],
    mut reacted: Vec<u32>,
) -> Result<(), C::Error> {
    let SharedParticles { own_count, ghosts, sent } = shared;
    reacted.sort_unstable();
    let mut free: Vec<bool> = (0..own_count as u32).map(|at| reacted.binary_search(&at).is_err()).collect();
    free.resize(run.state.particles.len(), true);
    let counts: Vec<usize> = sent.iter().map(Vec::len).collect();
    for pass in 0..PASSES {
        let Simulation { key, state, contacts, .. } = &mut *run;
        let particles = &mut state.particles;
        let states = sent.iter().flatten().map(|&at| GhostState {
            position: particles.position_of(at as usize),
            free: free[at as usize].into(),
        });
        let (states, _) =
            communicator.all_to_all_v("ghosts that move", &states.collect::<Vec<_>>(), &counts)?;
        for (at, ghost) in (own_count..).zip(states) {
            particles.set_position(at, ghost.position);
            free[at] = ghost.free > 0;
        }
        let now = StepKey { key: *key, step: state.step };
        let pushes = contacts.pushes(particles, pairs, |at| free[at as usize], now);
        if pass == 0 {
            state.totals.contacts += pushes.len() as u64 / 2;
        }
        if communicator.all_reduce_sum(&[pushes.len() as u64])[0] == 0 {
            break;
        }
        let (mut pushes, across): (Vec<Push>, Vec<Push>) =
            pushes.into_iter().partition(|&(at, _)| (at as usize) < own_count);
        let message = |(at, push): Push| {
            let ghost = at - own_count as u32;
            (ghosts.rank_of(ghost), PushMessage { at: ghosts.particles()[ghost as usize].index.into(), push })
        };
        let across = across.into_iter().map(message).collect();
        let (came, _) = send_to_ranks(communicator, "displacements of ghosts", across)?;
        pushes.extend(came.iter().map(|message| (message.at as u32, message.push)));
        contacts.displace(particles, pushes);
    }
    Ok(())
}
