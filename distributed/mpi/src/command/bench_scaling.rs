use std::time::{Duration, Instant};

use lazygrid::Sphere;
use lazygrid::glam::Vec3;
use lazygrid_mpi::{Config, Distributed, Error, OwnedSpheres, Ownership, Report, agree, try_reserved};
use lazygrid_ranks::tie_breaker;
use mpi::collective::SystemOperation;
use mpi::topology::SimpleCommunicator;
use mpi::traits::{Communicator, CommunicatorCollectives};
use serde_json::json;

use super::args::{BenchScaling, Scene};
use super::rank_range::rank_range;
use super::{Failure, print, refused};

#[derive(Default)]
struct Step {
    rebalance: Duration,
    search: Duration,
    moved: u64,
    /// Bytes of all ranks, in the search.
    sent: u64,
}

/// Collective.
pub(crate) fn bench_scaling(world: &SimpleCommunicator, args: &BenchScaling) -> Result<(), Failure> {
    let ranks = world.size() as u64;
    let spheres = args.spheres.unwrap_or_else(|| args.per_rank.saturating_mul(ranks));
    let mut config = Config::default().ownership(Ownership::BALANCE).backend(args.backend);
    if let Some(threads) = args.threads {
        config = config.threads(threads.get());
    }
    let mut distributed = Distributed::new(world, config)?;
    let mut particles = rank_spheres(world, args.scene, spheres)?;
    // The first step moves all spheres and allocates buffers.
    let first = step(world, &mut distributed, &mut particles)?;
    let mut steps = Vec::new();
    for number in 1..=args.steps {
        wander(&mut particles, number);
        steps.push(step(world, &mut distributed, &mut particles)?);
    }
    if world.rank() != 0 {
        return Ok(());
    }
    Ok(print(world, &row(args, &first, &steps, distributed.report()))?)
}

fn step(
    world: &SimpleCommunicator,
    distributed: &mut Distributed,
    particles: &mut OwnedSpheres,
) -> Result<Step, Error> {
    world.barrier();
    let begun = Instant::now();
    let rebalanced = distributed.rebalance(particles)?;
    let rebalance = slowest(world, begun.elapsed());
    let local = agree(world, particles.local().map_err(|error| refused(world, error.to_string())))?;
    let begun = Instant::now();
    distributed.count(local)?;
    let search = slowest(world, begun.elapsed());
    let mut sent = 0;
    world.all_reduce_into(&distributed.report().sent, &mut sent, SystemOperation::sum());
    Ok(Step { rebalance, search, moved: rebalanced.moved, sent })
}

fn slowest(world: &SimpleCommunicator, local: Duration) -> Duration {
    let mut most = 0.0;
    world.all_reduce_into(&local.as_secs_f64(), &mut most, SystemOperation::max());
    Duration::from_secs_f64(most)
}

fn row(args: &BenchScaling, first: &Step, steps: &[Step], report: &Report) -> String {
    let spheres = report.owned.total.max(1) as f64;
    let median = |value: fn(&Step) -> f64| median(steps.iter().map(value).collect());
    let object = json!({
        "ranks": report.owned.ranks,
        "scene": args.scene.name(),
        "spheres": report.owned.total,
        "pairs": report.pairs.total,
        "imbalance": { "spheres": report.owned.imbalance(), "pairs": report.pairs.imbalance() },
        "ghosts_per_sphere": report.ghosts.total as f64 / spheres,
        "bytes_per_sphere": median(|step| step.sent as f64).map(|sent| sent / spheres),
        "moved_per_step": median(|step| step.moved as f64),
        "first_seconds": { "rebalance": first.rebalance.as_secs_f64(), "search": first.search.as_secs_f64() },
        "seconds": {
            "rebalance": median(|step| step.rebalance.as_secs_f64()),
            "search": median(|step| step.search.as_secs_f64()),
        },
        "reason": report.detector,
    });
    format!("{object}\n")
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let [below, above] = [values.len().saturating_sub(1) / 2, values.len() / 2];
    Some(f64::midpoint(*values.get(below)?, *values.get(above)?))
}

/// Consecutive ids make the first step move almost all spheres.
fn rank_spheres(world: &SimpleCommunicator, scene: Scene, spheres: u64) -> Result<OwnedSpheres, Error> {
    let (rank, ranks) = (world.rank() as u64, world.size() as u64);
    let ids = rank_range(spheres, rank, ranks);
    let mut local = agree(world, try_reserved("spheres", ids.end - ids.start, rank as u32))?;
    local.extend(ids.clone().map(|id| sphere(scene, id, spheres)));
    Ok(OwnedSpheres { spheres: local, ids: ids.collect(), ..OwnedSpheres::default() })
}

/// Fills 5 % of a cube or of the middle of a cloud.
fn sphere(scene: Scene, id: u64, spheres: u64) -> Sphere {
    let cubes = match scene {
        Scene::FiveSizes => 0.2 * (0..5).map(|k| 0.125_f64.powi(k)).sum::<f64>(),
        _ => 1.0,
    };
    let side = (spheres as f64 * 4.19 * cubes / 0.05).cbrt() as f32;
    let cube = |scale: f32| Vec3::from([1, 2, 3].map(|axis| scale * (random(id, axis) - 0.5)));
    match scene {
        Scene::Uniform => Sphere::new(cube(side), 1.0),
        Scene::FiveSizes => Sphere::new(cube(side), 0.5_f32.powi((id % 5) as i32)),
        // The sum of four uniform numbers has a standard deviation of 0.58.
        Scene::Gaussian => {
            let sum = |axis: u64| (0..4).map(|k| random(id, 8 * axis + k) - 0.5).sum::<f32>();
            Sphere::new(Vec3::from([1, 2, 3].map(sum)) * (side / 1.45), 1.0)
        }
        Scene::Point => Sphere::new(Vec3::ZERO, 1.0),
    }
}

fn wander(particles: &mut OwnedSpheres, step: u32) {
    for (sphere, &id) in particles.spheres.iter_mut().zip(&particles.ids) {
        let by = [0, 1, 2].map(|axis| 2.0 * random(id, u64::from(step) * 4 + axis + 64) - 1.0);
        sphere.center += 0.1 * sphere.radius * Vec3::from(by);
    }
}

fn random(id: u64, stream: u64) -> f32 {
    (tie_breaker(tie_breaker(id) ^ stream) >> 40) as f32 / (1_u32 << 24) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn median_of_an_even_number_is_between_the_two_in_the_middle() {
        assert_eq!(median(vec![]), None);
        assert_eq!(median(vec![3.0]), Some(3.0));
        assert_eq!(median(vec![9.0, 1.0]), Some(5.0));
        assert_eq!(median(vec![4.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(vec![8.0, 1.0, 4.0, 2.0]), Some(3.0));
    }
}
