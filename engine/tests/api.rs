//! The public API as programs use it.

use std::error::Error as StdError;
use std::fmt::{Debug, Display};
use std::hash::Hash;
use std::ops::ControlFlow;
use std::str::FromStr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use lazygrid::glam::Vec3;
use lazygrid::{
    Algorithm, Backend, Config, Detector, EffectiveRadius, Error, Exclusions, ImageVector, InputError,
    Interaction, Interactions, ListOptions, NeighborList, Neighbors, NeighborsIter, Order, Pair, PhaseTime,
    Query, Radii, Report, Simd, Space, Sphere, Spheres, UnknownName, detect,
};

const fn crosses_threads<T: Send + Sync>() {}
const fn is_data<T: Send + Sync + Clone + Debug + PartialEq + 'static>() {}
const fn is_name<T: Copy + Eq + Hash + Display + FromStr<Err = UnknownName> + Default + 'static>() {}
const fn is_error<T: StdError + Send + Sync + Clone + PartialEq + 'static>() {}

const _: () = {
    crosses_threads::<Detector>();
    crosses_threads::<Config>();
    crosses_threads::<Report>();
    crosses_threads::<Neighbors<'_>>();
    crosses_threads::<NeighborsIter<'_>>();
    crosses_threads::<NeighborList<'_>>();
    crosses_threads::<Query<'_>>();
    crosses_threads::<Spheres<'_>>();
    is_data::<Sphere>();
    is_data::<Pair>();
    is_data::<Interaction>();
    is_data::<Interactions>();
    is_data::<Space>();
    is_data::<Order>();
    is_data::<Simd>();
    is_data::<PhaseTime>();
    is_name::<Algorithm>();
    is_name::<Backend>();
    is_error::<Error>();
    is_error::<InputError>();
    is_error::<UnknownName>();
    let _: &[Backend] = Backend::ALL;
    let _: [&[Algorithm]; 3] = [Algorithm::ALL, Algorithm::CPU, Algorithm::GPU];
};

fn every_query(detector: &mut Detector, wide: &[[f64; 4]], bonds: &Exclusions) -> Result<(), Error> {
    let centers = [[0.0_f64, 0.0, 0.0], [1.0, 0.0, 0.0]];
    let x = &[0.0_f64; 2];
    let points: Spheres<'_> = Spheres::points(&centers, Radii::All(0.5))?;
    let each: Spheres<'_> = Spheres::points(&centers, Radii::Each(x))?;
    let columns: Spheres<'_> = Spheres::columns(x, x, x, x)?;
    let _: &[Pair] = detector.pairs(wide)?;
    let _: &[Pair] = detector.pairs((points, wide))?;
    let _: u64 = detector.count((&[[0.0_f32; 4]], columns))?;
    let query: Query<'_> = Query::new((points, each)).without(bonds);
    let _: Neighbors<'_> = detector.neighbors(query)?;
    let _: u64 = detector.stream(query, 7, |_| ControlFlow::Break(()))?;
    let options: ListOptions = ListOptions::half().open().with_self().shifts().vectors().distances();
    let list: NeighborList<'_> = detector.neighbor_list(query, options)?;
    let _: (&[u64], &[Pair]) = (list.offsets(), list.pairs());
    let _: (&[[i32; 3]], &[[f64; 3]], &[f64]) = (list.shifts(), list.vectors(), list.distances());
    let _: (usize, bool) = (list.len(), list.is_empty());
    Ok(())
}

fn every_call(detector: &mut Detector, rows: &[Sphere], four: &[[f32; 4]]) -> Result<(), Error> {
    let _: &[Pair] = detector.pairs(rows)?;
    let _: &[Pair] = detector.pairs(four)?;
    let x = &[0.0_f32; 3];
    let spheres: Spheres<'_> = Spheres::columns(x, x, x, x)?.with_species(&[0, 1, 0])?;
    let lists: Neighbors<'_> = detector.neighbors(spheres)?;
    let _: (usize, bool, &[u32]) = (lists.len(), lists.is_empty(), lists.neighbors_of(0));
    let _: (&[u64], &[u32]) = (lists.offsets(), lists.indices());
    let iter: NeighborsIter<'_> = lists.iter();
    for (list, last) in iter.clone().zip(&lists).chain(iter.rev().zip(lists)) {
        let _: [&[u32]; 2] = [list, last];
    }
    let _: u64 = detector.count(spheres)?;
    let _: u64 = detector.stream(spheres, 100, |chunk: &[Pair]| match chunk {
        [] => ControlFlow::Break(()),
        _ => ControlFlow::Continue(()),
    })?;
    let _: u64 = detector.memory_for(1_000_000);
    let Report { spheres, pairs, backend, adapter, algorithm, reason, phases, .. } = detector.report();
    let _: (u64, u64, Backend, Option<String>, Algorithm, String) =
        (spheres, pairs, backend, adapter, algorithm, reason);
    let _: Option<(&'static str, Duration)> =
        phases.first().map(|phase: &PhaseTime| (phase.name, phase.time));
    Ok(())
}

fn every_setting() -> Result<Config, Error> {
    let mut reactions = Interactions::new(2, Interaction::Never)?;
    reactions.set(0, 1, Interaction::Within(0.5))?;
    reactions.set(1, 1, Interaction::Touch)?;
    let effective: EffectiveRadius = reactions.effective_radius(0);
    let _: (f32, Interaction, u32) = (effective.for_radius(1.0), reactions.get(0, 1), reactions.species());
    let space: Space = Space::periodic([Some(10.0), None, None])?;
    let _: (Vec3, f64) = (space.wrap(Vec3::ONE), space.distance_squared(Vec3::ZERO, Vec3::ONE));
    let sheared: Space = Space::triclinic([Some([1.0; 3]), None, None])?;
    let _: ([Option<[f64; 3]>; 3], [Option<f64>; 3]) = (sheared.cell_vectors(), sheared.lengths());
    let _: ([i32; 3], [f64; 3]) = {
        let bond: ImageVector = space.minimum_image([0.0; 3], [1.0; 3]);
        (bond.shift, bond.vector)
    };
    let _: [Exclusions; 3] = [
        Exclusions::new(2, [(0, 1)])?,
        Exclusions::across(2, 3, [(0, 2)])?,
        Exclusions::from_csr(&[0, 1, 1], &[1])?,
    ];
    Ok(Config::default()
        .backend(Backend::Cpu)
        .algorithm(Algorithm::CellList)
        .order(Order::Canonical)
        .threads(2)
        .simd(Simd::Portable)
        .tau(64)
        .cell_ratio(2.0)
        .max_pairs(1 << 20)
        .interactions(reactions)
        .space(space))
}

#[cfg(feature = "gpu")]
mod on_gpu {
    use lazygrid::gpu::{
        AdapterId, AdapterSummary, BoundScan, BoundSort, Calibration, CallCost, CellOrder, GpuConfig,
        GpuDetector, GpuDevice, GpuOutput, GpuPhase, GpuSession, GpuSkinDetector, GpuSpheres,
        KeyValueBuffers, Outcome, PrefixScan, RadixSort, SoftwareAdapter, SphereCount, Ticket, adapters,
        calibrate, plan::CallPlan, wgpu,
    };

    use super::*;

    const _: () = {
        crosses_threads::<GpuDevice>();
        crosses_threads::<GpuDetector>();
        crosses_threads::<GpuSession>();
        crosses_threads::<GpuSkinDetector>();
        crosses_threads::<GpuConfig>();
        crosses_threads::<GpuSpheres<'_>>();
        crosses_threads::<SphereCount<'_>>();
        crosses_threads::<AdapterSummary>();
        crosses_threads::<GpuOutput>();
        crosses_threads::<CellOrder>();
        crosses_threads::<BoundScan>();
        crosses_threads::<BoundSort>();
        is_data::<AdapterId>();
        is_data::<Calibration>();
        let _: &[GpuPhase] = GpuPhase::ALL;
        let _: &[(&str, usize)] = CallPlan::OUTCOME_FIELDS;
        let _: &[(&str, u32)] = CallPlan::OVERFLOW_BITS;
    };

    #[expect(dead_code, reason = "compiled only")]
    fn every_way_in(device: &wgpu::Device, queue: &wgpu::Queue, rows: &[Sphere]) -> Result<(), Error> {
        let _: Vec<AdapterSummary> = adapters();
        let gpu: GpuDevice = GpuDevice::from_wgpu(device, queue);
        let _: GpuDevice = GpuDevice::open(SoftwareAdapter::Allow)?;
        let _: GpuDevice = GpuDevice::open_adapter(&AdapterId::from("name"))?;
        let known: Calibration = calibrate(&gpu, |_| ())?;
        let config = Config::default().adapter(0).timeout(Duration::from_secs(1)).calibration([known]);
        let _: Detector = Detector::new(config)?;
        let mut session = GpuSession::new(gpu, GpuConfig::default())?;
        let ticket: Ticket = session.begin(rows.into())?;
        let _: &[Pair] = session.finish(ticket, 1000)?;
        let _: &Outcome = session.outcome();
        let _: Option<CallCost> = session.cost();
        Ok(())
    }

    #[expect(dead_code, reason = "compiled only")]
    fn resident(
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        spheres: &wgpu::Buffer,
    ) -> Result<(), Error> {
        let mut detector: GpuDetector = GpuDetector::new(device, GpuConfig::default())?;
        let cost: CallCost = detector.cost(1000)?;
        let _: (u32, u64, u64, Option<u64>) =
            (cost.dispatches, cost.working_bytes, cost.pair_bytes, cost.traffic_bytes);
        let reserved: GpuOutput = detector.reserve(1000)?;
        let found: GpuOutput = detector.encode(encoder, &GpuSpheres::new(spheres, 1000))?;
        let _: [&wgpu::Buffer; 3] = [&reserved.pairs, &found.outcome, &found.pairs];
        let scan: BoundScan = PrefixScan::new(device, true).bind(spheres, 1000)?;
        scan.encode(encoder);
        let keyed = KeyValueBuffers { keys: spheres.clone(), payload: scan.total().clone() };
        let sort: BoundSort = RadixSort::new(device, true).bind(&keyed, 1000, 24)?;
        sort.encode(encoder);
        let _: &KeyValueBuffers = sort.sorted();
        Ok(())
    }
}

#[test]
fn the_calls_above_run() -> Result<(), Box<dyn StdError>> {
    let rows = [Sphere::new([0.0, 0.0, 0.0], 1.0), Sphere::new(Vec3::X, 0.5)];
    assert_eq!(detect(&rows)?, [Pair::new(1, 0)]);
    let species = Interactions::new(2, Interaction::Touch)?;
    let mut detector = Detector::new(Config::default().backend(Backend::Cpu))?;
    every_call(&mut detector, &rows, &[[0.0; 4]])?;
    every_query(&mut Detector::new(Config::default())?, &[[0.0; 4]], &Exclusions::across(2, 2, [(0, 1)])?)?;
    let _: Vec<Pair> = detector.into_pairs();
    assert_eq!(species.species(), 2);
    let mut detector = Detector::new(every_setting()?)?;
    assert_eq!(detector.count(&rows), Err(Error::Input(InputError::SpeciesMissing)));
    Ok(())
}

#[test]
fn a_flag_ends_a_search_and_is_no_part_of_the_next() -> Result<(), Error> {
    let rows: Vec<_> = (0..20_000_u16).map(|k| Sphere::new([f32::from(k), 0.0, 0.0], 0.5)).collect();
    for &algorithm in Algorithm::CPU {
        let stop = Arc::new(AtomicBool::new(true));
        let config = Config::default().backend(Backend::Cpu).algorithm(algorithm).cancel_flag(stop.clone());
        let mut detector = Detector::new(config)?;
        assert_eq!(detector.count(&rows), Err(Error::Cancelled), "{algorithm}");
        assert_eq!(detector.pairs(&rows).map(<[Pair]>::len), Err(Error::Cancelled), "{algorithm}");
        stop.store(false, Ordering::Relaxed);
        assert_eq!(detector.pairs(&rows).map(<[Pair]>::len), Ok(19_999), "{algorithm}");
    }
    Ok(())
}

#[cfg(feature = "gpu")]
#[test]
fn timeout_on_the_cpu_is_refused_or_reported() -> Result<(), Error> {
    let limited = |backend| Config::default().backend(backend).timeout(Duration::from_millis(1500));
    let refused = Detector::new(limited(Backend::Cpu)).map(drop);
    assert_eq!(refused, Err(Error::TimeoutOnCpu { seconds: 1.5 }));
    let mut detector = Detector::new(limited(Backend::Auto).algorithm(Algorithm::HashGrid))?;
    detector.count(&[Sphere::default()])?;
    let reason = detector.report().reason;
    assert!(reason.contains("the timeout of GPU submissions has no effect"), "{reason}");
    Ok(())
}
