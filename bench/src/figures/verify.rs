use std::error::Error;

use lazygrid::{Algorithm, Backend, Config, Order, Pair, Sphere};
use lazygrid_check::{SpeciesSetup, TestInput, Tolerance, difference};

use crate::SpeciesScene;
use crate::measure::{ContenderFactory, Digest, Found};
use crate::peers::cell_list;

/// Largest scene without species whose reference is naive; larger ones use the plain cell list, which is itself checked
/// against naive up to this size.
const NAIVE_REFERENCE: usize = 20_000;

pub(super) struct Reference {
    input: TestInput,
    pairs: Vec<Pair>,
    digest: Digest,
}

impl Reference {
    pub(super) fn new(spheres: &[Sphere], species: Option<SpeciesScene>) -> Result<Self, Box<dyn Error>> {
        let naive =
            Config::default().backend(Backend::Cpu).algorithm(Algorithm::Naive).order(Order::Unordered);
        let contender = match (species, spheres.len()) {
            (Some(scene), _) => ContenderFactory::list_by_species("naive", naive, scene),
            (None, ..=NAIVE_REFERENCE) => ContenderFactory::list("naive", naive),
            (None, _) => cell_list::incremental(),
        };
        let mut search = (contender.make)()?;
        search.prepare(spheres)?;
        let found = search.run(spheres)?;
        let digest = Digest::from_found(&found);
        let pairs = match found {
            Found::Pairs(pairs) => pairs.to_vec(),
            Found::Count(_) => vec![],
        };
        let mixture = species.map(|scene| species_setup(scene, spheres.len())).transpose()?;
        Ok(Self { input: TestInput { mixture, ..spheres.to_vec().into() }, pairs, digest })
    }

    pub(super) fn check(&self, found: Digest) -> Result<(), String> {
        let (pairs, expected) = (found.pairs, self.digest.pairs);
        match found.agrees(&self.digest) {
            true => Ok(()),
            false if pairs == expected => Err(format!(
                "wrong answer: the number of pairs is right ({pairs}), but other pairs were found"
            )),
            false => Err(format!("wrong answer: {pairs} pairs, expected {expected}")),
        }
    }

    /// Counts the differing pairs within 4 ulp of tangency, relative to the squared cutoff
    /// (`docs/contract.md`). Any other difference is an error.
    pub(super) fn tangent(&self, found: &[Pair]) -> Result<u64, String> {
        let [found, expected] = [found, &self.pairs].map(|pairs| {
            let mut pairs = pairs.to_vec();
            pairs.sort_unstable();
            pairs
        });
        difference(&self.input, &found, &expected, Tolerance::Tangent)
            .map_err(|text| format!("wrong answer: {text}"))?;
        let absent =
            |from: &[Pair], pairs: &[Pair]| pairs.iter().filter(|p| from.binary_search(p).is_err()).count();
        Ok((absent(&found, &expected) + absent(&expected, &found)) as u64)
    }
}

fn species_setup(scene: SpeciesScene, n: usize) -> Result<SpeciesSetup, Box<dyn Error>> {
    let table = scene.table()?;
    let row = |a| (0..=a).map(|b| table.get(a, b)).collect();
    Ok(SpeciesSetup { species: scene.species(n), rows: (0..table.species()).map(row).collect() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row() -> Vec<Sphere> {
        let beyond = 2.0 * f32::EPSILON;
        [-4.0 - 4.0 * beyond, -2.0 - beyond, 0.0, 2.0].map(|x| Sphere::new([x, 0.0, 0.0], 1.0)).to_vec()
    }

    #[test]
    fn only_tangent_pairs_may_differ() {
        let spheres = row();
        let reference = Reference::new(&spheres, None).expect("valid spheres");
        let pair_list =
            |pairs: &[(u32, u32)]| pairs.iter().map(|&(i, j)| Pair::new(i, j)).collect::<Vec<_>>();
        assert_eq!(reference.pairs, pair_list(&[(2, 3)]));
        assert_eq!(reference.tangent(&pair_list(&[(2, 3)])), Ok(0));
        assert_eq!(reference.tangent(&pair_list(&[])), Ok(1));
        assert_eq!(reference.tangent(&pair_list(&[(2, 3), (1, 2)])), Ok(1));
        assert_eq!(reference.tangent(&pair_list(&[(1, 2)])), Ok(2));
        let wrong = |pairs: &[(u32, u32)], fault| {
            let verdict = reference.tangent(&pair_list(pairs));
            assert!(verdict.as_ref().is_err_and(|text| text.contains(fault)), "{pairs:?}: {verdict:?}");
        };
        wrong(&[(2, 3), (2, 3)], "2 pairs found, 1 expected; 1 duplicate, ");
        wrong(&[(2, 3), (0, 1)], "2 pairs found, 1 expected; 1 extra, ");
        wrong(&[(2, 3), (0, 3), (0, 2)], "3 pairs found, 1 expected; 2 extra, ");
    }

    #[test]
    fn missing_pair_is_wrong() {
        let spheres = [0.0, 1.0].map(|x| Sphere::new([x, 0.0, 0.0], 1.0));
        let reference = Reference::new(&spheres, None).expect("valid spheres");
        let verdict = reference.tangent(&[]);
        let says = "wrong answer: 0 pairs found, 1 expected; 1 missing, first 0: ";
        assert!(verdict.as_ref().is_err_and(|text| text.starts_with(says)), "{verdict:?}");
        let empty = Digest::from_found(&Found::Pairs(&[]));
        assert_eq!(reference.check(empty), Err("wrong answer: 0 pairs, expected 1".to_owned()));
        let full = Digest::from_found(&Found::Pairs(&[Pair::new(0, 1)]));
        assert_eq!(reference.check(full), Ok(()));
    }
}
