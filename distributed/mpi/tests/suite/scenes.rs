use lazygrid::{Backend, Detector, Space, Sphere, Spheres};
use lazygrid_mpi::{Config, GlobalPair, LocalSpheres, OwnedSpheres};
use mpi::Count;
use mpi::collective::SystemOperation;
use mpi::datatype::PartitionMut;
use mpi::topology::SimpleCommunicator;
use mpi::traits::{Communicator, CommunicatorCollectives};

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Scene {
    Uniform,
    FiveSizes,
    Giant,
    Gaussian,
    WideSizes,
    Point,
}

impl Scene {
    pub(crate) const ALL: [Self; 6] =
        [Self::Uniform, Self::FiveSizes, Self::Giant, Self::Gaussian, Self::WideSizes, Self::Point];

    pub(crate) fn sphere(self, k: u64, n: u64) -> Sphere {
        let side = (n as f32).cbrt() * 4.0;
        let cube = || [0, 1, 2].map(|axis| side * (random(k, axis) - 0.5));
        match self {
            Self::Uniform => Sphere::new(cube(), 1.0),
            Self::FiveSizes => Sphere::new(cube(), 0.5_f32.powi(k as i32 % 5) * 1.5),
            Self::Giant if k == n / 2 => Sphere::new([0.0; 3], side / 4.0),
            Self::Giant => Sphere::new(cube(), 0.8),
            Self::Gaussian => Sphere::new([0, 1, 2].map(|axis| side * 0.3 * normal(k, axis)), 0.8),
            Self::WideSizes if k % 1000 == 7 => Sphere::new(cube(), 10.0),
            Self::WideSizes => Sphere::new(cube(), 10.0 * 10_f32.powf(-1.0 - 3.0 * random(k, 9))),
            Self::Point => Sphere::new([1.0, 2.0, 3.0], 0.5),
        }
    }

    pub(crate) fn all(self, n: u64) -> Vec<Sphere> {
        (0..n).map(|k| self.sphere(k, n)).collect()
    }

    pub(crate) fn owned(self, n: u64, rank: u32, owner: impl Fn(u64) -> u32) -> OwnedSpheres {
        let mine = || (0..n).filter(|&k| owner(k) == rank);
        OwnedSpheres {
            spheres: mine().map(|k| self.sphere(k, n)).collect(),
            ids: mine().map(id).collect(),
            ..OwnedSpheres::default()
        }
    }
}

pub(crate) fn id(k: u64) -> u64 {
    k.wrapping_mul(0x9E37_79B9_7F4A_7C15)
}

pub(crate) fn random(k: u64, stream: u64) -> f32 {
    let mut word = (k << 8 | stream).wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    word = (word ^ (word >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    word = (word ^ (word >> 32)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((word ^ (word >> 31)) >> 40) as f32 / (1_u32 << 24) as f32
}

fn normal(k: u64, axis: u64) -> f32 {
    (0..6).map(|j| random(k, 16 + 8 * axis + j)).sum::<f32>() - 3.0
}

pub(crate) fn config() -> Config {
    Config::default().backend(Backend::Cpu).threads(1)
}

pub(crate) fn local(particles: &OwnedSpheres) -> LocalSpheres<'_> {
    particles.local().unwrap()
}

pub(crate) fn ids(pair: &lazygrid::Pair) -> [u64; 2] {
    let (a, b) = (id(pair.i.into()), id(pair.j.into()));
    [a.min(b), a.max(b)]
}

pub(crate) fn expected<'a>(spheres: impl Into<Spheres<'a>>, space: Space) -> Vec<[u64; 2]> {
    let config = lazygrid::Config::default().backend(Backend::Cpu).space(space).threads(1);
    let mut detector = Detector::new(config).unwrap();
    let mut pairs: Vec<_> = detector.pairs(spheres.into()).unwrap().iter().map(ids).collect();
    pairs.sort_unstable();
    pairs
}

pub(crate) fn gathered(world: &SimpleCommunicator, pairs: &[GlobalPair]) -> Vec<[u64; 2]> {
    let local: Vec<u64> = pairs.iter().flat_map(GlobalPair::ids).collect();
    let mut counts = vec![0 as Count; world.size() as usize];
    world.all_gather_into(&(local.len() as Count), &mut counts[..]);
    let starts: Vec<Count> =
        counts.iter().scan(0, |next, count| Some(std::mem::replace(next, *next + count))).collect();
    let mut all = vec![0_u64; counts.iter().sum::<Count>() as usize];
    world.all_gather_varcount_into(&local[..], &mut PartitionMut::new(&mut all[..], &counts[..], starts));
    let mut all: Vec<[u64; 2]> = all.chunks_exact(2).map(|two| [two[0], two[1]]).collect();
    all.sort_unstable();
    all
}

pub(crate) fn sum(world: &SimpleCommunicator, value: u64) -> u64 {
    let mut total = 0;
    world.all_reduce_into(&value, &mut total, SystemOperation::sum());
    total
}

pub(crate) fn digest(pairs: impl IntoIterator<Item = [u64; 2]>) -> u64 {
    let one = |[a, b]: [u64; 2]| {
        let word = (a ^ b.rotate_left(17)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        (word ^ (word >> 31)).wrapping_mul(0x94D0_49BB_1331_11EB)
    };
    pairs.into_iter().map(one).fold(0, u64::wrapping_add)
}
