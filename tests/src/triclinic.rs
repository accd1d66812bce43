//! The families of [`lazygrid_check::scenes::triclinic`] as strategies.

use lazygrid_check::scenes::triclinic as families;
use proptest::prelude::*;

use crate::hard::words;
use crate::{SceneSeed, TestInput};

macro_rules! strategies {
    ($($name:ident)*) => {$(
        #[doc = concat!("A strategy for [`lazygrid_check::scenes::triclinic::", stringify!($name), "`].")]
        pub fn $name() -> impl Strategy<Value = TestInput> {
            words().prop_map(|words| families::$name(&words))
        }
    )*};
}

strategies! { lattice soup directions carried_away corners ends_of_the_range largest_spheres }

pub fn mixture() -> impl Strategy<Value = TestInput> {
    let spheres = words().prop_map(|words| families::sizes(&words)).boxed();
    (crate::hard::mixture(spheres), any::<[u32; 12]>()).prop_map(|(scenario, setup)| {
        let space = families::soup(&SceneSeed { setup, elements: Vec::new() }).space;
        TestInput { space, ..scenario }
    })
}
