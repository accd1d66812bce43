use glam::{DVec3, Vec3};
use lazygrid::{Interaction, Sphere};

use crate::{SceneSeed, SeedReader, SpeciesSetup};

#[derive(Clone, Copy, Debug)]
pub struct SceneFamily {
    pub name: &'static str,
    pub spheres: fn(&SceneSeed) -> Vec<Sphere>,
}

pub const FAMILIES: [SceneFamily; 12] = [
    SceneFamily { name: "lattices in contact", spheres: lattice },
    SceneFamily { name: "duplicates", spheres: duplicates },
    SceneFamily { name: "a giant among tiny ones", spheres: giant },
    SceneFamily { name: "radii of twenty powers of two", spheres: powers_of_two },
    SceneFamily { name: "lines and planes", spheres: flat },
    SceneFamily { name: "clusters of clusters", spheres: clusters },
    SceneFamily { name: "far from the origin", spheres: far },
    SceneFamily { name: "floats of any size", spheres: any_floats },
    SceneFamily { name: "floats of one size", spheres: one_magnitude },
    SceneFamily { name: "the ends of the range", spheres: extremes },
    SceneFamily { name: "radii whose squares overflow", spheres: huge_radii },
    SceneFamily { name: "soup", spheres: soup },
];

fn sphere(center: Vec3, radius: f32) -> Sphere {
    Sphere::new(center.clamp(Vec3::MIN, Vec3::MAX), radius.min(f32::MAX))
}

fn position(mut coordinate: impl FnMut() -> f32) -> [f32; 3] {
    [coordinate(), coordinate(), coordinate()]
}

/// Lattices in contact, exact for dyadic spacings.
pub fn lattice(words: &SceneSeed) -> Vec<Sphere> {
    let mut choices = words.reader();
    let spacing = choices.pick(&[1.0_f32, 0.25, 3.0, 0.1, 0.3, 1.0 / 3.0, 1e-3, 1.1e-20, 7.7e15]);
    let shift = choices.pick(&[0.0_f32, 0.5, 1.0, -4.0, 1e3, -1e6]);
    words.each(|reader| {
        let at = Vec3::from(position(|| reader.below(8) as f32));
        Sphere::new((at + shift) * spacing, reader.pick(&[0.5, 1.0, 0.0]) * spacing)
    })
}

pub fn duplicates(words: &SceneSeed) -> Vec<Sphere> {
    let originals = words.each(|reader| {
        Sphere::new(position(|| reader.between(-2.0, 2.0)), reader.pick(&[0.0, 1e-3, 1.0, 2.0]))
    });
    let few = (1 + words.reader().below(5) as usize).min(originals.len());
    words.each(|reader| {
        // Skips the words of the original.
        let _ = [(); 4].map(|()| reader.below(1));
        reader.pick(&originals[..few])
    })
}

/// One huge sphere among tiny ones inside, at its surface and outside.
pub fn giant(words: &SceneSeed) -> Vec<Sphere> {
    let mut choices = words.reader();
    let tiny = choices.pick(&[1e-3_f32, 1.0, 1e10, 1e-30]);
    let radius = choices.pick(&[1e6_f32, (1 << 20) as f32]) * tiny;
    let ulp = f64::from(radius) - f64::from(radius.next_down());
    let mut spheres = words.each(|reader| {
        let direction = DVec3::from([(); 3].map(|()| f64::from(reader.within(3))));
        let other = reader.once_in(4);
        let depth = if other { reader.pick(&[0.0, 0.5, 1.0 + 1e-6, 1.5]) } else { 1.0 };
        let distance = depth * f64::from(radius + tiny) + f64::from(reader.within(3)) * ulp;
        Sphere::new((direction.normalize_or_zero() * distance).as_vec3(), tiny)
    });
    let at = choices.below(spheres.len() as u32 + 1);
    spheres.insert(at as usize, Sphere::new([0.0; 3], radius));
    spheres
}

/// Spheres with radii over twenty powers of two, many in exact contact.
pub fn powers_of_two(words: &SceneSeed) -> Vec<Sphere> {
    let unit = words.reader().pick(&[1.0_f32, 0.25, 8.0]);
    words.each(|reader| {
        let center = position(|| reader.within(32) as f32 * unit);
        Sphere::new(center, (reader.within(10) as f32).exp2())
    })
}

pub fn flat(words: &SceneSeed) -> Vec<Sphere> {
    let mut choices = words.reader();
    let axes = choices.pick(&[[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 1.0], [1.0, 1.0, 0.0]]);
    let diagonal = choices.below(2) == 1;
    let origin = Vec3::from(position(|| choices.between(-5.0, 5.0)));
    words.each(|reader| {
        let at = Vec3::from(position(|| reader.between(-20.0, 20.0)));
        let along = if diagonal { Vec3::splat(at.x) } else { at };
        Sphere::new(origin + along * Vec3::from(axes), reader.between(0.0, 1.5))
    })
}

/// Clusters of clusters of clusters.
pub fn clusters(words: &SceneSeed) -> Vec<Sphere> {
    let scale = words.reader().pick(&[1e-2_f32, 1e-4, 1.0 / 1024.0]);
    words.each(|reader| {
        let digits = [(); 3].map(|()| Vec3::from(position(|| reader.within(1) as f32)));
        let center = digits.iter().rev().fold(Vec3::ZERO, |at, digit| at * scale + *digit);
        let level = reader.below(3) as i32;
        Sphere::new(center, reader.pick(&[0.1, 0.5, 1.0]) * scale.powi(level))
    })
}

/// Coordinates whose ulp is about as large as the radii.
pub fn far(words: &SceneSeed) -> Vec<Sphere> {
    let mut choices = words.reader();
    let exponent = 3 + choices.below(37) as i32;
    let base = if exponent > 38 { f32::MAX } else { 10_f32.powi(exponent) };
    let both_sides = choices.below(2) == 1;
    let ulp = f64::from(base) - f64::from(base.next_down());
    words.each(|reader| {
        let center = position(|| {
            let x = f32::from_bits(base.to_bits() - reader.below(8));
            if reader.below(2) == 1 && both_sides { -x } else { x }
        });
        let radius = match reader.once_in(5) {
            false => reader.pick(&[0.0_f64, 0.5, 1.0, 1.5, 2.0]) * ulp,
            true => reader.pick(&[1e-30_f64, 1e-3, 1.0, 1e3]),
        };
        sphere(center.into(), radius as f32)
    })
}

fn any_magnitude(reader: &mut SeedReader<'_>) -> f32 {
    let x = reader.float_below(f32::INFINITY.to_bits());
    reader.signed(x)
}

/// Coordinates and radii log-uniform over all of `f32`.
pub fn any_floats(words: &SceneSeed) -> Vec<Sphere> {
    words.each(|reader| Sphere::new(position(|| any_magnitude(reader)), any_magnitude(reader).abs()))
}

/// Values log-uniform over four binades anywhere in `f32`.
pub fn one_magnitude(words: &SceneSeed) -> Vec<Sphere> {
    let mut choices = words.reader();
    let lowest = if choices.below(4) == 0 { 0 } else { choices.below(251) };
    let value = |reader: &mut SeedReader<'_>| {
        let x = f32::from_bits(reader.below(4 << 23) + (lowest << 23));
        reader.signed(x)
    };
    words.each(|reader| Sphere::new(position(|| value(reader)), value(reader).abs()))
}

/// Returns a length near which `f32` arithmetic changes: subnormal, or with a square that underflows or
/// overflows.
pub(crate) fn extreme_unit(reader: &mut SeedReader<'_>) -> f32 {
    let exponents =
        [-76, -149, -147, -130, -127, -126, -125, -120, -101, -64, -41, -39, 59, 64, 100, 119, 121];
    f64::from(reader.pick(&exponents)).exp2() as f32
}

/// Spheres a few `extreme_unit`s wide and apart, in some scenes far away.
pub fn extremes(words: &SceneSeed) -> Vec<Sphere> {
    let mut choices = words.reader();
    let (unit, other) = (extreme_unit(&mut choices), extreme_unit(&mut choices));
    let away = choices.pick(&[[0.0_f32; 3], [0.0, 1.0, 0.0], [1e30, 0.0, 0.0], [0.0, 0.0, -3e38]]);
    words.each(|reader| {
        let quarter = 0.25 * f64::from(if reader.once_in(8) { other } else { unit });
        let center = away.map(|away| (f64::from(reader.within(32)) * quarter + f64::from(away)) as f32);
        sphere(center.into(), (f64::from(reader.below(9)) * quarter) as f32)
    })
}

/// Radii whose squares overflow `f32`.
pub fn huge_radii(words: &SceneSeed) -> Vec<Sphere> {
    let least = 1e19_f32.to_bits();
    words.each(|reader| {
        let radius = f32::from_bits(least + reader.below(f32::MAX.to_bits() - least + 1));
        let center = position(|| match reader.below(3) {
            0 => reader.between(-1e20, 1e20),
            1 => any_magnitude(reader),
            // `between` needs a finite span.
            _ => 2.0 * reader.between(-0.5 * f32::MAX, 0.5 * f32::MAX),
        });
        Sphere::new(center, radius)
    })
}

/// Overlapping spheres in a box.
pub fn soup(words: &SceneSeed) -> Vec<Sphere> {
    words.each(|reader| {
        let radius = match reader.below(7) {
            0 => 0.0,
            1 => reader.between(0.4, 2.0),
            _ => reader.between(0.0, 0.4),
        };
        Sphere::new(position(|| reader.between(-3.0, 3.0)), radius)
    })
}

pub const TABLE_WORDS: usize = 41;

/// Distances may be 0, exact distances of spheres, or larger than all radii. `ids` has one word per sphere.
pub fn mixture(spheres: &[Sphere], table: &[u32; TABLE_WORDS], ids: &[u32]) -> SpeciesSetup {
    let mut choices = SeedReader::new(table);
    let count = 1 + choices.below(4);
    let mut interaction = || {
        let (kind, factor) = (choices.below(6), choices.pick(&[1.0_f32, 0.5, 2.0]));
        let (i, j) = (choices.below(spheres.len() as u32), choices.below(spheres.len() as u32));
        match kind {
            0 => Interaction::Never,
            1 => Interaction::Touch,
            2 => Interaction::Within(0.0),
            _ if spheres.is_empty() => Interaction::Within(factor.into()),
            _ => {
                let [a, b] = [i, j].map(|k| spheres[k as usize].center.as_dvec3());
                Interaction::Within((a.distance(b) as f32 * factor).min(f32::MAX).into())
            }
        }
    };
    let rows = (1..=count).map(|len| (0..len).map(|_| interaction()).collect()).collect();
    let species = ids.iter().map(|&word| SeedReader::new(&[word]).below(count)).collect();
    SpeciesSetup { species, rows }
}
