//! The choice of the backend, and of the algorithm on a GPU, as pure functions that also return the reason.
//! `lazygrid_host::algorithm_choice` chooses on the CPU.

#[cfg(feature = "gpu")]
use lazygrid_host::SkinCosts;
use lazygrid_kernels::Algorithm;

#[cfg(feature = "gpu")]
use crate::gpu::costs::{AdapterProfile, Crossover};
#[cfg(feature = "gpu")]
use crate::gpu::device::AdapterId;
use crate::{Backend, Error};

#[cfg(feature = "gpu")]
pub(crate) const LARGE_INPUT_ALGORITHM: Algorithm = Algorithm::CellList;

/// Returns the requested backend. Naming an adapter implies `Gpu`.
#[cfg(feature = "gpu")]
pub(crate) fn resolve_backend(asked: Backend, adapter: Option<&AdapterId>) -> Result<Backend, Error> {
    match (asked, adapter) {
        (asked, None) => Ok(asked),
        (Backend::Cpu, Some(adapter)) => Err(Error::AdapterOnCpu { adapter: adapter.to_string() }),
        (_, Some(_)) => Ok(Backend::Gpu),
    }
}

/// Returns the device and the reason, or `None` for the CPU. Calls `open` only if a GPU could run; the argument of
/// `open` permits a software adapter.
///
/// # Errors
/// [`Error::NotOnBackend`] if the backend lacks the algorithm; [`Error::GpuUnavailable`] if a required GPU cannot be
/// opened.
pub(crate) fn backend<D>(
    asked: Backend,
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
    match asked {
        Backend::Cpu if !on_cpu => Err(Error::NotOnBackend { algorithm, backend: asked }),
        Backend::Cpu => Ok((None, "CPU: asked for".to_owned())),
        _ if !on_cpu && !on_gpu => Err(Error::NotOnBackend { algorithm, backend: asked }),
        Backend::Gpu if !on_gpu => Err(Error::NotOnBackend { algorithm, backend: asked }),
        Backend::Gpu => insist("asked for", open(true)),
        Backend::Auto if !on_gpu => Ok((None, format!("CPU: {algorithm} runs there only"))),
        Backend::Auto if !on_cpu => insist(&format!("{algorithm} runs there only"), open(true)),
        Backend::Auto => Ok(match open(false) {
            Ok((name, device)) if is_per_call(asked, algorithm) => {
                (Some(device), format!("GPU {name} or the CPU: by the number of spheres"))
            }
            Ok((name, device)) => (Some(device), format!("GPU {name}: a real GPU")),
            Err(Error::NoAdapter { reason }) => (None, format!("CPU: no hardware GPU ({reason})")),
            Err(error) => (None, format!("CPU: {error}")),
        }),
        unknown => Err(Error::NotOnBackend { algorithm, backend: unknown }),
    }
}

/// Returns `true` if each call chooses between the CPU and the device that [`backend`] opened.
pub(crate) fn is_per_call(asked: Backend, algorithm: Algorithm) -> bool {
    asked == Backend::Auto && matches!(algorithm, Algorithm::Auto | Algorithm::CellList)
}

/// Returns the backend for spheres in host memory, and the reason.
#[cfg(feature = "gpu")]
pub(crate) fn per_call(spheres: u64, known: &AdapterProfile) -> (Backend, String) {
    let AdapterProfile { device_from, how, .. } = *known;
    match spheres < u64::from(device_from) {
        true => (Backend::Cpu, format!("CPU: {spheres} spheres are fewer than {device_from} ({how})")),
        false => (Backend::Gpu, format!("GPU: {spheres} spheres are at least {device_from} ({how})")),
    }
}

/// Returns the algorithm on a GPU, and the reason.
#[cfg(feature = "gpu")]
pub(crate) fn algorithm(
    asked: Algorithm,
    (spheres, split, classes): (u32, Option<u32>, usize),
    (crossover, known): (Crossover, &str),
) -> (Algorithm, String) {
    if asked != Algorithm::Auto {
        return (asked, format!("{asked}: asked for"));
    }
    let at = crossover.of(classes);
    if let Some(split) = split {
        let [a, b] = [split, spheres - split].map(u64::from);
        // At the crossover, the grid costs as much per sphere as testing it against `at / 2` spheres.
        let is_few = 2 * a * b < (a + b) * u64::from(at);
        let (chosen, few) = if is_few { (Algorithm::Naive, "few") } else { (LARGE_INPUT_ALGORITHM, "many") };
        return (chosen, format!("{chosen}: {a} times {b} comparisons are {few} ({known})"));
    }
    let sizes = if classes == 1 { "1 size class" } else { &format!("{classes} size classes") };
    let (chosen, relation) =
        if spheres < at { (Algorithm::Naive, "fewer than") } else { (LARGE_INPUT_ALGORITHM, "at least") };
    (chosen, format!("{chosen}: {spheres} spheres in {sizes} are {relation} {at} ({known})"))
}

#[cfg(feature = "gpu")]
pub(crate) fn can_use_skin(
    asked: Algorithm,
    chosen: Algorithm,
    spheres: u32,
    costs: &SkinCosts,
) -> Result<(), String> {
    let least = costs.min_worthwhile_spheres();
    match least {
        _ if !matches!(asked, Algorithm::Auto | Algorithm::CellList) => Err(format!("{asked} keeps none")),
        _ if chosen == Algorithm::Naive => Err("all pairs of so few cost less".to_owned()),
        Some(least) if spheres >= least => Ok(()),
        Some(least) => Err(format!("{spheres} spheres are fewer than {least}")),
        None => Err("testing them costs more than a new search".to_owned()),
    }
}

#[cfg(feature = "gpu")]
pub(crate) fn one_level(ran: Algorithm, chosen: Algorithm) -> String {
    format!("{ran} instead of {chosen}: the entries of several levels do not fit the device")
}

#[cfg(all(test, feature = "gpu"))]
mod tests {
    use super::*;
    use crate::gpu::costs::{Calibration, HARDWARE_SKIN_COSTS, SOFTWARE_SKIN_COSTS, profile_of};
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
    fn backends() {
        use Algorithm::{ArrayGrid, Auto, CellList, HashGrid, LazyGrid, Naive};
        let cpu_only = || Error::NotOnBackend { algorithm: HashGrid, backend: Backend::Gpu };
        let gpu_only = || Error::NotOnBackend { algorithm: LazyGrid, backend: Backend::Cpu };
        let unavailable = || Error::GpuUnavailable { reason: NONE.to_string() };
        for (asked, algorithm, machine, expected) in [
            (Backend::Auto, Auto, "gpu", Ok("GPU gpu or the CPU: by the number of spheres")),
            (Backend::Auto, ArrayGrid, "gpu", Ok("GPU gpu: a real GPU")),
            (Backend::Auto, Auto, "software", Ok("CPU: no hardware GPU")),
            (Backend::Auto, Auto, "none", Ok("CPU: no hardware GPU")),
            (Backend::Auto, HashGrid, "gpu", Ok("CPU: hash-grid runs there only")),
            (Backend::Auto, CellList, "gpu", Ok("GPU gpu or the CPU: by the number of spheres")),
            (Backend::Auto, CellList, "software", Ok("CPU: no hardware GPU")),
            (Backend::Cpu, Auto, "gpu", Ok("CPU: asked for")),
            (Backend::Cpu, Naive, "none", Ok("CPU: asked for")),
            (Backend::Gpu, Auto, "software", Ok("GPU software: asked for")),
            (Backend::Gpu, Naive, "gpu", Ok("GPU gpu: asked for")),
            (Backend::Gpu, Auto, "none", Err(unavailable())),
            (Backend::Gpu, HashGrid, "gpu", Err(cpu_only())),
            (Backend::Cpu, LazyGrid, "gpu", Err(gpu_only())),
        ] {
            let found = backend(asked, algorithm, open(machine));
            let case = format!("{asked}, {algorithm}, {machine}: {found:?}");
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
        for asked in Backend::ALL {
            assert_eq!(resolve_backend(asked, None), Ok(asked));
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
    fn an_algorithm_of_one_backend_is_found_there_or_refused() {
        for algorithm in Algorithm::ALL.iter().copied().filter(|a| *a != Algorithm::Auto) {
            let (on_cpu, on_gpu) = (Algorithm::CPU.contains(&algorithm), Algorithm::GPU.contains(&algorithm));
            assert_eq!(backend(Backend::Cpu, algorithm, open("gpu")).is_ok(), on_cpu, "{algorithm}");
            assert_eq!(backend(Backend::Gpu, algorithm, open("gpu")).is_ok(), on_gpu, "{algorithm}");
            let anywhere = backend(Backend::Auto, algorithm, open("software"));
            assert_eq!(anywhere.is_ok(), on_cpu || on_gpu, "{algorithm}");
            if let Ok((device, _)) = anywhere {
                assert_eq!(
                    device.is_some(),
                    !on_cpu,
                    "{algorithm}: software only where nothing else can run it"
                );
            }
        }
    }

    #[test]
    fn algorithms() {
        let crossover = Crossover { naive_below: 10_000, per_class: 500 };
        for (asked, spheres, classes, expected) in [
            (Algorithm::Auto, 0, 0, Algorithm::Naive),
            (Algorithm::Auto, 1, 1, Algorithm::Naive),
            (Algorithm::Auto, 9_999, 1, Algorithm::Naive),
            (Algorithm::Auto, 10_000, 1, LARGE_INPUT_ALGORITHM),
            (Algorithm::Auto, 10_000, 2, Algorithm::Naive),
            (Algorithm::Auto, 11_999, 5, Algorithm::Naive),
            (Algorithm::Auto, 12_000, 5, LARGE_INPUT_ALGORITHM),
            (Algorithm::Auto, u32::MAX, 256, LARGE_INPUT_ALGORITHM),
            (Algorithm::Naive, 1_000_000, 1, Algorithm::Naive),
            (Algorithm::ArrayGrid, 1, 1, Algorithm::ArrayGrid),
        ] {
            let (chosen, reason) = algorithm(asked, (spheres, None, classes), (crossover, "measured"));
            assert_eq!(chosen, expected, "{asked}, {spheres} spheres, {classes} classes: {reason}");
            assert!(reason.starts_with(chosen.name()), "{reason}");
            assert_eq!(reason.contains("measured"), asked == Algorithm::Auto, "{reason}");
        }
        let (_, reason) =
            algorithm(Algorithm::Auto, (3000, None, 1), (crossover, "measured on this adapter"));
        assert_eq!(
            reason,
            "naive: 3000 spheres in 1 size class are fewer than 10000 (measured on this adapter)"
        );
    }

    #[test]
    fn two_sets_are_compared_all_with_all_if_that_costs_less() {
        let crossover = Crossover { naive_below: 10_000, per_class: 0 };
        for (first, second, expected) in [
            (1, 10_000_000, Algorithm::Naive),
            (4_999, 10_000_000, Algorithm::Naive),
            (5_004, 10_000_000, LARGE_INPUT_ALGORITHM),
            (9_999, 9_999, Algorithm::Naive),
            (10_000, 10_000, LARGE_INPUT_ALGORITHM),
        ] {
            for (a, b) in [(first, second), (second, first)] {
                let (chosen, reason) =
                    algorithm(Algorithm::Auto, (a + b, Some(a), 1), (crossover, "measured"));
                assert_eq!(chosen, expected, "{a} and {b}: {reason}");
            }
        }
        assert_eq!(
            algorithm(LARGE_INPUT_ALGORITHM, (2, Some(1), 1), (crossover, "measured")).0,
            LARGE_INPUT_ALGORITHM
        );
    }

    #[test]
    fn a_crossover_is_never_above_the_measured_counts() {
        for (naive_below, per_class, classes, expected) in [
            (10_000, 500, 5, 12_000),
            (Crossover::MOST, 0, 1, Crossover::MOST),
            (4_000_000_000, 0, 1, Crossover::MOST),
            (10_000, 60_000, 256, Crossover::MOST),
            (u32::MAX, u32::MAX, 256, Crossover::MOST),
        ] {
            assert_eq!(Crossover { naive_below, per_class }.of(classes), expected);
        }
    }

    #[test]
    fn candidates() {
        use Algorithm::{Auto, CellList, LazyGrid, Naive};
        // The fixed cost of a call equals the saving for a thousand spheres.
        let costs = SkinCosts {
            search_ns: 11.0,
            levels_ns: 0.0,
            find_ns: 1.0,
            keep_ns: 1.0,
            measure_ns: 1.0,
            test_ns: 1.0,
            call_ns: 10_000.0,
        };
        let never = SkinCosts { measure_ns: 12.0, ..costs };
        for (asked, chosen, spheres, costs, expected) in [
            (Auto, CellList, 1000, costs, Ok(())),
            (CellList, CellList, 1000, costs, Ok(())),
            (Auto, CellList, 999, costs, Err("999 spheres are fewer than 1000")),
            (Auto, Naive, 5000, costs, Err("all pairs of so few cost less")),
            (Naive, Naive, 1_000_000, costs, Err("naive keeps none")),
            (LazyGrid, LazyGrid, 1_000_000, costs, Err("lazy-grid keeps none")),
            (Auto, CellList, u32::MAX, never, Err("testing them costs more than a new search")),
        ] {
            let may = can_use_skin(asked, chosen, spheres, &costs);
            assert_eq!(may, expected.map_err(str::to_owned), "{asked}, {chosen}, {spheres}");
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
