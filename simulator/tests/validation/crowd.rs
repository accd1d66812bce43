//! Spheres that do not overlap: how they stand around each other, and what elastic ones keep.

use std::f64::consts::PI;

use lazygrid::{Config, Detector, Space};
use lazygrid_sim::{Boundary, Contact, Model, Particles, Shape, Species};

use crate::Row;
use crate::setup::{begin, burst, share_error, species, steps};

/// Spheres of diameter 1 that fill 40 % of a periodic box.
const PACKING: f64 = 0.40;
/// Spheres along an edge of the lattice that they begin on.
const EDGE: u32 = 12;

fn model(contact: Contact, time_step: f64, kind: Species) -> Model {
    let n = EDGE.pow(3);
    let length = (f64::from(n) * PI / 6.0 / PACKING).cbrt() as f32;
    Model {
        time_step,
        species: vec![kind],
        contact,
        boundary: Boundary::periodic([-length / 2.0; 3], [length / 2.0; 3]),
        transmitters: vec![burst(Shape::Lattice([length; 3], [EDGE; 3]), &[(0, n)])],
        ..Model::default()
    }
}

/// The contact value g(σ⁺) = (1 − φ/2)/(1 − φ)³ of Carnahan and Starling for spheres pushed apart and for elastic ones;
/// what elastic collisions conserve.
pub(crate) fn hard_spheres() -> Vec<Row> {
    let expected = (1.0 - PACKING / 2.0) / (1.0 - PACKING).powi(3);
    let elastic = Species { thermal_speed: 1.0, ..species("A", 0.5, 0.0) };
    let elastic = model(Contact::Elastic, 1e-3, elastic);
    let mut simulation = begin(&elastic, 1);
    steps(&mut simulation, 1);
    let before = conserved(&simulation.state().particles);
    steps(&mut simulation, 3_000);
    let mut shells = Shells::new(&elastic);
    for _ in 0..100 {
        steps(&mut simulation, 60);
        shells.add(&simulation.state().particles);
    }
    let melted = &simulation.state().particles;
    let after = conserved(melted);
    let mut rows = vec![Row::new("g(σ⁺), elastic", expected, shells.contact_value(), 0.05 * expected)];
    rows.push(Row::new("relative drift of energy", 0.0, after.energy / before.energy - 1.0, 1e-5));
    let drift = (0..3).map(|k| (after.momentum[k] - before.momentum[k]).abs()).fold(0.0, f64::max);
    rows.push(Row::new("relative drift of momentum", 0.0, drift / before.speeds, 1e-5));

    // Diffusion would take long to forget the lattice, so it begins where the elastic ones ended.
    let mut pushed = model(Contact::Separate, 5e-6, species("A", 0.5, 1.0));
    pushed.transmitters.clear();
    let mut simulation = begin(&pushed, 1);
    simulation.insert(melted).expect("known species");
    steps(&mut simulation, 3_000);
    let mut shells = Shells::new(&pushed);
    for _ in 0..100 {
        steps(&mut simulation, 60);
        shells.add(&simulation.state().particles);
    }
    rows.push(Row::new("g(σ⁺), pushed apart", expected, shells.contact_value(), 0.05 * expected));
    rows
}

/// A thin gas of elastic spheres between walls: uniform up to them, with the energy that it had, and as warm along each axis.
pub(crate) fn gas_between_walls() -> Vec<Row> {
    let (n, radius, half, layer) = (5000_u32, 0.01_f32, 1.0_f32, 0.05_f32);
    let model = Model {
        time_step: 2e-3,
        species: vec![Species { thermal_speed: 1.0, ..species("A", radius, 0.0) }],
        contact: Contact::Elastic,
        boundary: Boundary::reflecting([-half; 3], [half; 3]),
        transmitters: vec![burst(Shape::Box([2.0 * (half - layer); 3]), &[(0, n)])],
        ..Model::default()
    };
    let mut simulation = begin(&model, 11);
    steps(&mut simulation, 1);
    let before = conserved(&simulation.state().particles);
    steps(&mut simulation, 1999);
    let particles = &simulation.state().particles;
    let after = conserved(particles);
    let n = f64::from(n);
    // Their surfaces end at the walls.
    let near = |at: &usize| particles.position_of(*at).iter().any(|&x| x.abs() > half - radius - layer);
    let share = (0..particles.len()).filter(near).count() as f64 / n;
    let expected = 1.0 - (1.0 - f64::from(layer / (half - radius))).powi(3);
    let mut rows =
        vec![Row::new("share near a wall after 4 s", expected, share, 4.0 * share_error(expected, n))];
    rows.push(Row::new("relative drift of energy, walls", 0.0, after.energy / before.energy - 1.0, 1e-5));
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        let squares: f64 = particles.velocity[axis].iter().map(|&v| f64::from(v).powi(2)).sum();
        let expected = 2.0 * before.energy / (3.0 * n);
        // The mean of n squares of normal numbers.
        rows.push(Row::new(
            format!("temperature along {name}"),
            expected,
            squares / n,
            4.0 * (2.0 / n).sqrt(),
        ));
    }
    rows
}

struct Conserved {
    energy: f64,
    momentum: [f64; 3],
    /// The sum of all speeds, beside which a drift of momentum is measured.
    speeds: f64,
}

fn conserved(particles: &Particles) -> Conserved {
    let mut sums = Conserved { energy: 0.0, momentum: [0.0; 3], speeds: 0.0 };
    for at in 0..particles.len() {
        let v = particles.get(at).velocity.map(f64::from);
        let square: f64 = v.iter().map(|v| v * v).sum();
        sums.energy += 0.5 * square;
        sums.speeds += square.sqrt();
        (0..3).for_each(|k| sums.momentum[k] += v[k]);
    }
    sums
}

/// How many pairs are how far apart, between contact and some way beyond.
struct Shells {
    space: Space,
    volume: f64,
    detector: Detector,
    counts: [u64; SHELLS],
    frames: u64,
    particles: u64,
}

const SHELLS: usize = 8;
/// The width of a shell, in diameters.
const WIDTH: f64 = 0.025;

impl Shells {
    fn new(model: &Model) -> Self {
        let space = model.boundary.space().expect("a box");
        let volume = space.lengths().map(|length| length.expect("a periodic axis")).iter().product();
        let detector = Detector::new(Config::default().space(space)).expect("a detector");
        Self { space, volume, detector, counts: [0; SHELLS], frames: 0, particles: 0 }
    }

    fn add(&mut self, particles: &Particles) {
        let reach = 0.5 * (1.0 + SHELLS as f64 * WIDTH) as f32;
        let at = |at: usize| particles.position_of(at);
        let rows: Vec<[f32; 4]> = (0..particles.len()).map(at).map(|[x, y, z]| [x, y, z, reach]).collect();
        for pair in self.detector.pairs(&rows).expect("pairs") {
            let [a, b] = [pair.i, pair.j].map(|k| particles.position_of(k as usize).into());
            let distance = self.space.distance_squared(a, b).sqrt();
            // What a step has pushed into a third sphere counts as in contact.
            let shell = ((distance - 1.0).max(0.0) / WIDTH) as usize;
            if let Some(count) = self.counts.get_mut(shell) {
                *count += 1;
            }
        }
        self.frames += 1;
        self.particles = particles.len() as u64;
    }

    /// g at contact, by a parabola through the logarithms of all shells.
    fn contact_value(&self) -> f64 {
        let n = self.particles as f64;
        let pairs = n * (n - 1.0) / 2.0 / self.volume;
        let point = |k: usize| {
            let [low, high] = [k, k + 1].map(|k| 1.0 + k as f64 * WIDTH);
            let shell = 4.0 / 3.0 * PI * (high.powi(3) - low.powi(3));
            let g = self.counts[k] as f64 / self.frames as f64 / (pairs * shell);
            ((k as f64 + 0.5) * WIDTH, g.ln())
        };
        let points: Vec<(f64, f64)> = (0..SHELLS).map(point).collect();
        parabola(&points).exp()
    }
}

/// The value at 0 of the parabola that fits best.
fn parabola(points: &[(f64, f64)]) -> f64 {
    let power = |k: i32| points.iter().map(|(x, _)| x.powi(k)).sum::<f64>();
    let right = |k: i32| points.iter().map(|(x, y)| x.powi(k) * y).sum::<f64>();
    let rows: [[f64; 3]; 3] = std::array::from_fn(|r| std::array::from_fn(|c| power((r + c) as i32)));
    let determinant = |m: [[f64; 3]; 3]| {
        m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
            + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
    };
    let mut first = rows;
    (0..3).for_each(|r| first[r][0] = right(r as i32));
    determinant(first) / determinant(rows)
}
