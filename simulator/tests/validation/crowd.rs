use std::f64::consts::PI;

use lazygrid::{Config, Detector, Space};
use lazygrid_sim::random::philox::{open_unit, philox};
use lazygrid_sim::{Boundary, Contact, Model, Particles, Shape, Species};
use rayon::prelude::*;

use crate::Row;
use crate::setup::{begin, burst, mean, run_for, species, steps};

const PACKING: f64 = 0.40;
const PER_SIDE: u32 = 12;

fn model(contact: Contact, packing: f64, time_step: f64, kind: Species, per_side: u32) -> Model {
    let n = per_side.pow(3);
    let length = (f64::from(n) * PI / 6.0 / packing).cbrt() as f32;
    Model {
        time_step,
        species: vec![kind],
        contact,
        boundary: Boundary::periodic([-length / 2.0; 3], [length / 2.0; 3]),
        transmitters: vec![burst(Shape::Lattice([length; 3], [per_side; 3]), &[(0, n)])],
        ..Model::default()
    }
}

/// Contact value g(σ⁺) = (1 − φ/2)/(1 − φ)³ of Carnahan and Starling.
pub(crate) fn hard_spheres() -> Vec<Row> {
    let expected = (1.0 - PACKING / 2.0) / (1.0 - PACKING).powi(3);
    let elastic = Species { thermal_speed: 1.0, ..species("A", 0.5, 0.0) };
    let elastic = model(Contact::Elastic, PACKING, 0.02, elastic, PER_SIDE);
    let mut simulation = run_for(&elastic, 1, 1);
    let before = conserved(&simulation.state().particles);
    steps(&mut simulation, 150);
    let mut shells = Shells::new(&elastic);
    for _ in 0..100 {
        steps(&mut simulation, 3);
        shells.add(&simulation.state().particles);
    }
    let melted = &simulation.state().particles;
    let after = conserved(melted);
    let mut rows = vec![Row::new("g(σ⁺), elastic", expected, shells.contact_value(), 0.05 * expected)];
    rows.push(Row::new("relative drift of energy", 0.0, after.energy / before.energy - 1.0, 1e-5));
    let drift = (0..3).map(|k| (after.momentum[k] - before.momentum[k]).abs()).fold(0.0, f64::max);
    rows.push(Row::new("relative drift of momentum", 0.0, drift / before.speeds, 1e-5));

    let mut pushed = model(Contact::Separate, PACKING, 0.02, species("A", 0.5, 1.0), PER_SIDE);
    pushed.transmitters.clear();
    let mut simulation = begin(&pushed, 1);
    simulation.insert(melted);
    steps(&mut simulation, 20);
    let mut shells = Shells::new(&pushed);
    for _ in 0..100 {
        steps(&mut simulation, 2);
        shells.add(&simulation.state().particles);
    }
    rows.push(Row::new("g(σ⁺), pushed apart", expected, shells.contact_value(), 0.05 * expected));
    rows
}

/// Carnahan and Starling.
fn compressibility(packing: f64) -> f64 {
    (1.0 + packing + packing.powi(2) - packing.powi(3)) / (1.0 - packing).powi(3)
}

/// With the collision rate Γ = 4nσ²g·√(πkT/m) of a sphere and P/nkT = 1 + (2π/3)·nσ³g, the factor P/nkT is 1 +
/// √π·σΓ/(6·√(kT/m)).
pub(crate) fn elastic_pressure() -> Vec<Row> {
    let mut cases = vec![(0.2, 0.5), (0.4, 0.05), (0.4, 3.0)];
    cases.extend((0..4).map(|case| {
        let [u, v, ..] = philox([case, 0, 0, 0], [28, 1]).map(|word| f64::from(open_unit(word)));
        (0.05 + 0.35 * u, 0.03 * 100_f64.powf(v))
    }));
    let row = |&(packing, time_step): &(f64, f64)| {
        let sphere = Species { thermal_speed: 1.0, ..species("A", 0.5, 0.0) };
        let model = model(Contact::Elastic, packing, time_step, sphere, 8);
        let mut simulation = run_for(&model, 3, (8.0 / time_step).ceil() as u32);
        let count = (30.0 / time_step).ceil() as u32;
        let mut collisions = 0;
        for _ in 0..count {
            steps(&mut simulation, 1);
            collisions += simulation.state().totals.contacts;
        }
        let particles = &simulation.state().particles;
        let n = particles.len() as f64;
        let thermal = (2.0 / 3.0 * conserved(particles).energy / n).sqrt();
        let rate = 2.0 * collisions as f64 / (n * f64::from(count) * time_step);
        let measured = 1.0 + PI.sqrt() / 6.0 * rate / thermal;
        let expected = compressibility(packing);
        Row::new(
            format!("pressure at {packing:.2}, step {time_step:.2} σ"),
            expected,
            measured,
            0.02 * expected,
        )
    };
    cases.par_iter().map(row).collect()
}

/// Short steps have the value of Brownian dynamics, about 0.49 at 0.3.
pub(crate) fn crowded_diffusion() -> Vec<Row> {
    const PACKINGS: [f64; 4] = [0.1, 0.2, 0.3, 0.4];
    let cases: Vec<(f64, f64)> =
        [0.1, 0.3, 1.0].into_iter().flat_map(|step| PACKINGS.map(|packing| (step, packing))).collect();
    let found: Vec<(f64, f64)> = cases.par_iter().map(|&case| slowed_diffusion(case)).collect();
    let mut rows = vec![Row::new("D/D₀ at 0.3, step 0.1 σ", 0.49, found[2].0, 0.03)];
    for (of_step, cases) in found.chunks(PACKINGS.len()).zip(cases.chunks(PACKINGS.len())) {
        for k in 1..PACKINGS.len() {
            let [(more, one), (less, other)] = [of_step[k - 1], of_step[k]];
            let (step, packing) = cases[k];
            let what = format!("D/D₀ falls from {:.1} to {packing}, step {step} σ", PACKINGS[k - 1]);
            let (fall, error) = (more - less, 4.0 * one.hypot(other));
            rows.push(Row { must_differ: true, ..Row::new(what, 0.0, fall.max(0.0), error) });
        }
    }
    rows.extend((0..2).into_par_iter().flat_map_iter(drawn_crowd).collect::<Vec<_>>());
    rows
}

/// Steps up to the longest without a warning, with one collision per particle on average.
fn drawn_crowd(case: u32) -> [Row; 2] {
    let [u, v, w, _] = philox([case, 0, 0, 0], [29, 1]).map(|word| f64::from(open_unit(word)));
    let (packing, more) = (0.05 + 0.2 * u, 0.1 + 0.05 * v);
    // Collisions per step: √(2·2D)·√(8/π)·√Δt·nπσ²·g(σ⁺), with the density n = 6φ/πσ³.
    let contact_value = (1.0 - packing / 2.0) / (1.0 - packing).powi(3);
    let longest = 1.0 / (24.0 / PI.sqrt() * packing * contact_value);
    let step = longest.min(0.3) * (0.5 + 0.5 * w);
    let cases = [(step, packing), (0.5 * step, packing), (step, packing + more)];
    let [(ratio, one), (of_half, other), (denser, third)] = cases.map(slowed_diffusion);
    let case = format!("at {packing:.2}, step {step:.2} σ");
    let falls = Row::new(
        format!("D/D₀ falls by {more:.2}, {case}"),
        0.0,
        (ratio - denser).max(0.0),
        4.0 * one.hypot(third),
    );
    [
        Row::new(format!("D/D₀ {case}, and half of it"), of_half, ratio, (4.0 * one.hypot(other)).max(0.03)),
        Row { must_differ: true, ..falls },
    ]
}

/// Takes the step √(2DΔt) in diameters, and the volume fraction.
fn slowed_diffusion((step, packing): (f64, f64)) -> (f64, f64) {
    let time_step = step * step / 2.0;
    let model = model(Contact::Separate, packing, time_step, species("A", 0.5, 1.0), 8);
    let mut simulation = begin(&model, 4);
    let [window, windows] = [(1.0 / time_step) as u32, 6];
    steps(&mut simulation, 2 * window);
    let particles = simulation.state().particles.len();
    let mut ratios = Vec::new();
    for _ in 0..windows {
        let mut moved = vec![[0.0_f32; 3]; particles];
        let mut last = by_id(&simulation.state().particles);
        for _ in 0..window {
            steps(&mut simulation, 1);
            let now = by_id(&simulation.state().particles);
            for ((moved, from), to) in moved.iter_mut().zip(&last).zip(&now) {
                let d = model.boundary.displacement(*from, *to);
                (0..3).for_each(|k| moved[k] += d[k]);
            }
            last = now;
        }
        let square: f64 = moved.iter().flatten().map(|&c| f64::from(c).powi(2)).sum();
        ratios.push(square / (particles as f64 * 6.0 * f64::from(window) * time_step));
    }
    mean(ratios)
}

fn by_id(particles: &Particles) -> Vec<[f32; 3]> {
    let mut rows = vec![[0.0; 3]; particles.len()];
    (0..particles.len()).for_each(|at| rows[particles.id[at] as usize] = particles.position_of(at));
    rows
}

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
    let mut simulation = run_for(&model, 11, 1);
    let before = conserved(&simulation.state().particles);
    steps(&mut simulation, 1999);
    let particles = &simulation.state().particles;
    let after = conserved(particles);
    let n = f64::from(n);
    let near = |at: &usize| particles.position_of(*at).iter().any(|&x| x.abs() > half - radius - layer);
    let fraction = (0..particles.len()).filter(near).count() as f64 / n;
    let expected = 1.0 - (1.0 - f64::from(layer / (half - radius))).powi(3);
    let mut rows = vec![Row::fraction("fraction near a wall after 4 s", expected, fraction, n)];
    rows.push(Row::new("relative drift of energy, walls", 0.0, after.energy / before.energy - 1.0, 1e-5));
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        let squares: f64 = particles.velocity[axis].iter().map(|&v| f64::from(v).powi(2)).sum();
        let expected = 2.0 * before.energy / (3.0 * n);
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

struct Shells {
    space: Space,
    volume: f64,
    detector: Detector,
    counts: [u64; SHELLS],
    frames: u64,
    particles: u64,
}

const SHELLS: usize = 8;
const WIDTH: f64 = 0.025;

impl Shells {
    fn new(model: &Model) -> Self {
        let space = model.boundary.space().expect("a box");
        let volume = space.lengths().map(|length| length.expect("a periodic axis")).iter().product();
        let detector = Detector::new(Config::default().space(space)).expect("a detector");
        Self { space, volume, detector, counts: [0; SHELLS], frames: 0, particles: 0 }
    }

    fn add(&mut self, particles: &Particles) {
        let query_radius = 0.5 * (1.0 + SHELLS as f64 * WIDTH) as f32;
        let at = |at: usize| particles.position_of(at);
        let rows: Vec<[f32; 4]> =
            (0..particles.len()).map(at).map(|[x, y, z]| [x, y, z, query_radius]).collect();
        for pair in self.detector.pairs(&rows).expect("pairs") {
            let [a, b] = [pair.i, pair.j].map(|k| particles.position_of(k as usize).into());
            let distance = self.space.distance_squared(a, b).sqrt();
            let shell = ((distance - 1.0).max(0.0) / WIDTH) as usize;
            if let Some(count) = self.counts.get_mut(shell) {
                *count += 1;
            }
        }
        self.frames += 1;
        self.particles = particles.len() as u64;
    }

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
