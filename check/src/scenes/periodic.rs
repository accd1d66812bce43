use lazygrid::{Space, Sphere};

#[cfg(doc)]
use crate::scenes::hard;
use crate::scenes::hard::extreme_unit;
use crate::{SceneSeed, SeedReader, TestInput};

#[derive(Clone, Copy, Debug)]
pub struct PeriodicSceneFamily {
    pub name: &'static str,
    pub scene: fn(&SceneSeed) -> TestInput,
}

pub const FAMILIES: [PeriodicSceneFamily; 6] = [
    PeriodicSceneFamily { name: "lattices across a periodic boundary", scene: lattice },
    PeriodicSceneFamily { name: "soup in a box", scene: soup },
    PeriodicSceneFamily { name: "crowds at the corner of a box", scene: corner },
    PeriodicSceneFamily { name: "coordinates far outside a box", scene: unwrapped },
    PeriodicSceneFamily { name: "boxes at the ends of the range", scene: extremes },
    PeriodicSceneFamily { name: "giants in small boxes", scene: giant },
];

/// One axis in four is unbounded.
pub fn lengths(reader: &mut SeedReader<'_>, lengths: &[f32]) -> [Option<f32>; 3] {
    [(); 3].map(|()| {
        let (length, is_unbounded) = (reader.pick(lengths), reader.once_in(4));
        (!is_unbounded).then_some(length)
    })
}

pub fn space(lengths: [Option<f32>; 3]) -> Space {
    Space::periodic(lengths.map(|length| length.map(f64::from))).unwrap_or_default()
}

fn in_box(spheres: Vec<Sphere>, lengths: [Option<f32>; 3]) -> TestInput {
    TestInput { space: space(lengths), ..spheres.into() }
}

/// Lattice sites in exact contact. Some spheres exceed the box.
pub fn lattice(words: &SceneSeed) -> TestInput {
    let mut choices = words.reader();
    let spacing = choices.pick(&[1.0_f32, 0.25, 3.0, 1.0 / 1024.0]);
    let shift = choices.pick(&[0.0_f32, 0.5, -1024.0]);
    let counts = lengths(&mut choices, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
    let spheres = words.each(|reader| {
        let center = [(); 3].map(|()| ((reader.below(24) as f32 - 12.0) + shift) * spacing);
        Sphere::new(center, reader.pick(&[0.5_f32, 0.5, 0.5, 1.0, 0.0, 6.0]) * spacing)
    });
    in_box(spheres, counts.map(|count| count.map(|count| count * spacing)))
}

/// Radii range from 0 to more than the box, centers over several boxes.
pub fn soup(words: &SceneSeed) -> TestInput {
    let mut choices = words.reader();
    let lengths = match choices.below(3) {
        0 => lengths(&mut choices, &[8.0, 7.3, 4.1]),
        1 => lengths(&mut choices, &[0.3, 1.1, 2.5, 5.0]),
        _ => [(); 3].map(|()| Some(choices.between(0.05, 9.0))),
    };
    let spheres = words.each(|reader| {
        let radius = match reader.below(10) {
            0 => 0.0,
            1 => reader.between(1.5, 12.0),
            2 | 3 => reader.between(0.3, 1.5),
            _ => reader.between(0.0, 0.3),
        };
        Sphere::new([(); 3].map(|()| reader.between(-4.0, 4.0)), radius)
    });
    in_box(spheres, lengths)
}

/// Spheres within a few ulp of the corner and the boundaries.
pub fn corner(words: &SceneSeed) -> TestInput {
    let lengths = lengths(&mut words.reader(), &[1.0, 10.0, 0.1, 3.3]);
    let spheres = words.each(|reader| {
        let center = lengths.map(|length| {
            let x = reader.pick(&[0.0_f32, 0.5, -0.5, 1.0, -1.0, 2.0]) * length.unwrap_or(1.0);
            let ulps = reader.within(3);
            (0..ulps.abs()).fold(x, |x, _| if ulps > 0 { x.next_up() } else { x.next_down() })
        });
        Sphere::new(center, reader.pick(&[0.0, 1e-7, 2e-7, 0.01, 0.2]))
    });
    in_box(spheres, lengths)
}

/// Spheres of an unwrapped simulation, up to 2⁵⁰ boxes away. All values are multiples of 2⁻³⁰.
pub fn unwrapped(words: &SceneSeed) -> TestInput {
    let mut choices = words.reader();
    let lengths = [(); 3].map(|()| {
        let length = choices.pick(&[2.0_f32, 1.625, 0.75, 1.0 / 3.0]);
        (length * 1024.0 * 1024.0).round() / (1024.0 * 1024.0)
    });
    let spheres = words.each(|reader| {
        let center = lengths.map(|length| {
            let (at, is_far, doublings) = (reader.within(1024), reader.below(2) == 1, reader.below(50));
            let turns = if is_far { length * (doublings as f32).exp2() } else { 0.0 };
            at as f32 / 1024.0 + turns
        });
        Sphere::new(center, reader.below(256) as f32 / 1024.0)
    });
    in_box(spheres, lengths.map(Some))
}

/// Sizes near which `f32` arithmetic changes.
pub fn extremes(words: &SceneSeed) -> TestInput {
    let mut choices = words.reader();
    let unit = extreme_unit(&mut choices);
    let of_quarters = |quarters: f64| (0.25 * quarters * f64::from(unit)) as f32;
    let lengths = match choices.once_in(4) {
        true => lengths(&mut choices, &[1.0, 3e38]),
        false => lengths(&mut choices, &[1.0, 2.5, 7.0, 16.0, 0.25])
            .map(|length| length.map(|length| of_quarters(4.0 * f64::from(length)).max(unit))),
    };
    let spheres = words.each(|reader| {
        let center = [(); 3].map(|()| of_quarters(reader.within(32).into()));
        Sphere::new(center, of_quarters(reader.below(9).into()))
    });
    in_box(spheres, lengths)
}

/// One sphere about as large as the box among tiny ones.
pub fn giant(words: &SceneSeed) -> TestInput {
    let mut choices = words.reader();
    let lengths = lengths(&mut choices, &[10.0, 6.0, 2.0]);
    let at = [(); 3].map(|()| choices.between(0.0, 10.0));
    let giant = Sphere::new(at, choices.between(0.5, 12.0));
    let mut spheres = words.each(|reader| Sphere::new([(); 3].map(|()| reader.between(0.0, 10.0)), 0.05));
    spheres.insert(spheres.len() / 2, giant);
    in_box(spheres, lengths)
}
