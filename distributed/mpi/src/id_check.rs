use bytemuck::{Pod, Zeroable};
use lazygrid_ranks::{Communicator, Digest};

use crate::communicator::{MpiCommunicator, try_reserved};
use crate::{Error, LocalSpheres};

#[derive(Debug, Default)]
pub(crate) struct IdCheck {
    /// Digest of the last unique ids.
    unique: Option<Digest>,
}

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct IdSummary {
    ids: Digest,
    spheres: u64,
    /// 1 for `f64` spheres, else 0.
    is_f64: u64,
}

#[derive(Debug)]
pub(crate) struct OwnedCounts {
    pub(crate) of_ranks: Vec<u64>,
    pub(crate) are_f64: bool,
}

impl OwnedCounts {
    fn new(summaries: &[IdSummary]) -> Result<Self, Error> {
        let has = |is_f64: u64| move |summary: &IdSummary| summary.spheres > 0 && summary.is_f64 == is_f64;
        let [first_f32, first_f64] = [0, 1].map(|is_f64| summaries.iter().position(has(is_f64)));
        if let (Some(other), Some(rank)) = (first_f32, first_f64) {
            let message =
                format!("the spheres are f64, but those of rank {other} f32; give all ranks one type");
            return Err(Error::Input { rank: rank as u32, index: None, message });
        }
        let of_ranks = summaries.iter().map(|summary| summary.spheres).collect();
        Ok(Self { of_ranks, are_f64: first_f64.is_some() })
    }
}

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct IdRecord {
    id: u64,
    index: u64,
}

impl IdCheck {
    /// Refuses duplicate ids and spheres of different types. Compares ids if their set has changed.
    pub(crate) fn check(
        &mut self,
        comm: &mut MpiCommunicator,
        local: LocalSpheres<'_>,
    ) -> Result<OwnedCounts, Error> {
        let summary = IdSummary {
            ids: Digest::from_ids(local.ids.iter().copied()),
            spheres: local.ids.len() as u64,
            is_f64: local.spheres.is_f64().into(),
        };
        let (summaries, _) = comm.all_gather("counts", &[summary])?;
        // Fails on all ranks.
        let counts = OwnedCounts::new(&summaries)?;
        let digest = summaries.iter().fold(Digest::default(), |all, summary| all.join(summary.ids));
        if self.unique != Some(digest) {
            self.unique = None;
            compare(comm, local)?;
            self.unique = Some(digest);
        }
        Ok(counts)
    }
}

/// Compares each id on the rank of its hash.
fn compare(comm: &mut MpiCommunicator, local: LocalSpheres<'_>) -> Result<(), Error> {
    let (rank, ranks) = (comm.rank(), comm.ranks());
    let records = comm.agree(records(local, rank, ranks))?;
    let (mut records, counts) = comm.all_to_all_v("ids", &records.0, &records.1)?;
    let from = (0_u64..).zip(&counts).flat_map(|(rank, &count)| std::iter::repeat_n(rank, count));
    // An index has 32 bits.
    records.iter_mut().zip(from).for_each(|(record, rank)| record.index |= rank << 32);
    records.sort_unstable_by_key(|record| (record.id, record.index));
    let rank_and_index = |record: &IdRecord| [(record.index >> 32) as u32, record.index as u32];
    let duplicate = match records.windows(2).find(|two| two[0].id == two[1].id) {
        Some([one, other]) => {
            Err(Error::DuplicateId { id: one.id, first: rank_and_index(one), second: rank_and_index(other) })
        }
        _ => Ok(()),
    };
    comm.agree(duplicate)
}

fn records(local: LocalSpheres<'_>, rank: u32, ranks: u32) -> Result<(Vec<IdRecord>, Vec<usize>), Error> {
    let mut counts = vec![0; ranks as usize];
    let mut records: Vec<IdRecord> = try_reserved("ids", local.ids.len() as u64, rank)?;
    records.extend((0..).zip(local.ids).map(|(index, &id)| IdRecord { id, index }));
    local.ids.iter().for_each(|&id| counts[Digest::home_rank(id, ranks) as usize] += 1);
    records.sort_unstable_by_key(|record| (Digest::home_rank(record.id, ranks), record.index));
    Ok((records, counts))
}
