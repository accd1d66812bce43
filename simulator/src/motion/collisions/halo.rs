//! Exchange of moving particles between ranks.

use bytemuck::Pod;

use super::mover::Mover;
use crate::Error;

/// Candidate pairs from a mover to the farthest one that its event depends on: its partner, a neighbor that may leave
/// its path, and a third that may hit this neighbor.
pub(crate) const HOPS: u32 = 3;

/// Every method is collective.
pub(crate) trait Halo {
    /// Equal on all ranks.
    type Error;

    fn agree<T>(&self, result: Result<T, Error>) -> Result<T, Self::Error>;

    /// Returns the values of all ranks. A value consists of 64-bit words.
    fn gather<T: Pod>(&mut self, value: T) -> Vec<T>;

    /// Appends at least the movers of other ranks up to [`HOPS`] candidate pairs away. Surfaces of a candidate pair are
    /// within twice the `allowance`.
    fn add_ghosts(&mut self, movers: &mut Vec<Mover>, allowance: f64) -> Result<(), Self::Error>;

    /// Updates ghosts that their owners changed, and appends their indices to `changed`.
    fn refresh(&mut self, movers: &mut [Mover], changed: &mut Vec<u32>) -> Result<(), Self::Error>;
}

#[derive(Debug)]
pub(crate) struct SingleProcess;

impl Halo for SingleProcess {
    type Error = Error;

    fn agree<T>(&self, result: Result<T, Error>) -> Result<T, Error> {
        result
    }

    fn gather<T: Pod>(&mut self, value: T) -> Vec<T> {
        vec![value]
    }

    fn add_ghosts(&mut self, _: &mut Vec<Mover>, _: f64) -> Result<(), Error> {
        Ok(())
    }

    fn refresh(&mut self, _: &mut [Mover], _: &mut Vec<u32>) -> Result<(), Error> {
        Ok(())
    }
}
