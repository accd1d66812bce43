#![allow(dead_code, reason = "each test binary uses a part")]

use lazygrid::{Interaction, Interactions, Space, Sphere};
use lazygrid_ranks::Particle;
use lazygrid_ranks::in_process::RankPairs;

pub(crate) fn naive(particles: &[Particle], space: &Space, table: Option<&Interactions>) -> Vec<[u64; 2]> {
    let mut pairs = Vec::new();
    for (k, a) in particles.iter().enumerate() {
        for b in &particles[..k] {
            let cutoff = match table.map_or(Interaction::Touch, |table| table.get(a.species, b.species)) {
                Interaction::Never => continue,
                Interaction::Touch => f64::from(a.sphere.radius) + f64::from(b.sphere.radius),
                Interaction::Within(distance) => distance,
            };
            if space.distance_squared(a.sphere.center, b.sphere.center) <= cutoff * cutoff {
                pairs.push([a.id.min(b.id), a.id.max(b.id)]);
            }
        }
    }
    pairs.sort_unstable();
    pairs
}

pub(crate) fn sorted_pairs(of_ranks: Vec<RankPairs>) -> Vec<[u64; 2]> {
    let mut pairs: Vec<_> = of_ranks.into_iter().flat_map(|rank| rank.pairs).collect();
    pairs.sort_unstable();
    pairs
}

pub(crate) fn numbered(spheres: impl IntoIterator<Item = Sphere>) -> Vec<Particle> {
    let particle = |(id, sphere)| Particle { sphere, id, species: (id % 3) as u32, index: 0 };
    (0..).zip(spheres).map(particle).collect()
}

/// Sets the interactions 0–0, 0–1, 0–2, 1–1, 1–2 and 2–2.
pub(crate) fn table(interactions: [Interaction; 6]) -> Interactions {
    let mut table = Interactions::new(3, Interaction::Never).unwrap();
    let pairs = [[0, 0], [0, 1], [0, 2], [1, 1], [1, 2], [2, 2]];
    for ([one, other], interaction) in pairs.into_iter().zip(interactions) {
        table.set(one, other, interaction).unwrap();
    }
    table
}

pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1_u32 << 24) as f32
    }

    pub(crate) fn next_f64(&mut self) -> f64 {
        self.next();
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub(crate) fn point(&mut self, side: f32) -> [f32; 3] {
        [(); 3].map(|()| side * self.next())
    }

    pub(crate) fn normal(&mut self) -> f32 {
        (0..12).map(|_| self.next()).sum::<f32>() - 6.0
    }
}
