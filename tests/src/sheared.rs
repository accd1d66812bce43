//! Spheres in spaces whose edges lean: the plain loop that judges detectors there, and families that shrink.

use glam::{DMat3, DVec3, Vec3};
use lazygrid::{Pair, Space, Sphere};
use proptest::prelude::*;

use crate::adversary::words;
use crate::periodic::pairs;
use crate::{Choices, Scenario, Words};

/// All pairs in canonical order, by looking at every image of one sphere that may be in reach of the other, in `f64`. It takes
/// the edges as they were given.
///
/// What is in reach has no more of an edge than as many times the height across the other edges as fit the reach.
pub fn oracle(scenario: &Scenario) -> Vec<Pair> {
    let edges: Vec<DVec3> =
        scenario.space.edges().into_iter().flatten().map(|edge| edge.as_dvec3()).collect();
    let inverse = fractions(&edges);
    pairs(scenario, |i, j| {
        let [a, b] = [i, j].map(|k| scenario.spheres[k].center.as_dvec3());
        let mut folded = a - b;
        for (edge, part) in edges.iter().zip(inverse.iter().map(|row| row.dot(a - b).round())) {
            folded -= *edge * part;
        }
        let reach = scenario.reach(i, j).unwrap_or(0.0);
        // No image is farther away along the edges than this one is.
        let along = edges.iter().zip(&inverse).map(|(edge, row)| *edge * row.dot(folded)).sum::<DVec3>();
        let looked_at = reach.min(along.length());
        let turns: Vec<[i32; 2]> = inverse
            .iter()
            .map(|row| {
                let (part, most) = (row.dot(folded), looked_at * row.length() + 1e-6);
                [(-part - most).ceil() as i32, (-part + most).floor() as i32]
            })
            .collect();
        // With a reach beyond that, one look is enough.
        if folded.length() <= reach { folded.length_squared() } else { nearest(folded, &edges, &turns) }
    })
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

/// The edges of a box of these lengths with the tilts xy, xz and yz; an axis without a length does not repeat.
pub fn tilted(lengths: [Option<f32>; 3], [xy, xz, yz]: [f32; 3]) -> [Option<Vec3>; 3] {
    let [x, y, z] = lengths;
    [x.map(|x| Vec3::new(x, 0.0, 0.0)), y.map(|y| Vec3::new(xy, y, 0.0)), z.map(|z| Vec3::new(xz, yz, z))]
}

fn in_space(spheres: Vec<Sphere>, edges: [Option<Vec3>; 3]) -> Scenario {
    Scenario { spheres, space: Space::sheared(edges).expect("edges that span a box"), mixture: None }
}

/// Some of three edges, one at least.
fn some_of(of: &mut Choices<'_>, edges: [Option<Vec3>; 3]) -> [Option<Vec3>; 3] {
    let taken = if of.below(2) == 0 { 7 } else { 1 + of.below(7) };
    [0, 1, 2].map(|k| edges[k].filter(|_| taken >> k & 1 == 1))
}

/// Sites of a lattice in exact contact in boxes whose edges lean by whole and half sites, some by more than a length.
fn of_sites(words: &Words) -> Scenario {
    let mut choices = words.choices();
    let spacing = choices.of(&[1.0_f32, 0.25, 1024.0]);
    let shift = choices.of(&[0.0_f32, 0.5, -64.0]);
    let lengths = [(); 3].map(|()| Some(choices.of(&[4.0_f32, 1.0, 2.0, 3.0, 5.0, 7.0]) * spacing));
    let tilts = [(); 3].map(|()| choices.within(12) as f32 * 0.5 * spacing);
    let edges = some_of(&mut choices, tilted(lengths, tilts));
    let spheres = words.each(|of| {
        let center = [(); 3].map(|()| ((of.below(24) as f32 - 12.0) + shift) * spacing);
        Sphere::new(center, of.of(&[0.5_f32, 0.5, 0.5, 1.0, 0.0, 6.0]) * spacing)
    });
    in_space(spheres, edges)
}

/// Spheres at random in boxes of any tilt: half a length, as LAMMPS allows, and far more. Sizes from points to more than
/// the box, coordinates up to some boxes outside.
fn of_tilts(words: &Words) -> Scenario {
    let mut choices = words.choices();
    let most = choices.of(&[0.5_f32, 0.5, 1.5, 6.0]);
    let lengths = [(); 3].map(|()| choices.between(0.7, 8.0));
    let tilts = [(1, 0), (2, 0), (2, 1)].map(|(_, along)| choices.between(-most, most) * lengths[along]);
    let edges = some_of(&mut choices, tilted(lengths.map(Some), tilts));
    in_space(sizes(words), edges)
}

/// Spheres at random in boxes with edges of any direction, the longest up to some hundred times as long as the shortest.
fn of_directions(words: &Words) -> Scenario {
    let mut choices = words.choices();
    let mut edge = || {
        let direction = Vec3::from([(); 3].map(|()| choices.between(-1.0, 1.0)));
        direction * choices.of(&[3.0_f32, 0.4, 8.0, 40.0])
    };
    let mut edges = [edge(), edge(), edge()];
    // Edges in one plane span no box.
    let volume = edges[0].cross(edges[1]).dot(edges[2]);
    if volume.abs() < 1e-2 * edges.iter().map(|edge| edge.length()).product::<f32>() {
        edges = [Vec3::new(3.0, 1.0, 0.0), Vec3::new(0.0, 4.0, -1.0), Vec3::new(2.0, 0.0, 5.0)];
    }
    let edges = some_of(&mut choices, edges.map(Some));
    in_space(sizes(words), edges)
}

/// From points to more than a box, at up to some boxes from the origin.
fn sizes(words: &Words) -> Vec<Sphere> {
    words.each(|of| {
        let radius = match of.below(10) {
            0 => 0.0,
            1 => of.between(1.5, 9.0),
            2 | 3 => of.between(0.3, 1.5),
            _ => of.between(0.0, 0.3),
        };
        Sphere::new([(); 3].map(|()| of.between(-6.0, 6.0)), radius)
    })
}

/// Spheres that an unwrapped simulation has carried away by whole edges; all values multiples of 2⁻⁸ below 2¹⁵.
fn unwrapped(words: &Words) -> Scenario {
    let mut choices = words.choices();
    let quarters = |of: &mut Choices<'_>, most: i32| of.within(most) as f32 / 4.0;
    let lengths = [(); 3].map(|()| Some(choices.of(&[2.0_f32, 3.25, 1.5])));
    let tilts = [(); 3].map(|()| quarters(&mut choices, 9));
    let edges = some_of(&mut choices, tilted(lengths, tilts));
    let spheres = words.each(|of| {
        let mut center = Vec3::from([(); 3].map(|()| of.within(256) as f32 / 256.0));
        for edge in edges.iter().flatten() {
            center += *edge * of.within(1024) as f32;
        }
        Sphere::new(center, of.below(128) as f32 / 256.0)
    });
    in_space(spheres, edges)
}

/// Spheres at the corner of the box and about the seams, by some units in the last place.
fn seams(words: &Words) -> Scenario {
    let mut choices = words.choices();
    let lengths = [(); 3].map(|()| Some(choices.of(&[1.0_f32, 10.0, 0.1, 3.3])));
    let tilts = [(); 3].map(|()| choices.of(&[0.0_f32, 0.5, -0.25, 1.0, 0.05]));
    let edges = some_of(&mut choices, tilted(lengths, tilts));
    let spheres = words.each(|of| {
        let mut center = Vec3::ZERO;
        for edge in tilted(lengths, tilts).into_iter().flatten() {
            center += edge * of.of(&[0.0_f32, 0.5, -0.5, 1.0, 0.25]);
        }
        let center = center.to_array().map(|x| {
            let ulps = of.within(3);
            (0..ulps.abs()).fold(x, |x, _| if ulps > 0 { x.next_up() } else { x.next_down() })
        });
        Sphere::new(center, of.of(&[0.0, 1e-7, 2e-7, 0.01, 0.2]))
    });
    in_space(spheres, edges)
}

/// Boxes and spheres of lengths at which arithmetic in `f32` changes.
fn extremes(words: &Words) -> Scenario {
    let mut choices = words.choices();
    let unit = choices.of(&[1e-30_f32, 1e-36, 1e30, 2e36]);
    let lengths = [(); 3].map(|()| Some(choices.of(&[1.0_f32, 2.5, 7.0]) * unit));
    let tilts = [(); 3].map(|()| choices.within(6) as f32 * 0.25 * unit);
    let edges = some_of(&mut choices, tilted(lengths, tilts));
    let spheres = words.each(|of| {
        let center = [(); 3].map(|()| of.within(32) as f32 * 0.25 * unit);
        Sphere::new(center, of.below(9) as f32 * 0.25 * unit)
    });
    in_space(spheres, edges)
}

/// Spheres as large as they can be, or nearly, in space that repeats along some edges and is unbounded across them.
fn largest(words: &Words) -> Scenario {
    let mut choices = words.choices();
    let unit = choices.of(&[1.0_f32, 1e38, 1e-3]);
    let edges = tilted([Some(unit), Some(2.0 * unit), None], [0.4 * unit, 0.0, 0.0]);
    let spheres = words.each(|of| {
        let share = of.of(&[1.0_f32, 0.6, 0.5, 1e-3, 0.0]);
        let center = [(); 3].map(|()| of.of(&[0.0_f32, 1.0, -1.0, 0.5]) * f32::MAX);
        Sphere::new([of.between(-1.0, 1.0) * unit, of.between(-1.0, 1.0) * unit, center[2]], share * f32::MAX)
    });
    in_space(spheres, edges)
}

macro_rules! strategies {
    ($($name:ident $family:ident)*) => {$(
        #[doc = concat!("Of `", stringify!($family), "`, which says what is hard about them.")]
        pub fn $name() -> impl Strategy<Value = Scenario> {
            words().prop_map(|words| $family(&words))
        }
    )*};
}

strategies! {
    lattice of_sites
    soup of_tilts
    directions of_directions
    carried_away unwrapped
    corners seams
    ends_of_the_range extremes
    largest_spheres largest
}

/// Species with interactions of every kind, in boxes that lean.
pub fn mixture() -> impl Strategy<Value = Scenario> {
    let spheres = words().prop_map(|words| sizes(&words)).boxed();
    (crate::adversary::mixture(spheres), any::<[u32; 12]>()).prop_map(|(scenario, setup)| {
        let space = of_tilts(&Words { setup, elements: Vec::new() }).space;
        Scenario { space, ..scenario }
    })
}
