//! The families of [`lazygrid_check::scenes::hard`] as `proptest` strategies, which shrink.

use lazygrid::Sphere;
use lazygrid_check::scenes::hard as families;
use lazygrid_check::scenes::hard::TABLE_WORDS;
use proptest::array::uniform12;
use proptest::collection::vec;
use proptest::prelude::*;

use crate::{SceneSeed, TestInput};

pub type Spheres = BoxedStrategy<Vec<Sphere>>;

pub(crate) fn words() -> impl Strategy<Value = SceneSeed> + Clone {
    let element = || uniform12(any::<u32>());
    let elements = prop_oneof![
        3 => vec(element(), 0..12),
        4 => vec(element(), 12..120),
        1 => vec(element(), 120..=600),
    ];
    (element(), elements).prop_map(|(setup, elements)| SceneSeed { setup, elements })
}

macro_rules! strategies {
    ($($name:ident)*) => {$(
        #[doc = concat!("A strategy for [`lazygrid_check::scenes::hard::", stringify!($name), "`].")]
        pub fn $name() -> Spheres {
            words().prop_map(|words| families::$name(&words)).boxed()
        }
    )*};
}

strategies! {
    lattice duplicates giant powers_of_two flat clusters far any_floats one_magnitude extremes huge_radii soup
}

pub fn any_spheres() -> Spheres {
    let family = 0..families::FAMILIES.len();
    let one =
        (family, words()).prop_map(|(family, words)| (families::FAMILIES[family].spheres)(&words)).boxed();
    let two = (one.clone(), one.clone()).prop_map(|(mut a, mut b)| {
        b.truncate(300);
        a.truncate(300);
        a.append(&mut b);
        a
    });
    prop_oneof![3 => one, 1 => two].boxed()
}

pub fn mixture(spheres: Spheres) -> impl Strategy<Value = TestInput> {
    let table = vec(any::<u32>(), TABLE_WORDS);
    (spheres, vec(any::<u32>(), 601), table).prop_map(|(spheres, ids, table)| {
        let table = table.try_into().expect("TABLE_WORDS words");
        let mixture = families::mixture(&spheres, &table, &ids[..spheres.len()]);
        TestInput { spheres, mixture: Some(mixture), ..TestInput::default() }
    })
}
