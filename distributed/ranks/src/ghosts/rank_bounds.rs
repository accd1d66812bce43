use lazygrid::Error;
use rayon::prelude::*;

use super::ClassBounds;
use super::ghost_rule::{RankAndClass, becomes_ghost};
use crate::memory::try_push;
use crate::{Communicator, Coordinate, SphereWrapper, WrappedSphere};

#[derive(Clone, Debug, Default)]
pub struct RankBounds<T = f32> {
    bounds: Vec<ClassBounds<T>>,
    starts: Vec<usize>,
}

struct BoxedSpheres<'a, T> {
    bounds: &'a ClassBounds<T>,
    /// Ascending indices.
    members: Vec<u32>,
}

impl<T: Coordinate> RankBounds<T> {
    pub fn new(of_ranks: impl IntoIterator<Item = Vec<ClassBounds<T>>>) -> Self {
        let mut all = Self { bounds: Vec::new(), starts: vec![0] };
        for bounds in of_ranks {
            all.bounds.extend(bounds);
            all.starts.push(all.bounds.len());
        }
        all
    }

    /// Sends this rank's boxes to all ranks. Collective.
    pub fn gather<C: Communicator>(
        communicator: &mut C,
        spheres: &[WrappedSphere<T>],
    ) -> Result<Self, C::Error> {
        let messages: Vec<_> = ClassBounds::all_of(spheres).iter().map(ClassBounds::message).collect();
        let (bounds, counts) = communicator.all_gather("bounding boxes", &messages)?;
        let mut bounds = bounds.into_iter().map(ClassBounds::from_message);
        Ok(Self::new(counts.iter().map(|&count| bounds.by_ref().take(count).collect())))
    }

    pub fn ranks(&self) -> u32 {
        self.starts.len().saturating_sub(1) as u32
    }

    pub fn of_rank(&self, rank: u32) -> &[ClassBounds<T>] {
        &self.bounds[self.starts[rank as usize]..self.starts[rank as usize + 1]]
    }

    /// Returns ascending indices of `rank`'s spheres that become ghosts, for each rank.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub fn ghosts(
        &self,
        rank: u32,
        spheres: &[WrappedSphere<T>],
        wrapper: &SphereWrapper,
    ) -> Result<Vec<Vec<u32>>, Error> {
        let boxed = boxed(spheres, self.of_rank(rank))?;
        let to = |to: u32| {
            let mut ghosts = Vec::new();
            for BoxedSpheres { bounds, members } in &boxed {
                let class = RankAndClass { rank, class: bounds.class() };
                let near = self.near(class, bounds, to, wrapper);
                if near.is_empty() {
                    continue;
                }
                for &k in members {
                    let sphere = ClassBounds::around(&spheres[k as usize]);
                    if near.iter().any(|near| near.can_pair(&sphere, wrapper)) {
                        try_push(&mut ghosts, k, "ghosts to send")?;
                    }
                }
            }
            ghosts.sort_unstable();
            Ok(ghosts)
        };
        (0..self.ranks()).into_par_iter().map(to).collect()
    }

    fn near(
        &self,
        from: RankAndClass,
        bounds: &ClassBounds<T>,
        to: u32,
        wrapper: &SphereWrapper,
    ) -> Vec<ClassBounds<T>> {
        let is_near = |other: &&ClassBounds<T>| {
            becomes_ghost(from, RankAndClass { rank: to, class: other.class() }, self.ranks())
                && bounds.can_pair(other, wrapper)
        };
        self.of_rank(to).iter().filter(is_near).copied().collect()
    }
}

fn boxed<'a, T: Coordinate>(
    spheres: &[WrappedSphere<T>],
    all: &'a [ClassBounds<T>],
) -> Result<Vec<BoxedSpheres<'a, T>>, Error> {
    let mut boxed: Vec<_> = all.iter().map(|bounds| BoxedSpheres { bounds, members: Vec::new() }).collect();
    for (k, sphere) in (0..).zip(spheres) {
        let key = (sphere.class(), sphere.group);
        if let Ok(found) = all.binary_search_by_key(&key, |bounds| (bounds.class(), bounds.group())) {
            try_push(&mut boxed[found].members, k, "spheres of bounding boxes")?;
        }
    }
    Ok(boxed)
}
