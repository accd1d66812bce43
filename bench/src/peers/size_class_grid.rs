use glam::{UVec3, Vec3};
use lazygrid::{Pair, Sphere};

use super::touch;

/// Searched distance over the largest diameter, above 1, so that rounding never skips a cell.
const MARGIN: f32 = 1.01;
/// Smallest cell size over the largest diameter.
const MIN_CELL_RATIO: f32 = 0.25;
/// Maximum number of cells per sphere, which limits empty cells in sparse scenes.
const CELLS_PER_SPHERE: f32 = 4.0;
/// Maximum number of rows of cells searched after a sphere's own row: the smallest cells require five cells in each
/// direction, 11 along each axis.
const ROWS: usize = 5 + 5 * 11;
/// Number of `f32` in an AVX2 vector.
const LANES: usize = 8;

#[derive(Default)]
pub(super) struct SizeClassGrid {
    pub(super) order: Vec<u32>,
    /// Values in cell order, with `LANES` more for full vectors.
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
    r: Vec<f32>,
    /// First sphere of each cell. Layers of empty cells surround the grid, so each cell has all its
    /// neighbors.
    starts: Vec<u32>,
    /// Largest distance of cells of touching spheres, and the number of empty layers.
    stencil_radius: u32,
    /// Spheres in the order of the previous step.
    members: Vec<Sphere>,
    keys: Vec<u32>,
    sorted: Vec<u32>,
    origin: Vec3,
    cells_per_length: f32,
    cells: UVec3,
    largest: f32,
}

impl SizeClassGrid {
    #[inline(always)]
    pub(super) fn build(&mut self, spheres: &[Sphere], cell_ratio: f32) {
        self.members.clear();
        self.members.extend(self.order.iter().map(|&k| spheres[k as usize]));
        self.grid(cell_ratio);
        let cells = self.cells.element_product() as usize;
        self.starts.clear();
        self.starts.resize(cells + 1, 0);
        self.keys.clear();
        for sphere in &self.members {
            let key = self.key(self.cell(sphere.center));
            self.keys.push(key);
            self.starts[key as usize] += 1;
        }
        // Turns counts into ends. Filling a cell from the back moves its end down to its start.
        let mut end = 0;
        for start in &mut self.starts {
            end += *start;
            *start = end;
        }
        self.scatter();
    }

    #[inline(always)]
    fn grid(&mut self, cell_ratio: f32) {
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let mut largest = 0.0_f32;
        for sphere in &self.members {
            (low, high) = (low.min(sphere.center), high.max(sphere.center));
            largest = largest.max(sphere.radius);
        }
        let extent = (high - low).max(Vec3::splat(f32::MIN_POSITIVE));
        let far = low.abs().max(high.abs()).max_element();
        let most = (self.members.len() as f32 * CELLS_PER_SPHERE).max(27.0);
        let rounding = far * 1e-6;
        let diameter = 2.0 * MARGIN * largest + rounding;
        let cell_size = 2.0 * cell_ratio.max(MIN_CELL_RATIO) * largest + rounding;
        let mut cell_size = cell_size.max(extent.max_element() / 1024.0);
        let stencil_radius = |cell_size: f32| (diameter / cell_size).ceil().max(1.0);
        let count = |cell_size: f32| {
            (extent / cell_size).floor() + Vec3::splat(1.0 + 2.0 * stencil_radius(cell_size))
        };
        while count(cell_size).element_product() > most {
            cell_size *= 1.1;
        }
        (self.origin, self.cells_per_length, self.largest) = (low, 1.0 / cell_size, largest);
        (self.cells, self.stencil_radius) = (count(cell_size).as_uvec3(), stencil_radius(cell_size) as u32);
    }

    /// Points outside belong to the border cells, which preserves adjacency.
    #[inline(always)]
    fn cell(&self, point: Vec3) -> UVec3 {
        // Negative values saturate to 0.
        let cell = ((point - self.origin) * self.cells_per_length).as_uvec3();
        cell.min(self.cells - UVec3::splat(1 + 2 * self.stencil_radius)) + UVec3::splat(self.stencil_radius)
    }

    #[inline(always)]
    fn key(&self, cell: UVec3) -> u32 {
        (cell.z * self.cells.y + cell.y) * self.cells.x + cell.x
    }

    #[inline(always)]
    fn scatter(&mut self) {
        let n = self.members.len();
        for column in [&mut self.x, &mut self.y, &mut self.z, &mut self.r] {
            column.resize(n + LANES, 0.0);
        }
        self.sorted.resize(n, 0);
        for (k, sphere) in self.members.iter().enumerate().rev() {
            let end = &mut self.starts[self.keys[k] as usize];
            *end -= 1;
            let at = *end as usize;
            (self.x[at], self.y[at], self.z[at]) = sphere.center.into();
            self.r[at] = sphere.radius;
            self.sorted[at] = self.order[k];
        }
        std::mem::swap(&mut self.order, &mut self.sorted);
    }

    /// Compares each sphere with later spheres in its row and in the adjacent rows after it.
    #[inline(always)]
    pub(super) fn pairs_within(&self, pairs: &mut Vec<Pair>) {
        let stencil_radius = self.stencil_radius as usize;
        let row = self.cells.x as usize;
        let layer = row * self.cells.y as usize;
        let mut ahead = [0; ROWS];
        let mut count = 0;
        for z in 0..=stencil_radius {
            for y in if z == 0 { stencil_radius + 1 } else { 0 }..=2 * stencil_radius {
                ahead[count] = z * layer + y * row - stencil_radius * row;
                count += 1;
            }
        }
        for cell in stencil_radius * layer..self.starts.len() - 1 - stencil_radius * layer {
            let members = self.starts[cell] as usize..self.starts[cell + 1] as usize;
            if members.is_empty() {
                continue;
            }
            let end = self.starts[cell + stencil_radius + 1] as usize;
            let mut runs = [(0, 0); ROWS];
            for (run, ahead) in runs.iter_mut().zip(&ahead[..count]) {
                let middle = cell + ahead;
                *run = (
                    self.starts[middle - stencil_radius] as usize,
                    self.starts[middle + stencil_radius + 1] as usize,
                );
            }
            for at in members {
                let (sphere, index) = (self.at(at), self.order[at]);
                self.compare(&sphere, index, at + 1..end, pairs);
                for &(start, end) in &runs[..count] {
                    self.compare(&sphere, index, start..end, pairs);
                }
            }
        }
    }

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

    #[inline(always)]
    fn around(&self, sphere: &Sphere) -> (UVec3, UVec3) {
        // Larger than all rounding errors, here and in the cell of a center.
        let cutoff = (sphere.radius + self.largest) * 1.0001 + sphere.center.abs().max_element() * 4e-7;
        let cutoff = Vec3::splat(cutoff);
        (self.cell(sphere.center - cutoff), self.cell(sphere.center + cutoff))
    }

    #[inline(always)]
    fn run(&self, y: u32, z: u32, low: u32, high: u32) -> std::ops::Range<usize> {
        let row = (z * self.cells.y + y) * self.cells.x;
        self.starts[(row + low) as usize] as usize..self.starts[(row + high) as usize + 1] as usize
    }

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
                let other = from + near.trailing_zeros() as usize;
                if touch(sphere, &self.at(other)) {
                    pairs.push(Pair::new(index, self.order[other]));
                }
                near &= near - 1;
            }
            from += LANES;
        }
    }

    /// Returns a mask of the spheres that touch, up to rounding.
    #[inline(always)]
    fn near(&self, sphere: &Sphere, from: usize) -> u32 {
        let lanes = from..from + LANES;
        let (x, y) = (&self.x[lanes.clone()], &self.y[lanes.clone()]);
        let (z, r) = (&self.z[lanes.clone()], &self.r[lanes]);
        // Closures of iterators would be compiled without the caller's wider vectors.
        let mut overlaps = [0.0; LANES];
        for k in 0..LANES {
            let (dx, dy, dz) = (x[k] - sphere.center.x, y[k] - sphere.center.y, z[k] - sphere.center.z);
            let cutoff = r[k] + sphere.radius;
            overlaps[k] = cutoff * cutoff * 1.000_01 - (dx * dx + dy * dy + dz * dz);
        }
        // A comparison per lane would compile to scalar code.
        let mut apart = 0;
        for (k, overlap) in overlaps.iter().enumerate() {
            apart |= (overlap.to_bits() >> 31) << k;
        }
        !apart & ((1 << LANES) - 1)
    }
}
