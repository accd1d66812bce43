//! Spheres that are hard on grids, as `proptest` strategies that shrink.
//!
//! Each is a list of small independent elements beside a few parameters, so that shrinking drops spheres one by
//! one and then moves the rest to simpler places.

use glam::{DVec3, Vec3};
use lazygrid::{Interaction, Sphere};
use proptest::array::uniform3;
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::{Index, select};

use crate::{Mixture, Scenario};

/// A strategy for spheres.
pub type Spheres = BoxedStrategy<Vec<Sphere>>;

/// Mostly a few dozen elements, sometimes none, at most 600.
fn many<S: Strategy + Clone + 'static>(element: S) -> impl Strategy<Value = Vec<S::Value>> {
    prop_oneof![
        3 => vec(element.clone(), 0..12),
        4 => vec(element.clone(), 12..120),
        1 => vec(element, 120..=600),
    ]
}

fn sphere(center: Vec3, radius: f32) -> Sphere {
    Sphere::new(center.clamp(Vec3::MIN, Vec3::MAX), radius.min(f32::MAX))
}

/// Lattices in contact: exactly so for dyadic spacings, and on either side of it by rounding for others. Some
/// spheres are twice as large or points.
pub fn lattice() -> Spheres {
    let spacing = select(vec![1.0_f32, 0.25, 3.0, 0.1, 0.3, 1.0 / 3.0, 1e-3, 1.1e-20, 7.7e15]);
    let shift = select(vec![0.0_f32, 0.5, 1.0, -4.0, 1e3, -1e6]);
    let spheres = many((uniform3(0_u8..8), select(vec![0.5_f32, 1.0, 0.0])));
    (spacing, shift, spheres)
        .prop_map(|(spacing, shift, spheres)| {
            let place = |at: [u8; 3]| (Vec3::from(at.map(f32::from)) + shift) * spacing;
            spheres.into_iter().map(|(at, size)| sphere(place(at), size * spacing)).collect()
        })
        .boxed()
}

/// Copies of a few spheres, points among them.
pub fn duplicates() -> Spheres {
    let originals = vec((uniform3(-2.0_f32..2.0), select(vec![0.0_f32, 1e-3, 1.0, 2.0])), 1..6);
    (originals, many(any::<Index>()))
        .prop_map(|(originals, picks)| {
            picks.iter().map(|pick| pick.get(&originals)).map(|&(at, r)| Sphere::new(at, r)).collect()
        })
        .boxed()
}

/// One huge sphere, somewhere in the list, among tiny ones in it, about its surface and beyond.
pub fn giant() -> Spheres {
    let ratio = select(vec![1e6_f32, (1 << 20) as f32]);
    let tiny = select(vec![1e-3_f32, 1.0, 1e10, 1e-30]);
    let depth = prop_oneof![3 => Just(1.0_f64), 1 => select(vec![0.0, 0.5, 1.0 + 1e-6, 1.5])];
    let spheres = many((uniform3(-3_i8..=3), depth, -3_i8..=3));
    (ratio, tiny, spheres, any::<Index>())
        .prop_map(|(ratio, tiny, spheres, place)| {
            let radius = ratio * tiny;
            let ulp = f64::from(radius) - f64::from(radius.next_down());
            let place_of = |direction: [i8; 3], depth: f64, gap: i8| {
                let unit = DVec3::from(direction.map(f64::from)).normalize_or_zero();
                let distance = depth * f64::from(radius + tiny) + f64::from(gap) * ulp;
                (unit * distance).as_vec3()
            };
            let mut all: Vec<Sphere> = spheres
                .into_iter()
                .map(|(d, depth, gap)| Sphere::new(place_of(d, depth, gap), tiny))
                .collect();
            all.insert(place.index(all.len() + 1), Sphere::new([0.0; 3], radius));
            all
        })
        .boxed()
}

/// Radii over twenty powers of two, centres on multiples of a power of two, so that many touch exactly.
pub fn powers_of_two() -> Spheres {
    let spheres = many((uniform3(-32_i8..32), -10_i8..=10));
    (select(vec![1.0_f32, 0.25, 8.0]), spheres)
        .prop_map(|(unit, spheres)| {
            let center = |at: [i8; 3]| Vec3::from(at.map(f32::from)) * unit;
            spheres.into_iter().map(|(at, k)| Sphere::new(center(at), f32::from(k).exp2())).collect()
        })
        .boxed()
}

/// Centres on a line or in a plane, along axes or across them.
pub fn flat() -> Spheres {
    let axes = select(vec![[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 1.0], [1.0, 1.0, 0.0]]);
    let spheres = many((uniform3(-20.0_f32..20.0), 0.0_f32..1.5));
    (axes, any::<bool>(), uniform3(-5.0_f32..5.0), spheres)
        .prop_map(|(axes, diagonal, origin, spheres)| {
            let center = |at: [f32; 3]| match diagonal {
                true => Vec3::from(origin) + Vec3::splat(at[0]) * Vec3::from(axes),
                false => Vec3::from(origin) + Vec3::from(at) * Vec3::from(axes),
            };
            spheres.into_iter().map(|(at, r)| Sphere::new(center(at), r)).collect()
        })
        .boxed()
}

/// Clusters of clusters of clusters, with sizes of all three scales.
pub fn clusters() -> Spheres {
    let digits = uniform3(uniform3(-1_i8..=1));
    let spheres = many((digits, 0_i32..3, select(vec![0.1_f32, 0.5, 1.0])));
    (select(vec![1e-2_f32, 1e-4, 1.0 / 1024.0]), spheres)
        .prop_map(|(scale, spheres)| {
            let center = |digits: [[i8; 3]; 3]| {
                digits.iter().rev().fold(Vec3::ZERO, |at, d| at * scale + Vec3::from(d.map(f32::from)))
            };
            spheres.into_iter().map(|(d, k, r)| Sphere::new(center(d), r * scale.powi(k))).collect()
        })
        .boxed()
}

/// Far from the origin, where neighbouring coordinates are units in the last place apart.
pub fn far() -> Spheres {
    let base = prop_oneof![(3_i32..=38).prop_map(|k| 10_f32.powi(k)), Just(f32::MAX)];
    let radius = prop_oneof![
        4 => select(vec![0.0_f64, 0.5, 1.0, 1.5, 2.0]).prop_map(|ulps| (ulps, 0.0)),
        1 => select(vec![1e-30_f64, 1e-3, 1.0, 1e3]).prop_map(|length| (0.0, length)),
    ];
    let spheres = many((uniform3((any::<bool>(), 0_u32..8)), radius));
    (base, any::<bool>(), spheres)
        .prop_map(|(base, both_sides, spheres)| {
            let ulp = f64::from(base) - f64::from(base.next_down());
            let coordinate = |(negative, ulps): (bool, u32)| {
                let x = f32::from_bits(base.to_bits() - ulps);
                if negative && both_sides { -x } else { x }
            };
            let radius = |(ulps, length): (f64, f64)| (ulps * ulp + length) as f32;
            spheres.into_iter().map(|(at, r)| sphere(at.map(coordinate).into(), radius(r))).collect()
        })
        .boxed()
}

/// A finite `f32` of any magnitude: uniform in its bits, so log-uniform in its value.
fn any_magnitude() -> impl Strategy<Value = f32> + Clone {
    (0..f32::INFINITY.to_bits(), any::<bool>()).prop_map(|(bits, negative)| {
        let x = f32::from_bits(bits);
        if negative { -x } else { x }
    })
}

/// Every value log-uniform over all of `f32`.
pub fn any_floats() -> Spheres {
    many((uniform3(any_magnitude()), any_magnitude()))
        .prop_map(|spheres| spheres.into_iter().map(|(at, r)| Sphere::new(at, r.abs())).collect())
        .boxed()
}

/// Values log-uniform over a few powers of two somewhere in the range of `f32`, subnormals included, so that
/// spheres of any magnitude do meet.
pub fn one_magnitude() -> Spheres {
    let value = || (any::<bool>(), 0_u32..4 << 23);
    let lowest = prop_oneof![1 => Just(0_u32), 3 => 0_u32..=250];
    (lowest, many((uniform3(value()), value())))
        .prop_map(|(lowest, spheres)| {
            let float = |(negative, bits): (bool, u32)| {
                let x = f32::from_bits(bits + (lowest << 23));
                if negative { -x } else { x }
            };
            spheres.into_iter().map(|(at, r)| Sphere::new(at.map(float), float(r).abs())).collect()
        })
        .boxed()
}

/// Lengths at which arithmetic in `f32` changes: the smallest numbers, those that many devices take for zero and their
/// neighbours, those whose squares underflow, and as far up.
pub(crate) fn extreme_unit() -> impl Strategy<Value = f32> {
    let exponents =
        [-149, -147, -130, -127, -126, -125, -120, -101, -76, -64, -41, -39, 59, 64, 100, 119, 121];
    select(exponents.to_vec()).prop_map(|exponent| (f64::from(exponent)).exp2() as f32)
}

/// Spheres a few such units wide and apart, many of them in contact; some of another unit, some about a place that is
/// far away on one axis.
pub fn extremes() -> Spheres {
    let element = (uniform3(-32_i8..=32), 0_u8..=8, (0_u8..8).prop_map(|k| k == 0));
    let away = select(vec![[0.0_f32; 3], [0.0, 1.0, 0.0], [1e30, 0.0, 0.0], [0.0, 0.0, -3e38]]);
    (extreme_unit(), extreme_unit(), away, many(element))
        .prop_map(|(unit, other, away, spheres)| {
            let place = |(at, size, is_other): ([i8; 3], u8, bool)| {
                let quarter = 0.25 * f64::from(if is_other { other } else { unit });
                let along = |axis: usize| (f64::from(at[axis]) * quarter + f64::from(away[axis])) as f32;
                sphere(Vec3::new(along(0), along(1), along(2)), (f64::from(size) * quarter) as f32)
            };
            spheres.into_iter().map(place).collect()
        })
        .boxed()
}

/// Radii whose squares overflow `f32`, anywhere.
pub fn huge_radii() -> Spheres {
    let radius = (1e19_f32.to_bits()..=f32::MAX.to_bits()).prop_map(f32::from_bits);
    let center =
        prop_oneof![(-1e20_f32..1e20).boxed(), any_magnitude().boxed(), (f32::MIN..f32::MAX).boxed()];
    many((uniform3(center), radius))
        .prop_map(|spheres| spheres.into_iter().map(|(at, r)| Sphere::new(at, r)).collect())
        .boxed()
}

/// Nothing special: a box with many overlaps and radii from nothing to large.
pub fn soup() -> Spheres {
    let radius = prop_oneof![5 => 0.0_f32..0.4, 1 => 0.4_f32..2.0, 1 => Just(0.0)];
    many((uniform3(-3.0_f32..3.0), radius))
        .prop_map(|spheres| spheres.into_iter().map(|(at, r)| Sphere::new(at, r)).collect())
        .boxed()
}

/// Any of them, and lists put together from two of them.
pub fn any_spheres() -> Spheres {
    let one = prop_oneof![
        lattice(),
        duplicates(),
        giant(),
        powers_of_two(),
        flat(),
        clusters(),
        far(),
        any_floats(),
        one_magnitude(),
        extremes(),
        huge_radii(),
        soup(),
    ];
    let two = (one.clone(), one.clone()).prop_map(|(mut a, mut b)| {
        b.truncate(300);
        a.truncate(300);
        a.append(&mut b);
        a
    });
    prop_oneof![3 => one, 1 => two].boxed()
}

/// Spheres of up to four species, with interactions of every kind: distances that are none, that are somebody's
/// exact distance from somebody else, and that are large beside all radii.
pub fn mixture(spheres: Spheres) -> impl Strategy<Value = Scenario> {
    let interaction = (0_u8..6, any::<[Index; 2]>(), select(vec![1.0_f32, 0.5, 2.0]));
    let table = (1_usize..=4, vec(interaction, 10));
    (spheres, vec(any::<Index>(), 601), table).prop_map(|(spheres, ids, (count, entries))| {
        let mut entries = entries.into_iter();
        let mut next = |(): ()| {
            let (kind, [a, b], factor) = entries.next().expect("ten entries of a triangle");
            match kind {
                0 => Interaction::Never,
                1 => Interaction::Touch,
                2 => Interaction::Within(0.0),
                _ if spheres.is_empty() => Interaction::Within(factor),
                _ => {
                    let (a, b) = (a.get(&spheres).center.as_dvec3(), b.get(&spheres).center.as_dvec3());
                    Interaction::Within((a.distance(b) as f32 * factor).min(f32::MAX))
                }
            }
        };
        let rows = (1..=count).map(|len| (0..len).map(|_| next(())).collect()).collect();
        let species = ids.iter().take(spheres.len()).map(|id| id.index(count) as u32).collect();
        Scenario { spheres, mixture: Some(Mixture { species, rows }) }
    })
}
