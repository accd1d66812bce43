use super::pair_test::PairTest;
use crate::Error;
use crate::memory::try_resize;

pub(crate) const MAX_LANES: usize = 16;

/// Spheres as columns, padded for whole vectors.
///
/// Invariant: if there are spheres, every column has `len + MAX_LANES` values; only [`Columns::resize`] changes
/// lengths.
#[derive(Debug, Default)]
pub(crate) struct Columns {
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
    r: Vec<f32>,
    id: Vec<u32>,
    len: usize,
}

pub(crate) struct ColumnsMut<'c> {
    pub(crate) xyzr: [&'c mut [f32]; 4],
    pub(crate) id: &'c mut [u32],
}

impl Columns {
    pub(crate) const BYTES_PER_SPHERE: u64 = 20;

    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// The caller must write all spheres. After an error the columns are empty.
    pub(crate) fn resize(&mut self, len: usize) -> Result<ColumnsMut<'_>, Error> {
        let Self { x, y, z, r, id, .. } = self;
        self.len = 0;
        let columns = [x, y, z, r];
        let mut xyzr: [&mut [f32]; 4] = Default::default();
        for (column, made) in columns.into_iter().zip(&mut xyzr) {
            try_resize(column, len + MAX_LANES, "columns of spheres")?;
            *made = &mut column[..len];
        }
        try_resize(id, len + MAX_LANES, "columns of spheres")?;
        self.len = len;
        Ok(ColumnsMut { xyzr, id: &mut id[..len] })
    }

    pub(crate) fn renumber(&mut self, order: &mut Vec<u32>) -> Result<(), Error> {
        try_resize(order, self.len, "the order of spheres")?;
        order.copy_from_slice(&self.id[..self.len]);
        self.id.iter_mut().zip(0..).for_each(|(id, at)| *id = at);
        Ok(())
    }

    pub(crate) fn gather(
        &mut self,
        test: &PairTest<'_>,
        ids: impl ExactSizeIterator<Item = u32>,
    ) -> Result<(), Error> {
        let ColumnsMut { xyzr: [x, y, z, r], id: column } = self.resize(ids.len())?;
        for (at, id) in ids.enumerate() {
            let (center, radius) = test.effective(id);
            (x[at], y[at], z[at]) = (center.x, center.y, center.z);
            (r[at], column[at]) = (radius, id);
        }
        Ok(())
    }

    #[inline(always)]
    pub(crate) fn id(&self, at: usize) -> u32 {
        self.id[at]
    }

    #[inline(always)]
    pub(crate) fn sphere(&self, at: usize) -> [f32; 4] {
        self.lanes::<1>(at).map(|[value]| *value)
    }

    #[inline(always)]
    pub(crate) fn lanes<const N: usize>(&self, base: usize) -> [&[f32; N]; 4] {
        const { assert!(N <= MAX_LANES) };
        assert!(base < self.len, "a load starts at a sphere");
        // SAFETY: there is a sphere, so by the invariant each column has `len + MAX_LANES` values, more than `base + N`.
        let lanes = |column: &Vec<f32>| unsafe { &*column.as_ptr().add(base).cast::<[f32; N]>() };
        [lanes(&self.x), lanes(&self.y), lanes(&self.z), lanes(&self.r)]
    }

    #[inline(always)]
    pub(crate) fn ids<const N: usize>(&self, base: usize) -> &[u32; N] {
        const { assert!(N <= MAX_LANES) };
        assert!(base < self.len, "a load starts at a sphere");
        // SAFETY: as in `lanes`.
        unsafe { &*self.id.as_ptr().add(base).cast::<[u32; N]>() }
    }
}
