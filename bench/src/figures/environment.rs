use std::process::Command;

use lazygrid::gpu;
use serde::{Deserialize, Serialize};

const LOCK: &str = include_str!("../../../Cargo.lock");

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Environment {
    pub cpu: String,
    pub cores: usize,
    /// 0 if unknown.
    pub memory_gib: f64,
    pub system: String,
    pub adapter: Option<Adapter>,
    pub versions: Vec<(String, String)>,
    /// Commit of the build, marked `with changes`, or `unknown`.
    pub commit: String,
    pub date: String,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Adapter {
    pub name: String,
    pub driver: String,
    pub api: String,
    pub is_hardware: bool,
}

impl Environment {
    pub fn here() -> Self {
        let file = |path: &str| std::fs::read_to_string(path).unwrap_or_default();
        let field = |text: &str, name: &str, by: char| {
            let line = text.lines().find(|line| line.starts_with(name))?;
            Some(line.split_once(by)?.1.trim().trim_matches('"').to_owned())
        };
        let unknown = || "unknown".to_owned();
        let memory = field(&file("/proc/meminfo"), "MemTotal", ':');
        let kib = memory.and_then(|text| text.split_whitespace().next()?.parse::<f64>().ok());
        let found = gpu::adapters().into_iter().next();
        Self {
            cpu: field(&file("/proc/cpuinfo"), "model name", ':').unwrap_or_else(unknown),
            cores: std::thread::available_parallelism().map_or(0, usize::from),
            memory_gib: kib.map_or(0.0, |kib| (kib / 1_048_576.0 * 10.0).round() / 10.0),
            system: field(&file("/etc/os-release"), "PRETTY_NAME", '=')
                .unwrap_or_else(|| std::env::consts::OS.to_owned()),
            adapter: found.map(|a| Adapter {
                name: a.name,
                driver: a.driver,
                api: a.api,
                is_hardware: a.is_hardware,
            }),
            versions: versions(),
            commit: crate::COMMIT.to_owned(),
            date: output("date", &["-u", "+%F %H:%M"]).unwrap_or_else(unknown),
        }
    }

    pub fn machine(&self) -> String {
        format!("{}, {} cores, {} GiB, {}", self.cpu, self.cores, self.memory_gib, self.system)
    }

    pub fn graphics(&self) -> String {
        match &self.adapter {
            None => "no GPU adapter".to_owned(),
            Some(a) => {
                let kind = if a.is_hardware { "hardware" } else { "software, runs on the CPU" };
                format!("{} ({kind}), {}, {}", a.name, a.driver, a.api)
            }
        }
    }
}

fn versions() -> Vec<(String, String)> {
    let mut versions = vec![("lazygrid".to_owned(), env!("CARGO_PKG_VERSION").to_owned())];
    for name in ["wgpu", "rayon", "parry3d"] {
        let entry = format!("name = \"{name}\"\nversion = \"");
        if let Some((version, _)) = LOCK.split_once(&entry).and_then(|(_, rest)| rest.split_once('"')) {
            versions.push((name.to_owned(), version.to_owned()));
        }
    }
    #[cfg(feature = "bullet")]
    versions.push(("Bullet".to_owned(), crate::peers::bullet::version()));
    #[cfg(not(feature = "bullet"))]
    versions.push(("Bullet".to_owned(), "not built in".to_owned()));
    versions
}

fn output(program: &str, args: &[&str]) -> Option<String> {
    let output = Command::new(program).args(args).output().ok().filter(|o| o.status.success())?;
    Some(String::from_utf8(output.stdout).ok()?.trim().to_owned())
}
