//! The tests share a device; those that destroy it run one at a time.

mod common;

use std::ops::ControlFlow;
use std::process::Command;
use std::sync::{Mutex, MutexGuard, PoisonError};

use common::{Random, cpu_pairs, device, exact_cloud, gpu_detector, new_device, skip};
use lazygrid::gpu::{GpuConfig, GpuDevice, GpuSession, SoftwareAdapter};
use lazygrid::{Algorithm, Config, Error, Pair, Sphere, Spheres};

fn alone() -> MutexGuard<'static, ()> {
    static ALONE: Mutex<()> = Mutex::new(());
    ALONE.lock().unwrap_or_else(PoisonError::into_inner)
}

fn cloud(n: usize) -> Vec<Sphere> {
    exact_cloud(&mut Random(n as u64), n, 8, |_| 0.25)
}

fn assert_lost<T>(result: Result<T, impl Into<Error>>) {
    let error = result.err().expect("the device is gone").into();
    assert!(matches!(error, Error::DeviceLost { .. }), "{error}");
    assert!(error.to_string().contains("create a new device and a new detector"), "{error}");
}

#[test]
fn lost_device_fails_calls_in_flight() {
    let Some(gpu) = new_device() else { return };
    destroy_in_flight(&gpu, 2);
    assert_lost(GpuSession::new(gpu, GpuConfig::default()));
}

#[test]
fn lost_device_of_the_caller_is_reported() {
    let Some(gpu) = new_device() else { return };
    destroy_in_flight(&GpuDevice::from_wgpu(&gpu.device, &gpu.queue), 1);
}

fn destroy_in_flight(gpu: &GpuDevice, calls: usize) {
    let spheres = cloud(3000);
    let mut session = GpuSession::new(gpu.clone(), GpuConfig::default()).expect("made");
    let tickets: Vec<_> =
        (0..calls).map(|_| session.begin(Spheres::from(&spheres)).expect("begun")).collect();
    gpu.device.destroy();
    for ticket in tickets {
        // With several, the call may have finished before the device was destroyed.
        match session.finish(ticket, u64::MAX).map(<[Pair]>::to_vec) {
            Ok(mut pairs) if calls > 1 => {
                pairs.sort_unstable();
                assert_eq!(pairs, cpu_pairs(&spheres));
            }
            lost => assert_lost(lost),
        }
    }
    for _ in 0..2 {
        match session.begin(Spheres::from(&spheres)) {
            Ok(ticket) => assert_lost(session.finish_count(ticket)),
            Err(error) => assert_lost::<()>(Err(error)),
        }
    }
}

#[test]
fn new_detector_works_after_device_loss() {
    let Some(_) = device() else { return };
    let _alone = alone();
    let spheres = cloud(12_000);
    let expected = cpu_pairs(&spheres);
    let mut detector = gpu_detector(Config::default());
    assert_eq!(detector.pairs(&spheres).expect("found"), expected);
    GpuDevice::shared(SoftwareAdapter::Allow).expect("the detector's").device.destroy();
    assert_lost(detector.pairs(&spheres));
    assert_lost(detector.count(&spheres));
    assert_lost(detector.neighbors(&spheres));
    let mut detector = gpu_detector(Config::default());
    assert_eq!(detector.pairs(&spheres).expect("found"), expected);
    assert_eq!(detector.count(&spheres).expect("counted"), expected.len() as u64);
}

#[test]
fn lost_device_ends_a_stream_with_an_error() {
    let Some(_) = device() else { return };
    let _alone = alone();
    // The stream must take several searches.
    let spheres = vec![Sphere::new([1.0; 3], 0.5); 3000];
    let mut detector = gpu_detector(Config::default());
    let mut handed = 0;
    let streamed = detector.stream(&spheres, 1 << 16, |pairs| {
        if handed == 0 {
            GpuDevice::shared(SoftwareAdapter::Allow).expect("the detector's").device.destroy();
        }
        handed += pairs.len();
        ControlFlow::Continue(())
    });
    assert_lost(streamed);
    assert!(0 < handed && handed < 3000 * 2999 / 2, "{handed}");
    let mut again = 0;
    let streamed = gpu_detector(Config::default()).stream(&spheres, 1 << 16, |pairs| {
        again += pairs.len();
        ControlFlow::Continue(())
    });
    assert_eq!((streamed, again), (Ok(3000 * 2999 / 2), 3000 * 2999 / 2));
}

#[test]
fn oversized_request_leaves_the_detector_usable() {
    let Some(gpu) = device() else { return };
    let _alone = alone();
    let few = cloud(2000);
    let expected = cpu_pairs(&few);
    let mut detector = gpu_detector(Config::default());
    for _ in 0..2 {
        let many = vec![Sphere::default(); (gpu.adapter.storage_binding / 16) as usize + 1];
        let Err(Error::LimitExceeded { needed, limit, .. }) = detector.count(&many) else {
            panic!("{} spheres do not fit one binding", many.len())
        };
        assert!(needed > limit, "{needed} {limit}");
        assert_eq!(detector.pairs(&few).expect("found"), expected);
    }
}

/// A software adapter uses the memory of the process, which `prlimit` restricts.
#[test]
fn out_of_memory_leaves_the_detector_usable() {
    let Some(gpu) = device() else { return };
    let has_prlimit = cfg!(target_os = "linux") && Command::new("prlimit").arg("--version").output().is_ok();
    if gpu.adapter.is_hardware || !has_prlimit {
        return skip(None, "needs a software adapter on Linux, and prlimit");
    }
    if std::env::var_os(IN_CHILD).is_some() {
        return run_out_of_memory();
    }
    let child = Command::new(std::env::current_exe().expect("this test"))
        .args(["--exact", "out_of_memory_leaves_the_detector_usable", "--nocapture"])
        .env(IN_CHILD, "")
        // Arenas of threads would take address space at random.
        .env("MALLOC_ARENA_MAX", "1")
        .output()
        .expect("a process");
    assert!(child.status.success(), "{}", String::from_utf8_lossy(&child.stderr));
}

const IN_CHILD: &str = "LAZYGRID_OUT_OF_MEMORY";

fn run_out_of_memory() {
    let (few, many) = (cloud(2000), vec![Sphere::default(); 1_000_000]);
    let expected = cpu_pairs(&few);
    let mut detector = gpu_detector(Config::default().algorithm(Algorithm::ArrayGrid));
    assert_eq!(detector.pairs(&few).expect("found"), expected);
    let statm = std::fs::read_to_string("/proc/self/statm").expect("Linux");
    let pages: u64 = statm.split(' ').next().and_then(|word| word.parse().ok()).expect("pages");
    let (id, limit) = (std::process::id().to_string(), pages * 4096 + (100 << 20));
    let allow = |bytes: &str| {
        let status = Command::new("prlimit").args(["--pid", &id, &format!("--as={bytes}:")]).status();
        assert!(status.expect("prlimit runs").success());
    };
    allow(&limit.to_string());
    let refused = detector.count(&many);
    let found = detector.pairs(&few).map(<[_]>::to_vec);
    let crowd = vec![Sphere::new([1.0; 3], 0.5); 5500];
    let crowded = detector.pairs(&crowd).map(<[_]>::len);
    let found_then = detector.pairs(&few).map(<[_]>::to_vec);
    allow("unlimited");
    for refused in [refused, crowded.map(|n| n as u64)] {
        assert!(matches!(refused, Err(Error::DeviceOutOfMemory { .. })), "{refused:?}");
    }
    for found in [found, found_then] {
        assert!(found.as_ref() == Ok(&expected), "{:?}", found.map(|pairs| pairs.len()));
    }
    assert_eq!(detector.pairs(&few).expect("found"), expected);
}
