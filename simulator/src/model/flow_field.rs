//! A flow with velocities on a regular grid, interpolated linearly along each axis. Outside, the velocity is that of
//! the nearest point.

use std::fmt;

use crate::Error;
use crate::checksum::Digest;

#[derive(Clone, PartialEq)]
pub struct FlowField {
    origin: [f64; 3],
    spacing: [f64; 3],
    points: [usize; 3],
    /// Three components per point in µm/s, z fastest.
    velocities: Vec<f32>,
    checksum: u64,
    /// Largest absolute component along each axis, in µm/s.
    fastest: [f64; 3],
    /// Largest change of a component between neighboring points, in 1/s.
    steepest: f64,
}

impl FlowField {
    pub(crate) const BYTES_PER_POINT: u64 = 3 * size_of::<f32>() as u64;

    /// Creates a field from the first point and the spacing in µm, and velocities in µm/s: three components per point,
    /// z fastest, x slowest.
    ///
    /// # Errors
    /// [`Error::Model`] if the number of velocities, the spacing or a velocity is invalid.
    pub fn new(
        [origin, spacing]: [[f64; 3]; 2],
        points: [usize; 3],
        velocities: Vec<f32>,
    ) -> Result<Self, Error> {
        let fault = |message: String| Err(Error::Model(format!("the flow field {message}")));
        let count = points.iter().try_fold(3_usize, |count, &n| count.checked_mul(n));
        if points.contains(&0) || count != Some(velocities.len()) {
            let found = velocities.len();
            return fault(format!("has {points:?} points and {found} numbers; give three for each point"));
        }
        if !origin.iter().all(|x| x.is_finite()) || !spacing.iter().all(|h| h.is_finite() && *h > 0.0) {
            return fault(format!(
                "begins at {origin:?} with a spacing of {spacing:?}; make the origin finite and the spacing positive"
            ));
        }
        if let Some(at) = velocities.iter().position(|v| !v.is_finite()) {
            let (point, value) = (at / 3, velocities[at]);
            return fault(format!("has the velocity {value} at point {point}; give finite velocities"));
        }
        let mut field =
            Self { origin, spacing, points, velocities, checksum: 0, fastest: [0.0; 3], steepest: 0.0 };
        field.checksum = field.digest();
        field.measure();
        Ok(field)
    }

    fn digest(&self) -> u64 {
        let mut digest = Digest::new();
        self.points.iter().for_each(|&n| digest.add(&(n as u64).to_le_bytes()));
        for chunk in self.velocities.chunks(4096) {
            digest.add(&chunk.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<_>>());
        }
        digest.checksum()
    }

    fn measure(&mut self) {
        for velocity in self.velocities.chunks_exact(3) {
            for (fastest, &v) in self.fastest.iter_mut().zip(velocity) {
                *fastest = fastest.max(f64::from(v).abs());
            }
        }
        let [_, ny, nz] = self.points;
        let strides = [3 * ny * nz, 3 * nz, 3];
        for (axis, stride) in strides.into_iter().enumerate() {
            let is_last = |at: usize| at / stride % self.points[axis] == self.points[axis] - 1;
            let ends = (0..self.velocities.len()).filter(|&at| !is_last(at));
            let change = |at: usize| f64::from(self.velocities[at + stride]) - f64::from(self.velocities[at]);
            let max_change = ends.map(|at| change(at).abs()).fold(0.0, f64::max);
            self.steepest = self.steepest.max(max_change / self.spacing[axis]);
        }
    }

    pub fn checksum(&self) -> u64 {
        self.checksum
    }

    pub(crate) fn fastest(&self) -> [f64; 3] {
        self.fastest
    }

    pub(crate) fn steepest(&self) -> f64 {
        self.steepest
    }

    /// Returns the first and the last point and the spacing, in µm; `None` for one point.
    pub(crate) fn extent(&self, axis: usize) -> Option<[f64; 3]> {
        let (first, spacing) = (self.origin[axis], self.spacing[axis]);
        let last = first + (self.points[axis] - 1) as f64 * spacing;
        (self.points[axis] > 1).then_some([first, last, spacing])
    }

    /// Returns the first point and the spacing, in µm, and the numbers of points.
    #[cfg(feature = "gpu")]
    pub(crate) fn grid(&self) -> ([[f64; 3]; 2], [usize; 3]) {
        ([self.origin, self.spacing], self.points)
    }

    #[cfg(feature = "gpu")]
    pub(crate) fn velocities(&self) -> &[[f32; 3]] {
        bytemuck::cast_slice(&self.velocities)
    }

    /// Returns a velocity in µm/s.
    pub fn at(&self, point: [f32; 3]) -> [f64; 3] {
        let cells: [_; 3] = std::array::from_fn(|axis| self.cell(axis, point[axis]));
        let mut sum = [0.0; 3];
        for corner in 0..8_usize {
            let mut weight = 1.0;
            let mut index = 0;
            for (axis, (first, fraction)) in cells.into_iter().enumerate() {
                let upper = corner >> axis & 1;
                weight *= if upper == 1 { fraction } else { 1.0 - fraction };
                index = index * self.points[axis] + (first + upper).min(self.points[axis] - 1);
            }
            let velocity = &self.velocities[3 * index..3 * index + 3];
            for (sum, &v) in sum.iter_mut().zip(velocity) {
                *sum += weight * f64::from(v);
            }
        }
        sum
    }

    /// Returns the index of the previous point, and the fraction of the distance to the next.
    fn cell(&self, axis: usize, x: f32) -> (usize, f64) {
        let last = self.points[axis] - 1;
        let at = ((f64::from(x) - self.origin[axis]) / self.spacing[axis]).clamp(0.0, last as f64);
        let first = (at as usize).min(last.saturating_sub(1));
        (first, at - first as f64)
    }
}

/// Omits the velocities, which may be millions, for their checksum.
impl fmt::Debug for FlowField {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("FlowField")
            .field("origin", &self.origin)
            .field("spacing", &self.spacing)
            .field("points", &self.points)
            .field("checksum", &self.checksum)
            .finish()
    }
}

#[cfg(test)]
mod tests;
