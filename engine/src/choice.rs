use lazygrid_kernels::Algorithm;

#[cfg(feature = "gpu")]
use crate::gpu::costs::AdapterProfile;
#[cfg(feature = "gpu")]
use crate::gpu::device::AdapterId;
use crate::{Backend, Error};

#[cfg(feature = "gpu")]
pub(crate) fn resolve_backend(requested: Backend, adapter: Option<&AdapterId>) -> Result<Backend, Error> {
    match (requested, adapter) {
        (requested, None) => Ok(requested),
        (Backend::Cpu, Some(adapter)) => Err(Error::AdapterOnCpu { adapter: adapter.to_string() }),
        (_, Some(_)) => Ok(Backend::Gpu),
    }
}

#[cfg(feature = "gpu")]
pub(crate) fn check_timeout(resolved: Backend, timeout: Option<std::time::Duration>) -> Result<(), Error> {
    match (resolved, timeout) {
        (Backend::Cpu, Some(timeout)) => Err(Error::TimeoutOnCpu { seconds: timeout.as_secs_f64() }),
        _ => Ok(()),
    }
}

/// Returns the device, `None` for the CPU, and the reason. The argument of `open` permits a software adapter.
pub(crate) fn backend<D>(
    requested: Backend,
    algorithm: Algorithm,
    open: impl FnOnce(bool) -> Result<(String, D), Error>,
) -> Result<(Option<D>, String), Error> {
    let runs_on = |backend: &[Algorithm]| algorithm == Algorithm::Auto || backend.contains(&algorithm);
    let (on_cpu, on_gpu) = (runs_on(Algorithm::CPU), runs_on(Algorithm::GPU));
    let insist = |why: &str, open: Result<(String, D), Error>| match open {
        Ok((name, device)) => Ok((Some(device), format!("GPU {name}: {why}"))),
        Err(unknown @ Error::UnknownAdapter { .. }) => Err(unknown),
        Err(error) => Err(Error::GpuUnavailable { reason: error.to_string() }),
    };
    match requested {
        Backend::Cpu if !on_cpu => Err(Error::NotOnBackend { algorithm, backend: requested }),
        Backend::Cpu => Ok((None, "CPU: requested".to_owned())),
        _ if !on_cpu && !on_gpu => Err(Error::NotOnBackend { algorithm, backend: requested }),
        Backend::Gpu if !on_gpu => Err(Error::NotOnBackend { algorithm, backend: requested }),
        Backend::Gpu => insist("requested", open(true)),
        Backend::Auto if !on_gpu => Ok((None, format!("CPU: {algorithm} runs there only"))),
        Backend::Auto if !on_cpu => insist(&format!("{algorithm} runs there only"), open(true)),
        Backend::Auto => Ok(match open(false) {
            Ok((name, device)) if is_per_call(requested, algorithm) => {
                (Some(device), format!("GPU {name} or the CPU: by the number of spheres"))
            }
            Ok((name, device)) => (Some(device), format!("GPU {name}: hardware adapter")),
            Err(Error::NoAdapter { reason }) => (None, format!("CPU: no hardware GPU ({reason})")),
            Err(error) => (None, format!("CPU: {error}")),
        }),
        unknown => Err(Error::NotOnBackend { algorithm, backend: unknown }),
    }
}

pub(crate) fn is_per_call(requested: Backend, algorithm: Algorithm) -> bool {
    requested == Backend::Auto && matches!(algorithm, Algorithm::Auto | Algorithm::CellList)
}

#[cfg(feature = "gpu")]
pub(crate) fn per_call(spheres: u64, profile: &AdapterProfile) -> (Backend, String) {
    let AdapterProfile { device_from, how, .. } = *profile;
    match spheres < u64::from(device_from) {
        true => (Backend::Cpu, format!("CPU: {spheres} spheres are fewer than {device_from} ({how})")),
        false => (Backend::Gpu, format!("GPU: {spheres} spheres are at least {device_from} ({how})")),
    }
}

#[cfg(all(test, feature = "gpu"))]
mod tests {
    use lazygrid_host::SkinCosts;

    use super::*;
    use crate::gpu::costs::{Calibration, Crossover, HARDWARE_SKIN_COSTS, SOFTWARE_SKIN_COSTS, profile_of};
    use crate::gpu::device::{AdapterSummary, card};

    const NONE: Error = Error::NoAdapter { reason: String::new() };

    fn open(machine: &str) -> impl FnOnce(bool) -> Result<(String, ()), Error> {
        let found = machine.to_owned();
        move |software| match found.as_str() {
            "gpu" => Ok((found, ())),
            "software" if software => Ok((found, ())),
            _ => Err(NONE),
        }
    }

    #[test]
    fn backend_and_reason_follow_request_and_machine() {
        use Algorithm::{ArrayGrid, Auto, CellList, HashGrid, LazyGrid, Naive};
        let cpu_only = || Error::NotOnBackend { algorithm: HashGrid, backend: Backend::Gpu };
        let gpu_only = || Error::NotOnBackend { algorithm: LazyGrid, backend: Backend::Cpu };
        let unavailable = || Error::GpuUnavailable { reason: NONE.to_string() };
        for (requested, algorithm, machine, expected) in [
            (Backend::Auto, Auto, "gpu", Ok("GPU gpu or the CPU: by the number of spheres")),
            (Backend::Auto, ArrayGrid, "gpu", Ok("GPU gpu: hardware adapter")),
            (Backend::Auto, Auto, "software", Ok("CPU: no hardware GPU")),
            (Backend::Auto, Auto, "none", Ok("CPU: no hardware GPU")),
            (Backend::Auto, HashGrid, "gpu", Ok("CPU: hash-grid runs there only")),
            (Backend::Auto, CellList, "gpu", Ok("GPU gpu or the CPU: by the number of spheres")),
            (Backend::Auto, CellList, "software", Ok("CPU: no hardware GPU")),
            (Backend::Cpu, Auto, "gpu", Ok("CPU: requested")),
            (Backend::Cpu, Naive, "none", Ok("CPU: requested")),
            (Backend::Gpu, Auto, "software", Ok("GPU software: requested")),
            (Backend::Gpu, Naive, "gpu", Ok("GPU gpu: requested")),
            (Backend::Gpu, Auto, "none", Err(unavailable())),
            (Backend::Gpu, HashGrid, "gpu", Err(cpu_only())),
            (Backend::Cpu, LazyGrid, "gpu", Err(gpu_only())),
        ] {
            let found = backend(requested, algorithm, open(machine));
            let case = format!("{requested}, {algorithm}, {machine}: {found:?}");
            match (found, expected) {
                (Ok((device, reason)), Ok(expected)) => {
                    assert!(
                        reason.starts_with(expected) && device.is_some() == expected.starts_with("GPU"),
                        "{case}"
                    );
                }
                (found, expected) => assert_eq!(found.err(), expected.err(), "{case}"),
            }
        }
    }

    #[test]
    fn named_adapter_implies_the_gpu() {
        let card = AdapterId::from("card");
        for &requested in Backend::ALL {
            assert_eq!(resolve_backend(requested, None), Ok(requested));
        }
        assert_eq!(resolve_backend(Backend::Auto, Some(&card)), Ok(Backend::Gpu));
        assert_eq!(resolve_backend(Backend::Gpu, Some(&card)), Ok(Backend::Gpu));
        let refused = resolve_backend(Backend::Cpu, Some(&card)).expect_err("a contradiction").to_string();
        assert!(refused.contains("card") && refused.contains("cpu"), "{refused}");
        let unknown =
            Error::UnknownAdapter { requested: String::new(), matches: 0, available: String::new() };
        let open = |_| Err::<(String, ()), _>(unknown.clone());
        let found = backend(Backend::Gpu, Algorithm::Auto, open);
        assert_eq!(found, Err(unknown));
    }

    #[test]
    fn algorithm_of_one_backend_runs_there_or_is_refused() {
        for algorithm in Algorithm::ALL.iter().copied().filter(|a| *a != Algorithm::Auto) {
            let (on_cpu, on_gpu) = (Algorithm::CPU.contains(&algorithm), Algorithm::GPU.contains(&algorithm));
            assert_eq!(backend(Backend::Cpu, algorithm, open("gpu")).is_ok(), on_cpu, "{algorithm}");
            assert_eq!(backend(Backend::Gpu, algorithm, open("gpu")).is_ok(), on_gpu, "{algorithm}");
            let anywhere = backend(Backend::Auto, algorithm, open("software"));
            assert_eq!(anywhere.is_ok(), on_cpu || on_gpu, "{algorithm}");
            if let Ok((device, _)) = anywhere {
                assert_eq!(device.is_some(), !on_cpu, "{algorithm}: software only if nothing else runs it");
            }
        }
    }

    #[test]
    fn calibration_applies_to_one_adapter_driver_and_version() {
        let adapter = card("Card");
        let measured = |adapter: &str, driver: &str, version: &str, naive_below| Calibration {
            adapter: adapter.to_owned(),
            driver: driver.to_owned(),
            version: version.to_owned(),
            crossover: Crossover { naive_below, per_class: 0 },
            radix_sort_from: 1000 * naive_below,
            skin: SkinCosts { call_ns: naive_below as f32, ..SOFTWARE_SKIN_COSTS },
            device_from: 10 * naive_below,
            tests_per_second: f64::from(1000 * naive_below),
        };
        let version = env!("CARGO_PKG_VERSION");
        let others = [
            measured("Other card", "driver 1", version, 1),
            measured("Card", "driver 2", version, 2),
            measured("Card", "driver 1", "0.0.1", 3),
        ];
        let assumed = profile_of(&others, &adapter);
        assert!(assumed.crossover == Crossover::HARDWARE && assumed.skin == HARDWARE_SKIN_COSTS);
        assert!(assumed.how.contains("not measured"), "{assumed:?}");
        assert_eq!(per_call(4095, &assumed).0, Backend::Cpu);
        assert_eq!(per_call(4096, &assumed).0, Backend::Gpu);
        let integrated = profile_of(&others, &AdapterSummary { is_integrated: true, ..adapter.clone() });
        assert_eq!(integrated.device_from, Calibration::INTEGRATED_DEVICE_FROM);
        let software = AdapterSummary { is_hardware: false, ..adapter.clone() };
        let assumed = profile_of(&[], &software);
        assert!(assumed.crossover == Crossover::SOFTWARE && assumed.skin == SOFTWARE_SKIN_COSTS);
        assert_eq!(per_call(1_000_000_000, &assumed).0, Backend::Cpu);
        let current = [4, 5].map(|naive_below| measured("Card", "driver 1", version, naive_below));
        let last = profile_of(&[&others[..], &current].concat(), &adapter);
        assert!(last.crossover.naive_below == 5 && last.skin.call_ns == 5.0, "{last:?}");
        assert_eq!((last.radix_sort_from, last.device_from), (5000, 50));
        assert_eq!((last.tests_per_second, assumed.tests_per_second), (5e3, 5e8));
    }
}
