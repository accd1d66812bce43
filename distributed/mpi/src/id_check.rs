use bytemuck::{Pod, Zeroable};
use lazygrid_ranks::{Communicator, Digest};

use crate::communicator::{MpiCommunicator, try_zeroed};
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
}

/// An id and its sphere's index, for the rank that compares.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct IdRecord {
    id: u64,
    index: u64,
}

impl IdCheck {
    /// Refuses duplicate ids, and returns the spheres by rank. Compares no set that equals the last call's.
    pub(crate) fn check(
        &mut self,
        comm: &mut MpiCommunicator,
        local: LocalSpheres<'_>,
    ) -> Result<Vec<u64>, Error> {
        let own = IdSummary { ids: Digest::of(local.ids.iter().copied()), spheres: local.ids.len() as u64 };
        let (summaries, _) = comm.all_gather("counts", &[own])?;
        let digest = summaries.iter().fold(Digest::default(), |all, summary| all.join(summary.ids));
        if self.unique != Some(digest) {
            self.unique = None;
            compare(comm, local)?;
            self.unique = Some(digest);
        }
        Ok(summaries.iter().map(|summary| summary.spheres).collect())
    }
}

/// Equal ids meet on the rank of their hash.
fn compare(comm: &mut MpiCommunicator, local: LocalSpheres<'_>) -> Result<(), Error> {
    let (rank, ranks) = (comm.rank(), comm.ranks());
    let records = comm.agree(records(local, rank, ranks))?;
    let (records, counts) = comm.all_to_all_v("ids", &records.0, &records.1)?;
    let from = (0..).zip(&counts).flat_map(|(rank, &count)| std::iter::repeat_n(rank, count));
    let met = try_zeroed("ids", records.len() as u64, rank).map(|mut met: Vec<IdRecord>| {
        // Sorted by id, rank and index, which has 32 bits.
        let placed =
            |(record, rank): (&IdRecord, u64)| IdRecord { index: rank << 32 | record.index, ..*record };
        met.iter_mut().zip(records.iter().zip(from).map(placed)).for_each(|(met, record)| *met = record);
        met.sort_unstable_by_key(|record| (record.id, record.index));
        met
    });
    let met = comm.agree(met)?;
    let place = |record: &IdRecord| [(record.index >> 32) as u32, record.index as u32];
    let duplicate = match met.windows(2).find(|two| two[0].id == two[1].id) {
        Some([one, other]) => Err(Error::DuplicateId { id: one.id, first: place(one), second: place(other) }),
        _ => Ok(()),
    };
    comm.agree(duplicate)
}

/// Grouped by home rank, with their number for each.
fn records(local: LocalSpheres<'_>, rank: u32, ranks: u32) -> Result<(Vec<IdRecord>, Vec<usize>), Error> {
    let mut counts = vec![0; ranks as usize];
    let mut records: Vec<IdRecord> = try_zeroed("ids", local.ids.len() as u64, rank)?;
    for ((index, &id), record) in (0..).zip(local.ids).zip(&mut records) {
        *record = IdRecord { id, index };
        counts[Digest::home_rank(id, ranks) as usize] += 1;
    }
    records.sort_unstable_by_key(|record| (Digest::home_rank(record.id, ranks), record.index));
    Ok((records, counts))
}
