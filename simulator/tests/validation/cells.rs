use std::f64::consts::{LN_2, PI};

use lazygrid_sim::{Adsorption, Model, ReceiverKind};

use crate::Row;
use crate::setup::{BackendRun, fraction_error, receiver, run_for, scenario};

const N: u32 = 20_000;
const D: f64 = 1.0;
/// Radius of the membrane around the origin.
const R: f64 = 1.0;

fn model(time_step: f64, diffusion: f64, permeability: f64, more: &str) -> Model {
    let text = format!(
        "time-step = {time_step}\nsteps = 1\n{more}\nrelease = [{{ species = \"A\", count = {N} }}]\n[[species]]\n\
         name = \"A\"\ndiffusion = {diffusion}\n[[membrane]]\nname = \"m\"\ncenter = [0, 0, 0]\nradius = {R}\n\
         permeability = {permeability}\n"
    );
    scenario(text)
}

fn inside(simulation: &BackendRun) -> f64 {
    simulation.squares().filter(|&square| square < R * R).count() as f64 / f64::from(N)
}

/// A radial function times r: its value and derivative at the membrane.
#[derive(Clone, Copy)]
struct AtMembrane(f64, f64);

impl AtMembrane {
    fn concentration(self) -> f64 {
        self.0 / R
    }

    fn gradient(self) -> f64 {
        self.1 / R - self.0 / (R * R)
    }
}

#[derive(Clone, Copy, Debug)]
struct Nucleus {
    radius: f64,
    /// In µm/s.
    rate: f64,
}

/// The Laplace transforms of the fraction inside and of the one taken.
struct Fractions {
    inside: f64,
    taken: f64,
}

/// Solves for the transforms r·c = A·f(r) inside and B·exp(−q(r − R)) outside, next to the source at the distance
/// `from`, with equal fluxes D·c′ = κ·(c₊ − c₋). Here f(r) = sinh(qr), or sinh(q(r − a)) + γ·cosh(q(r − a)) around a
/// nucleus of radius a, where D·c′ = k·c.
fn transformed(p: f64, from: f64, permeability: f64, nucleus: Option<Nucleus>) -> Fractions {
    let q = (p / D).sqrt();
    let Nucleus { radius, rate } = nucleus.unwrap_or(Nucleus { radius: 0.0, rate: 0.0 });
    let gamma = if radius > 0.0 { q / (rate / D + 1.0 / radius) } else { 0.0 };
    // f and its derivative over q, and an integral of r·f.
    let function = |r: f64| {
        let (sinh, cosh) = ((q * (r - radius)).sinh(), (q * (r - radius)).cosh());
        [sinh + gamma * cosh, cosh + gamma * sinh]
    };
    let moment = |r: f64| {
        let [f, slope] = function(r);
        r * slope / q - f / (q * q)
    };
    let [inner, outer] = match from == 0.0 {
        true => {
            let near = (-q * R).exp() / (4.0 * PI * D);
            [AtMembrane(near, -q * near), AtMembrane(0.0, 0.0)]
        }
        false => {
            let near = (-q * (from - R)).exp() / (8.0 * PI * D * q * from);
            [AtMembrane(0.0, 0.0), AtMembrane(near, q * near)]
        }
    };
    let [f, slope] = function(R);
    let layer = AtMembrane(f, q * slope);
    let out = AtMembrane(1.0, -q);
    let ratio = layer.gradient() / out.gradient();
    let begun = (inner.gradient() - outer.gradient()) / out.gradient();
    let jump = outer.concentration() - inner.concentration() + begun * out.concentration();
    let a = (permeability * jump - D * inner.gradient())
        / (D * layer.gradient() + permeability * (layer.concentration() - ratio * out.concentration()));
    let of_source = if from == 0.0 { (1.0 - (1.0 + q * R) * (-q * R).exp()) / p } else { 0.0 };
    Fractions {
        inside: of_source + 4.0 * PI * a * (moment(R) - moment(radius)),
        taken: 4.0 * PI * radius * rate * a * gamma / p,
    }
}

/// The inverse transform (H. Stehfest, *Numerical inversion of Laplace transforms*, Communications of the ACM 13
/// (1970) 47).
fn fractions(time: f64, from: f64, permeability: f64, nucleus: Option<Nucleus>) -> Fractions {
    const HALF: u32 = 7;
    let factorial = |n: u32| (1..=n).map(f64::from).product::<f64>();
    let weight = |k: u32| {
        let term = |j: u32| {
            f64::from(j).powi(HALF as i32) * factorial(2 * j)
                / (factorial(HALF - j)
                    * factorial(j)
                    * factorial(j - 1)
                    * factorial(k - j)
                    * factorial(2 * j - k))
        };
        let sum: f64 = (k.div_ceil(2)..=k.min(HALF)).map(term).sum();
        if (k + HALF).is_multiple_of(2) { sum } else { -sum }
    };
    let rate = LN_2 / time;
    let mut all = Fractions { inside: 0.0, taken: 0.0 };
    for k in 1..=2 * HALF {
        let Fractions { inside, taken } = transformed(rate * f64::from(k), from, permeability, nucleus);
        all.inside += rate * weight(k) * inside;
        all.taken += rate * weight(k) * taken;
    }
    all
}

pub(crate) fn spherical_membranes() -> Vec<Row> {
    let mut rows = Vec::new();
    let mut add = |what: String, expected: f64, (found, more): (f64, f64)| {
        rows.push(Row::new(what, expected, found, 4.0 * fraction_error(expected, N.into()) + more));
    };
    for (seed, from, permeability, time, spread) in [
        (1, 0.0, 0.5, 0.5, 0.05_f64),
        (2, 0.0, 0.5, 0.5, 0.25),
        (3, 0.0, 5.0, 0.3, 0.05),
        (4, 0.0, 5.0, 0.3, 0.25),
        (5, 1.5, 2.0, 0.5, 0.05),
        (6, 1.5, 2.0, 0.5, 0.25),
    ] {
        let count = (2.0 * D * time / (spread * spread)).round() as u32;
        let source = format!("[[transmitter]]\nname = \"tx\"\ncenter = [0, {from}, 0]");
        let model = model(time / f64::from(count), D, permeability, &source);
        let what = format!("from {from} R, κ = {permeability}, inside, steps of {spread} R");
        let expected = fractions(time, from, permeability, None).inside;
        add(what, expected, (inside(&run_for(&model, seed, count)), 0.0));
    }
    // Surfaces of the nucleus are at least four steps from the membrane.
    for (seed, rate, spread) in [(13, 0.0, 0.05_f64), (14, 0.0, 0.12), (15, 4.0, 0.05), (16, 4.0, 0.12)] {
        let (from, permeability, time, nucleus) = (1.5, 5.0, 0.5, Nucleus { radius: 0.5, rate });
        let count = (2.0 * D * time / (spread * spread)).round() as u32;
        let source = format!("[[transmitter]]\nname = \"tx\"\ncenter = [0, {from}, 0]");
        let mut model = model(time / f64::from(count), D, permeability, &source);
        let kind = match rate {
            0.0 => ReceiverKind::Reflecting,
            rate => ReceiverKind::Partial(Adsorption::Reactivity(rate)),
        };
        model.receivers.push(receiver(nucleus.radius, kind));
        let expected = fractions(time, from, permeability, Some(nucleus));
        let what = format!("nucleus of the rate {rate}, inside, steps of {spread} R");
        let simulation = run_for(&model, seed, count);
        add(what, expected.inside, (inside(&simulation), 0.0));
        if rate > 0.0 {
            let what = format!("nucleus of the rate {rate}, taken, steps of {spread} R");
            let taken = simulation.state().totals.arrived[0][0];
            add(what, expected.taken, (taken as f64 / f64::from(N), 0.0));
        }
    }
    let space = "[boundary]\nkind = \"periodic\"\nlow = [-2, -2, -2]\nhigh = [2, 2, 2]\n[[transmitter]]\nname = \"tx\"\n\
                 center = [0, 0, 0]\nshape = ";
    let volume_fraction = 4.0 / 3.0 * PI * R.powi(3) / 64.0;
    let full = |shape: &str| format!("{space}{shape}");
    let all = full("{ kind = \"box\", size = [4, 4, 4] }");
    for (seed, spread) in [(7, 0.3_f64), (8, 2.0)] {
        let model = model(spread * spread / (2.0 * D), D, 2.0, &all);
        add(
            format!("uniform, inside, steps of {spread} R"),
            volume_fraction,
            (inside(&run_for(&model, seed, 20)), 0.0),
        );
    }
    let ball = full("{ kind = \"ball\", radius = 0.999 }");
    let walls = ball.replace("periodic", "reflecting");
    add(
        "equilibrium, from inside".to_owned(),
        volume_fraction,
        (inside(&run_for(&model(0.05, D, 2.0, &walls), 9, 200)), 0.0),
    );
    // Well mixed up to κR/5D = 0.2 %.
    let (diffusion, permeability) = (20.0, 0.2);
    let rate =
        permeability * 4.0 * PI * R * R * (1.0 / volume_fraction + 1.0 / (1.0 - volume_fraction)) / 64.0;
    for (seed, time) in [(10, 0.5), (11, 1.5)] {
        let model = model(0.002, diffusion, permeability, &ball);
        let expected = volume_fraction + (1.0 - volume_fraction) * (-rate * time).exp();
        let found = inside(&run_for(&model, seed, (time / 0.002_f64).round() as u32));
        add(format!("relaxation, inside after {time} s"), expected, (found, 0.002));
    }
    let closed = model(0.5, D, 0.0, &walls);
    add("closed, inside".to_owned(), 1.0, (inside(&run_for(&closed, 12, 50)), 0.0));
    rows
}
