use glam::Vec3;
use lazygrid::{Space, Sphere};

#[cfg(doc)]
use crate::scenes::hard;
use crate::scenes::periodic::PeriodicSceneFamily;
use crate::{SceneSeed, SeedReader, TestInput};

pub const FAMILIES: [PeriodicSceneFamily; 7] = [
    PeriodicSceneFamily { name: "lattices in triclinic cells", scene: lattice },
    PeriodicSceneFamily { name: "soup in a triclinic cell", scene: soup },
    PeriodicSceneFamily { name: "cell vectors of any direction", scene: directions },
    PeriodicSceneFamily { name: "coordinates far outside a triclinic cell", scene: carried_away },
    PeriodicSceneFamily { name: "boundaries of a triclinic cell", scene: corners },
    PeriodicSceneFamily { name: "triclinic cells at the ends of the range", scene: ends_of_the_range },
    PeriodicSceneFamily { name: "the largest spheres in a triclinic cell", scene: largest_spheres },
];

/// Returns cell vectors as LAMMPS defines them by lengths and tilts.
pub fn tilted(lengths: [Option<f32>; 3], [xy, xz, yz]: [f32; 3]) -> [Option<Vec3>; 3] {
    let [x, y, z] = lengths;
    [x.map(|x| Vec3::new(x, 0.0, 0.0)), y.map(|y| Vec3::new(xy, y, 0.0)), z.map(|z| Vec3::new(xz, yz, z))]
}

pub fn space(cell_vectors: [Option<Vec3>; 3]) -> Space {
    Space::triclinic(
        cell_vectors.map(|cell_vector| cell_vector.map(|cell_vector| cell_vector.as_dvec3().to_array())),
    )
    .unwrap_or_default()
}

fn in_space(spheres: Vec<Sphere>, cell_vectors: [Option<Vec3>; 3]) -> TestInput {
    TestInput { space: space(cell_vectors), ..spheres.into() }
}

fn some_of(reader: &mut SeedReader<'_>, cell_vectors: [Option<Vec3>; 3]) -> [Option<Vec3>; 3] {
    let taken = if reader.below(2) == 0 { 7 } else { 1 + reader.below(7) };
    [0, 1, 2].map(|k| cell_vectors[k].filter(|_| taken >> k & 1 == 1))
}

/// Lattice sites in exact contact, in cells tilted by whole and half sites.
pub fn lattice(words: &SceneSeed) -> TestInput {
    let mut choices = words.reader();
    let spacing = choices.pick(&[1.0_f32, 0.25, 1024.0]);
    let shift = choices.pick(&[0.0_f32, 0.5, -64.0]);
    let lengths = [(); 3].map(|()| Some(choices.pick(&[4.0_f32, 1.0, 2.0, 3.0, 5.0, 7.0]) * spacing));
    let tilts = [(); 3].map(|()| choices.within(12) as f32 * 0.5 * spacing);
    let cell_vectors = some_of(&mut choices, tilted(lengths, tilts));
    let spheres = words.each(|reader| {
        let center = [(); 3].map(|()| ((reader.below(24) as f32 - 12.0) + shift) * spacing);
        Sphere::new(center, reader.pick(&[0.5_f32, 0.5, 0.5, 1.0, 0.0, 6.0]) * spacing)
    });
    in_space(spheres, cell_vectors)
}

/// Cells with tilts of half a length, as LAMMPS allows, and much more.
pub fn soup(words: &SceneSeed) -> TestInput {
    let mut choices = words.reader();
    let most = choices.pick(&[0.5_f32, 0.5, 1.5, 6.0]);
    let lengths = [(); 3].map(|()| choices.between(0.7, 8.0));
    let tilts = [(1, 0), (2, 0), (2, 1)].map(|(_, along)| choices.between(-most, most) * lengths[along]);
    let cell_vectors = some_of(&mut choices, tilted(lengths.map(Some), tilts));
    in_space(sizes(words), cell_vectors)
}

/// Vectors of any direction, with lengths up to a ratio of about 100.
pub fn directions(words: &SceneSeed) -> TestInput {
    let mut choices = words.reader();
    let mut cell_vector = || {
        let direction = Vec3::from([(); 3].map(|()| choices.between(-1.0, 1.0)));
        direction * choices.pick(&[3.0_f32, 0.4, 8.0, 40.0])
    };
    let mut cell_vectors = [cell_vector(), cell_vector(), cell_vector()];
    let volume = cell_vectors[0].cross(cell_vectors[1]).dot(cell_vectors[2]);
    if volume.abs() < 1e-2 * cell_vectors.iter().map(|cell_vector| cell_vector.length()).product::<f32>() {
        cell_vectors = [Vec3::new(3.0, 1.0, 0.0), Vec3::new(0.0, 4.0, -1.0), Vec3::new(2.0, 0.0, 5.0)];
    }
    let cell_vectors = some_of(&mut choices, cell_vectors.map(Some));
    in_space(sizes(words), cell_vectors)
}

/// Radii range from 0 to more than a cell.
pub fn sizes(words: &SceneSeed) -> Vec<Sphere> {
    words.each(|reader| {
        let radius = match reader.below(10) {
            0 => 0.0,
            1 => reader.between(1.5, 9.0),
            2 | 3 => reader.between(0.3, 1.5),
            _ => reader.between(0.0, 0.3),
        };
        Sphere::new([(); 3].map(|()| reader.between(-6.0, 6.0)), radius)
    })
}

/// Spheres of an unwrapped simulation, shifted by whole cell vectors. All values are multiples of 2⁻⁸ below
/// 2¹⁵.
pub fn carried_away(words: &SceneSeed) -> TestInput {
    let mut choices = words.reader();
    let quarters = |reader: &mut SeedReader<'_>, most: i32| reader.within(most) as f32 / 4.0;
    let lengths = [(); 3].map(|()| Some(choices.pick(&[2.0_f32, 3.25, 1.5])));
    let tilts = [(); 3].map(|()| quarters(&mut choices, 9));
    let cell_vectors = some_of(&mut choices, tilted(lengths, tilts));
    let spheres = words.each(|reader| {
        let mut center = Vec3::from([(); 3].map(|()| reader.within(256) as f32 / 256.0));
        for cell_vector in cell_vectors.iter().flatten() {
            center += *cell_vector * reader.within(1024) as f32;
        }
        Sphere::new(center, reader.below(128) as f32 / 256.0)
    });
    in_space(spheres, cell_vectors)
}

/// Spheres within a few ulp of the corner and the boundaries.
pub fn corners(words: &SceneSeed) -> TestInput {
    let mut choices = words.reader();
    let lengths = [(); 3].map(|()| Some(choices.pick(&[1.0_f32, 10.0, 0.1, 3.3])));
    let tilts = [(); 3].map(|()| choices.pick(&[0.0_f32, 0.5, -0.25, 1.0, 0.05]));
    let cell_vectors = some_of(&mut choices, tilted(lengths, tilts));
    let spheres = words.each(|reader| {
        let mut center = Vec3::ZERO;
        for cell_vector in tilted(lengths, tilts).into_iter().flatten() {
            center += cell_vector * reader.pick(&[0.0_f32, 0.5, -0.5, 1.0, 0.25]);
        }
        let center = center.to_array().map(|x| {
            let ulps = reader.within(3);
            (0..ulps.abs()).fold(x, |x, _| if ulps > 0 { x.next_up() } else { x.next_down() })
        });
        Sphere::new(center, reader.pick(&[0.0, 1e-7, 2e-7, 0.01, 0.2]))
    });
    in_space(spheres, cell_vectors)
}

/// Sizes near which `f32` arithmetic changes.
pub fn ends_of_the_range(words: &SceneSeed) -> TestInput {
    let mut choices = words.reader();
    let unit = choices.pick(&[1e-30_f32, 1e-36, 1e30, 2e36]);
    let lengths = [(); 3].map(|()| Some(choices.pick(&[1.0_f32, 2.5, 7.0]) * unit));
    let tilts = [(); 3].map(|()| choices.within(6) as f32 * 0.25 * unit);
    let cell_vectors = some_of(&mut choices, tilted(lengths, tilts));
    let spheres = words.each(|reader| {
        let center = [(); 3].map(|()| reader.within(32) as f32 * 0.25 * unit);
        Sphere::new(center, reader.below(9) as f32 * 0.25 * unit)
    });
    in_space(spheres, cell_vectors)
}

/// Spheres of nearly the largest radii, in a space that is unbounded along one axis.
pub fn largest_spheres(words: &SceneSeed) -> TestInput {
    let mut choices = words.reader();
    let unit = choices.pick(&[1.0_f32, 1e38, 1e-3]);
    let cell_vectors = tilted([Some(unit), Some(2.0 * unit), None], [0.4 * unit, 0.0, 0.0]);
    let spheres = words.each(|reader| {
        let fraction = reader.pick(&[1.0_f32, 0.6, 0.5, 1e-3, 0.0]);
        let center = [(); 3].map(|()| reader.pick(&[0.0_f32, 1.0, -1.0, 0.5]) * f32::MAX);
        Sphere::new(
            [reader.between(-1.0, 1.0) * unit, reader.between(-1.0, 1.0) * unit, center[2]],
            fraction * f32::MAX,
        )
    });
    in_space(spheres, cell_vectors)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Random;

    #[test]
    fn cell_does_not_depend_on_elements() {
        let mut random = Random(3);
        for family in FAMILIES {
            let mut triclinic = 0;
            for _ in 0..200 {
                let words = SceneSeed::drawn(&mut random, 3);
                let TestInput { space, spheres, .. } = (family.scene)(&words);
                assert!(space.is_periodic() && spheres.len() == 3, "{}: {words:?}", family.name);
                triclinic += usize::from(space.triclinic_cell().is_some());
                let others = SceneSeed { elements: SceneSeed::drawn(&mut random, 5).elements, ..words };
                assert_eq!((family.scene)(&others).space, space, "{}", family.name);
            }
            assert!(triclinic > 100, "{}: {triclinic}", family.name);
        }
    }
}
