use bytemuck::Zeroable;
use bytemuck::allocation::try_zeroed_vec;

use crate::Error;
use crate::contact::Rule;
use crate::simd::MAX_LANES;

/// Spheres as columns, in the order a detector wants them, padded so that a whole vector can be loaded at any of
/// them.
///
/// Invariant: every column has `len + MAX_LANES` values; only [`Columns::resize`] changes lengths.
#[derive(Debug, Default)]
pub(crate) struct Columns {
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
    r: Vec<f32>,
    id: Vec<u32>,
    len: usize,
}

/// The columns to be written: `x`, `y`, `z`, the effective radius (the radius itself where no interaction distances
/// are set) and the index in the input.
pub(crate) struct ColumnsMut<'c> {
    pub(crate) xyzr: [&'c mut [f32]; 4],
    pub(crate) id: &'c mut [u32],
}

impl Columns {
    pub(crate) const BYTES_PER_SPHERE: u64 = 20;

    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// Sees to it that [`resize`](Self::resize) will have the memory for `len` spheres.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub(crate) fn reserve(&mut self, len: usize) -> Result<(), Error> {
        let Self { x, y, z, r, id, .. } = self;
        for column in [x, y, z, r] {
            reserve(column, len + MAX_LANES, "columns of spheres")?;
        }
        reserve(id, len + MAX_LANES, "columns of spheres")
    }

    /// Makes room for `len` spheres, which the caller is to write.
    pub(crate) fn resize(&mut self, len: usize) -> ColumnsMut<'_> {
        let Self { x, y, z, r, id, .. } = self;
        let xyzr = [x, y, z, r].map(|column| {
            resize(column, len + MAX_LANES);
            &mut column[..len]
        });
        resize(id, len + MAX_LANES);
        self.len = len;
        ColumnsMut { xyzr, id: &mut id[..len] }
    }

    /// Fills the columns with the spheres of these ids.
    pub(crate) fn gather(&mut self, rule: &Rule<'_>, ids: impl ExactSizeIterator<Item = u32>) {
        let ColumnsMut { xyzr: [x, y, z, r], id: column } = self.resize(ids.len());
        for (at, id) in ids.enumerate() {
            let (center, radius) = rule.effective(id);
            (x[at], y[at], z[at]) = (center.x, center.y, center.z);
            (r[at], column[at]) = (radius, id);
        }
    }

    /// The index in the input of the sphere at `at`.
    #[inline(always)]
    pub(crate) fn id(&self, at: usize) -> u32 {
        self.id[at]
    }

    /// Centre and effective radius of the sphere at `at`.
    #[inline(always)]
    pub(crate) fn sphere(&self, at: usize) -> [f32; 4] {
        self.lanes::<1>(at).map(|[value]| *value)
    }

    /// `N` values of each of `x`, `y`, `z`, `r` from `base` on, with padding behind the last sphere.
    #[inline(always)]
    pub(crate) fn lanes<const N: usize>(&self, base: usize) -> [&[f32; N]; 4] {
        const { assert!(N <= MAX_LANES) };
        assert!(base <= self.len, "a load starts at a sphere");
        // SAFETY: by the invariant each column has `len + MAX_LANES` values, and `base + N` is no more.
        let lanes = |column: &Vec<f32>| unsafe { &*column.as_ptr().add(base).cast::<[f32; N]>() };
        [lanes(&self.x), lanes(&self.y), lanes(&self.z), lanes(&self.r)]
    }

    /// The ids that go with [`lanes`](Self::lanes).
    #[inline(always)]
    pub(crate) fn ids<const N: usize>(&self, base: usize) -> &[u32; N] {
        const { assert!(N <= MAX_LANES) };
        assert!(base <= self.len, "a load starts at a sphere");
        // SAFETY: as in `lanes`.
        unsafe { &*self.id.as_ptr().add(base).cast::<[u32; N]>() }
    }
}

/// A growing buffer gets room for one part in this many beyond what is asked for.
pub(crate) const GROWTH: usize = 8;

/// Makes room for `len` values, which are then of no meaning, or says that there is no memory for them.
///
/// New memory comes zeroed from the system and is not touched here: the threads that write it first also spread the
/// cost of its pages.
///
/// # Errors
/// [`Error::OutOfMemory`], with `what` the values are.
pub(crate) fn reserve<T: Zeroable>(buffer: &mut Vec<T>, len: usize, what: &'static str) -> Result<(), Error> {
    if buffer.capacity() < len {
        // A buffer that grows once is likely to grow again, a little, as particles are added step by step.
        let room = if buffer.capacity() == 0 { len } else { len + len / GROWTH };
        drop(std::mem::take(buffer));
        let refused = |()| Error::OutOfMemory { what, bytes: (room * size_of::<T>()) as u64 };
        *buffer = try_zeroed_vec(room).map_err(refused)?;
    }
    Ok(())
}

/// Changes a buffer's length, without more room than that where [`reserve`] has not made it.
pub(crate) fn resize<T: Copy + Default>(buffer: &mut Vec<T>, len: usize) {
    buffer.reserve_exact(len.saturating_sub(buffer.len()));
    buffer.resize(len, T::default());
}
