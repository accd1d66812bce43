//! parry3d's tree, used as its documentation advises.

use std::error::Error;

use lazygrid::{Pair, Sphere};
use parry3d::bounding_volume::Aabb;
use parry3d::math::Vector;
use parry3d::partitioning::{Bvh, BvhBuildStrategy, BvhWorkspace};

use super::{half_extent, touch};
use crate::measure::{ContenderFactory, Found, PairFinder};

#[derive(Clone, Copy, Debug)]
enum TreeUpdate {
    /// Updates all boxes; the topology stays.
    Refit,
    /// Updates a leaf if its sphere has left the box, whose margin is this fraction of the radius.
    Fat(f32),
    /// Refits, then rebuilds a small part of the tree.
    Optimize,
}

/// Returns trees without full rebuilds, which cost more than they gain within a hundred steps.
pub fn incremental() -> Vec<ContenderFactory> {
    vec![
        refitted("parry3d refit"),
        with_margin("parry3d refit, margin"),
        optimized("parry3d refit, optimized"),
    ]
}

pub fn refitted(name: impl Into<String>) -> ContenderFactory {
    ContenderFactory::new(name, || Ok(PersistentTree::new(TreeUpdate::Refit)))
}

pub fn with_margin(name: impl Into<String>) -> ContenderFactory {
    ContenderFactory::new(name, || Ok(PersistentTree::new(TreeUpdate::Fat(0.2))))
}

pub fn optimized(name: impl Into<String>) -> ContenderFactory {
    ContenderFactory::new(name, || Ok(PersistentTree::new(TreeUpdate::Optimize)))
}

pub fn from_scratch() -> Vec<ContenderFactory> {
    [("binned", BvhBuildStrategy::Binned), ("PLOC", BvhBuildStrategy::Ploc)]
        .map(|(name, strategy)| {
            ContenderFactory::new(format!("parry3d {name}"), move || {
                Ok(RebuiltTree { strategy, pairs: vec![] })
            })
        })
        .into()
}

struct PersistentTree {
    update: TreeUpdate,
    tree: Bvh,
    workspace: BvhWorkspace,
    pairs: Vec<Pair>,
}

impl PersistentTree {
    fn new(update: TreeUpdate) -> Self {
        let (tree, workspace) = (Bvh::new(), BvhWorkspace::default());
        Self { update, tree, workspace, pairs: vec![] }
    }
}

impl PairFinder for PersistentTree {
    fn run(&mut self, spheres: &[Sphere]) -> Result<Found<'_>, Box<dyn Error>> {
        let margin = if let TreeUpdate::Fat(margin) = self.update { margin } else { 0.0 };
        if self.tree.is_empty() {
            self.tree = build(spheres, BvhBuildStrategy::Binned);
        }
        for (index, sphere) in (0..).zip(spheres) {
            self.tree.insert_or_update_partially(aabb(sphere), index, margin * sphere.radius);
        }
        self.tree.refit(&mut self.workspace);
        if let TreeUpdate::Optimize = self.update {
            self.tree.optimize_incremental(&mut self.workspace);
        }
        query(&self.tree, &mut self.workspace, spheres, &mut self.pairs);
        Ok(Found::Pairs(&self.pairs))
    }
}

struct RebuiltTree {
    strategy: BvhBuildStrategy,
    pairs: Vec<Pair>,
}

impl PairFinder for RebuiltTree {
    fn run(&mut self, spheres: &[Sphere]) -> Result<Found<'_>, Box<dyn Error>> {
        let tree = build(spheres, self.strategy);
        query(&tree, &mut BvhWorkspace::default(), spheres, &mut self.pairs);
        Ok(Found::Pairs(&self.pairs))
    }
}

fn build(spheres: &[Sphere], strategy: BvhBuildStrategy) -> Bvh {
    Bvh::from_iter(strategy, spheres.iter().map(aabb).enumerate())
}

fn query(tree: &Bvh, workspace: &mut BvhWorkspace, spheres: &[Sphere], pairs: &mut Vec<Pair>) {
    pairs.clear();
    tree.traverse_bvtt_single_tree::<false>(workspace, &mut |i, j| {
        let (a, b) = (&spheres[i as usize], &spheres[j as usize]);
        if touch(a, b) {
            pairs.push(Pair::new(i, j));
        }
    });
}

fn aabb(sphere: &Sphere) -> Aabb {
    let center = Vector::from(sphere.center.to_array());
    Aabb::from_half_extents(center, Vector::splat(half_extent(sphere)))
}
