//! Radix sort and prefix scan where one dimension of a dispatch does not hold all workgroups; `gpu_kernels` has the others.

mod common;

use common::{device, limited};
use lazygrid::gpu::wgpu::Limits;
use lazygrid_check::primitives;

/// Workgroups along one dimension: as few as a pass of the sort has digits, which no device is short of.
const ROW: u32 = 256;
/// More tiles than a row holds, and in the last row fewer than in the others.
const MANY: usize = 1_100_001;

#[test]
fn more_than_one_dimension_of_groups() {
    let Some(own) = device() else { return };
    let own = limited(&own, |limits| Limits { max_compute_workgroups_per_dimension: ROW, ..limits });
    primitives::scan(&own, MANY).unwrap_or_else(|fault| panic!("scan: {fault}"));
    primitives::sort(&own, MANY).unwrap_or_else(|fault| panic!("sort: {fault}"));
}
