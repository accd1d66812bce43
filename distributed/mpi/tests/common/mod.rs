use std::path::Path;
use std::process::Command;

/// Runs the command with other arguments on each of two ranks, and returns what they print on standard error.
pub(crate) fn run_two_ranks(directory: &Path, arguments: [&[&str]; 2], code: i32) -> String {
    // Exit codes of ranks that Open MPI ends are unreliable.
    let rank = ["-n", "1", "sh", "-c", "\"$0\" \"$@\"; echo \"code $?\"", env!("CARGO_BIN_EXE_lazygrid-mpi")];
    let [one, other] = arguments;
    let output = Command::new("mpirun")
        .args(["--oversubscribe", "--timeout", "300"])
        .args([&rank[..], one, &[":"], &rank[..], other].concat())
        .current_dir(directory)
        .output()
        .unwrap();
    let [out, said] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
    assert_eq!(out.matches(&format!("code {code}\n")).count(), 2, "{arguments:?}: {out}{said}");
    said
}
