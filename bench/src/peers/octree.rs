//! An octree whose leaves run sweep and prune in parallel, updated between steps, as the paper describes
//! BiNS2 (section 4.3).
//!
//! A sphere is in each leaf that its box overlaps. A pair is reported by the leaf with
//! `max(low corner of a, low corner of b)`, a point of both boxes.

use std::error::Error;
use std::mem;

use glam::Vec3;
use lazygrid::{Pair, Sphere};
use rayon::prelude::*;

use super::half_extent;
use super::sweep_and_prune::{Interval, sort, sweep};
use crate::measure::{ContenderFactory, Found, PairFinder};

/// Leaves with more spheres are split, if that separates the spheres.
const SPLIT_ABOVE: usize = 256;
/// Eight sibling leaves with fewer spheres in total are merged.
const MERGE_BELOW: usize = 96;
/// Smallest side of a leaf over the mean diameter of its spheres; smaller leaves would have most spheres in common.
const MIN_LEAF_SIDE: f32 = 2.0;
const MAX_DEPTH: u32 = 20;
/// Side of the root cell over the extent of the spheres.
const ROOT_SCALE: f32 = 1.5;

pub fn incremental() -> ContenderFactory {
    ContenderFactory::new("octree (BiNS2)", || Ok(Octree::default()))
}

#[derive(Clone, Copy, Debug, Default)]
struct Bounds {
    low: Vec3,
    high: Vec3,
}

impl Bounds {
    fn from_sphere(sphere: &Sphere) -> Self {
        let half = Vec3::splat(half_extent(sphere));
        Self { low: sphere.center - half, high: sphere.center + half }
    }

    fn overlaps(&self, other: &Self) -> bool {
        self.low.cmple(other.high).all() && other.low.cmple(self.high).all()
    }

    fn contains(&self, other: &Self) -> bool {
        self.low.cmple(other.low).all() && other.high.cmple(self.high).all()
    }

    fn encloses(&self, other: &Self) -> bool {
        self.low.cmplt(other.low).all() && other.high.cmplt(self.high).all()
    }

    fn owns(&self, point: Vec3) -> bool {
        self.low.cmple(point).all() && point.cmplt(self.high).all()
    }

    fn octant(&self, k: usize) -> Self {
        let middle = 0.5 * (self.low + self.high);
        let upper = glam::BVec3::new(k & 1 != 0, k & 2 != 0, k & 4 != 0);
        Self { low: Vec3::select(upper, middle, self.low), high: Vec3::select(upper, self.high, middle) }
    }
}

struct Node {
    cell: Bounds,
    depth: u32,
    children: Option<usize>,
    members: Vec<u32>,
    intervals: Vec<Interval>,
    pairs: Vec<Pair>,
}

impl Node {
    fn leaf(cell: Bounds, depth: u32) -> Self {
        let (members, intervals, pairs) = Default::default();
        Self { cell, depth, children: None, members, intervals, pairs }
    }

    fn release(&mut self, boxes: &[Bounds]) {
        let Self { members, cell, .. } = self;
        members.retain(|&k| boxes[k as usize].overlaps(cell));
    }

    fn search(&mut self, spheres: &[Sphere], boxes: &[Bounds]) {
        let Self { members, intervals, pairs, cell, .. } = self;
        intervals.clear();
        intervals.extend(members.iter().map(|&k| Interval::new(&spheres[k as usize], k, 0)));
        sort(intervals);
        members.clear();
        members.extend(intervals.iter().map(|interval| interval.index));
        pairs.clear();
        sweep(intervals, |a, b| {
            let corner = boxes[a.index as usize].low.max(boxes[b.index as usize].low);
            if cell.owns(corner) {
                pairs.push(Pair::new(a.index, b.index));
            }
        });
    }
}

#[derive(Default)]
struct Octree {
    /// The root is first; children of merged nodes stay for reuse.
    nodes: Vec<Node>,
    free: Vec<usize>,
    boxes: Vec<Bounds>,
    before: Vec<Bounds>,
    /// The leaf that encloses a sphere's box.
    enclosing_leaf: Vec<Option<u32>>,
    pairs: Vec<Pair>,
}

impl PairFinder for Octree {
    fn run(&mut self, spheres: &[Sphere]) -> Result<Found<'_>, Box<dyn Error>> {
        mem::swap(&mut self.boxes, &mut self.before);
        spheres.par_iter().map(Bounds::from_sphere).collect_into_vec(&mut self.boxes);
        let fits = |root: &Node| self.boxes.par_iter().all(|b| root.cell.contains(b));
        if self.before.len() == spheres.len() && self.nodes.first().is_some_and(fits) {
            self.update();
        } else {
            self.rebuild();
        }
        self.merge(0);
        self.split(spheres);
        let boxes = &self.boxes;
        self.nodes.par_iter_mut().filter(|node| node.children.is_none()).for_each(|leaf| {
            leaf.search(spheres, boxes);
        });
        self.pairs.clear();
        for node in &self.nodes {
            if node.children.is_none() {
                self.pairs.extend_from_slice(&node.pairs);
            }
        }
        Ok(Found::Pairs(&self.pairs))
    }
}

impl Octree {
    fn rebuild(&mut self) {
        let none = Bounds { low: Vec3::INFINITY, high: Vec3::NEG_INFINITY };
        let all = self
            .boxes
            .iter()
            .fold(none, |all, b| Bounds { low: all.low.min(b.low), high: all.high.max(b.high) });
        let middle = 0.5 * (all.low + all.high);
        let half = ROOT_SCALE * 0.5 * (all.high - all.low).max_element().max(f32::MIN_POSITIVE);
        let cell = Bounds { low: middle - half, high: middle + half };
        let members = (0..self.boxes.len() as u32).collect();
        self.nodes = vec![Node { members, ..Node::leaf(cell, 0) }];
        self.free.clear();
        self.enclosing_leaf.clear();
        self.enclosing_leaf.resize(self.boxes.len(), Some(0));
    }

    fn update(&mut self) {
        let Self { nodes, boxes, before, enclosing_leaf, .. } = self;
        nodes.par_iter_mut().filter(|node| node.children.is_none()).for_each(|leaf| leaf.release(boxes));
        let nodes_now = &*nodes;
        let stays =
            |k: usize| enclosing_leaf[k].is_some_and(|h| nodes_now[h as usize].cell.encloses(&boxes[k]));
        let entered: Vec<(u32, u32)> = (0..boxes.len())
            .into_par_iter()
            .filter(|&k| !stays(k))
            .fold(Vec::new, |mut entered, k| {
                descend(nodes_now, 0, &boxes[k], &mut |leaf| {
                    if !before[k].overlaps(&nodes_now[leaf].cell) {
                        entered.push((leaf as u32, k as u32));
                    }
                });
                entered
            })
            .reduce(Vec::new, |mut all, mut more| {
                all.append(&mut more);
                all
            });
        for (leaf, k) in entered {
            nodes[leaf as usize].members.push(k);
        }
        let nodes = &*nodes;
        enclosing_leaf.par_iter_mut().zip(&*boxes).for_each(|(enclosing_leaf, b)| {
            if !enclosing_leaf.is_some_and(|h| nodes[h as usize].cell.encloses(b)) {
                *enclosing_leaf = leaf_enclosing(nodes, b);
            }
        });
    }

    /// Merges sparse siblings. Returns the number of spheres if `node` is a leaf afterwards.
    fn merge(&mut self, node: usize) -> Option<usize> {
        let Some(first) = self.nodes[node].children else {
            return Some(self.nodes[node].members.len());
        };
        let counts: Vec<Option<usize>> = (first..first + 8).map(|child| self.merge(child)).collect();
        let total: usize = counts.into_iter().sum::<Option<usize>>()?;
        if total >= MERGE_BELOW {
            return None;
        }
        let mut members: Vec<u32> =
            (first..first + 8).flat_map(|child| mem::take(&mut self.nodes[child].members)).collect();
        members.sort_unstable();
        members.dedup();
        for &k in &members {
            if self.nodes[node].cell.encloses(&self.boxes[k as usize]) {
                self.enclosing_leaf[k as usize] = Some(node as u32);
            }
        }
        self.free.push(first);
        let count = members.len();
        (self.nodes[node].children, self.nodes[node].members) = (None, members);
        Some(count)
    }

    fn split(&mut self, spheres: &[Sphere]) {
        let mut crowded: Vec<usize> = (0..self.nodes.len()).collect();
        while let Some(node) = crowded.pop() {
            if !self.wants_split(node, spheres) {
                continue;
            }
            let first = self.eight_leaves(node);
            for k in mem::take(&mut self.nodes[node].members) {
                let this = &self.boxes[k as usize];
                let mut enclosing_leaf = None;
                for child in first..first + 8 {
                    if self.nodes[child].cell.overlaps(this) {
                        self.nodes[child].members.push(k);
                        enclosing_leaf =
                            self.nodes[child].cell.encloses(this).then_some(child as u32).or(enclosing_leaf);
                    }
                }
                self.enclosing_leaf[k as usize] = enclosing_leaf;
            }
            self.nodes[node].children = Some(first);
            crowded.extend(first..first + 8);
        }
    }

    fn wants_split(&self, node: usize, spheres: &[Sphere]) -> bool {
        let Node { cell, depth, children, members, .. } = &self.nodes[node];
        if children.is_some() || members.len() <= SPLIT_ABOVE || *depth >= MAX_DEPTH {
            return false;
        }
        let radii: f32 = members.iter().map(|&k| spheres[k as usize].radius).sum();
        let diameter = 2.0 * radii / members.len() as f32;
        0.5 * (cell.high.x - cell.low.x) > MIN_LEAF_SIDE * diameter
    }

    fn eight_leaves(&mut self, node: usize) -> usize {
        let (cell, depth) = (self.nodes[node].cell, self.nodes[node].depth + 1);
        let leaves = (0..8).map(|k| Node::leaf(cell.octant(k), depth));
        match self.free.pop() {
            Some(first) => {
                for (node, leaf) in self.nodes[first..first + 8].iter_mut().zip(leaves) {
                    *node = leaf;
                }
                first
            }
            None => {
                self.nodes.extend(leaves);
                self.nodes.len() - 8
            }
        }
    }
}

fn descend(nodes: &[Node], node: usize, this: &Bounds, found: &mut impl FnMut(usize)) {
    if !nodes[node].cell.overlaps(this) {
        return;
    }
    match nodes[node].children {
        Some(first) => (first..first + 8).for_each(|child| descend(nodes, child, this, found)),
        None => found(node),
    }
}

fn leaf_enclosing(nodes: &[Node], this: &Bounds) -> Option<u32> {
    let mut node = 0;
    while let Some(first) = nodes[node].children {
        node = (first..first + 8).find(|&child| nodes[child].cell.encloses(this))?;
    }
    nodes[node].cell.encloses(this).then_some(node as u32)
}
