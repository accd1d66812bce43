use std::time::Duration;

use crate::common::{Random, device, limited, new_device, session_count, session_pairs};
use lazygrid::gpu::{GpuConfig, GpuDevice, GpuSession, wgpu};
use lazygrid::{Algorithm, Backend, Config, Detector, Sphere, Spheres};

fn uniform(seed: u64, n: usize, side: f32, radius: f32) -> Vec<Sphere> {
    let mut random = Random(seed);
    (0..n).map(|_| Sphere::new([0; 3].map(|_| random.unit() * side), radius)).collect()
}

fn count_on_cpu(detector: &mut Detector, spheres: &[Sphere]) -> u64 {
    detector.count(spheres).expect("valid")
}

fn cpu() -> Detector {
    Detector::new(Config::default().backend(Backend::Cpu)).expect("the CPU")
}

fn agree(gpu: u64, cpu: u64) -> bool {
    gpu.abs_diff(cpu) <= 2 + cpu / 1_000_000
}

fn lists_agree(gpu: &GpuDevice, spheres: &[Sphere], detector: &mut Detector, algorithms: &[Algorithm]) {
    let expected = detector.pairs(spheres).expect("valid");
    for &algorithm in algorithms {
        let settings = GpuConfig::default().algorithm(algorithm);
        let mut session = GpuSession::new(gpu.clone(), settings).expect("made");
        let found = session_pairs(&mut session, spheres);
        let differing = found.iter().filter(|pair| expected.binary_search(pair).is_err()).count();
        assert!(
            agree(found.len() as u64, expected.len() as u64),
            "{algorithm}: {} {}",
            found.len(),
            expected.len()
        );
        assert!(differing <= 2 + expected.len() / 1_000_000, "{algorithm}: {differing}");
    }
}

#[test]
fn millions_of_spheres_in_one_call() {
    let Some(gpu) = device() else { return };
    for (n, algorithm) in [(2_000_000, Algorithm::CellList), (600_000, Algorithm::LazyGrid)] {
        let side = (n as f32 * 4.188_79 * 0.125 / 0.05).cbrt();
        lists_agree(&gpu, &uniform(1, n, side, 0.5), &mut cpu(), &[algorithm]);
    }
}

/// Long loops, which a software adapter may end early.
#[test]
fn thousands_of_coincident_spheres_are_counted_exactly() {
    let Some(gpu) = device() else { return };
    let count = |n: u64, algorithm| {
        let spheres = vec![Sphere::new([1.0, -2.0, 3.0], 0.5); n as usize];
        let settings = GpuConfig::default().algorithm(algorithm);
        let mut session = GpuSession::new(gpu.clone(), settings).expect("made");
        assert_eq!(session_count(&mut session, &spheres), n * (n - 1) / 2, "{algorithm}, {n} spheres");
    };
    for algorithm in [Algorithm::Naive, Algorithm::ArrayGrid, Algorithm::CellList] {
        count(14_000, algorithm);
    }
    // The least number whose counters take several workgroups to scan.
    count(21_845, Algorithm::CellList);
}

#[test]
fn eighty_thousand_crowded_spheres() {
    let Some(gpu) = device() else { return };
    let mut spheres = uniform(4, 80_000, 4.0, 0.1);
    spheres.push(Sphere::new([2.0; 3], 0.4));
    let settings = GpuConfig::default().algorithm(Algorithm::ArrayGrid);
    let mut session = GpuSession::new(gpu, settings).expect("made");
    let found = session_count(&mut session, &spheres);
    let expected = count_on_cpu(&mut cpu(), &spheres);
    assert!(agree(found, expected), "{found} instead of {expected}");
}

#[test]
fn ten_thousand_spheres_of_ten_sizes_at_one_point() {
    let Some(gpu) = device() else { return };
    let n = 10_000;
    let spheres: Vec<_> = (0..n).map(|k| Sphere::new([1.0, -2.0, 3.0], 0.5_f32.powi(k % 10))).collect();
    let settings = GpuConfig::default().algorithm(Algorithm::LazyGrid).max_tests_per_dispatch(1 << 27);
    let mut session = GpuSession::new(gpu, settings).expect("made");
    let found = session_count(&mut session, &spheres);
    let outcome = session.outcome();
    assert!(outcome.entries_needed() > 8 * n as u64 && outcome.deferred_begin > 0, "{outcome:?}");
    assert_eq!(found, n as u64 * (n as u64 - 1) / 2);
}

#[test]
fn one_giant_among_a_hundred_thousand_grains() {
    let Some(gpu) = device() else { return };
    let mut spheres = uniform(5, 120_000, 10.0, 0.05);
    spheres.push(Sphere::new([5.0; 3], 4.0));
    let config = Config::default().backend(Backend::Cpu).algorithm(Algorithm::CellList);
    let mut detector = Detector::new(config).expect("the CPU");
    lists_agree(&gpu, &spheres, &mut detector, &[Algorithm::LazyGrid, Algorithm::CellList]);
}

/// `LAZYGRID_SOAK_STEPS` sets the number of steps (20,000 for a release).
#[test]
fn soak_of_changing_sizes_and_shapes() {
    // Other tests allocate memory of the shared device.
    let Some(gpu) = new_device() else { return };
    let steps =
        std::env::var("LAZYGRID_SOAK_STEPS").ok().and_then(|text| text.parse().ok()).unwrap_or(150_u64);
    let mut session = GpuSession::new(gpu.clone(), GpuConfig::default()).expect("made");
    session.set_timeout(Duration::from_secs(60));
    let mut detector = cpu();
    // Both calls in flight get the largest input first, so later growth is a leak.
    let largest = [uniform(0, LARGEST, 20.0, 0.5), vec![Sphere::new([0.0; 3], 0.25); CROWD]];
    for spheres in &largest {
        let tickets = [(); 2].map(|()| session.begin(Spheres::from(spheres)).expect("begun"));
        for ticket in tickets {
            session.finish(ticket, u64::MAX).expect("found");
        }
    }
    let before = held(&gpu, &session);
    for step in 0..steps {
        let spheres = scene(step);
        let ticket = session.begin(Spheres::from(&spheres)).expect("begun");
        let found = match step % 8 < 4 {
            true => session.finish_count(ticket).expect("counted"),
            false => session.finish(ticket, u64::MAX).expect("found").len() as u64,
        };
        // The position changes, to cover each kind of scene.
        if step % 100 == step / 100 % 100 {
            let expected = count_on_cpu(&mut detector, &spheres);
            assert!(agree(found, expected), "step {step}: {found} instead of {expected}");
        }
        let now = held(&gpu, &session);
        assert!(
            now[0] <= before[0] + SLACK && now[1] <= before[1],
            "step {step}: {before:?} grew to {now:?}"
        );
    }
}

const LARGEST: usize = 5000;
const CROWD: usize = 600;
/// Uniform buffers are temporary.
const SLACK: u64 = 16 << 10;

fn scene(step: u64) -> Vec<Sphere> {
    let mut random = Random(step);
    let n = if step % 11 == 3 { LARGEST } else { random.word() as usize % LARGEST };
    match step % 4 {
        0 => uniform(step, n, 20.0, 0.5),
        1 => uniform(step, n, 1000.0, 0.5),
        2 => uniform(step, n % CROWD, 0.5, 0.25),
        _ => (0..n).map(|k| Sphere::new([k as f32 * 0.75, 0.0, 0.0], random.unit())).collect(),
    }
}

fn held(gpu: &GpuDevice, session: &GpuSession) -> [u64; 2] {
    let allocated = gpu.device.generate_allocator_report().map_or(0, |report| report.total_allocated_bytes);
    [allocated, session.held_bytes()]
}

#[test]
fn results_above_the_largest_output_take_few_searches() {
    let Some(gpu) = device() else { return };
    let gpu = limited(&gpu, |limits| wgpu::Limits { max_storage_buffer_binding_size: 1 << 20, ..limits });
    for pair_capacity in [1 << 10, 1 << 17] {
        let settings = GpuConfig::default().pair_capacity(pair_capacity);
        let mut session = GpuSession::new(gpu.clone(), settings).expect("a session");
        let spheres = vec![Sphere::new([1.0; 3], 0.5); 600];
        let pairs = session_pairs(&mut session, &spheres);
        assert!(pairs == cpu().pairs(&spheres).expect("valid"), "{} pairs", pairs.len());
        assert!(session.submissions().searches < 12, "{:?}", session.submissions());
    }
}
