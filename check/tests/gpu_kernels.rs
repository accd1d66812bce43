//! The kernels one by one against plain sequential functions, as `lazygrid check` does it.

mod common;

use common::device;
use lazygrid_check::Extent;
use lazygrid_check::kernels::CHECKS;

#[test]
fn every_kernel_agrees_with_a_sequential_function() {
    let Some(own) = device() else { return };
    let faults: Vec<String> = CHECKS
        .iter()
        .filter_map(|check| {
            (check.run)(&own, Extent::Usual).err().map(|fault| format!("{}: {fault}", check.name))
        })
        .collect();
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}
