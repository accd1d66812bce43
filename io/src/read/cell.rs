use lazygrid::Space;

use crate::error::{Error, Location};

#[derive(Clone, Debug, PartialEq)]
pub(super) struct SimulationCell {
    pub(super) vectors: [[f64; 3]; 3],
    pub(super) periodic: [bool; 3],
}

const AXES: [&str; 3] = ["x", "y", "z"];

impl SimulationCell {
    /// For `doubles`, no component of a cell vector is negligible.
    pub(super) fn space(&self, location: &Location, doubles: bool) -> Result<Space, Error> {
        let mut lengths = [None; 3];
        for k in (0..3).filter(|&k| self.periodic[k]) {
            let vector = &self.vectors[k];
            let along = if *vector == [0.0; 3] { Some(k) } else { Self::axis_of(vector, doubles) };
            let Some(axis) = along.filter(|&axis| lengths[axis].is_none()) else {
                return self.triclinic_space(location);
            };
            let length = vector[axis].abs();
            let (value, rule) = match doubles {
                true => (length, "finite number"),
                false => (f64::from(length as f32), "32-bit number"),
            };
            if !(value.is_finite() && value > 0.0) {
                return Err(Error::BoxLength { location: location.clone(), axis: AXES[axis], length, rule });
            }
            lengths[axis] = Some(length);
        }
        Ok(Space::periodic(lengths).unwrap_or_default())
    }

    fn triclinic_space(&self, location: &Location) -> Result<Space, Error> {
        let repeats = |k: usize| self.periodic[k].then(|| self.vectors[k]);
        Space::triclinic([0, 1, 2].map(repeats))
            .map_err(|reason| Error::BoxVectors { location: location.clone(), reason: Box::new(reason) })
    }

    /// For `f32` spheres, ignores residues of rotations.
    fn axis_of(vector: &[f64; 3], doubles: bool) -> Option<usize> {
        const NEGLIGIBLE: f64 = 1.0 / (1 << 30) as f64;
        let longest = (0..3).max_by(|&a, &b| vector[a].abs().total_cmp(&vector[b].abs()))?;
        let others = (0..3).filter(|&axis| axis != longest).map(|axis| vector[axis].abs());
        let limit = if doubles { 0.0 } else { NEGLIGIBLE * vector[longest].abs() };
        (others.fold(0.0, f64::max) <= limit).then_some(longest)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::error::Position;

    fn space(vectors: [[f64; 3]; 3], periodic: [bool; 3]) -> Result<[Option<f64>; 3], String> {
        let location = Location { path: Path::new("a.xyz").into(), at: Position::Line(2) };
        let space = SimulationCell { vectors, periodic }.space(&location, false);
        space.map(|space| space.lengths()).map_err(|error| error.to_string())
    }

    #[test]
    fn cell_vectors_along_the_axes_are_lengths() {
        let (yes, no) = (true, false);
        let cube = [[4.0, 0.0, 0.0], [0.0, 5.0, 0.0], [0.0, 0.0, 6.0]];
        assert_eq!(space(cube, [yes; 3]), Ok([Some(4.0), Some(5.0), Some(6.0)]));
        assert_eq!(space(cube, [yes, no, yes]), Ok([Some(4.0), None, Some(6.0)]));
        assert_eq!(space(cube, [no; 3]), Ok([None; 3]));
        let rotated = [[0.0, 4.0, 2.4e-16], [-5.0, 0.0, 0.0], [0.0, 0.0, 6.0]];
        assert_eq!(space(rotated, [yes; 3]), Ok([Some(5.0), Some(4.0), Some(6.0)]));
        let skewed = [[4.0, 0.0, 0.0], [0.0, 5.0, 0.0], [1.0, 2.0, 6.0]];
        assert_eq!(space(skewed, [yes, yes, no]), Ok([Some(4.0), Some(5.0), None]));
    }

    #[test]
    fn tilted_cell_vectors_stay_unchanged() {
        let location = Location { path: Path::new("a.xyz").into(), at: Position::Line(2) };
        let vectors = [[4.0, 0.0, 0.0], [1.5, 5.0, 0.0], [0.0, 1.0, 6.0]];
        let space = |periodic| SimulationCell { vectors, periodic }.space(&location, false).unwrap();
        let expected = vectors.map(Some);
        assert_eq!(space([true; 3]).cell_vectors(), expected);
        assert_eq!(space([false, true, true]).cell_vectors(), [None, expected[1], expected[2]]);
        assert!(space([true, false, false]).triclinic_cell().is_none());
    }

    #[test]
    fn invalid_boxes_are_refused() {
        let flat = space([[4.0, 0.0, 0.0], [5.0, 0.0, 0.0], [0.0, 0.0, 6.0]], [true; 3]).unwrap_err();
        assert!(
            flat.starts_with(
                "a.xyz, line 2: the box cannot be periodic: the cell vectors (4, 0, 0), (5, 0, 0)"
            ),
            "{flat}"
        );
        assert!(flat.contains("--periodic none"), "{flat}");
        for (length, shown) in [(0.0, "0"), (1e39, "1e39")] {
            let flat = space([[4.0, 0.0, 0.0], [0.0, 5.0, 0.0], [0.0, 0.0, length]], [true; 3]);
            assert_eq!(
                flat.unwrap_err(),
                format!(
                    "a.xyz, line 2: the box is periodic along z and its length there is {shown}, no 32-bit number \
                     above zero; give lengths with --periodic X,Y,Z, or take space as unbounded with --periodic none"
                )
            );
        }
    }
}
