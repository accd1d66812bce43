//! What detectors hold and allocate, seen by the allocator itself.

use std::alloc::{GlobalAlloc, Layout, System};
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering::SeqCst};
use std::sync::{Mutex, MutexGuard, PoisonError};

use lazygrid::{Algorithm, Config, Detector, Order, Sphere};
use lazygrid_bench::scenes::Scene;
use lazygrid_tests::{Subject, in_pool};

/// The system's allocator, counting.
struct Counting;

static LIVE: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);
static TOTAL: AtomicUsize = AtomicUsize::new(0);
static LARGEST: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call goes to the system's allocator as it is; the counters touch no memory of the caller's.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let size = layout.size();
        let live = LIVE.fetch_add(size, SeqCst) + size;
        PEAK.fetch_max(live, SeqCst);
        TOTAL.fetch_add(size, SeqCst);
        LARGEST.fetch_max(size, SeqCst);
        // SAFETY: the caller's promise is the system allocator's condition.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        LIVE.fetch_sub(layout.size(), SeqCst);
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// What was allocated since the start of a measurement.
struct Measurement {
    live: usize,
    /// Counters are shared by all threads, so one measurement excludes all others.
    _alone: MutexGuard<'static, ()>,
}

impl Measurement {
    fn start() -> Self {
        static ALONE: Mutex<()> = Mutex::new(());
        let alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
        let measurement = Self { live: LIVE.load(SeqCst), _alone: alone };
        measurement.restart();
        measurement
    }

    /// Forgets peaks and totals but not what was live at the start.
    fn restart(&self) {
        PEAK.store(LIVE.load(SeqCst), SeqCst);
        TOTAL.store(0, SeqCst);
        LARGEST.store(0, SeqCst);
    }

    /// Bytes allocated since the start and not given back.
    fn held(&self) -> usize {
        LIVE.load(SeqCst).saturating_sub(self.live)
    }

    /// The most bytes held at any time.
    fn peak(&self) -> usize {
        PEAK.load(SeqCst).saturating_sub(self.live)
    }
}

const SCENES: [Scene; 3] = [Scene::Equal, Scene::FiveSizes, Scene::Burst];

#[test]
fn a_second_call_allocates_nothing_of_the_size_of_the_input() {
    const N: usize = 100_000;
    for scene in SCENES {
        let mut spheres = scene.spheres(N, 31);
        for subject in Subject::all().into_iter().filter(|s| s.algorithm != Algorithm::Naive) {
            let measurement = Measurement::start();
            let mut detector = Detector::new(subject.config()).expect("a detector");
            subject.run(|| {
                detector.pairs(&spheres).expect("pairs");
                detector.neighbors(&spheres).expect("neighbors");
                measurement.restart();
                detector.pairs(&spheres).expect("pairs");
                detector.neighbors(&spheres).expect("neighbors");
                detector.count(&spheres).expect("a count");
            });
            let (largest, total) = (LARGEST.load(SeqCst), TOTAL.load(SeqCst));
            println!("{subject} {scene}: largest {largest}, total {total}");
            assert!(largest < N, "{subject}, {scene}: one allocation of {largest} bytes");
            assert!(total < 4 * N, "{subject}, {scene}: {total} bytes allocated in all");
        }
        Scene::advance(&mut spheres, 31, 0);
    }
}

#[test]
fn memory_for_is_an_upper_bound_of_what_is_held() {
    for scene in Scene::ALL {
        for n in [0, 1, 100, 5000, 50_000] {
            let n = if scene == Scene::Point { n / 10 } else { n };
            let spheres = scene.spheres(n, 32);
            for subject in Subject::all() {
                if subject.algorithm == Algorithm::Naive && n > 10_000 {
                    continue;
                }
                in_pool(subject.threads, || ());
                let measurement = Measurement::start();
                let mut detector = Detector::new(subject.config()).expect("a detector");
                subject.run(|| detector.count(&spheres)).expect("a count");
                let (held, peak, bound) =
                    (measurement.held(), measurement.peak(), detector.memory_for(n as u64));
                println!("{subject} {scene} {n}: held {held}, peak {peak}, bound {bound}");
                assert!(
                    held as u64 <= bound,
                    "{subject}, {scene}, {n}: {held} bytes held, {bound} announced"
                );
            }
        }
    }
}

#[test]
fn memory_for_is_an_upper_bound_for_a_growing_input() {
    let spheres = Scene::FiveSizes.spheres(60_000, 33);
    for subject in Subject::each_algorithm().into_iter().filter(|s| s.algorithm != Algorithm::Naive) {
        let measurement = Measurement::start();
        let mut detector = Detector::new(subject.config()).expect("a detector");
        subject.run(|| {
            for n in (40_000..=60_000).step_by(2000) {
                detector.count(&spheres[..n]).expect("a count");
            }
        });
        let (held, bound) = (measurement.held(), detector.memory_for(60_000));
        assert!(held as u64 <= bound, "{subject}: {held} bytes held, {bound} announced");
    }
}

/// A stream of two hundred million pairs, within the memory of the detector and some chunks for each thread.
#[test]
fn a_stream_needs_no_memory_for_its_pairs() {
    let spheres = vec![Sphere::new([0.0; 3], 1.0); 20_000];
    for subject in Subject::all() {
        let measurement = Measurement::start();
        let mut detector = Detector::new(subject.config().order(Order::Unordered)).expect("a detector");
        let mut chunks = 0;
        let handed = subject.run(|| {
            detector.stream(&spheres, 4096, |_| {
                chunks += 1;
                if chunks == 5000 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            })
        });
        assert!(handed.expect("a stream") >= 4999 * 4096 / 2, "{subject}");
        let (peak, bound) = (measurement.peak(), detector.memory_for(20_000) as usize + (16 << 20));
        assert!(peak < bound, "{subject}: {peak} bytes, where {bound} are plenty");
    }
}

#[test]
fn a_refused_list_stays_within_its_limit() {
    let spheres = vec![Sphere::new([0.0; 3], 1.0); 8000];
    let limit = 1 << 20;
    for subject in Subject::all() {
        let measurement = Measurement::start();
        let mut detector = Detector::new(Config::max_pairs(subject.config(), limit)).expect("a detector");
        assert!(subject.run(|| detector.pairs(&spheres).is_err()), "{subject}");
        let bound = detector.memory_for(8000) as usize + 8 * limit as usize + (16 << 20);
        let peak = measurement.peak();
        assert!(peak < bound, "{subject}: {peak} bytes, where {bound} are plenty");
    }
}
