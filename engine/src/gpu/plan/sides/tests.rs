use lazygrid_kernels::Algorithm;

use super::*;
use crate::gpu::plan::Planner;
use crate::gpu::test_support::Random;
use crate::gpu::{DeviceLimits, GpuConfig, wgpu};

fn table(species: u32, pairs: &[(u32, u32, Interaction)]) -> Interactions {
    let mut table = Interactions::new(species, Interaction::Never).expect("a table");
    pairs.iter().for_each(|&(a, b, with)| table.set(a, b, with).expect("species of the table"));
    table
}

fn sides_of(table: &Interactions) -> Sides {
    Sides::new(table, None)
}

const TOUCH: Interaction = Interaction::Touch;
const ACROSS: [u8; 2] = [0b10, 0b01];

#[test]
fn reactants_are_on_opposite_sides_and_products_on_none() {
    let sides = sides_of(&table(3, &[(0, 1, Interaction::Within(0.5))]));
    assert_eq!((sides.of_species, sides.one_set.interaction), (vec![Some(0), Some(1), None], 0.5));
    assert_eq!(sides.one_set.of_side, ACROSS);
    assert_eq!(sides.two_sets.of_side, [0b1000, 0b0100, 0b0010, 0b0001]);
    assert_eq!(sides.two_sets.interaction, 0.5);
}

#[test]
fn species_of_disjoint_pairs_have_a_side_each() {
    for pairs in 2..=4 {
        let rows: Vec<_> = (0..pairs).map(|pair| (2 * pair, 2 * pair + 1, TOUCH)).collect();
        let sides = sides_of(&table(2 * pairs + 1, &rows));
        let one_each = (0..2 * pairs as u8).map(Some).chain([None]);
        assert_eq!(sides.of_species, one_each.collect::<Vec<_>>());
        let partner = |side: u8| 1 << (side ^ 1);
        assert_eq!(sides.one_set.of_side, (0..2 * pairs as u8).map(partner).collect::<Vec<_>>());
        assert_eq!(sides.one_set.interaction, SearchParams::TOUCH);
        let of_sets = (sides.two_sets.of_side.len(), sides.two_sets.interaction);
        assert_eq!(of_sets, (2, SearchParams::BY_SPECIES), "each set is one side");
    }
    let distances = [(0, 1, Interaction::Within(0.5)), (2, 3, Interaction::Within(0.25))];
    assert_eq!(sides_of(&table(4, &distances)).one_set.interaction, SearchParams::BY_SPECIES);
}

fn species_compared_in_vain(table: &Interactions) -> Vec<u32> {
    let sides = sides_of(table);
    let is_compared = |side: u8| sides.one_set.of_side[usize::from(side)] >> side & 1 == 1;
    let on_compared_side = |id: &u32| sides.of_species[*id as usize].is_some_and(is_compared);
    let pairs = |id: &u32| table.get(*id, *id) != Interaction::Never;
    (0..table.species()).filter(|id| !pairs(id)).filter(on_compared_side).collect()
}

#[test]
fn species_beyond_the_most_groups_share_sides_that_never_meet_themselves() {
    for pairs in 5..=20 {
        let disjoint: Vec<_> = (0..pairs).map(|pair| (2 * pair, 2 * pair + 1, TOUCH)).collect();
        let with_one = (0..2 * pairs).map(|id| (id, 2 * pairs, TOUCH));
        let partner_of_all: Vec<_> = disjoint.iter().copied().chain(with_one).collect();
        for table in [table(2 * pairs, &disjoint), table(2 * pairs + 1, &partner_of_all)] {
            assert_eq!(species_compared_in_vain(&table), [], "{pairs} pairs");
            assert_eq!(sides_of(&table).one_set.interaction, SearchParams::BY_SPECIES);
        }
    }
}

#[test]
fn ring_of_reactions_has_two_sides_that_pair_alike() {
    let ring: Vec<_> = (0..4).map(|id| (id, (id + 1) % 4, TOUCH)).collect();
    let sides = sides_of(&table(4, &ring));
    assert_eq!(sides.of_species, [0, 1, 0, 1].map(Some));
    assert_eq!((&sides.one_set.of_side[..], sides.one_set.interaction), (&ACROSS[..], SearchParams::TOUCH));
}

#[test]
fn species_that_all_pair_are_on_one_side() {
    let all = sides_of(&Interactions::new(7, TOUCH).expect("a table"));
    assert_eq!((all.of_species, all.one_set.of_side), (vec![Some(0); 7], vec![1]));
    assert_eq!(
        (all.one_set.interaction, all.two_sets.interaction),
        (SearchParams::TOUCH, SearchParams::TOUCH)
    );
    let none = sides_of(&Interactions::new(2, Interaction::Never).expect("a table"));
    assert_eq!((none.of_species, none.one_set.of_side), (vec![None; 2], vec![0]));
    assert_eq!(sides_of(&Interactions::new(0, TOUCH).expect("a table")).of_species, []);
}

#[test]
fn species_that_meets_itself_may_be_a_side() {
    let sides = sides_of(&table(2, &[(0, 0, TOUCH), (0, 1, TOUCH)]));
    assert_eq!(sides.of_species, [Some(0), Some(1)]);
    assert_eq!(sides.one_set.of_side, [0b11, 0b01]);
}

#[test]
fn species_with_a_distant_partner_is_a_narrow_side() {
    let within = |distance| Interaction::Within(distance);
    for of_partner in [Interaction::Never, TOUCH, within(8.0)] {
        let table = table(2, &[(0, 0, within(0.5)), (0, 1, within(8.0)), (1, 1, of_partner)]);
        let sides = sides_of(&table);
        assert_eq!(
            (&sides.of_species[..], sides.one_set.narrow),
            (&[Some(0), Some(1)][..], 0b01),
            "{of_partner:?}"
        );
        let half = |species| sides.effective_radius(&table, species).half;
        assert_eq!([half(0), half(1)], [0.25, 4.0]);
        assert_eq!(table.effective_radius(0).half, 4.0, "in other grids");
    }
    let by_contact = table(2, &[(0, 0, TOUCH), (0, 1, within(8.0))]);
    assert_eq!(sides_of(&by_contact).one_set.narrow, 0, "radii may be large");
    let not_much_farther = table(2, &[(0, 0, within(2.0)), (0, 1, within(8.0))]);
    assert_eq!(sides_of(&not_much_farther).one_set.narrow, 0);
    let searched_by_others_only = table(2, &[(0, 1, within(8.0))]);
    assert_eq!(sides_of(&searched_by_others_only).one_set.narrow, 0);
}

#[test]
fn narrow_sides_never_pair_with_each_other() {
    let within = |distance| Interaction::Within(distance);
    let table = table(2, &[(0, 0, within(0.5)), (0, 1, within(8.0)), (1, 1, within(0.25))]);
    for (most_frequent, narrow) in [(None, 0b10), (Some(0), 0b01), (Some(1), 0b10)] {
        let sides = Sides::new(&table, most_frequent);
        let found = (sides.of_species, sides.one_set.narrow);
        assert_eq!(
            found,
            (vec![Some(0), Some(1)], narrow),
            "the narrower one, unless it is not {most_frequent:?}"
        );
        assert_eq!(Sides::narrow_species(&table, most_frequent), [0b01, 0b10].map(|side| side == narrow));
    }
}

#[test]
fn side_that_saves_little_is_not_separated() {
    // More sides would save one in 18 comparisons.
    let mut almost_all = Interactions::new(6, TOUCH).expect("a table");
    almost_all.set(4, 5, Interaction::Never).expect("species of the table");
    assert_eq!(sides_of(&almost_all).of_species, [Some(0); 6]);
}

#[test]
fn species_that_never_meets_itself_is_on_no_side_that_does() {
    let mut almost_all = Interactions::new(6, TOUCH).expect("a table");
    almost_all.set(5, 5, Interaction::Never).expect("a species of the table");
    let sides = sides_of(&almost_all);
    assert_eq!(sides.of_species, [0, 0, 0, 0, 0, 1].map(Some));
    assert_eq!((sides.one_set.of_side, sides.one_set.interaction), (vec![0b11, 0b01], SearchParams::TOUCH));
    for species in 2..=8 {
        // The first species have no pairs of their own.
        for first in 1..=species {
            let mut table = Interactions::new(species, TOUCH).expect("a table");
            (0..first).for_each(|id| table.set(id, id, Interaction::Never).expect("a species of the table"));
            assert_eq!(species_compared_in_vain(&table), [], "{first} of {species}");
        }
    }
}

#[test]
fn divisions_are_counted_by_bell_numbers() {
    assert_eq!([0, 1, 2, 3, 4, 8].map(|groups| divisions(groups).len()), [1, 1, 2, 5, 15, 4140]);
}

#[test]
fn random_tables_have_sides_for_all_their_pairs() {
    let mut random = Random(1);
    let mut below = |limit: u32| (random.bits() >> 33) as u32 % limit;
    let (mut narrow, sizes) = (0, (1..14).cycle().take(1000).chain([100, 600]));
    for (k, species) in sizes.enumerate() {
        let pairs: Vec<_> = (0..species * 2)
            .map(|_| match below(6) {
                _ if k % 2 == 0 => (below(species), below(species), TOUCH),
                0 => (below(species), below(species), TOUCH),
                power => (below(species), below(species), Interaction::Within(8.0_f64.powi(power as i32))),
            })
            .collect();
        let table = table(species, &pairs);
        let sides = sides_of(&table);
        narrow += sides.one_set.narrow.count_ones();
        if species <= CellListLayout::MAX_SIDES as u32 {
            assert_eq!(species_compared_in_vain(&table), [], "{table:?}");
        }
        let all: Vec<u32> = (0..species).collect();
        for (a, b) in product(&all, &all).filter(|&(a, b)| table.get(a, b) != Interaction::Never) {
            let [of_a, of_b] = [a, b].map(|id| sides.of_species[id as usize].expect("the species pairs"));
            assert_eq!(sides.one_set.of_side[usize::from(of_a)] >> of_b & 1, 1, "{a} and {b} of {species}");
            let [half_a, half_b] = [a, b].map(|id| sides.effective_radius(&table, id).half);
            let are_narrow = [of_a, of_b].map(|side| sides.one_set.narrow >> side & 1 == 1);
            assert!(of_a == of_b || are_narrow != [true; 2], "{a} and {b} of {table:?}");
            let cutoff = match of_a != of_b && are_narrow.contains(&true) {
                true => 2.0 * half_a.max(half_b),
                false => half_a + half_b,
            };
            let distance = table.get(a, b).cutoff(0.0).expect("they pair");
            assert!(f64::from(cutoff) >= distance, "{a} and {b} are searched to {cutoff} of {table:?}");
        }
    }
    assert!(narrow > 100, "only {narrow} narrow sides");
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
