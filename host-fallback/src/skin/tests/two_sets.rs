use lazygrid_kernels::{Exclusions, Query};

use super::*;

const SPHERES: usize = 3000;

/// Spheres of both sets, in one number type.
enum Rows {
    F32(Vec<Sphere>),
    F64(Vec<[f64; 4]>),
}

impl Rows {
    fn sets(&self, split: usize) -> [Spheres<'_>; 2] {
        match self {
            Self::F32(rows) => [rows[..split].into(), rows[split..].into()],
            Self::F64(rows) => [rows[..split].into(), rows[split..].into()],
        }
    }

    fn all(&self) -> Spheres<'_> {
        match self {
            Self::F32(rows) => rows.into(),
            Self::F64(rows) => rows.into(),
        }
    }
}

fn follow(settings: Settings, is_f64: bool, query_of: impl Fn(usize) -> Option<usize>) -> usize {
    let ids = species(SPHERES);
    let bonds = Exclusions::new(SPHERES, (0..400).map(|k| (k, SPHERES as u32 - 1 - k))).expect("in range");
    let mut off = new_detector(Settings { skin: Skin::Off, ..settings.clone() });
    let mut detector = new_detector(settings);
    let (mut spheres, mut random, mut served) = (gas(SPHERES, 3, 20.0), Random(5), 0);
    for call in 0..50 {
        let rows = if is_f64 { Rows::F64(wide(&spheres)) } else { Rows::F32(spheres.clone()) };
        let query = match query_of(call) {
            Some(split) => {
                let [first, second] = rows.sets(split);
                let (of_first, of_second) = ids.split_at(split);
                let first = first.with_species(of_first).expect("one id for each");
                Query::new((first, second.with_species(of_second).expect("one id for each")))
            }
            None => Query::new(rows.all().with_species(&ids).expect("one id for each")).without(&bonds),
        };
        let expected = off.pairs(query).expect("valid").to_vec();
        assert!(!expected.is_empty());
        assert_eq!(detector.pairs(query).expect("valid"), expected, "f64: {is_f64}, call {call}");
        served += usize::from(is_served(&detector));
        step(&mut spheres, 0.05, &mut random);
    }
    served
}

#[test]
fn candidates_of_two_sets_never_change_an_answer() {
    for skin in [Skin::Auto, Skin::Fixed(0.3)] {
        for (k, settings) in settings(skin).into_iter().enumerate() {
            for is_f64 in [false, true] {
                let served = follow(settings.clone(), is_f64, |_| Some(1000));
                assert!(served > 10, "{skin:?}, settings {k}: {served} served");
            }
        }
    }
}

#[test]
fn candidates_serve_no_other_sets_of_as_many_spheres() {
    for settings in settings(Skin::Fixed(0.5)) {
        for is_f64 in [false, true] {
            let served =
                follow(settings.clone(), is_f64, |call| [Some(1000), Some(1100), None][call / 2 % 3]);
            assert!(served > 10, "{served} served");
        }
    }
}

#[test]
fn bad_spheres_of_a_second_set_are_refused_and_forgotten() {
    for is_f64 in [false, true] {
        let settings = Settings { skin: Skin::Fixed(1.0), ..Settings::default() };
        let mut detector = new_detector(settings);
        let spheres = gas(SPHERES, 2, 20.0);
        let mut count = |spheres: &[Sphere]| {
            let rows = if is_f64 { Rows::F64(wide(spheres)) } else { Rows::F32(spheres.to_vec()) };
            let [first, second] = rows.sets(1000);
            detector.count((first, second))
        };
        let expected = count(&spheres);
        for bad in [Sphere::new([f32::NAN, 0.0, 0.0], 1.0), Sphere::new([0.0; 3], -1.0)] {
            assert_eq!(count(&spheres), expected);
            let mut wrong = spheres.clone();
            wrong[1234] = bad;
            let refused = count(&wrong);
            assert!(matches!(refused, Err(Error::Input(InputError::SecondSet(_)))), "{refused:?}");
            assert_eq!(count(&spheres), expected);
        }
    }
}
