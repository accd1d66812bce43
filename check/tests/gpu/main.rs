//! All tests share a device, so that each kernel is compiled once.

#[path = "../common/mod.rs"]
mod common;

mod columns;
mod detector;
mod fast_math;
mod kernels;
mod levels;
mod periodic;
mod primitives;
mod scale;
mod session;
mod skin;
mod threads;
