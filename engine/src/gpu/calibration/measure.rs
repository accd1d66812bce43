use std::time::{Duration, Instant};

use lazygrid_kernels::{Sphere, Spheres};

use crate::Error;
use crate::gpu::session::GpuSession;

pub(super) const SIZES: [u32; 10] = [256, 512, 1024, 2048, 4096, 8192, 16_384, 32_768, 65_536, 131_072];
/// The fastest counts, because disturbances only add time.
pub(super) const ROUNDS: usize = 7;
/// Time of the rounds of a scene after which three rounds are enough: disturbances are a small part of long calls, and
/// a driver in software would take a minute.
const ROUNDS_TIME: Duration = Duration::from_millis(60);
/// Ratio of the second to the first time below which the second algorithm is clearly faster.
pub(super) const CLEAR_TIME_RATIO: f64 = 0.7;
const DENSITY: f32 = 0.05;

pub(super) fn time(session: &mut GpuSession, spheres: &[Sphere]) -> Result<Duration, Error> {
    let start = Instant::now();
    let ticket = session.begin(Spheres::from(spheres))?;
    session.finish_count(ticket)?;
    Ok(start.elapsed())
}

pub(super) fn rounds_up_to(most: usize) -> impl Iterator<Item = usize> {
    let start = Instant::now();
    (0..most).take_while(move |&round| round < 3 || start.elapsed() < ROUNDS_TIME)
}

/// Returns the fastest times for growing scenes, until the second algorithm is clearly faster or `continues` returns
/// `false`.
pub(super) fn compare_times(
    sizes: &[u32],
    classes: usize,
    rounds: usize,
    mut times: impl FnMut(&[Sphere]) -> Result<[Duration; 2], Error>,
    mut continues: impl FnMut(u32, [Duration; 2]) -> bool,
) -> Result<Vec<(u32, [Duration; 2])>, Error> {
    let mut samples = Vec::new();
    for &spheres in sizes {
        let scene = scene(spheres, classes, DENSITY);
        let mut least = [Duration::MAX; 2];
        for _ in rounds_up_to(rounds) {
            for (least, time) in least.iter_mut().zip(times(&scene)?) {
                *least = time.min(*least);
            }
        }
        samples.push((spheres, least));
        let [first, second] = least.map(|time| time.as_secs_f64());
        if !continues(spheres, least) || second < first * CLEAR_TIME_RATIO {
            break;
        }
    }
    Ok(samples)
}

/// Returns the spheres at which the second algorithm overtakes the first: the first size if it always wins, twice the
/// last size (at most `most`) if never.
pub(super) fn crossing(samples: &[(u32, [Duration; 2])], most: u32) -> u32 {
    // Between samples, the lead is about a power of the number of spheres, so logarithms are interpolated.
    let lead = |(_, [first, second]): &(u32, [Duration; 2])| {
        (second.as_secs_f64().max(1e-9) / first.as_secs_f64().max(1e-9)).ln()
    };
    let Some(last) = samples.iter().rposition(|sample| lead(sample) > 0.0) else {
        return samples.first().map_or(0, |first| first.0);
    };
    let Some(next) = samples.get(last + 1) else {
        return (2 * samples[last].0).min(most);
    };
    let (here, there) = (lead(&samples[last]), lead(next));
    let [from, to] = [&samples[last], next].map(|sample| f64::from(sample.0).ln());
    (from + (to - from) * here / (here - there)).exp().round() as u32
}

/// Returns evenly spread spheres of radii 1, 1/2, 1/4, … in turn, which fill the fraction `density` of a cube.
pub(super) fn scene(spheres: u32, classes: usize, density: f32) -> Vec<Sphere> {
    let radius = |k: usize| 0.5_f32.powi((k % classes) as i32);
    let volume = (0..spheres as usize).map(|k| 4.188_79 * radius(k).powi(3)).sum::<f32>();
    let side = (volume / density).cbrt();
    // Additive recurrence by powers of 1/x for the root of x⁴ = x + 1.
    const STEPS: [f64; 3] = [0.819_172_513_396_164_4, 0.671_043_606_703_789_2, 0.549_700_477_901_970_2];
    let position = |k: usize| STEPS.map(|step| (k as f64 * step).fract() as f32 * side);
    (0..spheres as usize).map(|k| Sphere::new(position(k), radius(k))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_crossing_lies_where_times_are_equal() {
        for (times, expected) in [
            (&[][..], 0..=0),
            (&[(256, 20, 10)], 256..=256),
            (&[(256, 10, 20), (512, 10, 20)], 1024..=1024),
            (&[(1000, 100, 400), (2000, 400, 400)], 2000..=2000),
            (&[(1000, 100, 200), (2000, 400, 200)], 1414..=1415),
            (&[(1000, 300, 200), (2000, 100, 200), (4000, 400, 200)], 2828..=2829),
            (&[(1000, 0, 0), (2000, 0, 0)], 1000..=1000),
            (&[(70_000, 10, 20)], 100_000..=100_000),
        ] {
            let sample = |&(spheres, a, b): &(u32, u64, u64)| (spheres, [a, b].map(Duration::from_micros));
            let samples: Vec<_> = times.iter().map(sample).collect();
            let found = crossing(&samples, 100_000);
            assert!(expected.contains(&found), "{times:?}: {found}");
        }
    }

    #[test]
    fn scene_fills_the_given_fraction_of_space() {
        for classes in [1, 5] {
            let spheres = scene(10_000, classes, DENSITY);
            let side = spheres.iter().map(|s| s.center.x).fold(0.0, f32::max);
            let volume: f32 = spheres.iter().map(|s| 4.188_79 * s.radius.powi(3)).sum();
            assert!((volume / side.powi(3) - DENSITY).abs() < 0.01, "{classes} classes");
            let mut radii: Vec<u32> = spheres.iter().map(|s| s.radius.to_bits()).collect();
            radii.sort_unstable();
            radii.dedup();
            assert_eq!(radii.len(), classes);
        }
    }
}
