//! Bullet 3's `btDbvtBroadphase` through a C++ shim, with one proxy per sphere.

use std::error::Error;
use std::ffi::c_int;
use std::ptr::NonNull;

use lazygrid::{Pair, Sphere};

use crate::measure::{ContenderFactory, Found, PairFinder};
use lazygrid_io::scenes::Scene;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tuning {
    /// Added to a box on each side, in units of length (the largest radius is 1); `None` for Bullet's 0.05.
    pub margin: Option<f32>,
    /// Searches the tree once per step instead of once per updated box.
    pub deferred: bool,
}

impl Tuning {
    pub const SHIPPED: Self = Self { margin: None, deferred: false };

    /// Returns the fastest of [`tunings`] in `bench/results/amd-epyc-2-cores.md`.
    pub fn best(scene: Scene) -> Self {
        let margin = match scene {
            Scene::Equal => 1.0,
            Scene::FiveSizes => 0.5,
            Scene::Transceivers(mixture) => mixture.carrier(),
            _ => 0.25,
        };
        Self { margin: Some(margin), deferred: false }
    }
}

pub fn tunings(scene: Scene) -> Vec<ContenderFactory> {
    let margins: &[f32] = match scene {
        Scene::Equal | Scene::FiveSizes => &[0.05, 0.1, 0.25, 0.5, 1.0, 2.0],
        // Large margins would make nearly all boxes overlap here.
        Scene::Burst | Scene::BurstLinear | Scene::Point | Scene::Transceivers(_) => &[0.05, 0.1, 0.25, 0.5],
    };
    let mut tunings = vec![];
    for &margin in margins {
        for (name, deferred) in [("", false), (", deferred", true)] {
            let tuning = Tuning { margin: Some(margin), deferred };
            tunings.push(incremental(format!("Bullet, margin {margin}{name}"), tuning));
        }
    }
    tunings
}

pub fn incremental(name: impl Into<String>, tuning: Tuning) -> ContenderFactory {
    ContenderFactory::new(name, move || Bullet::new(tuning))
}

pub fn version() -> String {
    let version = lazygrid_bullet_version();
    format!("{}.{:02}", version / 100, version % 100)
}

#[repr(C)]
struct World {
    _private: [u8; 0],
}

unsafe extern "C" {
    fn lazygrid_bullet_new(margin: f32, deferred: c_int) -> *mut World;
    safe fn lazygrid_bullet_version() -> c_int;
    fn lazygrid_bullet_free(world: *mut World);
    fn lazygrid_bullet_step(
        world: *mut World,
        spheres: *const Sphere,
        n: u32,
        pairs: *mut *const Pair,
        found: *mut usize,
    ) -> bool;
}

struct Bullet {
    world: NonNull<World>,
    proxies: Option<usize>,
}

impl Bullet {
    fn new(tuning: Tuning) -> Result<Self, Box<dyn Error>> {
        // SAFETY: the arguments are plain numbers; `Self` owns the result and frees it once, in `drop`.
        let world = unsafe {
            let margin = tuning.margin.unwrap_or(-1.0);
            lazygrid_bullet_new(margin, tuning.deferred.into())
        };
        let world = NonNull::new(world).ok_or("no memory for Bullet's broad phase")?;
        Ok(Self { world, proxies: None })
    }
}

impl Drop for Bullet {
    fn drop(&mut self) {
        // SAFETY: `world` came from `lazygrid_bullet_new` and is freed only here.
        unsafe { lazygrid_bullet_free(self.world.as_ptr()) }
    }
}

impl PairFinder for Bullet {
    fn run(&mut self, spheres: &[Sphere]) -> Result<Found<'_>, Box<dyn Error>> {
        let n = u32::try_from(spheres.len())?;
        if *self.proxies.get_or_insert(spheres.len()) != spheres.len() {
            return Err("the number of spheres must not change, as Bullet's proxies are kept".into());
        }
        let (mut pairs, mut found) = (std::ptr::null(), 0);
        // SAFETY: `spheres` are `n` rows of four floats (`Sphere` is `repr(C)`), as many as proxies, read only during
        // the call. `&mut self` lets one thread at a time use `world`, which is alive.
        let succeeded =
            unsafe { lazygrid_bullet_step(self.world.as_ptr(), spheres.as_ptr(), n, &mut pairs, &mut found) };
        if !succeeded {
            return Err("Bullet ran out of memory".into());
        }
        if found == 0 {
            return Ok(Found::Pairs(&[]));
        }
        // SAFETY: the shim returns `found` pairs of two `u32` (`Pair` is `repr(C)`). They stay in place until its next
        // call, which needs `&mut self` and therefore cannot happen during this borrow.
        Ok(Found::Pairs(unsafe { std::slice::from_raw_parts(pairs, found) }))
    }
}
