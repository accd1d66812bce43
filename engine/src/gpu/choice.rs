use lazygrid_host::SkinCosts;
use lazygrid_kernels::Algorithm;

use crate::gpu::costs::Crossover;

pub(crate) const LARGE_INPUT_ALGORITHM: Algorithm = Algorithm::CellList;

#[derive(Clone, Copy)]
pub(crate) struct CallSize {
    pub(crate) spheres: u32,
    pub(crate) split: Option<u32>,
    pub(crate) classes: usize,
}

pub(crate) fn algorithm(
    requested: Algorithm,
    size: CallSize,
    crossover: Crossover,
    source: &str,
) -> (Algorithm, String) {
    if requested != Algorithm::Auto {
        return (requested, format!("{requested}: requested"));
    }
    let CallSize { spheres, split, classes } = size;
    let at = crossover.for_classes(classes);
    if let Some(split) = split {
        let [a, b] = [split, spheres - split].map(u64::from);
        // At the crossover, a sphere in the grid costs as much as `at / 2` tests.
        let is_few = 2 * a * b < (a + b) * u64::from(at);
        let (chosen, few) = if is_few { (Algorithm::Naive, "few") } else { (LARGE_INPUT_ALGORITHM, "many") };
        return (chosen, format!("{chosen}: {a} times {b} comparisons are {few} ({source})"));
    }
    let sizes = if classes == 1 { "1 size class" } else { &format!("{classes} size classes") };
    let (chosen, relation) =
        if spheres < at { (Algorithm::Naive, "fewer than") } else { (LARGE_INPUT_ALGORITHM, "at least") };
    (chosen, format!("{chosen}: {spheres} spheres in {sizes} are {relation} {at} ({source})"))
}

pub(crate) fn can_use_skin(
    requested: Algorithm,
    chosen: Algorithm,
    spheres: u32,
    costs: &SkinCosts,
) -> Result<(), String> {
    let least = costs.min_worthwhile_spheres();
    match least {
        _ if !matches!(requested, Algorithm::Auto | Algorithm::CellList) => {
            Err(format!("{requested} keeps none"))
        }
        _ if chosen == Algorithm::Naive => Err("all pairs of so few cost less".to_owned()),
        Some(least) if spheres >= least => Ok(()),
        Some(least) => Err(format!("{spheres} spheres are fewer than {least}")),
        None => Err("testing them costs more than a new search".to_owned()),
    }
}

pub(crate) fn one_level(ran: Algorithm, chosen: Algorithm) -> String {
    format!("{ran} instead of {chosen}: the entries of several levels do not fit the device")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn algorithm_and_reason_follow_the_crossover() {
        let crossover = Crossover { naive_below: 10_000, per_class: 500 };
        for (requested, spheres, classes, expected) in [
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
            let (chosen, reason) =
                algorithm(requested, CallSize { spheres, split: None, classes }, crossover, "measured");
            assert_eq!(chosen, expected, "{requested}, {spheres} spheres, {classes} classes: {reason}");
            assert!(reason.starts_with(chosen.name()), "{reason}");
            assert_eq!(reason.contains("measured"), requested == Algorithm::Auto, "{reason}");
        }
        let size = CallSize { spheres: 3000, split: None, classes: 1 };
        let (_, reason) = algorithm(Algorithm::Auto, size, crossover, "measured on this adapter");
        assert_eq!(
            reason,
            "naive: 3000 spheres in 1 size class are fewer than 10000 (measured on this adapter)"
        );
    }

    #[test]
    fn cheap_pairs_of_two_sets_are_compared_all_with_all() {
        let crossover = Crossover { naive_below: 10_000, per_class: 0 };
        for (first, second, expected) in [
            (1, 10_000_000, Algorithm::Naive),
            (4_999, 10_000_000, Algorithm::Naive),
            (5_004, 10_000_000, LARGE_INPUT_ALGORITHM),
            (9_999, 9_999, Algorithm::Naive),
            (10_000, 10_000, LARGE_INPUT_ALGORITHM),
        ] {
            for (a, b) in [(first, second), (second, first)] {
                let size = CallSize { spheres: a + b, split: Some(a), classes: 1 };
                let (chosen, reason) = algorithm(Algorithm::Auto, size, crossover, "measured");
                assert_eq!(chosen, expected, "{a} and {b}: {reason}");
            }
        }
        let size = CallSize { spheres: 2, split: Some(1), classes: 1 };
        assert_eq!(algorithm(LARGE_INPUT_ALGORITHM, size, crossover, "measured").0, LARGE_INPUT_ALGORITHM);
    }

    #[test]
    fn a_crossover_is_never_above_the_measured_counts() {
        for (naive_below, per_class, classes, expected) in [
            (10_000, 500, 5, 12_000),
            (Crossover::MAX, 0, 1, Crossover::MAX),
            (4_000_000_000, 0, 1, Crossover::MAX),
            (10_000, 60_000, 256, Crossover::MAX),
            (u32::MAX, u32::MAX, 256, Crossover::MAX),
        ] {
            assert_eq!(Crossover { naive_below, per_class }.for_classes(classes), expected);
        }
    }

    #[test]
    fn candidate_list_is_refused_with_a_reason() {
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
        for (requested, chosen, spheres, costs, expected) in [
            (Auto, CellList, 1000, costs, Ok(())),
            (CellList, CellList, 1000, costs, Ok(())),
            (Auto, CellList, 999, costs, Err("999 spheres are fewer than 1000")),
            (Auto, Naive, 5000, costs, Err("all pairs of so few cost less")),
            (Naive, Naive, 1_000_000, costs, Err("naive keeps none")),
            (LazyGrid, LazyGrid, 1_000_000, costs, Err("lazy-grid keeps none")),
            (Auto, CellList, u32::MAX, never, Err("testing them costs more than a new search")),
        ] {
            let may = can_use_skin(requested, chosen, spheres, &costs);
            assert_eq!(may, expected.map_err(str::to_owned), "{requested}, {chosen}, {spheres}");
        }
    }
}
