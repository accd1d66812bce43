//! One grid of the plain cell list: the spheres of one size class, sorted by the cell of their centre.

use glam::{UVec3, Vec3};
use lazygrid::{Pair, Sphere};

use super::touch;

/// Cell edge over the class's largest diameter; PEERS' best lie between 1.5 and 2.5 for the uniform scenes.
const EDGE: f32 = 1.5;
/// No more cells than this per sphere, so that a spread-out cloud does not drown in empty ones.
const CELLS_PER_SPHERE: f32 = 2.0;
/// Candidates that are compared at once.
const LANES: usize = 16;

/// The spheres of one class in the order of their cells.
#[derive(Default)]
pub(super) struct Class {
    pub(super) order: Vec<u32>,
    /// Columns in that order; `LANES` more entries at the end that touch nothing, so that runs may be read in full.
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
    r: Vec<f32>,
    starts: Vec<u32>,
    keys: Vec<u32>,
    sorted: Vec<u32>,
    origin: Vec3,
    per_edge: f32,
    cells: UVec3,
    largest: f32,
}

impl Class {
    /// Sorts the class, whose members stand in `order`, by cell; the order of the last step comes in, so that both
    /// reading and writing stay near each other.
    pub(super) fn build(&mut self, spheres: &[Sphere]) {
        self.raster(spheres);
        let cells = self.cells.element_product() as usize;
        self.starts.clear();
        self.starts.resize(cells + 1, 0);
        self.keys.clear();
        for &k in &self.order {
            let key = self.key(self.cell(spheres[k as usize].center));
            self.keys.push(key);
            self.starts[key as usize + 1] += 1;
        }
        for cell in 0..cells {
            self.starts[cell + 1] += self.starts[cell];
        }
        self.sorted.resize(self.order.len(), 0);
        // `starts[cell]` runs ahead while its cell is filled; the starts then stand one place to the left.
        for (&k, &key) in self.order.iter().zip(&self.keys) {
            let place = &mut self.starts[key as usize];
            self.sorted[*place as usize] = k;
            *place += 1;
        }
        self.starts.copy_within(0..cells, 1);
        self.starts[0] = 0;
        std::mem::swap(&mut self.order, &mut self.sorted);
        self.gather(spheres);
    }

    /// Chooses the cells from the bounds of the centres.
    fn raster(&mut self, spheres: &[Sphere]) {
        let members = || self.order.iter().map(|&k| &spheres[k as usize]);
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let mut largest = 0.0_f32;
        for sphere in members() {
            (low, high) = (low.min(sphere.center), high.max(sphere.center));
            largest = largest.max(sphere.radius);
        }
        let extent = (high - low).max(Vec3::splat(f32::MIN_POSITIVE));
        let most = (self.order.len() as f32 * CELLS_PER_SPHERE).max(1.0);
        let mut edge = (2.0 * EDGE * largest).max(extent.max_element() / 1024.0);
        let count = |edge: f32| (extent / edge).floor() + Vec3::ONE;
        while count(edge).element_product() > most {
            edge *= 1.1;
        }
        (self.origin, self.per_edge, self.largest) = (low, 1.0 / edge, largest);
        self.cells = count(edge).as_uvec3();
    }

    /// The cell of a point; what lies outside belongs to the border, which keeps neighbours neighbours.
    #[inline(always)]
    fn cell(&self, point: Vec3) -> UVec3 {
        let cell = ((point - self.origin) * self.per_edge).max(Vec3::ZERO);
        cell.as_uvec3().min(self.cells - UVec3::ONE)
    }

    #[inline(always)]
    fn key(&self, cell: UVec3) -> u32 {
        (cell.z * self.cells.y + cell.y) * self.cells.x + cell.x
    }

    fn gather(&mut self, spheres: &[Sphere]) {
        for column in [&mut self.x, &mut self.y, &mut self.z, &mut self.r] {
            column.clear();
        }
        for &k in &self.order {
            let Sphere { center, radius } = spheres[k as usize];
            self.x.push(center.x);
            self.y.push(center.y);
            self.z.push(center.z);
            self.r.push(radius);
        }
        for column in [&mut self.x, &mut self.y, &mut self.z, &mut self.r] {
            column.resize(self.order.len() + LANES, f32::NAN);
        }
    }

    /// All pairs within the class: each sphere with those behind it in its row of cells, and with the rows that
    /// come after its own.
    #[inline(always)]
    pub(super) fn pairs_within(&self, pairs: &mut Vec<Pair>) {
        for at in 0..self.order.len() {
            let sphere = self.at(at);
            let (low, high) = self.around(&sphere);
            let own = self.cell(sphere.center);
            for z in own.z..=high.z {
                let first = if z == own.z { own.y } else { low.y };
                for y in first..=high.y {
                    let own_row = z == own.z && y == own.y;
                    let run = self.run(y, z, low.x, high.x);
                    let run = if own_row { at + 1..run.end } else { run };
                    self.compare(&sphere, self.order[at], run, pairs);
                }
            }
        }
    }

    /// All pairs of this class with the spheres of a finer one.
    #[inline(always)]
    pub(super) fn pairs_with(&self, finer: &Self, pairs: &mut Vec<Pair>) {
        for at in 0..finer.order.len() {
            let sphere = finer.at(at);
            let (low, high) = self.around(&sphere);
            for z in low.z..=high.z {
                for y in low.y..=high.y {
                    self.compare(&sphere, finer.order[at], self.run(y, z, low.x, high.x), pairs);
                }
            }
        }
    }

    #[inline(always)]
    fn at(&self, at: usize) -> Sphere {
        Sphere::new([self.x[at], self.y[at], self.z[at]], self.r[at])
    }

    /// The cells in which centres of this class that the sphere touches lie.
    #[inline(always)]
    fn around(&self, sphere: &Sphere) -> (UVec3, UVec3) {
        // More than all rounding, here and in the cell of a centre.
        let reach = (sphere.radius + self.largest) * 1.0001 + sphere.center.abs().max_element() * 4e-7;
        let reach = Vec3::splat(reach);
        (self.cell(sphere.center - reach), self.cell(sphere.center + reach))
    }

    #[inline(always)]
    fn run(&self, y: u32, z: u32, low: u32, high: u32) -> std::ops::Range<usize> {
        let row = (z * self.cells.y + y) * self.cells.x;
        self.starts[(row + low) as usize] as usize..self.starts[(row + high) as usize + 1] as usize
    }

    /// Compares a sphere with a run of this class, `LANES` at a time.
    #[inline(always)]
    fn compare(&self, sphere: &Sphere, index: u32, run: std::ops::Range<usize>, pairs: &mut Vec<Pair>) {
        let mut from = run.start;
        while from < run.end {
            let mut near = self.near(sphere, from);
            let left = run.end - from;
            if left < LANES {
                near &= (1 << left) - 1;
            }
            while near != 0 {
                let place = from + near.trailing_zeros() as usize;
                if touch(sphere, &self.at(place)) {
                    pairs.push(Pair::new(index, self.order[place]));
                }
                near &= near - 1;
            }
            from += LANES;
        }
    }

    /// Which of the `LANES` spheres from `from` on touch, give or take rounding.
    #[inline(always)]
    fn near(&self, sphere: &Sphere, from: usize) -> u32 {
        let lanes = from..from + LANES;
        let (x, y) = (&self.x[lanes.clone()], &self.y[lanes.clone()]);
        let (z, r) = (&self.z[lanes.clone()], &self.r[lanes]);
        let mut near = [false; LANES];
        for k in 0..LANES {
            let (dx, dy, dz) = (x[k] - sphere.center.x, y[k] - sphere.center.y, z[k] - sphere.center.z);
            let reach = r[k] + sphere.radius;
            near[k] = dx * dx + dy * dy + dz * dz <= reach * reach * 1.000_01;
        }
        let mut mask = 0;
        for (k, &hit) in near.iter().enumerate() {
            mask |= u32::from(hit) << k;
        }
        mask
    }
}
