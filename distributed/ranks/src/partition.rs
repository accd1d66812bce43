use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use crate::Error;
use crate::sample::Sample;

/// Where a region is cut in two: spheres with `(coordinate, tie)` below that of the cut are on the left. 16 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Split {
    axis: u32,
    at: f32,
    tie: u64,
}

impl Split {
    #[inline]
    fn is_left(&self, coordinate: f32, tie: u64) -> bool {
        coordinate < self.at || (coordinate == self.at && tie < self.tie)
    }
}

/// Space cut into one part per rank, by recursive bisection. It is kept from step to step: nothing but balance depends
/// on how well it fits.
///
/// Each cut is by `(coordinate, tie)`, where [ties](crate::tie) differ between spheres, so that spheres of equal
/// coordinates, even all at one point, are shared out evenly.
#[derive(Clone, Debug, PartialEq)]
pub struct Partition {
    parts: u32,
    /// Each region's split, then those of its left side, then those of its right.
    splits: Vec<Split>,
}

impl Partition {
    /// Cuts so that every part has its share of the sample, which is put in another order.
    pub fn new(sample: &mut [Sample], parts: u32) -> Self {
        let parts = parts.max(1);
        let mut splits = Vec::with_capacity(parts as usize - 1);
        cut(sample, parts, &mut splits);
        Self { parts, splits }
    }

    /// The partition of another rank, by its [splits](Self::splits).
    ///
    /// # Errors
    /// [`Error::Splits`] where that many parts have another number of splits, or one is along no axis.
    pub fn from_splits(parts: u32, splits: Vec<Split>) -> Result<Self, Error> {
        let sound = splits.iter().all(|split| split.axis < 3) && splits.len() as u64 + 1 == u64::from(parts);
        if sound { Ok(Self { parts, splits }) } else { Err(Error::Splits { splits: splits.len(), parts }) }
    }

    /// What another rank needs to have the same partition; one less than parts.
    pub fn splits(&self) -> &[Split] {
        &self.splits
    }

    /// The number of parts.
    pub fn parts(&self) -> u32 {
        self.parts
    }

    /// The part of a sphere, below [`parts`](Self::parts); its centre as a [`Body`](crate::Body) has it.
    #[inline]
    pub fn part_of(&self, center: Vec3, tie: u64) -> u32 {
        let (mut first, mut parts, mut node) = (0, self.parts, 0);
        while parts > 1 {
            let split = &self.splits[node];
            let left = parts / 2;
            if split.is_left(center[split.axis as usize], tie) {
                parts = left;
                node += 1;
            } else {
                first += left;
                parts -= left;
                // Past this split and those of the left side.
                node += left as usize;
            }
        }
        first
    }
}

fn cut(sample: &mut [Sample], parts: u32, splits: &mut Vec<Split>) {
    if parts < 2 {
        return;
    }
    let left = parts / 2;
    let middle = (sample.len() as u64 * u64::from(left) / u64::from(parts)) as usize;
    let axis = widest(sample);
    let split = match sample.is_empty() {
        true => Split { axis: 0, at: 0.0, tie: 0 },
        false => {
            let order = |a: &Sample, b: &Sample| {
                // Coordinates are finite, and −0 is 0.
                (a.at(axis) + 0.0).total_cmp(&(b.at(axis) + 0.0)).then(a.tie().cmp(&b.tie()))
            };
            let (_, at, _) = sample.select_nth_unstable_by(middle, order);
            Split { axis: axis as u32, at: at.at(axis), tie: at.tie() }
        }
    };
    splits.push(split);
    let (low, high) = sample.split_at_mut(middle);
    cut(low, left, splits);
    cut(high, parts - left, splits);
}

/// The axis along which the sample extends farthest.
fn widest(sample: &[Sample]) -> usize {
    let extent = |axis: usize| {
        let ends = sample.iter().fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], s| {
            [low.min(s.at(axis)), high.max(s.at(axis))]
        });
        f64::from(ends[1]) - f64::from(ends[0])
    };
    let extents = [extent(0), extent(1), extent(2)];
    let wider = |best: usize, axis: usize| if extents[axis] > extents[best] { axis } else { best };
    wider(wider(0, 1), 2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tie;

    fn sizes(centers: &[Vec3], parts: u32) -> Vec<u64> {
        let mut sample: Vec<_> = (0..).zip(centers).map(|(id, &center)| Sample::new(center, id)).collect();
        let partition = Partition::new(&mut sample, parts);
        let copy = Partition::from_splits(parts, partition.splits().to_vec()).unwrap();
        assert_eq!(copy, partition);
        let mut sizes = vec![0; parts as usize];
        (0..).zip(centers).for_each(|(id, &center)| sizes[copy.part_of(center, tie(id)) as usize] += 1);
        sizes
    }

    #[test]
    fn parts_of_the_sample_itself_are_even() {
        let lattice: Vec<_> =
            (0..1000).map(|k| Vec3::new((k % 10) as f32, (k / 10 % 10) as f32, 0.0)).collect();
        let point = vec![Vec3::splat(7.0); 1000];
        let zeros: Vec<_> = (0..1000).map(|k| Vec3::splat(if k % 2 == 0 { 0.0 } else { -0.0 })).collect();
        for centers in [&lattice, &point, &zeros] {
            for parts in [1, 2, 3, 5, 8, 100, 512] {
                let sizes = sizes(centers, parts);
                let (low, high) = (sizes.iter().min().unwrap(), sizes.iter().max().unwrap());
                // Each of the cuts above a part rounds to one sphere.
                assert!(high - low <= 2, "{parts} parts of {low} to {high}");
            }
        }
    }

    #[test]
    fn few_spheres_leave_parts_empty() {
        assert_eq!(sizes(&[], 8), [0; 8]);
        assert_eq!(sizes(&[Vec3::ONE], 8).iter().sum::<u64>(), 1);
        assert_eq!(sizes(&[Vec3::ONE; 7], 8).iter().max(), Some(&1));
    }

    #[test]
    fn splits_of_another_partition_are_refused() {
        let error = Partition::from_splits(3, vec![Split { axis: 0, at: 0.0, tie: 0 }]).unwrap_err();
        assert_eq!(error.to_string(), "1 splits make 2 parts and not 3; take those of the same partition");
        assert!(Partition::from_splits(2, vec![Split { axis: 3, at: 0.0, tie: 0 }]).is_err());
    }
}
