use bytemuck::{Pod, Zeroable};

use crate::sample::Sample;
use crate::{Coordinate, Error};

/// A plane through a region: spheres with a lower `(coordinate, tie breaker)` are left.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct BisectionPlane {
    at: f64,
    tie_breaker: u64,
    axis: u64,
}

impl BisectionPlane {
    #[inline]
    fn is_left(&self, coordinate: f64, tie_breaker: u64) -> bool {
        coordinate < self.at || (coordinate == self.at && tie_breaker < self.tie_breaker)
    }
}

/// Recursive bisection of space into one domain per rank. Only balance depends on it, so it can serve many steps.
/// [Tie breakers](crate::tie_breaker) divide spheres of equal coordinates evenly.
#[derive(Clone, Debug, PartialEq)]
pub struct Partition {
    domains: u32,
    /// Plane of each region, then of its left side, then of its right side.
    planes: Vec<BisectionPlane>,
}

impl Partition {
    /// Divides the sample about equally, and reorders it.
    pub fn new(sample: &mut [Sample], domains: u32) -> Self {
        let domains = domains.max(1);
        let mut planes = Vec::with_capacity(domains as usize - 1);
        cut(sample, domains, &mut planes);
        Self { domains, planes }
    }

    /// Creates a partition from its [planes](Self::planes).
    ///
    /// # Errors
    /// [`Error::Planes`] for a wrong number of planes or an invalid axis.
    pub fn from_planes(domains: u32, planes: Vec<BisectionPlane>) -> Result<Self, Error> {
        let sound =
            planes.iter().all(|plane| plane.axis < 3) && planes.len() as u64 + 1 == u64::from(domains);
        if sound {
            Ok(Self { domains, planes })
        } else {
            Err(Error::Planes { planes: planes.len(), domains })
        }
    }

    pub fn planes(&self) -> &[BisectionPlane] {
        &self.planes
    }

    pub fn domains(&self) -> u32 {
        self.domains
    }

    /// `center` is that of a [`WrappedSphere`](crate::WrappedSphere).
    #[inline]
    pub fn domain_of<T: Coordinate>(&self, center: [T; 3], tie_breaker: u64) -> u32 {
        let (mut first, mut domains, mut node) = (0, self.domains, 0);
        while domains > 1 {
            let plane = &self.planes[node];
            let left = domains / 2;
            if plane.is_left(center[plane.axis as usize].into(), tie_breaker) {
                domains = left;
                node += 1;
            } else {
                first += left;
                domains -= left;
                // Skips this plane and its left side.
                node += left as usize;
            }
        }
        first
    }
}

fn cut(sample: &mut [Sample], domains: u32, planes: &mut Vec<BisectionPlane>) {
    if domains < 2 {
        return;
    }
    let left = domains / 2;
    let middle = (sample.len() as u64 * u64::from(left) / u64::from(domains)) as usize;
    let axis = widest(sample);
    let plane = match sample.is_empty() {
        true => BisectionPlane { at: 0.0, tie_breaker: 0, axis: 0 },
        false => {
            let order = |a: &Sample, b: &Sample| {
                // Coordinates are finite, and −0 becomes 0.
                (a.at(axis) + 0.0).total_cmp(&(b.at(axis) + 0.0)).then(a.tie_breaker().cmp(&b.tie_breaker()))
            };
            let (_, at, _) = sample.select_nth_unstable_by(middle, order);
            BisectionPlane { at: at.at(axis), tie_breaker: at.tie_breaker(), axis: axis as u64 }
        }
    };
    planes.push(plane);
    let (low, high) = sample.split_at_mut(middle);
    cut(low, left, planes);
    cut(high, domains - left, planes);
}

fn widest(sample: &[Sample]) -> usize {
    let extent = |axis: usize| {
        let ends = sample.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], s| {
            [low.min(s.at(axis)), high.max(s.at(axis))]
        });
        ends[1] - ends[0]
    };
    let extents = [extent(0), extent(1), extent(2)];
    let wider = |best: usize, axis: usize| if extents[axis] > extents[best] { axis } else { best };
    wider(wider(0, 1), 2)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::tie_breaker;

    fn sizes(centers: &[Vec3], domains: u32) -> Vec<u64> {
        let mut sample: Vec<_> =
            (0..).zip(centers).map(|(id, &center)| Sample::new(center.to_array(), id)).collect();
        let partition = Partition::new(&mut sample, domains);
        let copy = Partition::from_planes(domains, partition.planes().to_vec()).unwrap();
        assert_eq!(copy, partition);
        let mut sizes = vec![0; domains as usize];
        (0..).zip(centers).for_each(|(id, &center)| {
            sizes[copy.domain_of(center.to_array(), tie_breaker(id)) as usize] += 1
        });
        sizes
    }

    #[test]
    fn domains_have_equally_many_samples() {
        let lattice: Vec<_> =
            (0..1000).map(|k| Vec3::new((k % 10) as f32, (k / 10 % 10) as f32, 0.0)).collect();
        let point = vec![Vec3::splat(7.0); 1000];
        let zeros: Vec<_> = (0..1000).map(|k| Vec3::splat(if k % 2 == 0 { 0.0 } else { -0.0 })).collect();
        for centers in [&lattice, &point, &zeros] {
            for domains in [1, 2, 3, 5, 8, 100, 512] {
                let sizes = sizes(centers, domains);
                let (low, high) = (sizes.iter().min().unwrap(), sizes.iter().max().unwrap());
                // Each plane above a domain rounds to one sphere.
                assert!(high - low <= 2, "{domains} domains of {low} to {high}");
            }
        }
    }

    #[test]
    fn few_spheres_leave_domains_empty() {
        assert_eq!(sizes(&[], 8), [0; 8]);
        assert_eq!(sizes(&[Vec3::ONE], 8).iter().sum::<u64>(), 1);
        assert_eq!(sizes(&[Vec3::ONE; 7], 8).iter().max(), Some(&1));
    }

    #[test]
    fn planes_of_another_partition_are_refused() {
        let error =
            Partition::from_planes(3, vec![BisectionPlane { at: 0.0, tie_breaker: 0, axis: 0 }]).unwrap_err();
        assert_eq!(
            error.to_string(),
            "1 planes cut space into 2 domains, not 3; use the planes of one partition"
        );
        assert!(
            Partition::from_planes(2, vec![BisectionPlane { at: 0.0, tie_breaker: 0, axis: 3 }]).is_err()
        );
    }
}
