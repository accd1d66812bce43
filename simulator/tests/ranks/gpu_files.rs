use std::ops::ControlFlow;

use lazygrid::{Backend, Config};
use lazygrid_ranks::Communicator;
use lazygrid_sim::run::checkpoint::Checkpoint;
use lazygrid_sim::run::{Run, RunEnd};

use crate::files::{files, go, go_on, run_of, state};
use crate::gpus::{device, on_gpu};
use crate::threads;

const SCENARIO: &str = r#"
time-step = 0.01
steps = 90
seed = 7

[boundary]
kind = "periodic"
low = [0, 0, 0]
high = [8, 8, 8]

[[species]]
name = "a"
radius = 0.1
diffusion = 4

[[species]]
name = "b"
radius = 0.2
diffusion = 2

[[decay]]
equation = "a -> b"
rate = 2

[[decay]]
equation = "b ->"
rate = 1

[[transmitter]]
name = "source"
center = [4, 4, 4]
times = [0, 0.2, 0.75]
shape = { kind = "ball", radius = 2 }
release = [{ species = "a", count = 200 }, { species = "b", count = 101 }]

[[transmitter]]
name = "spring"
center = [3, 4, 5]
release = [{ species = "a", rate = 300 }]

[[receiver]]
name = "sink"
center = [6, 4, 4]
radius = 1
kind = "absorbing"
species = ["a"]

[[receiver]]
name = "window"
center = [2, 4, 4]
radius = 1.5
kind = "transparent"

[output]
every = 15
frames-every = 30
frames = ["xyz", "npy"]
arrivals = true
"#;

#[test]
fn files_of_ranks_on_gpus_equal_one_gpu() {
    compare_files(SCENARIO);
}

#[test]
fn files_of_ranks_with_dissociations_on_gpus_equal_one_gpu() {
    compare_files(&SCENARIO.replace("\"b ->\"", "\"b -> a + b\"\nunbinding-radius = 0.3"));
}

fn compare_files(text: &str) {
    if device().is_none() {
        return;
    }
    let run = |directory: &tempfile::TempDir, steps, resume| {
        let run = run_of(text, directory.path(), steps, resume);
        Run { backend: Backend::Gpu, ..run }
    };
    let alone = tempfile::tempdir().unwrap();
    go(&run(&alone, 90, false), 0);
    let expected = files(alone.path());
    assert!(expected["arrivals.csv"].len() > 1000, "{:?}", expected.keys());
    // Numbers of ranks up to steps 37, 64 and 90; 0 is one process.
    for numbers in [[1, 1, 1], [2, 3, 0], [0, 3, 2]] {
        let over = tempfile::tempdir().unwrap();
        for (k, (ranks, steps)) in numbers.into_iter().zip([37, 64, 90]).enumerate() {
            go_on(&on_gpu(), &run(&over, steps, k > 0), ranks);
            let checkpoint = Checkpoint::read(&over.path().join("checkpoint")).unwrap();
            assert_eq!((checkpoint.backend.as_str(), checkpoint.state.step), (Backend::Gpu.name(), steps));
        }
        let found = files(over.path());
        assert!(expected.keys().eq(found.keys()), "{:?}", found.keys());
        for (name, expected) in &expected {
            assert!(found[name] == *expected, "{name} on {numbers:?} ranks");
        }
        assert_eq!(state(over.path()), state(alone.path()));
    }
}

#[test]
fn a_run_changes_between_gpus_and_cpus_of_ranks() {
    if device().is_none() {
        return;
    }
    let mut runs = [0, 3].map(|ranks| {
        let directory = tempfile::tempdir().unwrap();
        let segments = [(30, Backend::Gpu), (60, Backend::Cpu), (90, Backend::Gpu)];
        for (k, (steps, backend)) in segments.into_iter().enumerate() {
            let run = run_of(SCENARIO, directory.path(), steps, k > 0);
            let run = Run { backend, ..run };
            go_on(&Config::default().backend(backend), &run, ranks.min(2 + k as u32));
        }
        (files(directory.path()), state(directory.path()))
    });
    let [alone, over] = &mut runs;
    assert!(alone == over);
    assert!(alone.1.totals.arrived[0][0] > 100, "{:?}", alone.1.totals);
}

#[test]
fn one_rank_stops_all_gpus_and_the_run_can_continue() {
    if device().is_none() {
        return;
    }
    let directory = tempfile::tempdir().unwrap();
    let first = run_of(SCENARIO, directory.path(), 90, false);
    let ends = threads::on(3, |thread| {
        let rank = thread.rank();
        let ask =
            |step| if rank == 1 && step >= 17 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
        first.run_distributed(thread, on_gpu(), ask).map(|(end, simulation)| (end, simulation.step_count()))
    });
    // Batches end at outputs, which are multiples of 5 here.
    assert_eq!(ends, vec![Ok((RunEnd::Stopped, 20)); 3]);
    assert_eq!(state(directory.path()).step, 20);
    go_on(&on_gpu(), &run_of(SCENARIO, directory.path(), 90, true), 2);
    assert_eq!(state(directory.path()).step, 90);
}
