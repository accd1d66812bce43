mod difference;
mod exclusions;
mod images;
mod shrink;

use lazygrid::{Config, InputError, Interaction, Interactions, Pair, Query, Space, Sphere, Spheres};

pub(crate) use images::ImageOracle;

pub use difference::{Tolerance, checksum, difference};
pub use exclusions::{EXCLUSION_WORDS, ExclusionCase};
pub use shrink::shrink;

#[derive(Clone, Debug, Default, PartialEq)]
pub struct TestInput {
    pub spheres: Vec<Sphere>,
    pub space: Space,
    /// `None` if all touching spheres pair.
    pub mixture: Option<SpeciesSetup>,
    pub groups: Option<Vec<u32>>,
    pub excluded: Option<ExclusionCase>,
}

#[derive(Clone, Debug, PartialEq)]
pub struct SpeciesSetup {
    pub species: Vec<u32>,
    /// Lower triangle: `rows[a][b]` for `b ≤ a`.
    pub rows: Vec<Vec<Interaction>>,
}

impl SpeciesSetup {
    fn between(&self, a: u32, b: u32) -> Interaction {
        self.rows[a.max(b) as usize][a.min(b) as usize]
    }

    pub fn interactions(&self) -> Result<Interactions, InputError> {
        let mut table = Interactions::new(self.rows.len() as u32, Interaction::Never)?;
        for (a, row) in self.rows.iter().enumerate() {
            for (b, &interaction) in row.iter().enumerate() {
                table.set(a as u32, b as u32, interaction)?;
            }
        }
        Ok(table)
    }
}

impl From<Vec<Sphere>> for TestInput {
    fn from(spheres: Vec<Sphere>) -> Self {
        Self { spheres, ..Self::default() }
    }
}

impl TestInput {
    pub fn query(&self) -> Query<'_> {
        let query = Query::new(self.view());
        self.excluded.as_ref().map_or(query, |excluded| query.without(excluded.list()))
    }

    pub fn view(&self) -> Spheres<'_> {
        let mut spheres = Spheres::from(&self.spheres);
        if let Some(mixture) = &self.mixture {
            spheres = spheres.with_species(&mixture.species).unwrap_or(spheres);
        }
        if let Some(groups) = &self.groups {
            spheres = spheres.with_groups(groups).unwrap_or(spheres);
        }
        spheres
    }

    pub fn interactions(&self) -> Result<Option<Interactions>, InputError> {
        self.mixture.as_ref().map(SpeciesSetup::interactions).transpose()
    }

    pub fn config(&self, config: Config) -> Result<Config, InputError> {
        let config = if self.space.is_periodic() { config.space(self.space) } else { config };
        Ok(match self.interactions()? {
            None => config,
            Some(table) => config.interactions(table),
        })
    }

    pub fn only(&self, mut keep: impl FnMut(usize) -> bool) -> Self {
        let retained: Vec<usize> = (0..self.spheres.len()).filter(|&k| keep(k)).collect();
        let mixture = self.mixture.as_ref().map(|mixture| SpeciesSetup {
            species: retained.iter().map(|&k| mixture.species[k]).collect(),
            rows: mixture.rows.clone(),
        });
        Self {
            spheres: retained.iter().map(|&k| self.spheres[k]).collect(),
            space: self.space,
            mixture,
            groups: self.groups.as_ref().map(|groups| retained.iter().map(|&k| groups[k]).collect()),
            excluded: self.excluded.as_ref().map(|excluded| excluded.only(&retained)),
        }
    }

    /// Returns `true` if the host filters the pairs that a device finds.
    pub fn is_refined(&self) -> bool {
        self.space.triclinic_cell().is_some() || self.groups.is_some() || self.excluded.is_some()
    }

    pub fn excludes(&self, i: usize, j: usize) -> bool {
        let of_one_group = |groups: &Vec<u32>| groups[i] == groups[j] && groups[i] != Spheres::NO_GROUP;
        self.groups.as_ref().is_some_and(of_one_group)
            || self.excluded.as_ref().is_some_and(|excluded| excluded.has(i as u32, j as u32))
    }

    /// `None` if the spheres never pair.
    pub fn cutoff(&self, i: usize, j: usize) -> Option<f64> {
        if self.excludes(i, j) {
            return None;
        }
        let interaction = match &self.mixture {
            None => Interaction::Touch,
            Some(mixture) => mixture.between(mixture.species[i], mixture.species[j]),
        };
        match interaction {
            Interaction::Never => None,
            Interaction::Touch => Some(f64::from(self.spheres[i].radius) + f64::from(self.spheres[j].radius)),
            Interaction::Within(distance) => Some(distance),
        }
    }

    pub fn distance_squared(&self, i: usize, j: usize) -> f64 {
        let (a, b) = (self.spheres[i].center, self.spheres[j].center);
        if self.space.triclinic_cell().is_some() {
            return ImageOracle::new(&self.space)
                .distance_squared(a.as_dvec3() - b.as_dvec3(), f64::INFINITY);
        }
        if self.space.is_periodic() {
            return self.space.distance_squared(a, b);
        }
        let (dx, dy, dz) = (subtract(a.x, b.x), subtract(a.y, b.y), subtract(a.z, b.z));
        dx * dx + dy * dy + dz * dz
    }

    /// Returns all pairs by definition.
    pub fn oracle(&self) -> Vec<Pair> {
        if self.space.triclinic_cell().is_none() {
            return self.pairs_by(|i, j, _| self.distance_squared(i, j));
        }
        let images = ImageOracle::new(&self.space);
        self.pairs_by(|i, j, cutoff| {
            let [a, b] = [i, j].map(|k| self.spheres[k].center.as_dvec3());
            images.distance_squared(a - b, cutoff)
        })
    }

    pub fn oracle_of_valid(&self) -> Vec<Pair> {
        let is_valid = |k: &usize| self.spheres[*k].is_valid();
        let ids: Vec<u32> = (0..self.spheres.len()).filter(is_valid).map(|k| k as u32).collect();
        let pairs = self.only(|k| is_valid(&k)).oracle().into_iter();
        pairs.map(|pair| Pair { i: ids[pair.i as usize], j: ids[pair.j as usize] }).collect()
    }

    /// Returns all pairs without code of [`Space`], by `d − L·round(d/L)` of coordinates that are wrapped
    /// without rounding.
    pub fn rounding_oracle(&self) -> Vec<Pair> {
        let lengths = self.space.lengths();
        self.pairs_by(|i, j, _| {
            let (a, b) = (self.spheres[i].center, self.spheres[j].center);
            (0..3).fold(0.0, |sum, axis| {
                let (a, b) = (f64::from(a[axis]), f64::from(b[axis]));
                let d = match lengths[axis] {
                    Some(length) => {
                        let d = a % length - b % length;
                        d - length * (d / length).round()
                    }
                    None => a - b,
                };
                sum + d * d
            })
        })
    }

    /// Returns all pairs. `apart` may return any larger squared distance beyond the given cutoff.
    pub fn pairs_by(&self, apart: impl Fn(usize, usize, f64) -> f64) -> Vec<Pair> {
        let mut pairs = Vec::new();
        for i in 0..self.spheres.len() {
            for j in i + 1..self.spheres.len() {
                if self.cutoff(i, j).is_some_and(|cutoff| apart(i, j, cutoff) <= cutoff * cutoff) {
                    pairs.push(Pair { i: i as u32, j: j as u32 });
                }
            }
        }
        pairs
    }
}

fn subtract(a: f32, b: f32) -> f64 {
    f64::from(a) - f64::from(b)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pairs(spheres: &[[f32; 4]]) -> Vec<(u32, u32)> {
        let scenario = TestInput::from(spheres.iter().map(|&s| s.into()).collect::<Vec<_>>());
        scenario.oracle().iter().map(|p| (p.i, p.j)).collect()
    }

    #[test]
    fn oracle_matches_known_values() {
        assert_eq!(pairs(&[]), []);
        assert_eq!(pairs(&[[0.0, 0.0, 0.0, 1.0]]), []);
        let touching = [[0.0, 0.0, 0.0, 1.0], [3.0, 4.0, 0.0, 4.0], [0.0, 0.0, -1.5, 0.25]];
        assert_eq!(pairs(&touching), [(0, 1)]);
        let apart = [[0.0, 0.0, 0.0, 1.0], [3.0, 4.0, 0.0, 4.0_f32.next_down()]];
        assert_eq!(pairs(&apart), []);
        let points = [[1.0, 2.0, 3.0, 0.0]; 3];
        assert_eq!(pairs(&points), [(0, 1), (0, 2), (1, 2)]);
        let vast = [[f32::MAX, 0.0, 0.0, f32::MAX], [-f32::MAX, 0.0, 0.0, f32::MAX], [0.0, 0.0, 0.0, 0.0]];
        assert_eq!(pairs(&vast), [(0, 1), (0, 2), (1, 2)]);
        let tiny = f32::from_bits(1);
        let subnormal = [[0.0, 0.0, 0.0, tiny], [2.0 * tiny, 0.0, 0.0, tiny], [5.0 * tiny, 0.0, 0.0, tiny]];
        assert_eq!(pairs(&subnormal), [(0, 1)]);
    }

    #[test]
    fn interactions_override_radii() {
        let spheres = (0..4).map(|k| Sphere::new([k as f32, 0.0, 0.0], 0.75)).collect();
        let rows = vec![vec![Interaction::Never], vec![Interaction::Within(3.0), Interaction::Touch]];
        let scenario = TestInput {
            spheres,
            mixture: Some(SpeciesSetup { species: vec![0, 0, 1, 1], rows }),
            ..TestInput::default()
        };
        let expected = [(0, 2), (0, 3), (1, 2), (1, 3), (2, 3)].map(|(i, j)| Pair { i, j });
        assert_eq!(scenario.oracle(), expected);
    }
}
