use bytemuck::{Pod, Zeroable};
use lazygrid_ranks::{Carrier, Digest};

use crate::wire::Wire;
use crate::{Error, Local};

/// Sees to it that no two spheres of all ranks have the same id.
#[derive(Debug, Default)]
pub(crate) struct Identity {
    /// The ids that were looked at last, and are each of one sphere.
    known: Option<Digest>,
}

/// The summary of a rank's ids and spheres in every call.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Card {
    ids: Digest,
    spheres: u64,
}

/// An id and the place of its sphere, as it goes to the rank that looks for another one.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Claim {
    id: u64,
    index: u64,
}

impl Identity {
    /// Refuses ids that two spheres have, and tells how many spheres each rank has. Ids are compared only when they are not
    /// those of the last call, whichever ranks they are on now.
    pub(crate) fn check(&mut self, wire: &mut Wire, local: Local<'_>) -> Result<Vec<u64>, Error> {
        let own = Card { ids: Digest::of(local.ids.iter().copied()), spheres: local.ids.len() as u64 };
        let (cards, _) = wire.share("counts", &[own])?;
        let digest = cards.iter().fold(Digest::default(), |all, card| all.join(card.ids));
        if self.known != Some(digest) {
            self.known = None;
            compare(wire, local)?;
            self.known = Some(digest);
        }
        Ok(cards.iter().map(|card| card.spheres).collect())
    }
}

/// Every id goes to the rank that a hash of it says, so that equal ones meet.
fn compare(wire: &mut Wire, local: Local<'_>) -> Result<(), Error> {
    let ranks = wire.ranks();
    let judges: Vec<u32> = local.ids.iter().map(|&id| Digest::judge(id, ranks)).collect();
    let mut order: Vec<u32> = (0..judges.len() as u32).collect();
    order.sort_by_key(|&k| judges[k as usize]);
    let claim = |&k: &u32| Claim { id: local.ids[k as usize], index: k.into() };
    let claims: Vec<_> = order.iter().map(claim).collect();
    let mut counts = vec![0; ranks as usize];
    judges.iter().for_each(|&judge| counts[judge as usize] += 1);
    let (claims, counts) = wire.exchange("ids", &claims, &counts)?;
    let from = (0..).zip(&counts).flat_map(|(rank, &count)| std::iter::repeat_n(rank, count));
    let mut met: Vec<(u64, [u32; 2])> =
        claims.iter().zip(from).map(|(claim, rank)| (claim.id, [rank, claim.index as u32])).collect();
    met.sort_unstable();
    let twice = match met.windows(2).find(|two| two[0].0 == two[1].0) {
        Some(two) => Err(Error::DuplicateId { id: two[0].0, first: two[0].1, second: two[1].1 }),
        None => Ok(()),
    };
    wire.agree(twice)
}
