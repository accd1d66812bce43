//! The choice of the algorithm: a pure function of the input's statistics.

use lazygrid_kernels::{Algorithm, Backend};

use crate::{Error, InputStats};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum IndexKind {
    Naive,
    HashGrid,
    ArrayGrid,
    RecursiveGrid,
    CellList,
}

impl IndexKind {
    /// Returns the index of an algorithm; for `Auto` the one with the most memory.
    pub(crate) fn from_algorithm(algorithm: Algorithm) -> Result<Self, Error> {
        match algorithm {
            Algorithm::Naive => Ok(Self::Naive),
            Algorithm::HashGrid => Ok(Self::HashGrid),
            Algorithm::ArrayGrid => Ok(Self::ArrayGrid),
            Algorithm::RecursiveGrid => Ok(Self::RecursiveGrid),
            Algorithm::CellList | Algorithm::Auto => Ok(Self::CellList),
            _ => Err(Error::NotOnBackend { algorithm, backend: Backend::Cpu }),
        }
    }
}

/// Fewer spheres than this plus [`NAIVE_PER_CLASS`] per size class compare all pairs, because sampling and sorting cost
/// more. Measured with `cargo bench --bench parameter_sweep -- --what crossover`; a wrong value costs microseconds.
pub const NAIVE_BELOW: usize = 400;
/// Increase per size class, because each slows the plan of the cell list.
pub const NAIVE_PER_CLASS: usize = 80;

/// Returns the algorithm and its reason.
pub fn choose(requested: Algorithm, stats: &InputStats) -> (Algorithm, String) {
    if requested != Algorithm::Auto {
        return (requested, format!("{requested}: requested"));
    }
    let (n, classes) = (stats.spheres, stats.occupied().count());
    let crossover = NAIVE_BELOW + NAIVE_PER_CLASS * classes;
    let sizes = if classes == 1 { "1 size class" } else { &format!("{classes} size classes") };
    if n < crossover {
        (Algorithm::Naive, format!("naive: {n} spheres in {sizes} are fewer than {crossover}"))
    } else {
        (Algorithm::CellList, format!("cell-list: {n} spheres in {sizes}, {crossover} or more"))
    }
}

/// Comparisons between two sets that cost as much as sorting a sphere, and as searching one of the smaller set.
const COMPARED_PER_SORTED: u64 = 55;
const COMPARED_PER_SEARCHED: u64 = 300;

pub(crate) fn choose_between(requested: Algorithm, stats: &InputStats, split: usize) -> (Algorithm, String) {
    if requested != Algorithm::Auto {
        return choose(requested, stats);
    }
    let [a, b] = [split as u64, (stats.spheres - split) as u64];
    if a * b < COMPARED_PER_SORTED * (a + b) + COMPARED_PER_SEARCHED * a.min(b) {
        (Algorithm::Naive, format!("naive: {a} times {b} comparisons are few"))
    } else {
        (Algorithm::CellList, format!("cell-list: {a} spheres and {b} others"))
    }
}

#[cfg(test)]
mod tests {
    use lazygrid_kernels::Sphere;

    use super::*;
    use crate::compare::PairTest;
    use crate::executor::Executor;

    fn chosen(n: usize, radii: &[f32]) -> Algorithm {
        let spheres: Vec<_> = (0..n).map(|k| Sphere::new([k as f32; 3], radii[k % radii.len()])).collect();
        let stats = InputStats::from_test(&PairTest::new((&spheres).into(), None), Executor::Pool)
            .expect("all are valid");
        choose(Algorithm::Auto, &stats).0
    }

    #[test]
    fn few_spheres_use_naive_and_many_the_cell_list() {
        for (n, radii, expected) in [
            (0, &[1.0][..], Algorithm::Naive),
            (1, &[1.0], Algorithm::Naive),
            (479, &[1.0], Algorithm::Naive),
            (480, &[1.0], Algorithm::CellList),
            (480, &[1.0, 0.1], Algorithm::Naive),
            (560, &[1.0, 0.1], Algorithm::CellList),
            (100_000, &[1.0, 0.1, 0.0], Algorithm::CellList),
        ] {
            assert_eq!(chosen(n, radii), expected, "{n} spheres of radii {radii:?}");
        }
    }

    #[test]
    fn requested_algorithm_is_kept() {
        let spheres = [Sphere::default()];
        let stats = InputStats::from_test(&PairTest::new((&spheres).into(), None), Executor::Pool)
            .expect("all are valid");
        for &requested in Algorithm::CPU {
            assert_eq!(choose(requested, &stats).0, requested);
        }
    }
}
