//! Figure 5: a burst of carriers of ten sizes.

use std::error::Error;
use std::path::Path;

use lazygrid::{Algorithm, Backend, Config, Detector, Sphere};
use lazygrid_sim::scenario::Scenario;
use lazygrid_sim::{Contact, Model, Shape, Simulation, State};

use super::comparison::{Comparison, Limits};
use super::plan::DataPoint;
use super::row::Row;
use super::{Contender, Figure};

const SCENARIO: &str = include_str!("../../../simulator/scenarios/burst.toml");
const NAME: &str = "simulator/scenarios/burst.toml";

pub(super) const DESCRIPTION: &str = "The scenario is simulator/scenarios/burst.toml without its receiver: one \
    transmitter releases carriers of ten radii, 1 to 10 nm in equal numbers, from one point into unbounded water of \
    25 °C, where they diffuse with the Stokes–Einstein coefficient. Because hard spheres cannot share one point, \
    they are first placed uniformly in a ball of twice their total volume and pushed apart until none overlap, which \
    widens the ball by a few percent. They then diffuse, and contacts push them apart (`separate`), in steps of 2 \
    ns, in which the root-mean-square displacement of the smallest along each axis is at most their radius. Engines \
    are timed after 1, 10, 100 … steps in figure 5a, after 1, 100, 10 000 … in 5b, and at the end. Both the cost of \
    a step and the time that a burst needs to disperse grow with the number of carriers, so large bursts are \
    simulated for a shorter time and disperse only a little. At each moment, every engine searches the same \
    consecutive steps; the first one updates its data structure and is not timed. Times are of the search alone, on \
    all threads; the sweep of N3Sim uses one.";

/// Steps of 2 ns, in which √(2·D·t) of a carrier with radius 1 nm and D = 245 µm²/s is 0.99 nm.
const STEPS_PER_SECOND: f64 = 5e8;
/// Volume fraction of the initial ball: about the freezing density of hard spheres.
const INITIAL_FILLING: f64 = 0.5;
/// Time step in seconds that moves particles by less than rounding errors.
const NEGLIGIBLE_TIME_STEP: f64 = 1e-30;
/// Relative growth of radii while overlaps are removed, because rounding would leave small overlaps.
const MARGIN: f32 = 1e-3;
/// Maximum number of steps that remove the initial overlaps.
const MAX_SEPARATION_STEPS: u32 = 200;

fn moments(times: u32, last: u32) -> Vec<u32> {
    let mut moments: Vec<u32> =
        std::iter::successors(Some(1), |k: &u32| k.checked_mul(times)).take_while(|&k| k < last).collect();
    moments.push(last);
    moments
}

pub(super) fn rows(
    point: &DataPoint,
    steps: u32,
    limits: Limits,
    seed: u64,
    left_out: impl Fn(Contender) -> Option<String>,
) -> Result<Vec<Row>, Box<dyn Error>> {
    let moments = moments(if point.figure == Figure::F5a { 10 } else { 100 }, steps);
    let mut comparison = Comparison::new(
        point,
        Limits {
            time: limits.time / moments.len() as u32,
            in_all: limits.in_all / moments.len() as u32,
            ..limits
        },
        left_out,
    );
    let mut burst = begin(model(point.n)?, seed)?;
    let first = burst.state().step;
    let mut rows = vec![];
    for moment in moments {
        while burst.state().step - first < moment {
            burst.step()?;
        }
        let state = burst.state().clone();
        let mut timed = Simulation::resume(burst.model().clone(), seed, Algorithm::Auto, state)?;
        let mut warm_up = true;
        while !comparison.is_over() {
            comparison.frame(&spheres(&timed), warm_up)?;
            timed.step()?;
            warm_up = false;
        }
        rows.extend(comparison.take_rows(Some(f64::from(moment) / STEPS_PER_SECOND)));
    }
    Ok(rows)
}

fn begin(model: Model, seed: u64) -> Result<Simulation, Box<dyn Error>> {
    let mut still = Model { time_step: NEGLIGIBLE_TIME_STEP, ..model.clone() };
    still.species.iter_mut().for_each(|species| species.radius *= 1.0 + MARGIN);
    let mut pushed = Simulation::new(still, seed, Algorithm::Auto)?;
    let mut detector = Detector::new(Config::default().backend(Backend::Cpu))?;
    for _ in 0..MAX_SEPARATION_STEPS {
        pushed.step()?;
        let mut state = pushed.state().clone();
        let State { particles, .. } = &mut state;
        for (radius, &species) in particles.radius.iter_mut().zip(&particles.species) {
            *radius = model.species[species as usize].radius;
        }
        let burst = Simulation::resume(model.clone(), seed, Algorithm::Auto, state)?;
        if detector.count(&spheres(&burst))? == 0 {
            return Ok(burst);
        }
    }
    Err(format!("carriers still overlap after {MAX_SEPARATION_STEPS} initial pushes").into())
}

fn model(n: usize) -> Result<Model, Box<dyn Error>> {
    let mut model = Scenario::parse(Path::new(NAME), SCENARIO.to_owned())?.model;
    // Receivers would absorb carriers and change indices.
    model.receivers.clear();
    for transmitter in &mut model.transmitters {
        let sizes = transmitter.release.len().max(1);
        transmitter.release.iter_mut().for_each(|(_, count)| *count = (n / sizes) as u32);
        let cubed = |&(species, count): &(u32, u32)| {
            f64::from(count) * f64::from(model.species[species as usize].radius).powi(3)
        };
        let radius = (transmitter.release.iter().map(cubed).sum::<f64>() / INITIAL_FILLING).cbrt();
        transmitter.shape = Shape::Shell(0.0, radius as f32);
    }
    (model.time_step, model.contact) = (1.0 / STEPS_PER_SECOND, Contact::Separate);
    Ok(model)
}

fn spheres(simulation: &Simulation) -> Vec<Sphere> {
    let particles = &simulation.state().particles;
    (0..particles.len()).map(|k| Sphere::new(particles.position_of(k), particles.radius[k])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const N: usize = 400;
    const STEPS: u32 = 300;

    fn spread(spheres: impl Iterator<Item = Sphere>) -> f64 {
        let squares: Vec<f64> = spheres.map(|sphere| f64::from(sphere.center.length_squared())).collect();
        squares.iter().sum::<f64>() / squares.len() as f64
    }

    #[test]
    fn burst_moments_grow_geometrically_up_to_the_end() {
        assert_eq!(moments(10, 1000), [1, 10, 100, 1000]);
        assert_eq!(moments(100, 400), [1, 100, 400]);
        assert_eq!(moments(10, 1), [1]);
    }

    #[test]
    fn steps_are_no_longer_than_radii() {
        let model = model(N).expect("the scenario");
        for (species, kind) in (0..).zip(&model.species) {
            let step = model.step_length(species);
            assert!(step <= f64::from(kind.radius), "{}: {step}", kind.name);
        }
    }

    #[test]
    fn burst_starts_as_a_ball_without_overlaps() {
        let model = model(4000).expect("the scenario");
        let Shape::Shell(_, radius) = model.transmitters[0].shape else { panic!("no ball") };
        let begun = spheres(&begin(model, 1).expect("positions for all carriers"));
        assert!(lazygrid::detect(&begun).expect("spheres").is_empty());
        let filled: f64 = begun.iter().map(|s| f64::from(s.radius).powi(3)).sum::<f64>();
        assert!((filled / f64::from(radius).powi(3) - INITIAL_FILLING).abs() < 1e-4);
        // In a ball, r² has a mean of 3/5 and a standard deviation of √(12/175) of the squared radius.
        let uniform = 0.6 * f64::from(radius).powi(2);
        let all = spread(begun.iter().copied()) / uniform;
        assert!((1.0..1.12).contains(&all), "{all}");
        for size in 1..=10 {
            let has_size = |s: &Sphere| (s.radius * 1000.0).round() as i32 == size;
            let relative = spread(begun.iter().copied().filter(has_size)) / uniform;
            assert!(
                (relative - all).abs() < 4.0 * (12.0_f64 / 175.0).sqrt() / 0.6 / 400.0_f64.sqrt(),
                "{size}: {relative}"
            );
        }
    }

    #[test]
    fn burst_from_one_point_spreads_to_the_initial_ball() {
        const STEPS: u32 = 1000;
        let mut model = model(N).expect("the scenario");
        let mut from_ball = begin(model.clone(), 1).expect("positions for all carriers");
        model.transmitters[0].shape = Shape::Point;
        let mut from_point = Simulation::new(model, 1, Algorithm::Auto).expect("a model");
        let ratio = |point: &Simulation, ball: &Simulation| {
            (spread(spheres(point).into_iter()) / spread(spheres(ball).into_iter())).sqrt()
        };
        assert_eq!(ratio(&from_point, &from_ball), 0.0);
        for _ in 0..STEPS {
            from_point.step().expect("a step");
            from_ball.step().expect("a step");
        }
        let ratio = ratio(&from_point, &from_ball);
        assert!((0.85..1.15).contains(&ratio), "{ratio} times as wide");
    }

    #[test]
    fn contact_spreads_equally_with_shorter_steps() {
        let model = model(N).expect("the scenario");
        let begun = begin(model.clone(), 1).expect("positions for all carriers");
        let from = spread(spheres(&begun).into_iter());
        let grown = |contact, shorter: u32| {
            let growth = |seed| {
                let time_step = model.time_step / f64::from(shorter);
                let model = Model { contact, time_step, ..model.clone() };
                let mut burst =
                    Simulation::resume(model, seed, Algorithm::Auto, begun.state().clone()).expect("a state");
                (0..STEPS * shorter).for_each(|_| burst.step().expect("a step"));
                spread(spheres(&burst).into_iter()) - from
            };
            (1..=4).map(growth).sum::<f64>() / 4.0
        };
        let alone = grown(Contact::Ignore, 1);
        let [together, finer] = [1, 3].map(|shorter| grown(Contact::Separate, shorter));
        let mean = model.species.iter().map(|kind| kind.diffusion).sum::<f64>() / model.species.len() as f64;
        let exact = 6.0 * mean * model.time_step * f64::from(STEPS);
        assert!((alone / exact - 1.0).abs() < 0.2, "{alone} {exact}");
        assert!(together > 1.5 * alone, "{together} {alone}");
        assert!((together / finer - 1.0).abs() < 0.2, "{together} {finer}");
    }
}
