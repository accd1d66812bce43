//! Distances in triclinic cells without the library's reduction.

use glam::{DMat3, DVec3};
use lazygrid::Space;

pub(crate) struct ImageOracle {
    cell_vectors: [Option<[f64; 3]>; 3],
    /// Cell vectors with their indices, the longest first. The search loops over all but the last.
    descending: Vec<(usize, DVec3)>,
    fractions: Vec<DVec3>,
}

impl ImageOracle {
    pub(crate) fn new(space: &Space) -> Self {
        let cell_vectors = space.cell_vectors();
        let numbered = cell_vectors.into_iter().enumerate();
        let mut descending: Vec<_> =
            numbered.filter_map(|(k, vector)| vector.map(|vector| (k, DVec3::from(vector)))).collect();
        descending.sort_by(|(_, a), (_, b)| b.length_squared().total_cmp(&a.length_squared()));
        let fractions = fractions(&descending.iter().map(|(_, vector)| *vector).collect::<Vec<_>>());
        Self { cell_vectors, descending, fractions }
    }

    /// Products of a vector with these rows are fractional coordinates.
    pub(crate) fn fractions(&self) -> &[DVec3] {
        &self.fractions
    }

    /// Returns the smallest squared length of `apart` and its images. For a finite `cutoff`, returns the
    /// squared length of any image within `cutoff`, or any larger value if no image is.
    ///
    /// An image within `cutoff` has a fractional coordinate of at most `cutoff` over the height of the cell
    /// along that vector.
    pub(crate) fn distance_squared(&self, apart: DVec3, cutoff: f64) -> f64 {
        let mut shift = [0.0; 3];
        for ((k, _), row) in self.descending.iter().zip(&self.fractions) {
            shift[*k] = -row.dot(apart).round();
        }
        let folded = self.image(apart, shift);
        // Not by the length: if it rounds to `cutoff`, another image may be the one within.
        if squared(folded) <= cutoff * cutoff && cutoff.is_finite() {
            return squared(folded);
        }
        // The folded image bounds the search: the nearest is no longer.
        let along =
            self.descending.iter().zip(&self.fractions).map(|((_, vector), row)| *vector * row.dot(folded));
        let limit = cutoff.min(along.sum::<DVec3>().length());
        let mut shifts = [[0; 2]; 3];
        for (range, row) in shifts.iter_mut().zip(&self.fractions) {
            let (coordinate, most) = (row.dot(folded), limit * row.length() + 1e-6);
            *range = [(-coordinate - most).ceil() as i32, (-coordinate + most).floor() as i32];
        }
        self.nearest(apart, shift, folded, &shifts[..self.descending.len()])
    }

    /// Rounds as the library documents.
    fn image(&self, vector: DVec3, shift: [f64; 3]) -> DVec3 {
        let component = |axis: usize| {
            let terms = [0, 1, 2].map(|k| self.cell_vectors[k].map_or(0.0, |vector| shift[k] * vector[axis]));
            vector[axis] + (terms[0] + terms[1] + terms[2])
        };
        DVec3::new(component(0), component(1), component(2))
    }

    /// Returns the smallest squared length of images that differ from `shift` by `shifts` along the remaining
    /// vectors. `near` approximates the image at `shift`. Along the last vector, the integer nearest to the
    /// minimum of the parabola and its two neighbors suffice.
    fn nearest(&self, vector: DVec3, shift: [f64; 3], near: DVec3, shifts: &[[i32; 2]]) -> f64 {
        let at = self.descending.len() - shifts.len();
        let Some((k, cell_vector)) = self.descending.get(at) else {
            return squared(self.image(vector, shift));
        };
        let shifted = |by: f64| {
            let mut shift = shift;
            shift[*k] += by;
            shift
        };
        match shifts {
            [[from, to], shifts @ ..] if !shifts.is_empty() => (*from..=*to)
                .map(f64::from)
                .map(|by| self.nearest(vector, shifted(by), near + *cell_vector * by, shifts))
                .fold(f64::INFINITY, f64::min),
            _ => {
                let least = (-near.dot(*cell_vector) / cell_vector.length_squared()).round();
                let offset = [-1.0, 0.0, 1.0].map(|offset| self.image(vector, shifted(least + offset)));
                offset.into_iter().map(squared).fold(f64::INFINITY, f64::min)
            }
        }
    }
}

fn squared(vector: DVec3) -> f64 {
    vector.x * vector.x + vector.y * vector.y + vector.z * vector.z
}

/// Returns the inverse matrix, or its pseudoinverse within a plane or line.
fn fractions(vectors: &[DVec3]) -> Vec<DVec3> {
    match *vectors {
        [a] => vec![a / a.length_squared()],
        [a, b] => {
            let across = |a: DVec3, b: DVec3| a - b * (a.dot(b) / b.length_squared());
            let row = |vector: DVec3, other: DVec3| across(vector, other) / across(vector, other).dot(vector);
            vec![row(a, b), row(b, a)]
        }
        [a, b, c] => {
            let inverse = DMat3::from_cols(a, b, c).inverse().transpose();
            vec![inverse.x_axis, inverse.y_axis, inverse.z_axis]
        }
        _ => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn image_distances_match_known_values() {
        let oracle = |vectors: [Option<DVec3>; 3]| {
            let vectors = vectors.map(|vector| vector.map(|vector| vector.to_array()));
            ImageOracle::new(&Space::triclinic(vectors).expect("linearly independent vectors"))
        };
        let at = |images: &ImageOracle, x, y, z| images.distance_squared(DVec3::new(x, y, z), 1.5);
        let triclinic = oracle([Some(DVec3::X * 4.0), Some(DVec3::new(1.5, 3.0, 0.0)), None]);
        assert_eq!(at(&triclinic, 1.5, 3.0, 0.0), 0.0);
        assert_eq!(at(&triclinic, 1.5, 2.0, 0.5), 1.25);
        assert_eq!(at(&triclinic, 4000.0 - 15.0, -30.0 + 1.0, 0.0), 1.0);
        assert!(at(&triclinic, 0.0, 0.0, 3.0) > 2.25);
        let far = oracle([Some(DVec3::X * 4.0), Some(DVec3::new(1.5 + 40.0, 3.0, 0.0)), None]);
        for k in 0..50 {
            let [x, y] = [0.61 * f64::from(k), 0.37 * f64::from(k)];
            let [one, other] = [&triclinic, &far].map(|images| at(images, x, y, 0.0));
            assert!((one - other).abs() < 1e-9 || one.min(other) > 2.25, "{one} {other}");
        }
        let flat = oracle([Some(DVec3::X * 0.5), Some(DVec3::new(1.375, 1.0, 0.0)), None]);
        let apart = DVec3::new(-0.25, 2.75, 0.25);
        assert_eq!(flat.distance_squared(apart, f64::INFINITY), 0.140625);
        // The nearest image in each direction alone is beyond the cutoff by rounding, another one is within.
        let skewed = oracle([
            Some(DVec3::new(1.0000000359391298e-36, 0.0, 0.0)),
            Some(DVec3::new(0.0, 6.999999982524604e-36, 0.0)),
            Some(DVec3::new(-5.000000179695649e-37, 1.5000000987502456e-36, 2.5000000450062737e-36)),
        ]);
        let [one, other] = [[-1e-36_f32, 5.2500003e-36, 1.75e-36], [-1.5000001e-36, 4e-36, -5.75e-36]];
        let apart = DVec3::from_array(std::array::from_fn(|k| f64::from(one[k]) - f64::from(other[k])));
        let cutoff = f64::from(1.5000001e-36_f32) + f64::from(1.75e-36_f32);
        assert!(skewed.distance_squared(apart, cutoff) < 0.95 * cutoff * cutoff);
        let line = oracle([None, Some(DVec3::new(3.0, 4.0, 0.0)), None]);
        assert_eq!(at(&line, 6.0, 8.0, 1.0), 1.0);
    }
}
