//! Different settings are the same error on all ranks.

#![allow(clippy::unwrap_used, reason = "tests")]

use lazygrid::{Interaction, Interactions, Space};
use lazygrid_ranks::{Communicator, Settings, threads};

fn compare(ranks: u32, settings_of: impl Fn(u32) -> Settings + Sync) -> Option<String> {
    let compared = threads::on(ranks, |mut rank| {
        let compared = settings_of(rank.rank()).agree(&mut rank);
        // No rank gets a message of another call.
        assert_eq!(rank.all_reduce_sum(&[1]), [u64::from(ranks)]);
        compared
    });
    assert!(compared.iter().all(|one| *one == compared[0]), "{compared:?}");
    compared.into_iter().next().unwrap().err()
}

fn table(entries: &[(u32, u32, Interaction)]) -> Interactions {
    let mut table = Interactions::new(3, Interaction::Touch).unwrap();
    entries.iter().for_each(|&(a, b, interaction)| table.set(a, b, interaction).unwrap());
    table
}

fn tilted(tilt: f64) -> Space {
    let vectors = [[10.0, 0.0, 0.0], [tilt, 10.0, 0.0], [0.0, 0.0, 10.0]];
    Space::triclinic(vectors.map(Some)).unwrap()
}

#[test]
fn equal_settings_agree() {
    let reacts = table(&[(0, 1, Interaction::Within(0.5))]);
    for ranks in [1, 2, 5] {
        let settings = |rank| {
            let zero = if rank % 2 == 0 { 0.0 } else { -0.0 };
            Settings::new("1").with_space(&tilted(zero)).with_interactions(Some(&reacts)).with("steps", 3)
        };
        assert_eq!(compare(ranks, settings), None);
    }
}

#[test]
fn any_difference_is_named_with_two_ranks_and_their_values() {
    let odd_one = |ranks: u32, odd: u32, settings_of: &(dyn Fn(bool) -> Settings + Sync)| {
        compare(ranks, |rank| settings_of(rank == odd)).unwrap()
    };
    let steps =
        |is_odd: bool| Settings::new("1").with("keep", true).with("steps", if is_odd { 7 } else { 8 });
    assert_eq!(
        odd_one(4, 2, &steps),
        "rank 0: the setting `steps` is 8 on rank 0 and 7 on rank 2; 1 of 4 ranks differs from rank 0; give all ranks \
         the same"
    );
    assert_eq!(
        odd_one(4, 0, &steps),
        "rank 0: the setting `steps` is 7 on rank 0 and 8 on rank 1; 3 of 4 ranks differ from rank 0; give all ranks \
         the same"
    );
    let version = |is_odd: bool| Settings::new(if is_odd { "0.1.0" } else { "0.1.1" });
    assert!(odd_one(3, 1, &version).contains("`version` is 0.1.1 on rank 0 and 0.1.0 on rank 1"));
    let long = |is_odd: bool| {
        Settings::new("1").with_long("model", "a model", "x".repeat(if is_odd { 99 } else { 98 }))
    };
    let said = odd_one(2, 1, &long);
    assert!(said.contains("`model` is a model with the digest ") && said.len() < 200, "{said}");
}

#[test]
fn any_difference_of_spaces_is_found() {
    let spaces = [
        Space::UNBOUNDED,
        Space::periodic([Some(10.0); 3]).unwrap(),
        Space::periodic([Some(10.0), Some(10.0), None]).unwrap(),
        Space::periodic([None, Some(10.0), Some(10.0)]).unwrap(),
        Space::periodic([Some(10.0), Some(10.0_f64.next_up()), Some(10.0)]).unwrap(),
        tilted(1.0),
        tilted(1.0_f64.next_down()),
    ];
    for (k, one) in spaces.iter().enumerate() {
        for other in &spaces[..k] {
            let said = compare(2, |rank| Settings::new("1").with_space(if rank == 0 { one } else { other }));
            assert!(said.unwrap().starts_with("rank 0: the setting `space` is "), "{one:?}, {other:?}");
        }
    }
}

#[test]
fn any_difference_of_interactions_is_found() {
    let tables = [
        None,
        Some(table(&[])),
        Some(Interactions::new(2, Interaction::Touch).unwrap()),
        Some(table(&[(0, 1, Interaction::Never)])),
        Some(table(&[(0, 2, Interaction::Never)])),
        Some(table(&[(2, 2, Interaction::Within(0.0))])),
        Some(table(&[(2, 2, Interaction::Within(f64::from_bits(1)))])),
    ];
    for (k, one) in tables.iter().enumerate() {
        for other in &tables[..k] {
            let table_of = |rank| if rank == 0 { one } else { other };
            let said = compare(2, |rank| Settings::new("1").with_interactions(table_of(rank).as_ref()));
            assert!(
                said.unwrap().starts_with("rank 0: the setting `interactions` is "),
                "{one:?}, {other:?}"
            );
        }
    }
}

#[test]
fn a_setting_that_some_ranks_do_not_have_is_named() {
    for has in [0, 1] {
        let said = compare(3, |rank| {
            let settings = Settings::new("1").with("keep", true);
            if rank == has { settings.with("steps", 3) } else { settings }
        });
        let said = said.unwrap();
        assert!(said.contains("the setting `steps` is ") && said.contains("not known on rank"), "{said}");
    }
}
