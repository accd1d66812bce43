use std::fmt::Debug;

use lazygrid::Error;
use lazygrid::gpu::GpuDevice;
use lazygrid_kernels::kernel::Variant;
use thiserror::Error;

pub(super) const SIZES: [usize; 7] = [0, 1, 255, 256, 257, 1023, 20_000];

#[derive(Clone, Debug, Error, PartialEq)]
pub enum KernelError {
    #[error("{0}")]
    WrongResult(String),
    #[error(transparent)]
    Device(#[from] Error),
}

pub(super) fn variants(gpu: &GpuDevice) -> impl Iterator<Item = Variant> {
    let smallest = gpu.adapter.has_subgroups.then_some(gpu.adapter.subgroup_sizes[0]);
    let subgroups = smallest.filter(|&size| size >= 4);
    let with = move |subgroups| Variant { subgroups, ..Variant::default() };
    [None, subgroups].into_iter().take(1 + usize::from(subgroups.is_some())).map(with)
}

pub(super) fn ordered(x: f32) -> u32 {
    if x.is_sign_negative() { !x.to_bits() } else { x.to_bits() | 1 << 31 }
}

pub(crate) fn same<T: PartialEq + Debug>(
    case: impl FnOnce() -> String,
    found: &T,
    expected: &T,
) -> Result<(), KernelError> {
    if found == expected {
        return Ok(());
    }
    Err(wrong(&case(), found, expected))
}

// Separate, so it is not compiled for each type.
fn wrong(case: &str, found: &dyn Debug, expected: &dyn Debug) -> KernelError {
    let short = |value: &dyn Debug| {
        let text = format!("{value:?}");
        match text.char_indices().nth(200) {
            Some((end, _)) => format!("{}…", &text[..end]),
            None => text,
        }
    };
    KernelError::WrongResult(format!("{case}: {} instead of {}", short(found), short(expected)))
}

/// Returns `value` after `change`, for structures that other crates cannot create field by field.
pub(crate) fn changed<T>(mut value: T, change: impl FnOnce(&mut T)) -> T {
    change(&mut value);
    value
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_differences_are_shortened() {
        assert_eq!(same(|| "one".to_owned(), &1, &1), Ok(()));
        let fault = same(|| "many".to_owned(), &vec![7; 1000], &vec![8; 1000]).expect_err("they differ");
        let text = fault.to_string();
        assert!(text.starts_with("many: [7, 7") && text.contains("instead of [8, 8") && text.len() < 500);
    }
}
