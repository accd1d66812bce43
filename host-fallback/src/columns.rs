use crate::contact::Rule;
use crate::simd::MAX_LANES;

/// Spheres as columns, in the order a detector wants them, padded so that a whole vector can be loaded at any of
/// them. `id` is the index in the input; `r` the effective radius, which is the radius where no interaction
/// distances are set.
#[derive(Debug, Default)]
pub(crate) struct Columns {
    pub(crate) x: Vec<f32>,
    pub(crate) y: Vec<f32>,
    pub(crate) z: Vec<f32>,
    pub(crate) r: Vec<f32>,
    pub(crate) id: Vec<u32>,
    len: usize,
}

impl Columns {
    pub(crate) const BYTES_PER_SPHERE: u64 = 20;

    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// Makes room for `len` spheres; what is there is overwritten by the caller.
    pub(crate) fn resize(&mut self, len: usize) {
        self.len = len;
        let padded = len + MAX_LANES;
        for column in [&mut self.x, &mut self.y, &mut self.z, &mut self.r] {
            column.resize(padded, 0.0);
        }
        self.id.resize(padded, 0);
    }

    /// Fills the columns with the spheres of these ids.
    pub(crate) fn gather(&mut self, rule: &Rule<'_>, ids: impl ExactSizeIterator<Item = u32>) {
        self.resize(ids.len());
        for (at, id) in ids.enumerate() {
            let (center, radius) = rule.effective(id);
            (self.x[at], self.y[at], self.z[at]) = (center.x, center.y, center.z);
            self.r[at] = radius;
            self.id[at] = id;
        }
    }
}
