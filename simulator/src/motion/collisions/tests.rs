use super::halo::SingleProcess;
use super::mover::{Mover, length};
use super::overlaps::bounce_overlaps;
use super::rounds::{Adjacency, SLACK, Window, WindowEnd};
use super::rules::{CollisionEvent, Rules};
use super::{Collisions, Scratch};
use crate::model::receiver::finder_with;
use crate::model::{Contact, Model, ReactionRate, Species};
use crate::random::gaussian::normals;
use crate::random::philox::{open_unit, philox};
use crate::{Axis, Boundary, Reaction};

fn run_in_order(rules: &Rules, movers: &mut [Mover], pairs: &[[u32; 2]], horizon: f64) -> u64 {
    let mut collisions = 0;
    loop {
        let all = pairs.iter().filter_map(|&pair| rules.predict(movers, pair));
        let walls = (0..movers.len() as u32).filter_map(|at| rules.predict_wall(movers, at));
        let first = all.chain(walls).fold(CollisionEvent::NEVER, CollisionEvent::earlier);
        if first.time > horizon {
            return collisions;
        }
        let (after, met) = rules.outcome(movers, &first);
        first.particles().iter().zip(after).for_each(|(&at, mover)| movers[at as usize] = mover);
        collisions += met;
    }
}

pub(crate) fn model(contact: Contact, axis: Axis) -> Model {
    let kind = |radius, diffusion, mass| Species {
        name: "A".into(),
        radius,
        diffusion,
        mass,
        thermal_speed: 1.0,
        ..Species::default()
    };
    Model {
        time_step: 1.0,
        species: vec![kind(0.5, 1.0, 1.0), kind(0.3, 3.0, 0.5)],
        contact,
        boundary: Boundary { axes: [axis; 3], vessel: None },
        ..Model::default()
    }
}

pub(crate) fn movers(case: u32, per_side: u32, speed: f64) -> Vec<Mover> {
    let mover = |k: u32| {
        let words = philox([k, case, 0, 0], [1, 2]);
        let motion = normals(philox([k, case, 1, 0], [1, 2])).map(|c| speed * f64::from(c));
        let species = u32::from(words[3].is_multiple_of(4));
        let site = [k % per_side, k / per_side % per_side, k / per_side / per_side];
        let shift = |c: usize| 0.08 * (f64::from(open_unit(words[c])) - 0.5);
        Mover {
            position: std::array::from_fn(|c| 1.1 * (f64::from(site[c]) + 0.5) + shift(c)),
            time: 0.0,
            motion,
            speed: length(motion),
            velocity: motion,
            id: (k * 37) % 1009,
            species,
            radius: [0.5, 0.3][species as usize],
            collided: false,
        }
    };
    (0..per_side.pow(3)).map(mover).collect()
}

fn run(movers: &[Mover], rules: &Rules, slack: f64) -> (Vec<Mover>, WindowEnd) {
    let mut movers = movers.to_vec();
    let pairs = detected(rules, &movers);
    let mut neighbors = Adjacency::default();
    neighbors.build(&pairs, movers.len());
    neighbors.sort_by_id(&movers);
    let (own_count, neighbors) = (movers.len(), &neighbors);
    let window =
        Window { rules, neighbors, own_count, horizon: HORIZON, top_speed: 5.0, slack, limit: 10_000 };
    let end = window.run(&mut movers, &mut SingleProcess).expect("one process");
    (movers, end)
}

fn detected(rules: &Rules, movers: &[Mover]) -> Vec<[u32; 2]> {
    let n = movers.len() as u32;
    let mut pairs: Vec<[u32; 2]> = (0..n).flat_map(|i| (0..i).map(move |j| [j, i])).collect();
    pairs.retain(|&[a, b]| !rules.passes([a, b].map(|at| &movers[at as usize])));
    pairs
}

const HORIZON: f64 = 0.6;

#[test]
fn rounds_equal_the_order_of_times() {
    let [low, high] = [0.0, 5.5];
    for (case, contact) in [Contact::Separate, Contact::Elastic].into_iter().cycle().take(8).enumerate() {
        for axis in [Axis::Open, Axis::Reflecting { low, high }, Axis::Periodic { low, high }] {
            let rules = Rules::new(&model(contact, axis)).expect("collisions");
            let mut plain = movers(case as u32, 5, 0.4);
            let rounds = run(&plain, &rules, 0.0);
            let pairs = detected(&rules, &plain);
            let met = run_in_order(&rules, &mut plain, &pairs, HORIZON);
            assert_eq!(rounds, (plain, WindowEnd::Finished(met)), "{case} {axis:?}");
            assert!(met > 60, "only {met} collisions");
        }
    }
}

#[test]
fn late_hits_overlap_by_the_slack_at_most() {
    let axis = Axis::Periodic { low: 0.0, high: 5.5 };
    for case in 0..8 {
        let rules = Rules::new(&model(Contact::Separate, axis)).expect("collisions");
        let (rounds, _) = run(&movers(case, 5, 0.4), &rules, SLACK);
        for (k, a) in rounds.iter().enumerate() {
            for b in &rounds[..k] {
                let gap = a.gap(b, HORIZON, &rules.boundary);
                assert!(gap > -2.0 * SLACK * a.contact_distance(b), "{case}: {gap}");
            }
        }
    }
}

#[test]
fn speed_or_number_beyond_the_limit_ends_a_window() {
    let rules = Rules::new(&model(Contact::Elastic, Axis::Open)).expect("collisions");
    let begun = movers(0, 3, 0.3);
    let pairs: Vec<[u32; 2]> = (0..27).flat_map(|i| (0..i).map(move |j| [j, i])).collect();
    let mut neighbors = Adjacency::default();
    neighbors.build(&pairs, begun.len());
    let top_speed = begun.iter().map(|mover| mover.speed).fold(0.0, f64::max);
    let (own_count, neighbors) = (begun.len(), &neighbors);
    let window =
        Window { rules: &rules, neighbors, own_count, horizon: 1.0, top_speed, slack: 0.0, limit: 3 };
    let end = |window: Window| window.run(&mut begun.clone(), &mut SingleProcess).expect("one process");
    assert!(matches!(end(window), WindowEnd::TooMany(4..)));
    let slow = Window { top_speed: 0.5 * top_speed, limit: 1000, ..window };
    assert!(matches!(end(slow), WindowEnd::TooFast(speed) if speed > 0.5 * top_speed));
}

#[test]
fn overlapping_reactants_pass_through_each_other() {
    let mut model = model(Contact::Elastic, Axis::Open);
    let position = |k: u32| [0.4 * f64::from(k), 0.0, 0.0];
    let motion = |k: u32| [0.1 - 0.2 * f64::from(k), 0.0, 0.0];
    let first = Mover { species: 0, radius: 0.5, ..movers(0, 2, 1.0)[0] };
    let mover = |k: u32| Mover { position: position(k), motion: motion(k), id: k, ..first };
    let mut both = [0, 1].map(mover);
    for reactions in
        [vec![Reaction { reactants: [0, 0], binding_radius: 0.2, ..Reaction::default() }], vec![]]
    {
        let (passes, before) = (!reactions.is_empty(), both);
        model.reactions = reactions;
        let rules = Rules::new(&model).expect("collisions");
        let bounces =
            bounce_overlaps(&rules, &mut both, 2, &[[0, 1]], &mut SingleProcess).expect("one process");
        assert_eq!(
            (bounces == 0, both.map(|one| one.motion) == before.map(|one| one.motion)),
            (passes, passes)
        );
    }
}

pub(crate) fn with_points(contact: Contact) -> Model {
    let mut model = model(contact, Axis::Periodic { low: 0.0, high: 5.5 });
    model.species.push(Species { radius: 0.0, ..model.species[1].clone() });
    model.reactions = vec![Reaction {
        reactants: [0; 2],
        binding_radius: 0.2,
        chance: ReactionRate::PerStep(0.1),
        ..Reaction::default()
    }];
    model
}

fn movers_with_bursts() -> Vec<Mover> {
    let mut movers = movers(0, 5, 0.4);
    let sphere = Mover { species: 0, radius: 0.5, ..movers[0] };
    let point = Mover { species: 2, radius: 0.0, ..sphere };
    for (first, position) in [(sphere, [3.3, 3.85, 3.85]), (point, [1.0, 0.55, 0.55])] {
        let next = movers.len() as u32;
        movers.extend((next..next + 600).map(|id| Mover { id, position, ..first }));
    }
    movers
}

#[test]
fn points_and_reactants_at_one_position_are_no_candidates() {
    const ALLOWANCE: f64 = 0.05;
    let mut collisions =
        Collisions::new(&with_points(Contact::Separate)).expect("a detector").expect("collisions");
    let movers = movers_with_bursts();
    let n = movers.len() as u32;
    let may_collide = |&[a, b]: &[u32; 2]| {
        let [a, b] = [a, b].map(|at| &movers[at as usize]);
        let is_near = a.gap(b, 0.0, &collisions.rules.boundary) <= 2.0 * ALLOWANCE;
        is_near && a.contact_distance(b) > 0.0 && !collisions.rules.may_react([a, b])
    };
    let all = (0..n).flat_map(|j| (0..j).map(move |i| [i, j]));
    let mut expected: Vec<_> = all.filter(may_collide).collect();
    expected.sort_unstable();
    let mut scratch = Scratch { movers: movers.clone(), ..Scratch::default() };
    let mut found = collisions.candidates(&mut scratch, ALLOWANCE).expect("candidates");
    found.iter_mut().for_each(|pair| pair.sort_unstable());
    found.sort_unstable();
    assert!(expected.len() > 600 && expected.len() < 10 * movers.len(), "{}", expected.len());
    assert!(found == expected, "{} candidates of {} movers, and not {}", found.len(), n, expected.len());
}

pub(crate) fn remove_table(collisions: &mut Collisions, model: &Model) {
    assert!(collisions.interactions.is_some());
    collisions.interactions = None;
    collisions.detector = finder_with(&model.boundary, None).expect("a detector");
}
