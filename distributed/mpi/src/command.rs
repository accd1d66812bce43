pub(crate) mod args;
mod bench_scaling;
mod failure;
mod input;
mod manifest;
mod output;
mod rank_range;
mod simulate;
mod summary;
mod text;

use std::io::{self, Write};
use std::time::{Duration, Instant};

use lazygrid::Space;
use lazygrid_io::read::Precision;
use lazygrid_mpi::{Config, Distributed, Error, GlobalPair, agree, try_reserved};
use mpi::topology::SimpleCommunicator;
use mpi::traits::Communicator;

use crate::command::args::Detect;
use crate::command::output::{Target, write};
use crate::command::summary::Summary;

pub(crate) use bench_scaling::bench_scaling;
pub(crate) use failure::Failure;
pub(crate) use simulate::simulate;

/// Collective.
pub(crate) fn detect(world: &SimpleCommunicator, args: &Detect) -> Result<(), Failure> {
    let target = agree(world, Target::from_args(world, args).map_err(|message| refused(world, message)));
    let target = target.map_err(Failure::Usage)?;
    let mut times = Times::default();
    let input = times.take("read", || input::read(world, args))?;
    let mut distributed = Distributed::new(world, config(args, input.space))?;
    let mut particles = input.particles;
    let precision = if particles.doubles.is_some() { Precision::F64 } else { Precision::F32 };
    times.take("rebalance", || distributed.rebalance(&mut particles))?;
    let local = particles.local().map_err(|error| refused(world, error.to_string()));
    let local = agree(world, local)?;
    let files = match target {
        None => times.take("search", || distributed.count(local)).map(|_| Vec::new())?,
        Some(target) => {
            let pairs = times.take("search", || {
                let pairs = distributed.pairs(local)?;
                let ids = try_reserved("ids of pairs", pairs.len() as u64, world.rank() as u32);
                let mut ids = agree(world, ids)?;
                ids.extend(pairs.iter().map(GlobalPair::ids));
                Ok(ids)
            })?;
            times.take("write", || write(world, &mut distributed, &target, pairs))?
        }
    };
    if world.rank() != 0 {
        return Ok(());
    }
    let (report, space) = (distributed.report(), input.space);
    let summary = Summary { report, space, precision, files, times: times.0 };
    Ok(print(world, &if args.json { summary.json() } else { summary.to_string() })?)
}

fn config(args: &Detect, space: Space) -> Config {
    let config = Config::default()
        .space(space)
        .ownership(args.ownership())
        .backend(args.backend)
        .max_pairs(args.max_pairs);
    match args.threads {
        Some(threads) => config.threads(threads.get()),
        None => config,
    }
}

#[derive(Default)]
struct Times(Vec<(&'static str, Duration)>);

impl Times {
    fn take<T>(&mut self, name: &'static str, work: impl FnOnce() -> Result<T, Error>) -> Result<T, Error> {
        let begun = Instant::now();
        let result = work();
        self.0.push((name, begun.elapsed()));
        result
    }
}

fn print(world: &SimpleCommunicator, text: &str) -> Result<(), Error> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(refused(world, format!("cannot write to standard output: {error}")))
        }
        _ => Ok(()),
    }
}

pub(crate) fn refused(world: &SimpleCommunicator, message: String) -> Error {
    Error::Input { rank: world.rank() as u32, index: None, message }
}
