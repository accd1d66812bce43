use std::fs;
use std::path::{Path, PathBuf};

/// The available memory and its limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AvailableMemory {
    /// Bytes.
    pub bytes: u64,
    /// The strictest limit.
    pub limit: MemoryLimit,
}

/// A memory limit of a process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MemoryLimit {
    /// Free memory, swap included.
    System,
    /// Control group, as of a container or batch job.
    ControlGroup,
    /// Address space, `ulimit -v`.
    AddressSpace,
}

impl MemoryLimit {
    /// Returns the name for messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::System => "free memory of the system",
            Self::ControlGroup => "limit of the control group",
            Self::AddressSpace => "ulimit -v",
        }
    }
}

/// Returns the least memory that any limit leaves; `None` if unknown, as outside Linux.
pub fn available_memory() -> Option<AvailableMemory> {
    let system = system(&read("/proc/meminfo")).map(|bytes| (bytes, MemoryLimit::System));
    let address_space = available_address_space().map(|bytes| (bytes, MemoryLimit::AddressSpace));
    let group = control_group(&read("/proc/self/cgroup"), Path::new("/sys/fs/cgroup"));
    let group = group.map(|bytes| (bytes, MemoryLimit::ControlGroup));
    let all = [system, address_space, group].into_iter().flatten();
    all.min_by_key(|&(bytes, _)| bytes).map(|(bytes, limit)| AvailableMemory { bytes, limit })
}

/// Returns the available memory if it is less than `needed` bytes.
pub fn lacking_memory(needed: u64) -> Option<AvailableMemory> {
    available_memory().filter(|available| available.bytes < needed)
}

/// Returns the address space that is left if it is less than `needed` bytes. It alone limits mapped bytes
/// that are never written.
pub fn lacking_address_space(needed: u64) -> Option<AvailableMemory> {
    let bytes = available_address_space().filter(|bytes| *bytes < needed)?;
    Some(AvailableMemory { bytes, limit: MemoryLimit::AddressSpace })
}

fn available_address_space() -> Option<u64> {
    address_space(&read("/proc/self/limits"), &read("/proc/self/status"))
}

fn read(path: &str) -> String {
    fs::read_to_string(path).unwrap_or_default()
}

/// Maximum threads of llvmpipe.
const MAX_DRIVER_THREADS: u64 = 32;
/// Bytes that llvmpipe maps for a search or a simulation: 350 to 395 MiB with LLVM 15.
const DRIVER: u64 = 448 << 20;

/// Returns the bytes of a software driver's threads: stacks of 8 MiB, and code.
pub fn memory_of_driver_threads() -> u64 {
    let cores = std::thread::available_parallelism().map_or(1, |cores| cores.get() as u64);
    cores.min(MAX_DRIVER_THREADS) * (10 << 20)
}

/// Returns the bytes that a software driver maps without data. The driver ends the process if memory is
/// refused.
pub fn memory_of_driver() -> u64 {
    DRIVER + memory_of_driver_threads()
}

fn kilobytes(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(':'))?;
    Some(line.split_whitespace().next()?.parse::<u64>().ok()?.saturating_mul(1024))
}

fn system(meminfo: &str) -> Option<u64> {
    Some(kilobytes(meminfo, "MemAvailable")? + kilobytes(meminfo, "SwapFree").unwrap_or(0))
}

fn address_space(limits: &str, status: &str) -> Option<u64> {
    let line = limits.lines().find_map(|line| line.strip_prefix("Max address space"))?;
    let limit: u64 = line.split_whitespace().next()?.parse().ok()?;
    Some(limit.saturating_sub(kilobytes(status, "VmSize")?))
}

/// Covers groups of version 1 and 2 and their ancestors.
fn control_group(memberships: &str, root: &Path) -> Option<u64> {
    let of_line = |line: &str| {
        let (controllers, path) = line.split_once(':')?.1.split_once(':')?;
        let (root, names) = match controllers {
            "" => (root.to_owned(), ["memory.max", "memory.current"]),
            _ if controllers.split(',').any(|name| name == "memory") => {
                (root.join("memory"), ["memory.limit_in_bytes", "memory.usage_in_bytes"])
            }
            _ => return None,
        };
        let folder = root.join(path.trim_start_matches('/'));
        let folders = folder.ancestors().take_while(|folder| folder.starts_with(&root));
        folders.filter_map(|folder| left(folder, names)).min()
    };
    memberships.lines().filter_map(of_line).min()
}

/// Counts inactive file pages as free.
fn left(folder: &Path, [limit, used]: [&str; 2]) -> Option<u64> {
    let read = |name: &str| -> Option<String> { fs::read_to_string(PathBuf::from(folder).join(name)).ok() };
    let number = |name: &str| read(name)?.trim().parse::<u64>().ok();
    let statistics = read("memory.stat").unwrap_or_default();
    let files = statistics.lines().find_map(|line| line.strip_prefix("inactive_file ")?.parse().ok());
    let used = number(used)?.saturating_sub(files.unwrap_or(0));
    Some(number(limit)?.saturating_sub(used))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_read_as_linux_writes_them() {
        let meminfo = "MemTotal:       16000 kB\nMemAvailable:    8000 kB\nSwapFree:        1000 kB\n";
        assert_eq!(system(meminfo), Some(9000 << 10));
        assert_eq!(system(""), None);
        let status = "Name:\ta\nVmSize:\t    100 kB\n";
        let limits = "Limit  Soft Limit Hard Limit Units\nMax address space  1024000  unlimited  bytes\n";
        assert_eq!(address_space(limits, status), Some(1_024_000 - 102_400));
        assert_eq!(address_space("Max address space  unlimited  unlimited  bytes", status), None);
    }

    #[test]
    fn control_group_is_limited_by_the_groups_above_it() {
        let root = tempfile::tempdir().unwrap();
        let group = root.path().join("jobs/mine");
        fs::create_dir_all(&group).unwrap();
        let write = |folder: &Path, name: &str, text: &str| fs::write(folder.join(name), text).unwrap();
        write(&group, "memory.max", "max\n");
        write(&group, "memory.current", "500\n");
        assert_eq!(control_group("0::/jobs/mine\n", root.path()), None);
        let above = root.path().join("jobs");
        write(&above, "memory.max", "1000\n");
        write(&above, "memory.current", "700\n");
        write(&above, "memory.stat", "anon 100\ninactive_file 50\n");
        assert_eq!(control_group("0::/jobs/mine\n", root.path()), Some(350));
        let first = root.path().join("memory/job");
        fs::create_dir_all(&first).unwrap();
        write(&first, "memory.limit_in_bytes", "300\n");
        write(&first, "memory.usage_in_bytes", "100\n");
        assert_eq!(control_group("5:cpu,memory:/job\n0::/\n", root.path()), Some(200));
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn this_process_can_get_memory() {
        assert!(available_memory().unwrap().bytes > 1 << 20);
    }
}
