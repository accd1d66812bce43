//! Memory of large result arrays, for reuse: the system zeroes new memory page by page, which takes as long as the
//! search of a neighbor list.

use std::sync::{Mutex, PoisonError};

use bytemuck::Pod;
use lazygrid::Error;
use numpy::ndarray::{ArrayView, Dim, Dimension, IntoDimension};
use numpy::{Element, PyArray};
use pyo3::prelude::*;

use crate::error;

/// In 8-byte words: 512 MiB.
const MAX_POOLED_WORDS: usize = 1 << 26;
/// 256 KiB. The allocator is as fast for smaller blocks, of which the pool might have very many.
const MIN_POOLED_WORDS: usize = 1 << 15;

static POOL: Mutex<Vec<Vec<u64>>> = Mutex::new(Vec::new());

#[pyclass(frozen)]
struct ResultMemory(Vec<u64>);

impl Drop for ResultMemory {
    fn drop(&mut self) {
        if self.0.len() < MIN_POOLED_WORDS {
            return;
        }
        let mut pool = POOL.lock().unwrap_or_else(PoisonError::into_inner);
        let pooled: usize = pool.iter().map(Vec::len).sum();
        if pooled + self.0.len() <= MAX_POOLED_WORDS {
            pool.push(std::mem::take(&mut self.0));
        }
    }
}

/// Leaves contents arbitrary.
pub(crate) fn array<T: Element + Pod, const N: usize>(
    py: Python<'_>,
    shape: [usize; N],
) -> PyResult<Bound<'_, PyArray<T, Dim<[usize; N]>>>>
where
    [usize; N]: IntoDimension<Dim = Dim<[usize; N]>>,
    Dim<[usize; N]>: Dimension,
{
    const { assert!(size_of::<T>() == size_of::<u64>() && align_of::<T>() <= align_of::<u64>()) };
    let length: usize = shape.iter().product();
    let mut memory = memory(length)?;
    let values = memory.as_mut_ptr().cast::<T>();
    let owner = Bound::new(py, ResultMemory(memory))?;
    // SAFETY: `values` are at least as many words as the shape has values, of the same size and alignment, and any bits
    // are values of `T`. The owner keeps this memory until it is dropped, and neither changes nor moves it. No other
    // code reads or writes it, because the pool has given it away.
    Ok(unsafe {
        let view = ArrayView::from_shape_ptr(shape, values);
        PyArray::borrow_from_array(&view, owner.into_any())
    })
}

/// Returns at least `length` words: the smallest block of the pool that is at most twice as large, or new memory.
fn memory(length: usize) -> PyResult<Vec<u64>> {
    let mut pool = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    let fitting = (0..pool.len()).filter(|&at| (length..=2 * length).contains(&pool[at].len()));
    if let Some(at) = fitting.min_by_key(|&at| pool[at].len()) {
        return Ok(pool.swap_remove(at));
    }
    // Lists of a simulation vary in length from step to step.
    let words = length + length / 16;
    if pool.iter().map(Vec::len).sum::<usize>() + words > MAX_POOLED_WORDS {
        pool.clear();
    }
    drop(pool);
    bytemuck::allocation::try_zeroed_vec(words).map_err(|()| {
        let bytes = (words * size_of::<u64>()) as u64;
        error::engine(Error::OutOfMemory { what: "neighbor lists", bytes })
    })
}
