//! Distances in spaces whose edges lean, by looking at images one after the other: what judges detectors there.

use glam::{DMat3, DVec3};
use lazygrid::Space;

/// The edges of a space as they were given, and nothing that the library makes of them.
pub(crate) struct Images {
    /// The longest first. Along the last one no loop is needed.
    edges: Vec<DVec3>,
    /// For each edge what gives the part of it that a vector has.
    fractions: Vec<DVec3>,
}

impl Images {
    pub(crate) fn of(space: &Space) -> Self {
        let mut edges: Vec<DVec3> = space.edges().into_iter().flatten().map(|edge| edge.as_dvec3()).collect();
        edges.sort_by(|a, b| b.length_squared().total_cmp(&a.length_squared()));
        let fractions = fractions(&edges);
        Self { edges, fractions }
    }

    /// The least squared length of this vector and all its images, with an infinite `reach`. With another it may be that of any
    /// image within reach, and where there is none, of any at all.
    ///
    /// What is in reach has no more of an edge than as many times the height across the other edges as fit the reach.
    pub(crate) fn distance_squared(&self, apart: DVec3, reach: f64) -> f64 {
        let turns = self.edges.iter().zip(&self.fractions).map(|(edge, row)| *edge * row.dot(apart).round());
        // All turns at once, between which the last bits of a small distance would be lost.
        let folded = apart - turns.sum::<DVec3>();
        // With a reach beyond that, one look is enough.
        if reach.is_finite() && folded.length() <= reach {
            return folded.length_squared();
        }
        // No image is farther away along the edges than this one is.
        let along = self.edges.iter().zip(&self.fractions).map(|(edge, row)| *edge * row.dot(folded));
        let looked_at = reach.min(along.sum::<DVec3>().length());
        let turns = self.fractions.iter().map(|row| {
            let (part, most) = (row.dot(folded), looked_at * row.length() + 1e-6);
            [(-part - most).ceil() as i32, (-part + most).floor() as i32]
        });
        nearest(folded, &self.edges, &turns.collect::<Vec<_>>())
    }
}

/// The least squared length of the vector and these turns of each edge. Along the last edge that is where the parabola has
/// its least, or beside it.
fn nearest(vector: DVec3, edges: &[DVec3], turns: &[[i32; 2]]) -> f64 {
    match (edges, turns) {
        ([edge], [_]) => {
            let least = (-vector.dot(*edge) / edge.length_squared()).round();
            [-1.0, 0.0, 1.0]
                .map(|beside| (vector + *edge * (least + beside)).length_squared())
                .into_iter()
                .fold(f64::INFINITY, f64::min)
        }
        ([edge, edges @ ..], [[from, to], turns @ ..]) => (*from..=*to)
            .map(|turn| nearest(vector + *edge * f64::from(turn), edges, turns))
            .fold(f64::INFINITY, f64::min),
        _ => vector.length_squared(),
    }
}

/// For each edge what gives the part of it that a vector has: across the other edges, and within the plane or the line of
/// all of them.
fn fractions(edges: &[DVec3]) -> Vec<DVec3> {
    match *edges {
        [a] => vec![a / a.length_squared()],
        [a, b] => {
            let across = |a: DVec3, b: DVec3| a - b * (a.dot(b) / b.length_squared());
            let row = |of: DVec3, other: DVec3| across(of, other) / across(of, other).dot(of);
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
    use glam::Vec3;

    use super::*;

    #[test]
    fn distances_by_hand() {
        let of =
            |edges: [Option<Vec3>; 3]| Images::of(&Space::sheared(edges).expect("edges that span a box"));
        let at = |images: &Images, x, y, z| images.distance_squared(DVec3::new(x, y, z), 1.5);
        let leaning = of([Some(Vec3::X * 4.0), Some(Vec3::new(1.5, 3.0, 0.0)), None]);
        assert_eq!(at(&leaning, 1.5, 3.0, 0.0), 0.0);
        assert_eq!(at(&leaning, 1.5, 2.0, 0.5), 1.25);
        assert_eq!(at(&leaning, 4000.0 - 15.0, -30.0 + 1.0, 0.0), 1.0);
        assert!(at(&leaning, 0.0, 0.0, 3.0) > 2.25);
        // A box that leans by more than it is long has the images of one that leans less.
        let far = of([Some(Vec3::X * 4.0), Some(Vec3::new(1.5 + 40.0, 3.0, 0.0)), None]);
        for k in 0..50 {
            let [x, y] = [0.61 * f64::from(k), 0.37 * f64::from(k)];
            let [one, other] = [&leaning, &far].map(|images| at(images, x, y, 0.0));
            assert!((one - other).abs() < 1e-9 || one.min(other) > 2.25, "{one} {other}");
        }
        // The nearest of all, not only the first look.
        let flat = of([Some(Vec3::X * 0.5), Some(Vec3::new(1.375, 1.0, 0.0)), None]);
        let apart = DVec3::new(-0.25, 2.75, 0.25);
        assert_eq!(flat.distance_squared(apart, f64::INFINITY), 0.140625);
        let line = of([None, Some(Vec3::new(3.0, 4.0, 0.0)), None]);
        assert_eq!(at(&line, 6.0, 8.0, 1.0), 1.0);
    }
}
