//! A failed allocation is an error, never an abort or a wrong answer, and the detector remains usable.

use std::alloc::{GlobalAlloc, Layout, System};
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering::SeqCst};

use lazygrid::{
    Algorithm, Backend, Config, Detector, Error, Interaction, Interactions, Order, Pair, Query, Skin, Space,
    Sphere, Spheres,
};
use lazygrid_io::read::{Frame, Frames, Options, SortError, pairs};
use lazygrid_io::scenes::Scene;
use lazygrid_tests::{DetectorVariant, SuiteVariant, variants};

struct Refusing;

/// Smallest large allocation, above the text of a message.
const MIN_LARGE_BYTES: usize = 4096;

static LIVE: AtomicUsize = AtomicUsize::new(0);
/// Number of large allocations that still succeed; `usize::MAX` for all.
static GRANTED_ALLOCATIONS: AtomicUsize = AtomicUsize::new(usize::MAX);
/// Total bytes above which large allocations are refused.
static LIMIT: AtomicUsize = AtomicUsize::new(usize::MAX);
static REFUSED: AtomicUsize = AtomicUsize::new(0);
/// Held by the running test, because tests share the allocator.
static TEST_LOCK: Mutex<()> = Mutex::new(());

// SAFETY: every call is forwarded unchanged to the system allocator, or returns null, which is how an
// allocator reports failure. The counters touch no memory of the caller.
unsafe impl GlobalAlloc for Refusing {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let size = layout.size();
        if size >= MIN_LARGE_BYTES {
            let one_less = |grants: usize| (grants > 0).then(|| grants - usize::from(grants < usize::MAX));
            let granted = GRANTED_ALLOCATIONS.fetch_update(SeqCst, SeqCst, one_less).is_ok();
            if !granted || LIVE.load(SeqCst).saturating_add(size) > LIMIT.load(SeqCst) {
                REFUSED.fetch_add(1, SeqCst);
                return std::ptr::null_mut();
            }
        }
        LIVE.fetch_add(size, SeqCst);
        // SAFETY: the caller upholds the contract of `GlobalAlloc`, which is that of the system allocator.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        LIVE.fetch_sub(layout.size(), SeqCst);
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Refusing = Refusing;

#[derive(Clone, Copy, Debug)]
enum Refusal {
    After(usize),
    /// Refuses above this number of bytes more than at the start.
    Above(usize),
}

impl Refusal {
    fn during<T>(self, work: impl FnOnce() -> T) -> (T, usize) {
        REFUSED.store(0, SeqCst);
        match self {
            Self::After(grants) => GRANTED_ALLOCATIONS.store(grants, SeqCst),
            Self::Above(bytes) => LIMIT.store(LIVE.load(SeqCst) + bytes, SeqCst),
        }
        let result = work();
        GRANTED_ALLOCATIONS.store(usize::MAX, SeqCst);
        LIMIT.store(usize::MAX, SeqCst);
        (result, REFUSED.load(SeqCst))
    }
}

#[derive(Clone, Copy, Debug)]
enum RequestKind {
    Canonical,
    Unordered,
    Neighbors,
    Count,
    /// The limit is a third of the pairs.
    StreamCanonical,
    StreamUnordered,
}

impl RequestKind {
    const ALL: [Self; 6] = [
        Self::Canonical,
        Self::Unordered,
        Self::Neighbors,
        Self::Count,
        Self::StreamCanonical,
        Self::StreamUnordered,
    ];

    fn config(self, config: Config, found: u64) -> Config {
        match self {
            Self::Unordered | Self::StreamUnordered => config.order(Order::Unordered),
            Self::StreamCanonical => config.max_pairs(found / 3),
            _ => config,
        }
    }

    /// `streamed` has the capacity for all pairs, so the consumer allocates nothing.
    fn answer(
        self,
        detector: &mut Detector,
        query: Query<'_>,
        streamed: &mut Vec<Pair>,
    ) -> Result<(u64, u64), Error> {
        let sum = |pairs: &[Pair]| {
            let each = pairs.iter().map(|pair| (u64::from(pair.i) << 32 | u64::from(pair.j)).wrapping_pow(3));
            (pairs.len() as u64, each.fold(0, u64::wrapping_add))
        };
        match self {
            Self::Canonical | Self::Unordered => Ok(sum(detector.pairs(query)?)),
            Self::Neighbors => {
                let lists = detector.neighbors(query)?;
                let later = |i: u32| {
                    lists.neighbors_of(i as usize).iter().filter(move |&&j| i < j).map(move |&j| (i, j))
                };
                streamed.clear();
                streamed.extend((0..lists.len() as u32).flat_map(later).map(|(i, j)| Pair { i, j }));
                Ok(sum(streamed))
            }
            Self::Count => Ok((detector.count(query)?, 0)),
            Self::StreamCanonical | Self::StreamUnordered => {
                streamed.clear();
                detector.stream(query, 500, |pairs| {
                    streamed.extend_from_slice(pairs);
                    ControlFlow::Continue(())
                })?;
                assert!(matches!(self, Self::StreamUnordered) || streamed.is_sorted());
                Ok(sum(streamed))
            }
        }
    }
}

/// Runs the queries with the refusals `next(0)`, `next(1)` and so on, until nothing is refused.
fn walk<'a>(
    variant: DetectorVariant,
    config: &Config,
    query: impl Into<Query<'a>>,
    next: impl Fn(usize) -> Refusal,
) {
    walk_after(None, variant, config, query.into(), next);
}

/// The detectors have searched `before` and may keep its candidates.
fn walk_after(
    before: Option<Query<'_>>,
    variant: DetectorVariant,
    config: &Config,
    query: Query<'_>,
    next: impl Fn(usize) -> Refusal,
) {
    let mut detector = Detector::new(config.clone()).expect("a detector");
    let found = detector.count(query).expect("there is memory");
    for request in RequestKind::ALL {
        let config = request.config(config.clone(), found);
        let new = || {
            let mut detector = Detector::new(config.clone()).expect("a detector");
            if let Some(before) = before {
                (0..3).for_each(|_| assert!(detector.count(before).is_ok()));
            }
            detector
        };
        let mut streamed = Vec::with_capacity(1 << 20);
        let all = request.answer(&mut new(), query, &mut streamed).expect("there is memory");
        let mut refusals = 0;
        let returns = if before.is_some() { 2 } else { 1 };
        for k in 0.. {
            let (mut detector, refusal) = (new(), next(k / returns));
            let (answer, refused) = refusal.during(|| request.answer(&mut detector, query, &mut streamed));
            let case = format!("{variant}, {request:?}, {refusal:?}");
            match answer {
                Ok(answer) => assert_eq!(answer, all, "{case}"),
                Err(ref error @ Error::OutOfMemory { what, bytes }) => {
                    assert!(
                        refused > 0 && bytes as usize >= MIN_LARGE_BYTES && !what.is_empty(),
                        "{case}: {error}"
                    );
                    assert!(error.to_string().contains(&bytes.to_string()), "{case}: {error}");
                    refusals += 1;
                    if let Some(before) = before.filter(|_| k % returns == 1) {
                        assert!(detector.count(before).is_ok(), "{case}: the earlier query");
                    }
                    let again = request.answer(&mut detector, query, &mut streamed);
                    assert_eq!(again, Ok(all), "{case}: the repeated query");
                }
                Err(error) => panic!("{case}: {error}"),
            }
            if refused == 0 {
                break;
            }
        }
        // Kept candidates may serve a query without allocation.
        assert!(refusals > 0 || before.is_some(), "{variant}, {request:?}: nothing was refused");
    }
}

/// Returns CPU algorithms only, because GPU drivers have their own allocator.
fn variants() -> impl Iterator<Item = DetectorVariant> {
    let is_one = |s: &DetectorVariant| {
        s.backend() == Backend::Cpu && s.threads() <= 2 && s.algorithm != Algorithm::Auto
    };
    variants::all().into_iter().filter(is_one)
}

#[test]
fn failed_allocation_is_an_error_wherever_it_occurs() {
    let _alone = TEST_LOCK.lock();
    let sizes = Scene::FiveSizes.spheres(1300, 41);
    let burst = Scene::Burst.spheres(1200, 42);
    let mut cluster = Scene::Equal.spheres(1300, 43);
    cluster.iter_mut().for_each(|sphere| sphere.center += 100.0);
    cluster.push(Sphere::new([100.0; 3], 20.0));
    let species: Vec<u32> = (0..3).cycle().take(sizes.len()).collect();
    let mut table = Interactions::new(3, Interaction::Touch).expect("three species");
    table.set(0, 1, Interaction::Within(0.5)).expect("a distance");
    let with_species = Spheres::from(&sizes).with_species(&species).expect("one each");
    let periodic = Space::periodic([Some(9.0), None, Some(7.0)]).expect("a box");
    let vectors = [[9.0, 0.0, 0.0], [3.0, 8.0, 0.0], [1.0, -2.0, 7.0]];
    let triclinic = Space::triclinic(vectors.map(Some)).expect("a cell");
    let few_sizes = &sizes[..400];
    let mut moved = few_sizes.to_vec();
    moved.iter_mut().step_by(2).for_each(|sphere| sphere.center.x += 0.1);
    let rows: Vec<[f64; 4]> =
        few_sizes.iter().map(|s| [s.center.x, s.center.y, s.center.z, s.radius].map(f64::from)).collect();
    let doubles = Spheres::from(&rows);
    let few_ids = &species[..few_sizes.len()];
    let few_with_species = Spheres::from(few_sizes).with_species(few_ids).expect("one each");

    for variant in variants() {
        let config = || variant.settings();
        let few = || variant.settings().tau(50);
        let keeps_candidates = variant.algorithm == Algorithm::CellList;
        variant.run(|| {
            walk(
                variant,
                &config(),
                (Spheres::from(few_sizes), Spheres::from(&burst[..300])),
                Refusal::After,
            );
            walk(variant, &config().space(periodic), doubles, Refusal::After);
            walk(variant, &config().space(triclinic), Spheres::from(few_sizes), Refusal::After);
            if keeps_candidates {
                for skin in [Skin::Auto, Skin::Fixed(0.05)] {
                    let config = config().skin(skin);
                    walk(variant, &config, Spheres::from(few_sizes), Refusal::After);
                    for query in [few_sizes, &moved] {
                        walk_after(Some(few_sizes.into()), variant, &config, query.into(), Refusal::After);
                    }
                    let config = config.interactions(table.clone());
                    let of_species =
                        [few_with_species, Spheres::from(&rows).with_species(few_ids).expect("one each")];
                    for (before, query) in [(0, 1), (1, 0)] {
                        let [before, query] = [before, query].map(|at| Query::from(of_species[at]));
                        walk_after(Some(before), variant, &config, query, Refusal::After);
                    }
                }
            }
            walk(variant, &config(), Spheres::from(&burst), Refusal::After);
            walk(variant, &few(), Spheres::from(&cluster), Refusal::After);
            walk(variant, &config().interactions(table.clone()), with_species, Refusal::After);
            walk(variant, &few().space(periodic), Spheres::from(&sizes), Refusal::After);
            // Limits from a page up, in steps of 30 %.
            let above = |k: usize| Refusal::Above((MIN_LARGE_BYTES as f64 * 1.3_f64.powi(k as i32)) as usize);
            walk(variant, &few(), Spheres::from(&cluster), above);
        });
    }
}

fn read_under_limits<T>(path: &Path, read: impl Fn(&Path) -> Result<T, lazygrid_io::Error>) {
    // Reading begins with such buffers.
    const FIXED_BYTES: usize = 1 << 19;
    assert!(read(path).is_ok(), "{path:?}");
    let mut refusals = 0;
    for k in 0.. {
        let refusal = Refusal::Above((FIXED_BYTES as f64 * 1.05_f64.powi(k)) as usize);
        let (result, refused) = refusal.during(|| read(path));
        match result {
            // A refused reservation for several rows is no error if each row fits.
            Ok(_) => {}
            Err(error) => {
                let said = error.to_string();
                assert!(refused > 0 && said.contains("memory") && said.len() < 300, "{path:?}: {said}");
                refusals += 1;
            }
        }
        if refused == 0 {
            break;
        }
    }
    assert!(refusals > 0, "{path:?}: nothing was refused");
}

fn frame(path: &Path) -> Result<Frame, lazygrid_io::Error> {
    let options = Options { ids: true, radii: [("A".to_owned(), 1.0)].into(), ..Options::default() };
    Frames::open(path, options)?.next().expect("a frame")
}

#[test]
fn failed_allocation_of_a_reader_is_an_error() {
    const ROWS: u32 = 30_000;
    let _alone = TEST_LOCK.lock();
    let directory = tempfile::tempdir().expect("a directory");
    let write = |name: &str, header: &str, row: &dyn Fn(u32) -> String| {
        let path = directory.path().join(name);
        let rows: String = (0..ROWS).rev().map(row).collect();
        std::fs::write(&path, format!("{header}\n{rows}")).expect("a file");
        path
    };
    let named = write("named.csv", "id,species,x,y,z,r", &|k| format!("{k},a species {k},{k},0,0,1\n"));
    read_under_limits(&named, frame);
    let listing = write("listed.smoldyn", "A(up) 0 0 0 30000", &|k| format!("A(up) {k} 0 0 {k}\n"));
    read_under_limits(&listing, frame);
    let bonds = write("bonds.csv", "i,j", &|k| format!("{k},{}\n", k + 1));
    read_under_limits(&bonds, |path| pairs(path));

    for grants in 0.. {
        let mut frame = frame(&named).expect("there is memory");
        let (sorted, refused) = Refusal::After(grants).during(|| frame.sort_by_id());
        match sorted {
            Ok(()) => assert!(refused == 0 && frame.ids.is_some_and(|ids| ids.is_sorted())),
            Err(error) => assert!(refused > 0 && matches!(error, SortError::OutOfMemory(_)), "{error:?}"),
        }
        if refused == 0 {
            assert_eq!(grants, 4, "the order, and columns of ids, spheres and species");
            break;
        }
    }
}
