//! The sides of a cell list's spheres on the GPU: groups of species, divided so that few spheres are compared. Sides
//! without common interactions are never compared.

use lazygrid_host::SpeciesPartition;
use lazygrid_kernels::layout::{CellListLayout, SearchParams};
use lazygrid_kernels::{EffectiveRadius, Interaction, Interactions};

/// More sides must save at least this fraction of comparisons: each side has a table of cells.
const WORTHWHILE: f64 = 0.25;
/// A group is a narrow side if its spheres pair among themselves within less than this fraction of the distance to
/// others. The cells of a larger one would seldom be crowded enough to pay for searches between sides.
const MAX_NARROW: f32 = 0.25;
const MAX_SIDES: usize = CellListLayout::MAX_SIDES;

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Sides {
    /// `None` for a species that never pairs.
    pub(crate) of_species: Vec<Option<u8>>,
    /// For one set: the sides that each side is compared with, one bit each.
    pub(crate) partners: Vec<u8>,
    /// For one set; see [`SearchParams::narrow_sides`].
    pub(crate) narrow: u8,
    /// For one set; see [`SearchParams::interaction`].
    pub(crate) interaction: f32,
    /// For two sets, where spheres of one species may meet.
    pub(crate) across_sets: f32,
}

impl Sides {
    /// Minimizes the comparisons for equal numbers of each species.
    pub(crate) fn of(table: &Interactions) -> Self {
        let [by_partners, by_reach] = SpeciesPartition::of_table(table);
        let mut groups = PairingGroups::of(&by_reach, table);
        if groups.narrow == 0 {
            groups = PairingGroups::of(&by_partners, table);
        }
        let species = || 0..table.species();
        let division = groups.divide();
        let of_species: Vec<Option<u8>> =
            species().map(|of| Some(division[groups.of_species[of as usize]?])).collect();
        let partners = groups.side_partners(&division);
        let is_narrow = |side: usize| {
            (0..groups.count()).any(|of| groups.is_narrow(of) && usize::from(division[of]) == side)
        };
        let narrow = mask((0..partners.len()).map(is_narrow));
        let on = |side: usize| {
            let own = species().filter(|&of| of_species[of as usize].map(usize::from) == Some(side));
            own.collect::<Vec<_>>()
        };
        let members: Vec<Vec<u32>> = (0..partners.len()).map(on).collect();
        let compared = side_pairs(&partners).flat_map(|(a, b)| product(&members[a], &members[b]));
        let interaction = common(compared, table);
        let across_sets = if partners.len() == 1 {
            interaction
        } else {
            let all = members.concat();
            common(product(&all, &all), table)
        };
        Self { of_species, partners, narrow, interaction, across_sets }
    }

    /// Returns the rule for the effective radius of a species in a cell list: on a narrow side, with reach to its own
    /// side only.
    pub(crate) fn effective_radius(&self, table: &Interactions, species: u32) -> EffectiveRadius {
        let to_all = table.effective_radius(species);
        match self.of_species[species as usize] {
            Some(side) if self.narrow >> side & 1 == 1 => {
                let own = (0..table.species()).filter(|&other| self.of_species[other as usize] == Some(side));
                EffectiveRadius { half: table.reach_among(species, own).effective.half, ..to_all }
            }
            _ => to_all,
        }
    }

    /// Returns `true` if there is one side and contact decides all its pairs, so that a search needs no species.
    pub(crate) fn are_decided_by_contact(&self) -> bool {
        self.partners.len() == 1 && self.interaction == SearchParams::TOUCH
    }
}

/// The groups of species that pair with some group.
struct PairingGroups {
    of_species: Vec<Option<usize>>,
    /// Numbers of spheres.
    weights: Vec<f64>,
    /// The groups with which each group pairs, one bit each.
    partners: Vec<u8>,
    /// Narrow groups, one bit each. No two of them pair.
    narrow: u8,
}

/// The side of each group.
type Division = [u8; MAX_SIDES];

impl PairingGroups {
    fn of(partition: &SpeciesPartition, table: &Interactions) -> Self {
        let active: Vec<usize> = (0..partition.count()).filter(|&group| !partition.is_idle(group)).collect();
        let position = |of: u32| active.iter().position(|&group| group == partition.group_of(of));
        let of_species: Vec<Option<usize>> = (0..table.species()).map(position).collect();
        let weight = |group: usize| of_species.iter().filter(|of| **of == Some(group)).count() as f64;
        let partners = |group: usize| mask(active.iter().map(|&other| partition.meets(group, other)));
        let groups = Self {
            weights: (0..active.len()).map(weight).collect(),
            partners: active.iter().map(|&group| partners(group)).collect(),
            of_species,
            narrow: 0,
        };
        let narrow = groups.narrow(table);
        Self { narrow, ..groups }
    }

    fn count(&self) -> usize {
        self.weights.len()
    }

    fn is_narrow(&self, group: usize) -> bool {
        self.narrow >> group & 1 == 1
    }

    /// Returns the groups whose spheres pair among themselves within much less than with others, without those that pair
    /// with an earlier one. The first are groups without contact, which may be large, with the smallest distances.
    fn narrow(&self, table: &Interactions) -> u8 {
        let meets_itself = |&group: &usize| self.partners[group] >> group & 1 == 1;
        let groups = (0..self.count()).filter(meets_itself);
        let mut groups: Vec<_> = groups.filter_map(|of| Some((self.narrowness(of, table)?, of))).collect();
        groups.sort_by(|((a, a_ratio), _), ((b, b_ratio), _)| a.cmp(b).then(a_ratio.total_cmp(b_ratio)));
        groups.iter().fold(0, |narrow, &(_, group)| match self.partners[group] & narrow {
            0 => narrow | 1 << group,
            _ => narrow,
        })
    }

    /// Returns `true` if some spheres of the group pair by contact, and the fraction of its distances to all; `None` if
    /// it is not narrow.
    fn narrowness(&self, group: usize, table: &Interactions) -> Option<(bool, f32)> {
        let members = || (0..table.species()).filter(|&of| self.of_species[of as usize] == Some(group));
        members().try_fold((false, 0.0_f32), |(touches, fraction), species| {
            let own = table.reach_among(species, members()).effective;
            let to_all = table.effective_radius(species).half;
            let is_narrow = own.half < MAX_NARROW * to_all;
            is_narrow.then(|| (touches || own.touches, fraction.max(own.half / to_all)))
        })
    }

    /// Returns `true` if each narrow group has a side to itself.
    fn separates_narrow(&self, division: &Division) -> bool {
        let others = |group: usize| (0..self.count()).filter(move |&other| other != group);
        (0..self.count())
            .filter(|&group| self.is_narrow(group))
            .all(|group| others(group).all(|other| division[other] != division[group]))
    }

    /// Returns the division with fewest comparisons, with as many sides as save enough of them.
    fn divide(&self) -> Division {
        let mut best = [(f64::INFINITY, [0; MAX_SIDES]); MAX_SIDES + 1];
        for division in divisions(self.count()).into_iter().filter(|of| self.separates_narrow(of)) {
            let partners = self.side_partners(&division);
            let (cost, of_this_many) = (self.comparisons(&division, &partners), &mut best[partners.len()]);
            if cost < of_this_many.0 {
                *of_this_many = (cost, division);
            }
        }
        let [_, one, more @ ..] = best;
        let chosen = more
            .into_iter()
            .fold(one, |chosen, more| if more.0 <= (1.0 - WORTHWHILE) * chosen.0 { more } else { chosen });
        chosen.1
    }

    /// Returns the sides with which each side is compared, one bit each.
    fn side_partners(&self, division: &Division) -> Vec<u8> {
        let groups = self.count();
        let sides = division[..groups].iter().max().map_or(1, |&last| usize::from(last) + 1);
        let mut partners = vec![0; sides];
        let pairs = (0..groups).flat_map(|a| (0..groups).map(move |b| (a, b)));
        for (a, b) in pairs.filter(|&(a, b)| self.partners[a] >> b & 1 == 1) {
            partners[usize::from(division[a])] |= 1 << division[b];
        }
        partners
    }

    fn comparisons(&self, division: &Division, partners: &[u8]) -> f64 {
        let mut spheres = [0.0; MAX_SIDES];
        self.weights.iter().zip(division).for_each(|(weight, &side)| spheres[usize::from(side)] += weight);
        side_pairs(partners)
            .map(|(a, b)| if a == b { 0.5 * spheres[a] * spheres[a] } else { spheres[a] * spheres[b] })
            .sum()
    }
}

/// Returns all divisions of groups into sides, once each: a group is on the side of an earlier group or on the next one.
fn divisions(groups: usize) -> Vec<Division> {
    let mut divisions = vec![([0; MAX_SIDES], 0)];
    for group in 0..groups {
        let on_each_side = |(division, sides): (Division, u8)| {
            (0..=sides).map(move |side| {
                let mut division = division;
                division[group] = side;
                (division, sides.max(side + 1))
            })
        };
        divisions = divisions.into_iter().flat_map(on_each_side).collect();
    }
    divisions.into_iter().map(|(division, _)| division).collect()
}

/// Returns each pair of sides that are compared.
fn side_pairs(partners: &[u8]) -> impl Iterator<Item = (usize, usize)> {
    let pairs = (0..partners.len()).flat_map(|a| (a..partners.len()).map(move |b| (a, b)));
    pairs.filter(|&(a, b)| partners[a] >> b & 1 == 1)
}

fn mask(bits: impl Iterator<Item = bool>) -> u8 {
    bits.enumerate().fold(0, |mask, (at, bit)| mask | u8::from(bit) << at)
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

#[cfg(test)]
mod tests {
    use lazygrid_kernels::Algorithm;

    use super::*;
    use crate::gpu::plan::Planner;
    use crate::gpu::{DeviceLimits, GpuConfig, wgpu};

    fn table(species: u32, pairs: &[(u32, u32, Interaction)]) -> Interactions {
        let mut table = Interactions::new(species, Interaction::Never).expect("a table");
        pairs.iter().for_each(|&(a, b, with)| table.set(a, b, with).expect("species of the table"));
        table
    }

    const TOUCH: Interaction = Interaction::Touch;
    const ACROSS: [u8; 2] = [0b10, 0b01];

    #[test]
    fn reactants_are_on_opposite_sides_and_products_on_none() {
        let sides = Sides::of(&table(3, &[(0, 1, Interaction::Within(0.5))]));
        assert_eq!((sides.of_species, sides.interaction), (vec![Some(0), Some(1), None], 0.5));
        assert_eq!(sides.partners, ACROSS);
        assert_eq!(sides.across_sets, SearchParams::BY_SPECIES, "of two sets spheres of one species meet");
    }

    #[test]
    fn species_of_disjoint_pairs_have_a_side_each() {
        for pairs in 2..=4 {
            let rows: Vec<_> = (0..pairs).map(|pair| (2 * pair, 2 * pair + 1, TOUCH)).collect();
            let sides = Sides::of(&table(2 * pairs + 1, &rows));
            let one_each = (0..2 * pairs as u8).map(Some).chain([None]);
            assert_eq!(sides.of_species, one_each.collect::<Vec<_>>());
            let partner = |side: u8| 1 << (side ^ 1);
            assert_eq!(sides.partners, (0..2 * pairs as u8).map(partner).collect::<Vec<_>>());
            assert_eq!(
                (sides.interaction, sides.across_sets),
                (SearchParams::TOUCH, SearchParams::BY_SPECIES)
            );
        }
        let distances = [(0, 1, Interaction::Within(0.5)), (2, 3, Interaction::Within(0.25))];
        assert_eq!(Sides::of(&table(4, &distances)).interaction, SearchParams::BY_SPECIES);
    }

    #[test]
    fn species_beyond_the_most_groups_share_a_side_that_meets_itself() {
        let pairs: Vec<_> = (0..6).map(|pair| (2 * pair, 2 * pair + 1, TOUCH)).collect();
        let sides = Sides::of(&table(12, &pairs));
        let last = sides.of_species[11].expect("the species pairs");
        assert_eq!(sides.of_species[7..], [Some(last); 5]);
        assert_eq!(sides.partners[usize::from(last)] >> last & 1, 1);
        assert_ne!(sides.of_species[0], sides.of_species[1]);
        assert_eq!(sides.interaction, SearchParams::BY_SPECIES);
    }

    #[test]
    fn ring_of_reactions_has_two_sides_that_pair_alike() {
        let ring: Vec<_> = (0..4).map(|of| (of, (of + 1) % 4, TOUCH)).collect();
        let sides = Sides::of(&table(4, &ring));
        assert_eq!(sides.of_species, [0, 1, 0, 1].map(Some));
        assert_eq!((&sides.partners[..], sides.interaction), (&ACROSS[..], SearchParams::TOUCH));
    }

    #[test]
    fn species_that_all_pair_are_on_one_side() {
        let all = Sides::of(&Interactions::new(7, TOUCH).expect("a table"));
        assert_eq!((all.of_species, all.partners), (vec![Some(0); 7], vec![1]));
        assert_eq!((all.interaction, all.across_sets), (SearchParams::TOUCH, SearchParams::TOUCH));
        let none = Sides::of(&Interactions::new(2, Interaction::Never).expect("a table"));
        assert_eq!((none.of_species, none.partners), (vec![None; 2], vec![0]));
        assert_eq!(Sides::of(&Interactions::new(0, TOUCH).expect("a table")).of_species, []);
    }

    #[test]
    fn species_that_meets_itself_may_be_a_side() {
        let sides = Sides::of(&table(2, &[(0, 0, TOUCH), (0, 1, TOUCH)]));
        assert_eq!(sides.of_species, [Some(0), Some(1)]);
        assert_eq!(sides.partners, [0b11, 0b01]);
    }

    #[test]
    fn species_with_a_distant_partner_is_a_narrow_side() {
        let within = |distance| Interaction::Within(distance);
        for of_partner in [Interaction::Never, TOUCH, within(8.0)] {
            let table = table(2, &[(0, 0, within(0.5)), (0, 1, within(8.0)), (1, 1, of_partner)]);
            let sides = Sides::of(&table);
            assert_eq!(
                (&sides.of_species[..], sides.narrow),
                (&[Some(0), Some(1)][..], 0b01),
                "{of_partner:?}"
            );
            let half = |species| sides.effective_radius(&table, species).half;
            assert_eq!([half(0), half(1)], [0.25, 4.0]);
            assert_eq!(table.effective_radius(0).half, 4.0, "in other grids");
        }
        let not_much_farther = table(2, &[(0, 0, within(2.0)), (0, 1, within(8.0))]);
        assert_eq!(Sides::of(&not_much_farther).narrow, 0);
        let searched_by_others_only = table(2, &[(0, 1, within(8.0))]);
        assert_eq!(Sides::of(&searched_by_others_only).narrow, 0);
    }

    #[test]
    fn narrow_sides_never_pair_with_each_other() {
        let within = |distance| Interaction::Within(distance);
        let table = table(2, &[(0, 0, within(0.5)), (0, 1, within(8.0)), (1, 1, within(0.25))]);
        let sides = Sides::of(&table);
        assert_eq!((sides.of_species, sides.narrow), (vec![Some(0), Some(1)], 0b10), "the narrower one");
    }

    #[test]
    fn side_that_saves_little_is_not_separated() {
        // A side of the species that does not meet itself would save half of one in 18 comparisons.
        let mut almost_all = Interactions::new(6, TOUCH).expect("a table");
        almost_all.set(5, 5, Interaction::Never).expect("a species of the table");
        assert_eq!(Sides::of(&almost_all).of_species, [Some(0); 6]);
    }

    #[test]
    fn divisions_are_counted_by_bell_numbers() {
        assert_eq!([0, 1, 2, 3, 4, 8].map(|groups| divisions(groups).len()), [1, 1, 2, 5, 15, 4140]);
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
            for (a, b) in product(&all, &all).filter(|&(a, b)| table.get(a, b) != Interaction::Never) {
                let [of_a, of_b] = [a, b].map(|of| sides.of_species[of as usize].expect("the species pairs"));
                assert_eq!(sides.partners[usize::from(of_a)] >> of_b & 1, 1, "{a} and {b} of {species}");
            }
        }
    }

    #[test]
    fn contact_of_all_species_is_searched_without_species() {
        let searches = |of_last: [Interaction; 3]| {
            let mut table = Interactions::new(3, TOUCH).expect("few species");
            (0..).zip(of_last).for_each(|(other, with)| table.set(2, other, with).expect("known species"));
            let config = GpuConfig::default().algorithm(Algorithm::CellList).interactions(Some(table));
            let limits = DeviceLimits::from(&wgpu::Limits {
                max_storage_buffers_per_shader_stage: 16,
                ..Default::default()
            });
            let plan = Planner::new(config, limits).plan(1_000_000).expect("fits");
            let has_species = |name: &str| {
                let mut kernels = plan.sequence.kernels.iter().filter(|kernel| kernel.kernel.name == name);
                let names = kernels.next()?.bindings().map(|binding| binding.name);
                Some(names.into_iter().any(|name| name == "species" || name == "sorted_species"))
            };
            ["cell_list_search", "cell_list_search_overflow", "spheres_gather"].map(has_species)
        };
        let (with, without) = ([Some(true); 3], [Some(false), Some(false), Some(true)]);
        let never = Interaction::Never;
        assert_eq!(searches([never; 3]), without, "a species that never pairs");
        assert_eq!(searches([TOUCH, never, never]), with);
        assert_eq!(searches([Interaction::Within(0.5), Interaction::Within(0.5), never]), with);
    }
}
