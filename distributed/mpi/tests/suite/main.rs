//! Properties for any number of ranks, run by `test.sh`; without it on one rank.

#![allow(clippy::unwrap_used, reason = "tests")]
#![allow(clippy::print_stdout, reason = "a test program, of which rank 0 says what it did")]

mod answers;
mod disagreements;
mod doubles;
mod failures;
mod rebalancing;
mod scale;
mod scenes;
mod sequences;

use mpi::topology::SimpleCommunicator;
use mpi::traits::{Communicator, CommunicatorCollectives};

type Case = (&'static str, fn(&SimpleCommunicator));

const CASES: &[Case] = &[
    ("answers: every scene, size and placement", answers::every_scene),
    ("answers: species and interactions", answers::interactions),
    ("answers: each pair with both owners", answers::both_owners),
    ("answers: streams and counts", answers::streams),
    ("answers: spheres in f64", doubles::answers),
    ("answers: f32 spheres in boxes of other lengths", doubles::f32_in_other_boxes),
    ("answers: f32 spheres across other boundaries", doubles::f32_across_other_boundaries),
    ("answers: messages in rounds", answers::rounds),
    ("answers: bytes that few ranks or none have", answers::bytes_of_few_ranks),
    ("rebalancing: data moves with its spheres", rebalancing::moves_data),
    ("rebalancing: a balanced partition is reused", rebalancing::reuses_partition),
    ("failures: one bad sphere", failures::bad_sphere),
    ("failures: ids that two spheres have", failures::duplicate_ids),
    ("failures: lengths, species and limits", failures::refusals),
    ("failures: spheres in f64 and f32", doubles::both_types),
    ("failures: pairs of owners above the limit", failures::pairs_of_owners_above_the_limit),
    ("disagreements: settings of one rank", disagreements::settings),
    ("disagreements: settings that each rank has for itself", disagreements::own_settings),
    ("disagreements: a table of the detector", disagreements::detectors_own_table),
    ("disagreements: what one rank cannot do", disagreements::failures_of_one),
    ("sequences: changes and failures between calls", sequences::random_calls),
    ("scale: a million spheres", scale::million),
    ("scale: all at one point", scale::one_point),
];

fn main() {
    let Some((universe, _)) = mpi::initialize_with_threading(mpi::Threading::Funneled) else {
        println!("MPI is running already");
        std::process::exit(1);
    };
    lazygrid_mpi::abort_on_panic();
    let world = universe.world();
    if std::env::var_os("LAZYGRID_TEST_MPI_PANIC").is_some() {
        failures::panic(&world);
    }
    let wanted: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with('-')).collect();
    let mut passed = 0;
    for (name, case) in CASES {
        if wanted.is_empty() || wanted.iter().any(|pattern| name.contains(pattern.as_str())) {
            case(&world);
            world.barrier();
            passed += 1;
            if world.rank() == 0 {
                println!("on {} ranks: {name} ... ok", world.size());
            }
        }
    }
    if world.rank() == 0 {
        println!("{passed} passed, 0 failed");
    }
}
