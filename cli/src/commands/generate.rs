use lazygrid::Sphere;
use lazygrid_io::scenes::{Scene, Transceivers};
use lazygrid_io::{AvailableMemory, write};

use super::lacking_with_threads;
use crate::args::Generate;
use crate::error::CliError;
use crate::progress::Progress;

/// Bytes besides the spheres.
const OVERHEAD: u64 = 64 << 20;

pub(crate) fn run(args: &Generate) -> Result<(), CliError> {
    let scene = scene(args)?;
    let n = args.spheres as usize;
    let needed = args.spheres.saturating_mul(size_of::<Sphere>() as u64).saturating_add(OVERHEAD);
    let (needed, lacking) = lacking_with_threads(needed);
    if let Some(AvailableMemory { bytes: available, limit }) = lacking {
        let limit = limit.name();
        return Err(CliError::TooLittleMemoryToGenerate { spheres: args.spheres, needed, available, limit });
    }
    // A refused allocation would end the process.
    Vec::<Sphere>::new().try_reserve_exact(n).map_err(|_| CliError::NoMemory { spheres: args.spheres })?;
    let progress = Progress::new(None);
    progress.say(format!("generating {n} spheres"));
    let mut spheres = scene.spheres(n, args.seed);
    for step in 0..args.steps {
        Scene::advance(&mut spheres, args.seed, step);
    }
    let (path, format) = &args.output;
    progress.say(format!("writing {n} spheres"));
    Ok(write::spheres(path, *format, &spheres)?)
}

fn scene(args: &Generate) -> Result<Scene, CliError> {
    match (args.scene, args.transceivers, args.size_ratio) {
        (Scene::Transceivers(_), Some(transceivers), _) if u64::from(transceivers) > args.spheres => {
            Err(CliError::TooManyTransceivers { transceivers, spheres: args.spheres })
        }
        (Scene::Transceivers(Transceivers { count, ratio }), requested_count, requested_ratio) => {
            Ok(Scene::Transceivers(Transceivers {
                count: requested_count.unwrap_or(count),
                ratio: requested_ratio.unwrap_or(ratio),
            }))
        }
        (scene, None, None) => Ok(scene),
        (scene, ..) => Err(CliError::NoTransceivers { scene }),
    }
}
