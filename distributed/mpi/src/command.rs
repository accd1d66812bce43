//! What the command does. `detect` reads, settles, searches, writes, and says what was found; `scale` takes times.

pub(crate) mod args;
mod input;
mod manifest;
mod npy;
mod output;
mod scale;
mod summary;
mod text;

use std::io::{self, Write};
use std::time::Instant;

use lazygrid_mpi::{Config, Distributed, Error, agree};
use mpi::topology::SimpleCommunicator;
use mpi::traits::Communicator;

use crate::command::args::Detect;
use crate::command::output::{Target, write};
use crate::command::summary::Summary;

pub(crate) use scale::scale;

/// Collective, as all of the command: every rank returns the same.
pub(crate) fn detect(world: &SimpleCommunicator, args: &Detect) -> Result<(), Error> {
    let target = agree(world, Target::of(args).map_err(|message| refused(world, message)))?;
    let begun = Instant::now();
    let input = input::read(world, args)?;
    let read = begun.elapsed();
    let mut config = Config::default()
        .space(input.space)
        .ownership(args.ownership())
        .backend(args.backend)
        .max_pairs(args.max_pairs);
    if let Some(threads) = args.threads {
        config = config.threads(threads);
    }
    let mut distributed = Distributed::new(world, config)?;
    let mut particles = input.particles;
    let begun = Instant::now();
    distributed.settle(&mut particles)?;
    let settled = begun.elapsed();
    let local = particles.local().map_err(|error| refused(world, error.to_string()));
    let local = agree(world, local)?;
    let begun = Instant::now();
    let mut files = Vec::new();
    let mut written = None;
    let searched = match target {
        None => {
            distributed.count(local)?;
            begun.elapsed()
        }
        Some(target) => {
            let pairs: Vec<[u64; 2]> = distributed.pairs(local)?.iter().map(|pair| pair.ids()).collect();
            let searched = begun.elapsed();
            let begun = Instant::now();
            files = write(world, &mut distributed, &target, pairs)?;
            written = Some(begun.elapsed());
            searched
        }
    };
    let times =
        [("read", Some(read)), ("settle", Some(settled)), ("search", Some(searched)), ("write", written)];
    let summary = Summary { report: distributed.report(), space: input.space, files, times };
    if world.rank() != 0 {
        return Ok(());
    }
    print(world, &if args.json { summary.json() } else { summary.to_string() })
}

/// Writes to standard output at once.
fn print(world: &SimpleCommunicator, text: &str) -> Result<(), Error> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        // Whoever reads has read enough.
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(refused(world, format!("cannot write to standard output: {error}")))
        }
        _ => Ok(()),
    }
}

/// What this rank cannot go on with.
pub(crate) fn refused(world: &SimpleCommunicator, message: String) -> Error {
    Error::Input { rank: world.rank() as u32, index: None, message }
}
