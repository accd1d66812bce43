use lazygrid_tests::command::data;

use crate::{LAZYGRID, lazygrid};

#[test]
fn wrong_usage_has_its_own_exit_code() {
    let pour = data("lammps-pour.dump");
    for args in [
        &[][..],
        &["detect"],
        &["invent"],
        &["detect", &pour, "--format", "pdb"],
        &["detect", &pour, "--radius", "acid"],
        &["detect", &pour, "--radius", "acid=-1"],
        &["detect", &pour, "--radius", "acid=inf"],
        &["detect", &pour, "--algorithm", "magic"],
        &["detect", &pour, "--backend", "cpu", "--algorithm", "lazy-grid"],
        &["detect", &pour, "--cell-ratio", "99"],
        &["detect", &pour, "--threads", "0"],
        &["detect", &pour, "--tau", "many"],
        &["detect", &pour, "--output", "pairs.txt"],
        &["detect", &pour, "--count", "--output", "pairs.csv"],
        &["detect", &pour, "--count", "--neighbors"],
        &["detect", &pour, "--unordered", "--neighbors"],
        &["generate", "equal", "--output", "a.npy"],
        &["generate", "equal", "-n", "5", "--output", "a.dump"],
        &["generate", "equal", "-n", "4294967295", "--output", "a.npy"],
        &["generate", "cube", "-n", "5", "--output", "a.npy"],
        &["completions", "basic"],
    ] {
        let run = lazygrid(args);
        assert_eq!(run.code, Some(2), "{args:?}: {}", run.err);
        assert!(!run.err.is_empty() && run.out.is_empty(), "{args:?}");
    }
}

#[test]
fn help_completions_and_devices() {
    for command in [
        &["--help"][..],
        &["detect", "--help"],
        &["generate", "--help"],
        &["devices", "--help"],
        &["calibrate", "--help"],
    ] {
        assert!(lazygrid(command).succeeds().out.contains("Usage: lazygrid"));
    }
    assert!(lazygrid(["detect", "--help"]).succeeds().out.contains("lazygrid detect pour.dump"));
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        assert!(lazygrid(["completions", shell]).succeeds().out.contains("cell-ratio"), "{shell}");
    }
    let devices = lazygrid(["devices"]).succeeds().out;
    assert!(devices.starts_with("cpu  ") && devices.contains("\ngpu  "), "{devices}");
    for adapter in lazygrid::gpu::adapters() {
        let limit = format!("{} MiB per storage binding", adapter.storage_binding >> 20);
        assert!(devices.contains(&adapter.name) && devices.contains(&limit), "{devices}");
    }
}

#[test]
fn a_reader_that_goes_away_is_no_failure() {
    let run = LAZYGRID.run_with_closed_output(["completions", "zsh"]);
    assert_eq!((run.code, run.err.as_str()), (Some(0), ""));
}
