//! Runs a command, and reads its output without the crate's own readers.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::ffi::OsStr;
use std::fs;
use std::process::{Command, Output, Stdio};

use serde_json::Value;
use tempfile::TempDir;

use crate::skip;

pub struct Run {
    pub code: Option<i32>,
    pub out: String,
    pub err: String,
}

pub fn has_gpu() -> bool {
    let has_one = !lazygrid::gpu::adapters().is_empty();
    if !has_one {
        skip(Some("LAZYGRID_REQUIRE_GPU"), "there is no GPU adapter with Vulkan, Metal or DirectX 12");
    }
    has_one
}

#[derive(Clone, Copy, Debug)]
pub struct Program(pub &'static str);

impl Program {
    pub(crate) fn command(self, args: impl IntoIterator<Item = impl AsRef<OsStr>>) -> Command {
        let mut command = Command::new(self.0);
        // Without `XDG_RUNTIME_DIR`, some Vulkan layers print warnings on standard error.
        command
            .args(args)
            .env("XDG_RUNTIME_DIR", std::env::temp_dir())
            // Results name their commit, which may change while tests run.
            .env("GIT_DIR", "none")
            .env_remove("RUST_LOG")
            .env_remove("LAZYGRID_LAMMPS_LIB")
            .stdin(Stdio::null());
        command
    }

    pub fn run(self, args: impl IntoIterator<Item = impl AsRef<OsStr>>) -> Run {
        self.command(args).output().unwrap().into()
    }

    pub fn run_with_cache(self, cache: &str, args: &[&str]) -> Run {
        self.run_with("XDG_CACHE_HOME", cache, args)
    }

    pub fn run_with(self, variable: &str, value: &str, args: &[&str]) -> Run {
        self.command(args).env(variable, value).output().unwrap().into()
    }

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
    pub fn succeeds(self) -> Self {
        assert_eq!(self.code, Some(0), "{}", self.err);
        self
    }

    pub fn fails(self) -> Self {
        assert_eq!(self.code, Some(1), "{}", self.err);
        assert!(self.err.lines().last().is_some_and(|line| line.starts_with("error: ")), "{}", self.err);
        self
    }

    pub fn json(&self) -> Value {
        let mut objects = self.json_lines();
        assert_eq!(objects.len(), 1, "{}", self.out);
        objects.remove(0)
    }

    pub fn json_lines(&self) -> Vec<Value> {
        self.out.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
    }
}

pub fn data(name: &str) -> String {
    format!("{}/data/{name}", env!("CARGO_MANIFEST_DIR"))
}

pub struct Scratch(TempDir);

impl Scratch {
    #[expect(clippy::new_without_default, reason = "a default that makes a directory would surprise")]
    pub fn new() -> Self {
        Self(TempDir::new().unwrap())
    }

    pub fn path(&self, name: &str) -> String {
        self.0.path().join(name).to_str().unwrap().to_owned()
    }

    pub fn write(&self, name: &str, content: &str) -> String {
        let path = self.path(name);
        fs::write(&path, content).unwrap();
        path
    }

    pub fn names(&self) -> Vec<String> {
        let entries = fs::read_dir(self.0.path()).unwrap();
        let mut names: Vec<_> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort_unstable();
        names
    }
}

/// Returns a NumPy file; `descr` and `shape` are as in Python.
pub fn npy_bytes(descr: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}\n");
    [b"\x93NUMPY\x01\x00", &(header.len() as u16).to_le_bytes()[..], header.as_bytes(), data].concat()
}

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
