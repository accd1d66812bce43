use std::fs;

use lazygrid_tests::command::{Scratch, table};

use crate::{FRAME, LAZYGRID, SPHERES, detect};

#[test]
fn the_input_is_never_replaced() {
    let scratch = Scratch::new();
    let file = scratch.write("ok.csv", SPHERES);
    let numbered = scratch.write("pairs-1.csv", &FRAME.repeat(2));
    let listed = scratch.write("near.indices.npy", FRAME);
    let bonds = scratch.write("bonds.csv", "0,1\n");
    fs::hard_link(&file, scratch.path("hard.csv")).unwrap();
    let mut same = vec![
        (file.clone(), file.clone(), None),
        (file.clone(), scratch.path("./ok.csv"), None),
        (file.clone(), scratch.path("hard.csv"), None),
        (listed, scratch.path("near.npy"), Some(["--neighbors", "--format", "xyz"])),
        (file.clone(), bonds.clone(), Some(["--exclude", &bonds, "--backend=cpu"])),
    ];
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("ok.csv", scratch.path("soft.csv")).unwrap();
        same.push((file.clone(), scratch.path("soft.csv"), None));
        same.push((scratch.path("soft.csv"), file.clone(), None));
    }
    let before = scratch.names();
    for (input, output, more) in same {
        let more = more.into_iter().flatten();
        let run = LAZYGRID.run(["detect", &input, "-o", &output].into_iter().chain(more));
        assert_eq!(run.code, Some(2), "{input} {output}: {}", run.err);
        assert!(run.err.contains("this is the input") && run.out.is_empty(), "{}", run.err);
        assert_eq!(fs::read_to_string(&file).unwrap(), SPHERES);
    }
    assert_eq!(scratch.names(), before);
    assert_eq!(fs::read_to_string(&bonds).unwrap(), "0,1\n");
    let run = detect([&numbered, "--format", "xyz", "-o", &scratch.path("pairs-{frame}.csv")]);
    assert_eq!(run.code, Some(2), "{}", run.err);
    assert_eq!(fs::read_to_string(&numbered).unwrap(), FRAME.repeat(2));
    assert_eq!(table(&scratch.path("pairs-0.csv")), [[0, 1]]);
    let old = scratch.write("old.csv", "what was here before");
    detect([&file, "-o", &old]).succeeds();
    assert_eq!(table(&old), [[0, 1]]);
}

#[test]
fn closed_standard_output_loses_no_file() {
    let scratch = Scratch::new();
    let (file, frames) = (scratch.write("ok.csv", SPHERES), scratch.write("ok.xyz", &FRAME.repeat(2)));
    for (input, output, written) in
        [(&file, "pairs.csv", &["pairs.csv"][..]), (&frames, "p-{frame}.csv", &["p-0.csv", "p-1.csv"])]
    {
        let args = ["detect", "--backend", "cpu", input, "-o", &scratch.path(output)];
        let run = LAZYGRID.run_with_closed_output(args).succeeds();
        assert_eq!(run.err, "");
        for name in written {
            assert_eq!(table(&scratch.path(name)), [[0, 1]]);
        }
    }
}

#[cfg(target_os = "linux")]
#[test]
fn full_disk_of_one_list_leaves_the_lists_of_the_last_run() {
    let scratch = Scratch::new();
    let file = scratch.write("ok.csv", SPHERES);
    let offsets = scratch.write("near.offsets.npy", "of the last run");
    std::os::unix::fs::symlink("/dev/full", scratch.path("near.indices.npy")).unwrap();
    let run = detect([&file, "--neighbors", "-o", &scratch.path("near.npy")]);
    assert_eq!(run.code, Some(1), "{}", run.err);
    assert!(run.err.contains("near.indices.npy: cannot write: No space left on device"), "{}", run.err);
    assert_eq!(fs::read_to_string(&offsets).unwrap(), "of the last run");
    assert_eq!(scratch.names(), ["near.indices.npy", "near.offsets.npy", "ok.csv"]);
}

#[cfg(unix)]
#[test]
fn number_in_a_name_that_is_not_utf_8_is_refused() {
    use std::ffi::OsString;
    use std::os::unix::ffi::OsStringExt;

    let scratch = Scratch::new();
    let file = scratch.write("two.xyz", &FRAME.repeat(2));
    let named = |name: &[u8]| {
        let output = OsString::from_vec([scratch.path("").as_bytes(), name].concat());
        let args = ["detect", "--backend", "cpu", &file, "--frame", "0", "-o"].map(OsString::from);
        LAZYGRID.run(args.into_iter().chain([output]))
    };
    let run = named(b"\xFF-{frame}.csv");
    assert!(run.code == Some(2) && run.err.contains("not UTF-8"), "{}", run.err);
    assert_eq!(scratch.names(), ["two.xyz"]);
    named(b"\xFF.csv").succeeds();
}

#[cfg(target_os = "linux")]
mod stopped {
    use std::os::unix::process::ExitStatusExt;
    use std::process::Stdio;

    use lazygrid_tests::running::Running;

    use super::*;

    /// Starts a command that waits for more frames, and has begun to write its output.
    fn begun(scratch: &Scratch) -> Running {
        let before = scratch.names();
        let output = scratch.path("pairs.csv");
        let args = ["detect", "/dev/stdin", "--format", "xyz", "--backend", "cpu", "-o", &output];
        let mut running = LAZYGRID.start(args, Stdio::piped(), Stdio::null());
        running.write(FRAME.as_bytes());
        running.wait_until(|| scratch.names().iter().any(|name| !before.contains(name)))
    }

    #[test]
    fn a_signal_leaves_nothing_behind() {
        for (signal, number) in [("-INT", 2), ("-TERM", 15)] {
            let scratch = Scratch::new();
            // A closed standard input would complete the file.
            let ended = begun(&scratch).end(signal);
            assert_eq!(String::from_utf8(ended.stderr).unwrap(), "");
            assert_eq!(ended.status.signal(), Some(number), "{}", ended.status);
            assert_eq!(scratch.names(), [""; 0]);
        }
    }

    #[test]
    fn files_of_a_killed_run_are_removed_at_the_next_use_of_the_directory() {
        let scratch = Scratch::new();
        let file = scratch.write("ok.csv", SPHERES);
        let foreign = scratch.write(".lazygrid-notes.part", "mine");
        let killed = begun(&scratch);
        let live = begun(&scratch);
        killed.end("-KILL");
        assert_eq!(scratch.names().len(), 4);

        detect([&file, "-o", &scratch.path("other.csv")]).succeeds();
        assert_eq!(scratch.names().len(), 4, "{:?}", scratch.names());
        assert!(live.finish().status.success());
        assert_eq!(table(&scratch.path("pairs.csv")), [[0, 1]]);
        assert_eq!(scratch.names(), [".lazygrid-notes.part", "ok.csv", "other.csv", "pairs.csv"]);
        assert_eq!(fs::read_to_string(foreign).unwrap(), "mine");
    }
}
