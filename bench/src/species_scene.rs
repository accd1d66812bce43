use lazygrid::{Interaction, Interactions, Sphere};
use lazygrid_io::scenes::Scene;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, UnitBall};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpeciesScene {
    /// A burst of one species, with one partner in a thousand spheres.
    RarePartner,
    /// A crowd that pairs at short distances; one sphere in a thousand is a partner at a large distance.
    DistantPartner,
    /// One enzyme per 25 substrate molecules, all nearly at one point.
    Enzymes,
    /// One target in a crowd of its partner.
    Target,
    Ring,
    AllPair,
    DisjointPairs,
    /// Three disjoint pairs of species, nearly at one point.
    DisjointPairsCrowd,
    /// A burst of one of ten species, with one sphere in a thousand of the others.
    TenSpecies,
}

impl SpeciesScene {
    pub const ALL: [Self; 9] = [
        Self::RarePartner,
        Self::DistantPartner,
        Self::Enzymes,
        Self::Target,
        Self::Ring,
        Self::AllPair,
        Self::DisjointPairs,
        Self::DisjointPairsCrowd,
        Self::TenSpecies,
    ];

    pub const fn name(self) -> &'static str {
        match self {
            Self::RarePartner => "rare-partner",
            Self::DistantPartner => "distant-partner",
            Self::Enzymes => "enzymes",
            Self::Target => "target",
            Self::Ring => "ring",
            Self::AllPair => "all-pair",
            Self::DisjointPairs => "disjoint-pairs",
            Self::DisjointPairsCrowd => "disjoint-pairs-crowd",
            Self::TenSpecies => "ten-species",
        }
    }

    pub fn spheres(self, n: usize, seed: u64) -> Vec<Sphere> {
        let (extent, radius) = match self {
            Self::RarePartner | Self::TenSpecies => (0.5, 0.05),
            Self::DistantPartner => (0.25, 0.001),
            Self::Enzymes | Self::DisjointPairsCrowd => (0.05, 0.005),
            Self::Target => (7.0, 0.5),
            Self::Ring | Self::AllPair | Self::DisjointPairs => return Scene::Equal.spheres(n, seed),
        };
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let sphere = |k: usize| {
            let extent = if self.is_distant(k) { 50.0 } else { extent };
            Sphere::new(UnitBall.sample(&mut random).map(|x: f32| extent * x), radius)
        };
        (0..n).map(sphere).collect()
    }

    pub fn species(self, n: usize) -> Vec<u32> {
        let species = |k: usize| match self {
            Self::RarePartner => u32::from(k % 1000 == 999),
            Self::DistantPartner => u32::from(self.is_distant(k)),
            Self::Enzymes => u32::from(!k.is_multiple_of(26)),
            Self::Target => u32::from(k > 0),
            Self::Ring | Self::AllPair => k as u32 % 4,
            Self::DisjointPairs | Self::DisjointPairsCrowd => k as u32 % 6,
            Self::TenSpecies if k % 1000 == 999 => [9, 0, 1, 2, 3, 4, 5, 6, 7][k / 1000 % 9],
            Self::TenSpecies => 8,
        };
        (0..n).map(species).collect()
    }

    fn is_distant(self, k: usize) -> bool {
        self == Self::DistantPartner && k % 1000 == 999
    }

    pub const fn is_of_two_sets(self) -> bool {
        matches!(self, Self::RarePartner | Self::Enzymes | Self::Target)
    }

    pub fn table(self) -> Result<Interactions, lazygrid::Error> {
        let (count, pairs): (_, &[(u32, u32)]) = match self {
            Self::RarePartner | Self::Enzymes | Self::Target => (2, &[(0, 1)]),
            Self::Ring => (4, &[(0, 1), (1, 2), (2, 3), (0, 3)]),
            Self::DisjointPairs | Self::DisjointPairsCrowd => (6, &[(0, 1), (2, 3), (4, 5)]),
            Self::TenSpecies => (10, &[(0, 1), (2, 3), (4, 5), (6, 7), (8, 9)]),
            Self::AllPair => return Ok(Interactions::new(4, Interaction::Touch)?),
            Self::DistantPartner => {
                let mut table = Interactions::new(2, Interaction::Within(0.002))?;
                table.set(0, 1, Interaction::Within(2.0))?;
                return Ok(table);
            }
        };
        let mut table = Interactions::new(count, Interaction::Never)?;
        for &(a, b) in pairs {
            table.set(a, b, Interaction::Touch)?;
        }
        Ok(table)
    }
}
