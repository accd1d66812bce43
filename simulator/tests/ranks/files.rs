use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::Path;

use lazygrid::{Algorithm, Backend, Config};
use lazygrid_sim::run::checkpoint::Checkpoint;
use lazygrid_sim::run::{Run, RunEnd};
use lazygrid_sim::scenario::Scenario;

use crate::{on_cpu, threads};

const SCENARIO: &str = r#"
time-step = 0.01
steps = 40
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

[[species]]
name = "ab"
radius = 0.3
diffusion = 1

[[reaction]]
equation = "a + b -> ab"
binding-radius = 1.0
probability = 0.3

[[decay]]
equation = "ab -> a + b"
rate = 5
unbinding-radius = 0.6

[[transmitter]]
name = "source"
center = [4, 4, 4]
times = [0, 0.2]
shape = { kind = "ball", radius = 2 }
release = [{ species = "a", count = 200 }, { species = "b", count = 200 }]

[[receiver]]
name = "sink"
center = [6, 4, 4]
radius = 1
kind = "absorbing"
species = ["a"]

[[receiver]]
name = "cell"
center = [2, 4, 4]
radius = 1
kind = "receptors"
count = 20
binding-rate = 100
unbinding-rate = 2

[output]
every = 3
frames-every = 10
frames = ["xyz", "npy"]
arrivals = true
"#;

pub(crate) fn run(directory: &Path, steps: u32, resume: bool) -> Run {
    run_of(SCENARIO, directory, steps, resume)
}

pub(crate) fn run_of(text: &str, directory: &Path, steps: u32, resume: bool) -> Run {
    let path = directory.join("scenario.toml");
    let mut scenario = Scenario::parse(&path, text.to_owned()).unwrap();
    scenario.steps = steps;
    scenario.output.animation =
        Some(lazygrid_sim::animation::Animation { every: 5, particles: 100.try_into().unwrap() });
    Run { backend: Backend::Auto, resume, ..Run::new(scenario, path, directory) }
}

pub(crate) fn go(run: &Run, ranks: u32) {
    go_on(&on_cpu(), run, ranks);
}

pub(crate) fn go_on(detector: &Config, run: &Run, ranks: u32) {
    if ranks == 0 {
        assert_eq!(run.run(|_| ControlFlow::Continue(())).unwrap().0, RunEnd::Finished);
        return;
    }
    for end in threads::on(ranks, |thread| {
        run.run_distributed(thread, detector.clone(), |_| ControlFlow::Continue(())).map(|(end, _)| end)
    }) {
        assert_eq!(end, Ok(RunEnd::Finished));
    }
}

pub(crate) fn every_file(directory: &Path) -> BTreeMap<String, Vec<u8>> {
    let files = std::fs::read_dir(directory).unwrap().map(|entry| entry.unwrap());
    files
        .map(|entry| (entry.file_name().into_string().unwrap(), std::fs::read(entry.path()).unwrap()))
        .collect()
}

pub(crate) fn is_checkpoint(name: &str) -> bool {
    name.starts_with("checkpoint")
}

pub(crate) fn files(directory: &Path) -> BTreeMap<String, Vec<u8>> {
    every_file(directory).into_iter().filter(|(name, _)| !is_checkpoint(name)).collect()
}

pub(crate) fn state(directory: &Path) -> lazygrid_sim::State {
    let path = directory.join("checkpoint");
    let mut state = Checkpoint::read(&path).unwrap().into_state(&path).unwrap();
    state.particles = state.particles.permuted(&state.particles.by_id());
    state.bound.sort_unstable_by_key(|bound| bound.id);
    state
}

fn names(directory: &Path) -> Vec<String> {
    every_file(directory).into_keys().filter(|name| is_checkpoint(name)).collect()
}

fn compare(text: &str, steps: u32, numbers: &[u32]) -> BTreeMap<String, Vec<u8>> {
    let alone = tempfile::tempdir().unwrap();
    go(&run_of(text, alone.path(), steps, false), 0);
    let expected = files(alone.path());
    for &ranks in numbers {
        let over = tempfile::tempdir().unwrap();
        go(&run_of(text, over.path(), steps, false), ranks);
        let found = files(over.path());
        assert!(expected.keys().eq(found.keys()), "{:?}", found.keys());
        for (name, expected) in &expected {
            assert!(found[name] == *expected, "{name} on {ranks} ranks");
        }
        assert_eq!(state(over.path()), state(alone.path()));
        assert_eq!(names(over.path()).len(), 1 + ranks as usize);
    }
    expected
}

#[test]
fn files_equal_one_process() {
    let files = compare(SCENARIO, 40, &[1, 2, 3, 8]);
    assert!(
        ["series.csv", "frames.xyz", "frame-000000040.npy", "arrivals.csv", "releases.csv"]
            .iter()
            .all(|name| files[*name].len() > 100),
        "{:?}",
        files.keys()
    );
}

/// The others are compared under MPI (`distributed/mpi/tests/simulate.rs`).
#[test]
fn shipped_scenarios_equal_one_process() {
    let scenarios = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios");
    for (name, steps) in [("chemotaxis", 60), ("distances", 100), ("wall", 120)] {
        let text = std::fs::read_to_string(scenarios.join(name).with_extension("toml")).unwrap();
        // A sweep varies the scenario before its section.
        let text = text.split("[sweep]").next().unwrap();
        let files = compare(text, steps, &[2, 3]);
        let series = std::str::from_utf8(&files["series.csv"]).unwrap();
        let [first, last] = [series.lines().nth(1), series.lines().last()];
        let counts =
            |row: Option<&str>| row.unwrap().split(',').skip(2).map(str::to_owned).collect::<Vec<_>>();
        assert!(name == "chemotaxis" || counts(first) != counts(last), "{name}: {series}");
    }
}

#[test]
fn any_number_of_ranks_continues_a_run() {
    let alone = tempfile::tempdir().unwrap();
    go(&run(alone.path(), 40, false), 0);
    for numbers in [[3, 2, 0], [0, 3, 8]] {
        let directory = tempfile::tempdir().unwrap();
        for (k, (ranks, steps)) in numbers.into_iter().zip([13, 27, 40]).enumerate() {
            go(&run(directory.path(), steps, k > 0), ranks);
            let parts = (0..ranks).map(|rank| format!("checkpoint.{steps:09}.{rank}"));
            let expected: Vec<_> = ["checkpoint".to_owned()].into_iter().chain(parts).collect();
            assert_eq!(names(directory.path()), expected);
        }
        assert!(files(directory.path()) == files(alone.path()), "{numbers:?}");
        assert_eq!(state(directory.path()), state(alone.path()));
    }
}

#[test]
fn resume_with_another_flow_field_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("flow.npy");
    let write = |v: f32| {
        let mut bytes = b"\x93NUMPY\x01\x00\x3e\x00".to_vec();
        bytes.extend(b"{'descr': '<f4', 'fortran_order': False, 'shape': (1,1,1,3)}  ");
        (0..3).for_each(|_| bytes.extend(v.to_le_bytes()));
        std::fs::write(&path, bytes).unwrap();
    };
    let field = "[flow]\nprofile = 'field'\nfile = 'flow.npy'\nspacing = [1, 1, 1]\n\n[output]";
    let run = |steps| {
        let mut run = run(directory.path(), steps, steps > 10);
        run.scenario =
            Scenario::parse(&run.path, SCENARIO.replace("[output]", field)).unwrap_or_else(|e| panic!("{e}"));
        run.scenario.steps = steps;
        run
    };
    write(2.0);
    go(&run(10), 2);
    write(3.0);
    let alone = run(20).run(|_| ControlFlow::Continue(())).map(|(end, _)| end).unwrap_err().to_string();
    let all = threads::on(2, |thread| {
        let end = run(20).run_distributed(thread, on_cpu(), |_| ControlFlow::Continue(()));
        end.map(|(end, _)| end).unwrap_err().to_string()
    });
    for error in all.into_iter().chain([alone]) {
        assert!(
            error.contains("checkpoint: the flow field has the checksum ") && error.contains("'flow.file'"),
            "{error}"
        );
    }
    write(2.0);
    go(&run(20), 2);
}

#[test]
fn one_rank_stops_all_and_the_run_can_continue() {
    let directory = tempfile::tempdir().unwrap();
    let first = run(directory.path(), 40, false);
    let ends = threads::on(3, |thread| {
        let rank = lazygrid_ranks::Communicator::rank(&thread);
        let ask =
            |step| if rank == 1 && step == 17 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
        first.run_distributed(thread, on_cpu(), ask).map(|(end, simulation)| (end, simulation.step_count()))
    });
    assert_eq!(ends, vec![Ok((RunEnd::Stopped, 17)); 3]);
    assert_eq!(state(directory.path()).step, 17);
}

#[test]
fn complete_run_is_finished_even_if_asked_to_stop() {
    let directory = tempfile::tempdir().unwrap();
    go(&run(directory.path(), 10, false), 2);
    let resumed = run(directory.path(), 10, true);
    let ends = threads::on(2, |thread| {
        resumed.run_distributed(thread, on_cpu(), |_| ControlFlow::Break(())).map(|(end, _)| end)
    });
    assert_eq!(ends, vec![Ok(RunEnd::Finished); 2]);
    assert_eq!(resumed.run(|_| ControlFlow::Break(())).unwrap().0, RunEnd::Finished);
}

#[test]
fn lost_part_is_named_and_run_is_not_replaced() {
    let directory = tempfile::tempdir().unwrap();
    go(&run(directory.path(), 10, false), 2);
    std::fs::remove_file(directory.path().join("checkpoint.000000010.1")).unwrap();
    let resumed = run(directory.path(), 20, true);
    let ends = threads::on(3, |thread| {
        resumed.run_distributed(thread, on_cpu(), |_| ControlFlow::Continue(())).map(|(end, _)| end)
    });
    let messages: Vec<_> = ends.into_iter().map(Result::unwrap_err).collect();
    assert_eq!(messages, vec![messages[0].clone(); 3]);
    assert!(messages[0].contains("checkpoint.000000010.1: cannot read"), "{}", messages[0]);
    let run = run(directory.path(), 20, false);
    let ends = threads::on(2, |thread| {
        run.run_distributed(thread, on_cpu(), |_| ControlFlow::Continue(())).map(|(end, _)| end)
    });
    assert!(ends.iter().all(|end| end.as_ref().unwrap_err().contains("it holds a run already")), "{ends:?}");
}

#[test]
fn a_run_that_differs_on_one_rank_is_refused_by_the_name_of_the_setting() {
    let directory = tempfile::tempdir().unwrap();
    let base = || run(directory.path(), 20, false);
    let refused = |name: &str, odd: Run| {
        let base = base();
        let ends = threads::on(3, |thread| {
            let run = if lazygrid_ranks::Communicator::rank(&thread) == 2 { &odd } else { &base };
            run.run_distributed(thread, on_cpu(), |_| ControlFlow::Continue(())).map(|(end, _)| end)
        });
        let messages: Vec<_> = ends.into_iter().map(Result::unwrap_err).collect();
        assert_eq!(messages, vec![messages[0].clone(); 3]);
        let expected = format!("rank 0: the setting `{name}` is ");
        assert!(
            messages[0].starts_with(&expected) && messages[0].contains(" on rank 2; 1 of 3 ranks "),
            "{}",
            messages[0]
        );
    };
    let with = |change: fn(&mut Scenario)| {
        let mut run = base();
        change(&mut run.scenario);
        run
    };
    refused("resume", Run { resume: true, ..base() });
    refused("steps", with(|scenario| scenario.steps = 21));
    refused("output", with(|scenario| scenario.output.every = 4));
    refused("output", with(|scenario| scenario.output.animation = None));
    refused("directory", Run { directory: directory.path().join("elsewhere"), ..base() });
    refused("seed", with(|scenario| scenario.seed = 8));
    refused("model", with(|scenario| scenario.model.reactions[0].binding_radius = 1.0_f32.next_up()));
    let differing = Run { algorithm: Algorithm::RecursiveGrid, ..base() };
    let ends = threads::on(3, |thread| {
        let run = if lazygrid_ranks::Communicator::rank(&thread) == 2 { differing.clone() } else { base() };
        run.run_distributed(thread, on_cpu(), |_| ControlFlow::Continue(())).map(|(end, _)| end)
    });
    assert_eq!(ends, vec![Ok(RunEnd::Finished); 3]);
}
