//! A Verlet list: tests candidates of the plain cell list until some sphere has moved by half the skin.

use std::error::Error;

use lazygrid::{Pair, Sphere};

use super::cell_list::CellList;
use super::touch;
use crate::measure::{ContenderFactory, Found, PairFinder};
use lazygrid_io::scenes::Scene;

/// Returns the fastest of [`skins`] for a largest radius of 1, by `--mode skins --output unordered
/// --algorithm auto --steps 100 --rounds 3 --step-length 0.01` of the bench `peers`. Skins of other scenes
/// than equal spheres were measured with steps of a tenth.
fn best(scene: Scene, step_length: f32) -> f32 {
    match scene {
        Scene::Equal if step_length <= 0.003 => 0.1,
        Scene::Equal if step_length <= 0.03 => 0.5,
        Scene::Equal => 2.0,
        Scene::FiveSizes => 1.0,
        Scene::Burst | Scene::BurstLinear | Scene::Point => 0.1,
        // Not measured: nearly all spheres are carriers, so it is the skin of equal spheres. Transceivers
        // exceed its limit at each step.
        Scene::Transceivers(mixture) => 2.0 * mixture.carrier(),
    }
}

pub fn tuned(name: impl Into<String>, scene: Scene, step_length: f32) -> ContenderFactory {
    with(name, scene, best(scene, step_length))
}

pub fn skins(scene: Scene) -> Vec<ContenderFactory> {
    let with_skin = |skin: f32| with(format!("Verlet list, skin {skin}"), scene, skin);
    [0.02, 0.05, 0.1, 0.25, 0.5, 1.0, 1.5, 2.0, 2.5].map(with_skin).into()
}

fn with(name: impl Into<String>, scene: Scene, skin: f32) -> ContenderFactory {
    ContenderFactory::new(name, move || Ok(Verlet::new(scene, skin)))
}

struct Verlet {
    skin: f32,
    list: CellList,
    wide: Vec<Sphere>,
    order: Vec<u32>,
    index_of: Vec<u32>,
    now: Vec<Sphere>,
    then: Vec<Sphere>,
    candidates: Vec<Pair>,
    pairs: Vec<Pair>,
}

impl Verlet {
    fn new(scene: Scene, skin: f32) -> Self {
        Self {
            skin,
            list: CellList::from_scene(scene),
            wide: vec![],
            order: vec![],
            index_of: vec![],
            now: vec![],
            then: vec![],
            candidates: vec![],
            pairs: vec![],
        }
    }

    fn advance(&mut self, spheres: &[Sphere]) -> bool {
        if self.order.len() != spheres.len() {
            return false;
        }
        let most = 0.25 * self.skin * self.skin * 0.9999;
        let mut farthest = 0.0_f32;
        for ((now, then), &k) in self.now.iter_mut().zip(&self.then).zip(&self.order) {
            *now = spheres[k as usize];
            farthest = farthest.max(now.center.distance_squared(then.center));
        }
        farthest <= most
    }

    fn find(&mut self, spheres: &[Sphere]) {
        let widen = |sphere: &Sphere| Sphere { radius: sphere.radius + 0.5 * self.skin, ..*sphere };
        self.wide.clear();
        self.wide.extend(spheres.iter().map(widen));
        self.candidates.clone_from(self.list.pairs_of(&self.wide));
        self.order.clear();
        self.order.extend(self.list.order());
        self.index_of.resize(spheres.len(), 0);
        for (index, &k) in (0..).zip(&self.order) {
            self.index_of[k as usize] = index;
        }
        for pair in &mut self.candidates {
            *pair = Pair::new(self.index_of[pair.i as usize], self.index_of[pair.j as usize]);
        }
        self.now.clear();
        self.now.extend(self.order.iter().map(|&k| spheres[k as usize]));
        self.then.clone_from(&self.now);
    }
}

impl PairFinder for Verlet {
    fn run(&mut self, spheres: &[Sphere]) -> Result<Found<'_>, Box<dyn Error>> {
        if !self.advance(spheres) {
            self.find(spheres);
        }
        self.pairs.clear();
        for &Pair { i, j } in &self.candidates {
            if touch(&self.now[i as usize], &self.now[j as usize]) {
                self.pairs.push(Pair::new(self.order[i as usize], self.order[j as usize]));
            }
        }
        Ok(Found::Pairs(&self.pairs))
    }
}
