use lazygrid_ranks::Settings;
use mpi::traits::Communicator;

use crate::communicator::MpiCommunicator;
use crate::{Config, Error};

/// Compares a program's settings on all ranks. Collective.
///
/// # Errors
/// [`Error::Settings`] on all ranks if one differs.
pub fn agree_on(communicator: &impl Communicator, settings: &Settings) -> Result<(), Error> {
    settings.agree(&mut MpiCommunicator::new(communicator.duplicate(), Config::default().message_limit))
}
