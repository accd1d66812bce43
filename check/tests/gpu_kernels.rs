//! The kernels one by one against plain sequential functions, as `lazygrid check` does it.

mod common;

use common::device;
use lazygrid_check::Extent;
use lazygrid_check::kernels::CHECKS;

#[test]
fn every_kernel_agrees_with_a_sequential_function() {
    let Some(own) = device() else { return };
    for check in CHECKS {
        (check.run)(&own, Extent::Usual).unwrap_or_else(|fault| panic!("{}: {fault}", check.name));
    }
}
