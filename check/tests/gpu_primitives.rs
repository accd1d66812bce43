//! Radix sort and prefix scan of more than one dimension of a dispatch holds; `gpu_kernels` has the smaller ones.

mod common;

use common::device;
use lazygrid_check::primitives::{self, LARGE};

#[test]
fn more_than_one_dimension_of_groups() {
    let Some(own) = device() else { return };
    primitives::scan(&own, LARGE).unwrap_or_else(|fault| panic!("scan: {fault}"));
    primitives::sort(&own, LARGE).unwrap_or_else(|fault| panic!("sort: {fault}"));
}
