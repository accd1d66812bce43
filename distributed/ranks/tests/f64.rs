//! Spheres within 2 ulp of tangency, against one process and the exact contact test.

#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use std::ops::ControlFlow;

use common::{Random, table};
use lazygrid::Interaction::{self, Never, Touch, Within};
use lazygrid::{Algorithm, Config, Detector, Interactions, Order, Space, Spheres};
use lazygrid_ranks::{
    ClassBounds, Communicator, Ghosts, Migration, PairKind, Particle, Partitioner, RankBounds, Search,
    SphereWrapper, threads,
};

type Row = [f64; 4];

/// Species pair within distances that `f32` does not represent, or touch.
const TABLE: [Interaction; 6] = [Never, Within(0.7), Touch, Within(0.3), Never, Touch];

#[derive(Clone, Copy, Debug)]
enum Placement {
    InTurn,
    Balanced,
}

#[derive(Clone, Debug)]
struct Scene {
    rows: Vec<Row>,
    space: Space,
    with_species: bool,
    algorithm: Algorithm,
}

#[derive(Clone, Copy, Debug)]
struct Scale {
    unit: f64,
    offset: f64,
    images: f64,
}

const PLAIN: Scale = Scale { unit: 1.0, offset: 0.0, images: 0.0 };

fn length([x, y, z]: [f64; 3]) -> f64 {
    let unit = x.abs().max(y.abs()).max(z.abs());
    if unit == 0.0 { 0.0 } else { unit * [x, y, z].map(|x| (x / unit).powi(2)).iter().sum::<f64>().sqrt() }
}

fn by_ulps(number: f64, ulps: i64) -> f64 {
    f64::from_bits(number.to_bits().saturating_add_signed(ulps))
}

fn tangent(random: &mut Random, space: &Space, scale: Scale, distance: Option<f64>) -> [Row; 2] {
    let Scale { unit, offset, images } = scale;
    let a = [0, 1, 2].map(|_| offset + 9.9 * unit * random.next_f64());
    let direction = [0, 1, 2].map(|_| random.next_f64() - 0.5);
    let sum = distance.unwrap_or(unit * (0.1 + 0.4 * random.next_f64()));
    let mut b = [0, 1, 2].map(|k| a[k] + sum / length(direction) * direction[k]);
    for vector in space.cell_vectors().into_iter().flatten() {
        let times = (images * (2.0 * random.next_f64() - 1.0)).round();
        b = [0, 1, 2].map(|k| b[k] + times * vector[k]);
    }
    let ulps = (5.0 * random.next_f64()) as i64 - 2;
    if distance.is_some() {
        b[0] = f64::from_bits(b[0].abs().to_bits().saturating_add_signed(ulps)).copysign(b[0]);
    }
    let apart = length(space.minimum_image(a, b).vector);
    let radius = apart * random.next_f64();
    [[a[0], a[1], a[2], radius], [b[0], b[1], b[2], by_ulps(apart - radius, ulps)]]
}

fn scene(pairs: usize, space: Space, scale: Scale) -> Scene {
    let mut random = Random(7);
    let rows = (0..pairs).flat_map(|_| tangent(&mut random, &space, scale, None)).collect();
    Scene { rows, space, with_species: false, algorithm: Algorithm::Auto }
}

fn spaces() -> Vec<Space> {
    let lengths = [Some(10.1), Some(10.3), Some(9.87)];
    let tilted = |tilt: f64, last: bool| {
        let last = last.then_some([0.0, 0.1, 9.87]);
        Space::triclinic([Some([10.1, 0.0, 0.0]), Some([tilt, 10.3, 0.0]), last]).unwrap()
    };
    vec![
        Space::UNBOUNDED,
        Space::periodic(lengths).unwrap(),
        Space::periodic([lengths[0], None, lengths[2]]).unwrap(),
        tilted(0.7, true),
        tilted(1e-9, false),
    ]
}

fn scaled(space: &Space, unit: f64) -> Space {
    let vectors = space.cell_vectors().map(|vector| vector.map(|vector| vector.map(|number| number * unit)));
    Space::triclinic(vectors).unwrap()
}

impl Scene {
    fn species(&self) -> Vec<u32> {
        (0..self.rows.len() as u32).map(|k| k % 2 + k / 2 % 2).collect()
    }

    fn table(&self) -> Option<Interactions> {
        self.with_species.then(|| table(TABLE))
    }

    fn config(&self) -> Config {
        let config = Config::default().space(self.space).interactions(self.table()).threads(1);
        config.order(Order::Unordered)
    }

    fn expected(&self) -> Vec<[u64; 2]> {
        let (table, species) = (self.table(), self.species());
        let is_pair = |i: usize, j: usize| {
            let with = table.as_ref().map_or(Touch, |table| table.get(species[i], species[j]));
            with.distance().is_some_and(|distance| self.space.touch(self.rows[i], self.rows[j], distance))
        };
        let all = (0..self.rows.len()).flat_map(|j| (0..j).map(move |i| [i, j]));
        let mut exact: Vec<_> =
            all.filter(|&[i, j]| is_pair(i, j)).map(|pair| pair.map(|k| k as u64)).collect();
        exact.sort_unstable();
        let spheres = Spheres::from(&self.rows).with_species(&species).unwrap();
        let mut detector = Detector::new(self.config().order(Order::Canonical)).unwrap();
        let found = detector.pairs(spheres).unwrap().iter().map(|pair| [pair.i, pair.j].map(u64::from));
        assert!(found.eq(exact.iter().copied()), "one process");
        exact
    }

    fn check(&self) -> usize {
        let expected = self.expected();
        for (ranks, placement) in [
            (1, Placement::InTurn),
            (2, Placement::InTurn),
            (3, Placement::Balanced),
            (5, Placement::InTurn),
            (8, Placement::Balanced),
        ] {
            let of_ranks = threads::on(ranks, |communicator| {
                Rank::new(self, communicator, placement).pairs(self).unwrap()
            });
            let mut found: Vec<_> = of_ranks.into_iter().flatten().collect();
            found.sort_unstable();
            let (n, m) = (found.len(), expected.len());
            assert!(found == expected, "{placement:?} on {ranks} ranks: {n} pairs and not {m}");
        }
        expected.len()
    }
}

struct Rank<C> {
    communicator: C,
    wrapper: SphereWrapper,
    rows: Vec<Row>,
    ids: Vec<u64>,
}

impl<C: Communicator<Error = String>> Rank<C> {
    fn new(scene: &Scene, mut communicator: C, placement: Placement) -> Self {
        let (rank, ranks) = (communicator.rank(), communicator.ranks());
        let wrapper = SphereWrapper::new(scene.space, scene.table().as_ref());
        let mut ids: Vec<u64> =
            (0..scene.rows.len() as u64).filter(|id| id % u64::from(ranks) == u64::from(rank)).collect();
        if let Placement::Balanced = placement {
            let rows: Vec<_> = ids.iter().map(|&id| scene.rows[id as usize]).collect();
            let wrapped = wrapper.wrap_all_f64(Spheres::from(&rows)).unwrap();
            let assigned = Partitioner::default().assign(&mut communicator, &wrapped, &ids, 1.2).unwrap();
            let migration = Migration::to_ranks(&assigned.ranks, ranks).unwrap();
            ids = migration.apply(&mut communicator, "ids", |k| ids[k as usize]).unwrap();
        }
        let rows = ids.iter().map(|&id| scene.rows[id as usize]).collect();
        Self { communicator, wrapper, rows, ids }
    }

    fn pairs(mut self, scene: &Scene) -> Result<Vec<[u64; 2]>, String> {
        let (rank, ranks) = (self.communicator.rank(), self.communicator.ranks());
        let species: Vec<u32> = self.ids.iter().map(|&id| scene.species()[id as usize]).collect();
        let spheres = Spheres::from(&self.rows).with_species(&species).unwrap();
        let wrapped = self.wrapper.wrap_all_f64(spheres).unwrap();
        let bounds = RankBounds::gather(&mut self.communicator, &wrapped)?;
        let leaving = bounds.ghosts(rank, &wrapped, &self.wrapper).unwrap();
        let particle = |k: u32| {
            let (id, species) = (self.ids[k as usize], species[k as usize]);
            Particle { sphere: spheres.get(k as usize), id, species, index: k }
        };
        let row = |k: u32| self.rows[k as usize];
        let ghosts = Ghosts::exchange_f64(&mut self.communicator, &leaving, particle, row)?;
        let detector = Detector::new(scene.config().algorithm(scene.algorithm)).unwrap();
        let mut search = Search::new(detector, scene.config(), self.wrapper, rank, ranks).unwrap();
        let mut pairs = Vec::new();
        // The second call has the candidate list and the frame of the first.
        for _ in 0..2 {
            pairs.clear();
            let counts = search.run(spheres, &ghosts, |kind, found| {
                let other = |k: u32| match kind {
                    PairKind::Local => self.ids[k as usize],
                    PairKind::WithGhost => ghosts.particles()[k as usize].id,
                };
                let ids = found.iter().map(|&[i, j]| [self.ids[i as usize], other(j)]);
                pairs.extend(ids.map(|[a, b]| [a.min(b), a.max(b)]));
                ControlFlow::Continue(())
            });
            let counted = search.count(spheres, &ghosts).unwrap().reported();
            assert_eq!([counts.unwrap().reported(), counted], [pairs.len() as u64; 2]);
        }
        Ok(pairs)
    }
}

#[test]
fn ranks_decide_in_f64() {
    for space in spaces() {
        let scene = scene(150, space, PLAIN);
        let rounded = scene.rows.iter().map(|row| row.map(|x| f64::from(x as f32))).collect();
        let rounded = Scene { rows: rounded, ..scene.clone() }.expected();
        let count = scene.check();
        assert!(count > 70 && rounded != scene.expected(), "{count} in {space:?}");
        Scene { algorithm: Algorithm::RecursiveGrid, ..scene }.check();
    }
}

#[test]
fn spheres_far_from_the_origin_are_decided_in_f64() {
    for space in spaces() {
        for offset in [1e9, -1e30, 1e300] {
            // Leaves some digits to differences of coordinates.
            let unit = if offset == 1e9 { 1.0 } else { 1e-12 * f64::abs(offset) };
            let space = scaled(&space, unit);
            assert!(
                scene(60, space, Scale { unit, offset, images: 0.0 }).check() > 20,
                "{space:?} at {offset:e}"
            );
        }
        if space.is_periodic() {
            for images in [2.0, 1e9] {
                assert!(scene(60, space, Scale { images, ..PLAIN }).check() > 10, "{space:?}, {images:e}");
            }
        }
    }
}

#[test]
fn sizes_beyond_f32_are_decided_in_f64() {
    for space in spaces() {
        for unit in [1e-300, 1e-60, 1e60, 1e300] {
            let space = scaled(&space, unit);
            assert!(scene(60, space, Scale { unit, ..PLAIN }).check() > 20, "{space:?} at {unit:e}");
        }
    }
    let mut random = Random(3);
    let mut rows = Vec::new();
    for k in 0..150 {
        let scale =
            Scale { unit: 1e-310 * 10.0_f64.powi(615 * k / 300) * 10.0_f64.powi(615 * k / 300), ..PLAIN };
        rows.extend(tangent(&mut random, &Space::UNBOUNDED, scale, None));
    }
    let (space, algorithm) = (Space::UNBOUNDED, Algorithm::Auto);
    let count = Scene { rows, space, with_species: false, algorithm }.check();
    assert!(count > 70, "{count}");
}

#[test]
fn distances_of_species_are_decided_in_f64() {
    for space in spaces() {
        for scale in [PLAIN, Scale { offset: 1e9, ..PLAIN }] {
            let mut random = Random(5);
            let mut next = |k: usize| tangent(&mut random, &space, scale, k.is_multiple_of(2).then_some(0.7));
            let rows = (0..150).flat_map(&mut next).collect();
            let scene = Scene { rows, space, with_species: true, algorithm: Algorithm::Auto };
            let count = scene.check();
            assert!(count > 20, "{count} in {space:?}");
        }
    }
}

/// Each sphere is alone in its box, so no other sphere makes it a ghost.
#[test]
fn touching_spheres_have_boxes_that_may_pair() {
    let mut random = Random(11);
    let mut touching = 0;
    for space in spaces() {
        for k in 0..20_000 {
            let unit = [1.0, 1.0, 1.0, 1e-320, 1e-305, 1e-160, 1e-30, 1e30, 1e150, 1e290][k % 10];
            let space = if unit == 1e-320 { Space::UNBOUNDED } else { scaled(&space, unit) };
            let offset = unit * [0.0, 0.0, 1e3, 1e9, 1e6, -1e7][k / 10 % 6];
            let images = [0.0, 1.0, 100.0, 1e9, 1e15][k / 60 % 5];
            let scale = Scale { unit, offset, images };
            let [a, b] = tangent(&mut random, &space, scale, None);
            let within = k.is_multiple_of(3).then_some(a[3] + b[3]).filter(|distance| distance.is_finite());
            let table = within.map(|distance| Interactions::new(1, Within(distance)).unwrap());
            let wrapper = SphereWrapper::new(space, table.as_ref());
            let [at_a, at_b] = [a, b].map(|row| ClassBounds::around(&wrapper.wrap_f64(row, 0)));
            let is_touching = space.touch(a, b, within);
            touching += usize::from(is_touching);
            assert!(!is_touching || at_a.can_pair(&at_b, &wrapper), "{a:?} and {b:?} in {space:?}");
        }
    }
    assert!(touching > 20_000, "{touching}");
}

#[test]
fn boxes_of_far_spheres_in_f64_do_not_pair() {
    for unit in [1e-320, 1e-300, 1.0, 1e160, 1e300] {
        let wrapper = SphereWrapper::new(Space::UNBOUNDED, None);
        let bounds =
            |x: f64, r: f64| ClassBounds::around(&wrapper.wrap_f64([x * unit, 0.0, 0.0, r * unit], 0));
        let can_pair = |x: f64| bounds(0.0, 2.0).can_pair(&bounds(x, 1.0), &wrapper);
        assert!(can_pair(3.0) && !can_pair(3.1), "{unit:e}");
    }
}

#[test]
fn f32_spheres_in_other_boxes_need_f64() {
    let needs = |space: &Space| SphereWrapper::new(*space, None).needs_f64();
    assert_eq!(spaces().iter().map(needs).collect::<Vec<_>>(), [false, true, true, false, false]);
    let mut within = Interactions::new(1, Within(0.7)).unwrap();
    assert!(!SphereWrapper::new(Space::UNBOUNDED, Some(&within)).needs_f64());
    within.set(0, 0, Within(1e-60)).unwrap();
    assert!(SphereWrapper::new(Space::UNBOUNDED, Some(&within)).needs_f64());
}
