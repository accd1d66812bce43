//! Running the command, and reading what it wrote without the crate's own readers.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::ffi::OsStr;
use std::fs;
use std::process::{Command, Output, Stdio};

use serde_json::Value;
use tempfile::TempDir;

/// What a run of the command did.
pub struct Run {
    /// The exit code.
    pub code: Option<i32>,
    /// Standard output.
    pub out: String,
    /// Standard error.
    pub err: String,
}

/// Whether there is a GPU, or must be one; where there is none, a word on standard error why something is skipped.
pub fn has_gpu() -> bool {
    let has_one = !lazygrid::gpu::adapters().is_empty() || std::env::var_os("LAZYGRID_REQUIRE_GPU").is_some();
    if !has_one {
        #[expect(clippy::print_stderr, reason = "a skipped test says why")]
        {
            eprintln!("skipped: what needs a GPU, as there is no Vulkan, Metal or DirectX 12 here");
        }
    }
    has_one
}

/// A built command, by the path of its binary.
#[derive(Clone, Copy, Debug)]
pub struct Program(pub &'static str);

impl Program {
    fn command(self, args: impl IntoIterator<Item = impl AsRef<OsStr>>) -> Command {
        let mut command = Command::new(self.0);
        // Without a run-time directory some Vulkan layers complain on standard error.
        command
            .args(args)
            .env("XDG_RUNTIME_DIR", std::env::temp_dir())
            // Results say of which commit they are. A commit or an edit while tests run is no concern of theirs.
            .env("GIT_DIR", "none")
            .env_remove("RUST_LOG")
            .stdin(Stdio::null());
        command
    }

    /// Runs it with these arguments.
    pub fn run(self, args: impl IntoIterator<Item = impl AsRef<OsStr>>) -> Run {
        self.command(args).output().unwrap().into()
    }

    /// Runs it with these arguments and a cache directory of its own (on Linux).
    pub fn run_with_cache(self, cache: &str, args: &[&str]) -> Run {
        self.command(args).env("XDG_CACHE_HOME", cache).output().unwrap().into()
    }

    /// Runs it with a standard output that nobody reads.
    pub fn run_with_closed_output(self, args: impl IntoIterator<Item = impl AsRef<OsStr>>) -> Run {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let run = self.command(args).stdout(writer).stderr(Stdio::piped()).spawn().unwrap();
        run.wait_with_output().unwrap().into()
    }
}

impl From<Output> for Run {
    fn from(output: Output) -> Self {
        let [out, err] = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
        Self { code: output.status.code(), out, err }
    }
}

impl Run {
    /// Exit code 0.
    pub fn succeeds(self) -> Self {
        assert_eq!(self.code, Some(0), "{}", self.err);
        self
    }

    /// Fails as for bad input: one line on standard error, nothing of a panic.
    pub fn fails(self) -> Self {
        assert_eq!(self.code, Some(1), "{}", self.err);
        assert!(self.err.lines().last().is_some_and(|line| line.starts_with("error: ")), "{}", self.err);
        self
    }

    /// The one object that was printed.
    pub fn json(&self) -> Value {
        let mut objects = self.json_lines();
        assert_eq!(objects.len(), 1, "{}", self.out);
        objects.remove(0)
    }

    /// The objects that were printed, one on a line.
    pub fn json_lines(&self) -> Vec<Value> {
        self.out.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
    }
}

/// A file of `tests/data`.
pub fn data(name: &str) -> String {
    format!("{}/data/{name}", env!("CARGO_MANIFEST_DIR"))
}

/// A directory that goes away with the test.
pub struct Scratch(TempDir);

impl Scratch {
    /// An empty one.
    #[expect(clippy::new_without_default, reason = "a default that makes a directory would surprise")]
    pub fn new() -> Self {
        Self(TempDir::new().unwrap())
    }

    /// The path of a file in it.
    pub fn path(&self, name: &str) -> String {
        self.0.path().join(name).to_str().unwrap().to_owned()
    }

    /// Writes a file and returns its path.
    pub fn write(&self, name: &str, content: &str) -> String {
        let path = self.path(name);
        fs::write(&path, content).unwrap();
        path
    }

    /// The names of all files, temporary ones included.
    pub fn names(&self) -> Vec<String> {
        let entries = fs::read_dir(self.0.path()).unwrap();
        let mut names: Vec<_> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort_unstable();
        names
    }
}

/// The shape and the 32-bit words of a NumPy file, `N` in a row.
pub fn npy<const N: usize>(path: &str, kind: &str) -> (String, Vec<[u32; N]>) {
    let bytes = fs::read(path).unwrap();
    assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00");
    let end = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    assert!(end.is_multiple_of(64) && bytes[end - 1] == b'\n');
    let header = std::str::from_utf8(&bytes[10..end]).unwrap();
    let start = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ");
    let shape = header.strip_prefix(&start).unwrap().trim_end().strip_suffix(", }").unwrap();
    let words: Vec<_> =
        bytes[end..].chunks_exact(4).map(|b| u32::from_le_bytes(b.try_into().unwrap())).collect();
    let (rows, []) = words.as_chunks::<N>() else { panic!("{} words in rows of {N}", words.len()) };
    (shape.to_owned(), rows.to_vec())
}

/// The rows of a table `i,j`.
pub fn table(path: &str) -> Vec<[u32; 2]> {
    let text = fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("i,j"));
    let row = |line: &str| {
        let (i, j) = line.split_once(',').unwrap();
        [i.parse().unwrap(), j.parse().unwrap()]
    };
    lines.map(row).collect()
}
