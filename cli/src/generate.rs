use lazygrid::Sphere;
use lazygrid_io::scenes::Scene;
use lazygrid_io::write;

use crate::args::Generate;
use crate::failure::Failure;
use crate::progress::Progress;

/// Writes a scene after some moves.
pub(crate) fn run(args: &Generate) -> Result<(), Failure> {
    let n = args.spheres as usize;
    // The scene would end the program where memory is refused.
    Vec::<Sphere>::new().try_reserve_exact(n).map_err(|_| Failure::NoMemory { spheres: args.spheres })?;
    let progress = Progress::new(None);
    progress.say(format!("generating {n} spheres"));
    let mut spheres = args.scene.spheres(n, args.seed);
    for step in 0..args.step {
        Scene::advance(&mut spheres, args.seed, step);
    }
    let (path, format) = &args.output;
    progress.say(format!("writing {n} spheres"));
    Ok(write::spheres(path, *format, &spheres)?)
}
