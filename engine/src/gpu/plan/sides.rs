//! The two sides of a cell list's spheres on the GPU. Sides without common interactions are never compared.

use lazygrid_host::SpeciesPartition;
use lazygrid_kernels::layout::SearchParams;
use lazygrid_kernels::{Interaction, Interactions};

/// Sides are kept apart if they save at least this fraction of comparisons.
const WORTHWHILE: f64 = 0.25;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Side {
    /// Species pairs with none.
    Idle,
    First,
    Second,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Sides {
    pub(crate) of_species: Vec<Side>,
    /// For one set; see [`SearchParams::side_pairs`].
    pub(crate) side_pairs: u32,
    /// For one set; see [`SearchParams::interaction`].
    pub(crate) interaction: f32,
    /// For two sets, where spheres of one species may meet.
    pub(crate) across_sets: f32,
}

impl Sides {
    /// Minimizes the comparisons for equal numbers of each species.
    pub(crate) fn of(table: &Interactions) -> Self {
        let groups = SpeciesPartition::of_table(table);
        let species = || 0..table.species();
        let is_idle = |group: usize| (0..groups.count()).all(|other| !groups.meets(group, other));
        let active: Vec<usize> = (0..groups.count()).filter(|&group| !is_idle(group)).collect();
        let weights: Vec<f64> = active
            .iter()
            .map(|&group| species().filter(|&of| groups.group_of(of) == group).count() as f64)
            .collect();
        // The first group is on the first side.
        let divisions = 1_u32 << active.len().saturating_sub(1);
        let meets = |a: usize, b: usize| groups.meets(active[a], active[b]);
        let cost = |second: u32| comparisons(second << 1, &weights, meets);
        let best = (0..divisions).min_by(|&a, &b| cost(a).0.total_cmp(&cost(b).0)).unwrap_or(0);
        let best = if cost(best).0 <= (1.0 - WORTHWHILE) * cost(0).0 { best } else { 0 };
        let side = |of: u32| match active.iter().position(|&group| group == groups.group_of(of)) {
            None => Side::Idle,
            Some(at) if (best << 1) >> at & 1 == 1 => Side::Second,
            Some(_) => Side::First,
        };
        let of_species: Vec<Side> = species().map(side).collect();
        let side_pairs = cost(best).1;
        let on = |side: Side| species().filter(|&of| of_species[of as usize] == side).collect::<Vec<_>>();
        let [first, second] = [Side::First, Side::Second].map(on);
        let compared = [
            (SearchParams::FIRST_WITH_ITSELF, &first, &first),
            (SearchParams::FIRST_WITH_SECOND, &first, &second),
            (SearchParams::SECOND_WITH_ITSELF, &second, &second),
        ];
        let compared = compared.into_iter().filter(|(bit, ..)| side_pairs & bit != 0);
        let interaction = common(compared.flat_map(|(_, a, b)| product(a, b)), table);
        let across_sets = if second.is_empty() {
            interaction
        } else {
            let all = [first, second].concat();
            common(product(&all, &all), table)
        };
        Self { of_species, side_pairs, interaction, across_sets }
    }
}

fn product(a: &[u32], b: &[u32]) -> impl Iterator<Item = (u32, u32)> {
    a.iter().flat_map(|&a| b.iter().map(move |&b| (a, b)))
}

fn common(mut pairs: impl Iterator<Item = (u32, u32)>, table: &Interactions) -> f32 {
    let Some((a, b)) = pairs.next() else { return SearchParams::TOUCH };
    let first = table.get(a, b);
    match first {
        _ if pairs.any(|(a, b)| table.get(a, b) != first) => SearchParams::BY_SPECIES,
        Interaction::Never => SearchParams::BY_SPECIES,
        Interaction::Touch => SearchParams::TOUCH,
        Interaction::Within(distance) => distance as f32,
    }
}

/// Returns the comparisons with the groups in the set `second` on the second side, and the compared sides. `weights`
/// are the groups' numbers of spheres.
fn comparisons(second: u32, weights: &[f64], meets: impl Fn(usize, usize) -> bool) -> (f64, u32) {
    let groups = weights.len();
    let side = |group: usize| (second >> group & 1) as usize;
    let mut spheres = [0.0; 2];
    (0..groups).for_each(|group| spheres[side(group)] += weights[group]);
    let pairs = (0..groups).flat_map(|a| (a..groups).map(move |b| (a, b)));
    let side_pairs =
        pairs.filter(|&(a, b)| meets(a, b)).fold(0, |bits, (a, b)| bits | 1 << (side(a) + side(b)));
    let each = [0.5 * spheres[0] * spheres[0], spheres[0] * spheres[1], 0.5 * spheres[1] * spheres[1]];
    ((0..3).filter(|bit| side_pairs >> bit & 1 == 1).map(|bit| each[bit]).sum(), side_pairs)
}

#[cfg(test)]
mod tests {
    use super::Side::{First, Idle, Second};
    use super::*;

    fn table(species: u32, pairs: &[(u32, u32, Interaction)]) -> Interactions {
        let mut table = Interactions::new(species, Interaction::Never).expect("a table");
        pairs.iter().for_each(|&(a, b, with)| table.set(a, b, with).expect("species of the table"));
        table
    }

    const TOUCH: Interaction = Interaction::Touch;

    #[test]
    fn reactants_are_on_opposite_sides_and_products_on_none() {
        let within = Interaction::Within(0.5);
        let sides = Sides::of(&table(5, &[(0, 1, within), (2, 3, within)]));
        // Either reactant of the second reaction may be on the first side.
        assert!([[First, Second], [Second, First]].contains(&[sides.of_species[2], sides.of_species[3]]));
        assert_eq!([sides.of_species[0], sides.of_species[1], sides.of_species[4]], [First, Second, Idle]);
        assert_eq!(
            (sides.side_pairs, sides.interaction),
            (SearchParams::FIRST_WITH_SECOND, SearchParams::BY_SPECIES)
        );
        let sides = Sides::of(&table(3, &[(0, 1, within)]));
        assert_eq!((sides.of_species, sides.interaction), (vec![First, Second, Idle], 0.5));
        assert_eq!(sides.across_sets, SearchParams::BY_SPECIES, "of two sets spheres of one species meet");
    }

    #[test]
    fn ring_of_reactions_has_two_sides_that_pair_alike() {
        let ring: Vec<_> = (0..4).map(|of| (of, (of + 1) % 4, TOUCH)).collect();
        let sides = Sides::of(&table(4, &ring));
        assert_eq!(sides.of_species, [First, Second, First, Second]);
        assert_eq!(
            (sides.side_pairs, sides.interaction),
            (SearchParams::FIRST_WITH_SECOND, SearchParams::TOUCH)
        );
    }

    #[test]
    fn species_that_all_pair_are_on_one_side() {
        let all = Sides::of(&Interactions::new(7, TOUCH).expect("a table"));
        assert_eq!(all.of_species, [First; 7]);
        assert_eq!(
            (all.side_pairs, all.interaction, all.across_sets),
            (1, SearchParams::TOUCH, SearchParams::TOUCH)
        );
        let none = Sides::of(&Interactions::new(2, Interaction::Never).expect("a table"));
        assert_eq!((none.of_species, none.side_pairs), (vec![Idle; 2], 0));
        assert_eq!(Sides::of(&Interactions::new(0, TOUCH).expect("a table")).of_species, []);
    }

    #[test]
    fn species_that_meets_itself_may_be_a_side() {
        let sides = Sides::of(&table(2, &[(0, 0, TOUCH), (0, 1, TOUCH)]));
        assert_eq!(sides.of_species, [First, Second]);
        assert_eq!(sides.side_pairs, SearchParams::FIRST_WITH_ITSELF | SearchParams::FIRST_WITH_SECOND);
    }

    #[test]
    fn sides_never_separate_species_that_pair() {
        let mut state = 1_u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            state >> 33
        };
        for species in (1..14).chain([100, 600]) {
            let pairs: Vec<_> = (0..species * 2)
                .map(|_| ((next() % u64::from(species)) as u32, (next() % u64::from(species)) as u32, TOUCH))
                .collect();
            let table = table(species, &pairs);
            let sides = Sides::of(&table);
            let all: Vec<u32> = (0..species).collect();
            for (a, b) in product(&all, &all) {
                if table.get(a, b) != Interaction::Never {
                    let bit = [a, b].map(|of| match sides.of_species[of as usize] {
                        First => 0,
                        Second => 1,
                        Idle => panic!("species {of} pairs"),
                    });
                    assert_eq!(sides.side_pairs >> (bit[0] + bit[1]) & 1, 1, "{a} and {b} of {species}");
                }
            }
        }
    }
}
