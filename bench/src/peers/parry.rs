//! parry3d's bounding volume hierarchy, used as its documentation advises, in several tunings.

use std::error::Error;

use lazygrid::{Pair, Sphere};
use parry3d::bounding_volume::Aabb;
use parry3d::math::Vector;
use parry3d::partitioning::{Bvh, BvhBuildStrategy, BvhWorkspace};

use super::{half_extent, touch};
use crate::measure::{Contender, Found, Search};

/// What happens to the tree at every step before it is traversed.
#[derive(Clone, Copy, Debug)]
enum Upkeep {
    /// Leaves are written with their exact boxes and all inner boxes follow; the tree's shape stays.
    Refit,
    /// As `Refit`, but a leaf is written only when its sphere has left its box, which is larger on each side by
    /// this share of the radius.
    Fat(f32),
    /// As `Refit`, then a small part of the tree is rebuilt.
    Optimize,
}

/// The tunings for a tree that lives from step to step. Rebuilding it now and then is none of them: within a
/// hundred steps of the scenes the refitted tree does not get worse by what that costs.
pub fn running() -> Vec<Contender> {
    vec![
        refitted("parry3d refit"),
        with_margin("parry3d refit, margin"),
        optimised("parry3d refit, optimised"),
    ]
}

/// A tree that is refitted at every step.
pub fn refitted(name: impl Into<String>) -> Contender {
    Contender::new(name, || Ok(Living::new(Upkeep::Refit)))
}

/// The same, with boxes a fifth of the radius larger on every side.
pub fn with_margin(name: impl Into<String>) -> Contender {
    Contender::new(name, || Ok(Living::new(Upkeep::Fat(0.2))))
}

/// The same, a part of it rebuilt at every step.
pub fn optimised(name: impl Into<String>) -> Contender {
    Contender::new(name, || Ok(Living::new(Upkeep::Optimize)))
}

/// The two ways to build a tree from nothing.
pub fn scratch() -> Vec<Contender> {
    [("binned", BvhBuildStrategy::Binned), ("PLOC", BvhBuildStrategy::Ploc)]
        .map(|(name, strategy)| {
            Contender::new(format!("parry3d {name}"), move || Ok(Built { strategy, pairs: vec![] }))
        })
        .into()
}

/// A tree kept from step to step.
struct Living {
    upkeep: Upkeep,
    tree: Bvh,
    workspace: BvhWorkspace,
    pairs: Vec<Pair>,
}

impl Living {
    fn new(upkeep: Upkeep) -> Self {
        let (tree, workspace) = (Bvh::new(), BvhWorkspace::default());
        Self { upkeep, tree, workspace, pairs: vec![] }
    }
}

impl Search for Living {
    fn run(&mut self, spheres: &[Sphere]) -> Result<Found<'_>, Box<dyn Error>> {
        let margin = if let Upkeep::Fat(margin) = self.upkeep { margin } else { 0.0 };
        if self.tree.is_empty() {
            self.tree = build(spheres, BvhBuildStrategy::Binned);
        }
        for (index, sphere) in (0..).zip(spheres) {
            self.tree.insert_or_update_partially(aabb(sphere), index, margin * sphere.radius);
        }
        self.tree.refit(&mut self.workspace);
        if let Upkeep::Optimize = self.upkeep {
            self.tree.optimize_incremental(&mut self.workspace);
        }
        query(&self.tree, &mut self.workspace, spheres, &mut self.pairs);
        Ok(Found::Pairs(&self.pairs))
    }
}

/// A tree built for one answer.
struct Built {
    strategy: BvhBuildStrategy,
    pairs: Vec<Pair>,
}

impl Search for Built {
    fn run(&mut self, spheres: &[Sphere]) -> Result<Found<'_>, Box<dyn Error>> {
        let tree = build(spheres, self.strategy);
        query(&tree, &mut BvhWorkspace::default(), spheres, &mut self.pairs);
        Ok(Found::Pairs(&self.pairs))
    }
}

fn build(spheres: &[Sphere], strategy: BvhBuildStrategy) -> Bvh {
    Bvh::from_iter(strategy, spheres.iter().map(aabb).enumerate())
}

/// The tree's candidates, tested exactly.
fn query(tree: &Bvh, workspace: &mut BvhWorkspace, spheres: &[Sphere], pairs: &mut Vec<Pair>) {
    pairs.clear();
    tree.traverse_bvtt_single_tree::<false>(workspace, &mut |i, j| {
        let (a, b) = (&spheres[i as usize], &spheres[j as usize]);
        if touch(a, b) {
            pairs.push(Pair::new(i, j));
        }
    });
}

/// The box of a sphere.
fn aabb(sphere: &Sphere) -> Aabb {
    let center = Vector::from(sphere.center.to_array());
    Aabb::from_half_extents(center, Vector::splat(half_extent(sphere)))
}
