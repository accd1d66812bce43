use lazygrid_tests::command::data;

use crate::{LAZYGRID, lazygrid};

#[test]
fn wrong_usage_has_its_own_exit_code() {
    let pour = data("lammps-pour.dump");
    for (args, message) in [
        (&[][..], "Usage: lazygrid <COMMAND>"),
        (&["detect"], "<FILE>"),
        (&["invent"], "unrecognized subcommand 'invent'"),
        (&["detect", &pour, "--format", "pdb"], "invalid value 'pdb' for '--format"),
        (&["detect", &pour, "--radius", "acid"], "expected SPECIES=R"),
        (&["detect", &pour, "--radius", "acid=-1"], "the radius '-1' must be"),
        (&["detect", &pour, "--radius", "acid=inf"], "the radius 'inf' must be"),
        (&["detect", &pour, "--algorithm", "magic"], "invalid value 'magic' for '--algorithm"),
        (&["detect", &pour, "--backend", "cpu", "--algorithm", "lazy-grid"], "not run on the cpu backend"),
        (&["detect", &pour, "--cell-ratio", "99"], "expected a number from 0.5 to 16"),
        (&["detect", &pour, "--threads", "0"], "expected a whole number above zero"),
        (&["detect", &pour, "--tau", "many"], "invalid value 'many' for '--tau"),
        (&["detect", &pour, "--output", "pairs.txt"], "pairs.txt: unknown output format"),
        (&["detect", &pour, "--count", "--output", "pairs.csv"], "'--count' cannot be used with '--output"),
        (&["detect", &pour, "--count", "--neighbors"], "'--count' cannot be used with '--neighbors'"),
        (&["detect", &pour, "--unordered", "--neighbors"], "'--unordered' cannot be used with '--neighbors'"),
        (&["generate", "equal", "--output", "a.npy"], "--spheres <N>"),
        (&["generate", "equal", "-n", "5", "--output", "a.dump"], "'a.dump' does not end in .npy"),
        (&["generate", "equal", "-n", "4294967295", "--output", "a.npy"], "not in 0..=4294967294"),
        (&["generate", "cube", "-n", "5", "--output", "a.npy"], "invalid value 'cube' for '<SCENE>'"),
        (&["completions", "basic"], "invalid value 'basic' for '<SHELL>'"),
        (&["check", "--backend", "cpu", "--adapter", "0"], "adapter '0' and the cpu backend exclude"),
        (&["check", "--quick", "--full"], "'--quick' cannot be used with '--full'"),
        (&["check", "--seed", "1", "--fuzz", "1"], "'--seed <S>' cannot be used with '--fuzz"),
        (&["check", "--fuzz", "0"], "expected a number of seconds above zero"),
        (&["check", "--backend", "auto"], "invalid value 'auto' for '--backend"),
    ] {
        let run = lazygrid(args);
        assert_eq!(run.code, Some(2), "{args:?}: {}", run.err);
        assert!(run.err.contains(message) && run.out.is_empty(), "{args:?}: {}", run.err);
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
