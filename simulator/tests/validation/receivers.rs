//! What receivers count.

use lazygrid_sim::{Kind, Model, Receiver, Shape};

use crate::Row;
use crate::setup::{begin, burst, in_ball, share_error, species, steps};

const D: f64 = 100.0;
const R: f64 = 5.0;
const DISTANCE: f64 = 10.0;
const N: u32 = 200_000;

fn model(time_step: f64, kind: Kind) -> Model {
    let receiver = Receiver {
        name: "rx".to_owned(),
        center: [DISTANCE as f32, 0.0, 0.0],
        radius: R as f32,
        kind,
        sees: vec![true],
    };
    Model {
        time_step,
        species: vec![species("A", 0.0, D)],
        transmitters: vec![burst(Shape::Point, &[(0, N)])],
        receivers: vec![receiver],
        ..Model::default()
    }
}

/// Share that reaches an absorbing sphere within T: (r/d)·erfc((d − r)/√(4DT)).
pub(crate) fn absorbing() -> Vec<Row> {
    let time = 0.5;
    let expected = R / DISTANCE * libm::erfc((DISTANCE - R) / (4.0 * D * time).sqrt());
    let tolerance = 4.0 * share_error(expected, N.into()) + 0.005 * expected;
    let mut rows = Vec::new();
    for kind in [Kind::Absorbing, Kind::Endpoint] {
        for count in [50, 200, 500] {
            let mut simulation = begin(&model(time / f64::from(count), kind), 2);
            steps(&mut simulation, count);
            let share = simulation.state().totals.arrived[0][0] as f64 / f64::from(N);
            let what = format!("{kind:?}, {count} steps").to_lowercase();
            let must_differ = kind == Kind::Endpoint;
            rows.push(Row { must_differ, ..Row::new(what, expected, share, tolerance) });
        }
    }
    rows
}

/// Share inside a transparent sphere after some times: the integral of the concentration over it.
pub(crate) fn transparent() -> Vec<Row> {
    let time_step = 0.01;
    let mut simulation = begin(&model(time_step, Kind::Transparent), 3);
    let mut rows = Vec::new();
    for until in [5, 20, 50] {
        let done = simulation.state().step;
        steps(&mut simulation, until - done);
        let time = simulation.time();
        let expected = in_ball(R, DISTANCE, 2.0 * D * time);
        let share = simulation.inside(0)[0] as f64 / f64::from(N);
        let what = format!("inside after {time} s");
        rows.push(Row::new(what, expected, share, 4.0 * share_error(expected, N.into())));
    }
    rows
}
