use std::sync::Arc;

use lazygrid::Algorithm;

use super::*;
use crate::{
    Adsorption, Boundary, Flow, Model, Receiver, ReceiverKind, Shape, Simulation, Species, Transmitter,
};

const ORIGIN_AND_SPACING: [[f64; 3]; 2] = [[-1.0, 2.0, 0.5], [0.5, 2.0, 1.0]];

fn linear(points: [usize; 3], velocity: impl Fn([f64; 3]) -> [f64; 3]) -> FlowField {
    let [origin, spacing] = ORIGIN_AND_SPACING;
    let mut velocities = Vec::new();
    for i in 0..points[0] {
        for j in 0..points[1] {
            for k in 0..points[2] {
                let index = [i, j, k];
                let point = std::array::from_fn(|axis| origin[axis] + index[axis] as f64 * spacing[axis]);
                velocities.extend(velocity(point).map(|v| v as f32));
            }
        }
    }
    FlowField::new(ORIGIN_AND_SPACING, points, velocities).unwrap()
}

#[test]
fn product_of_coordinates_is_interpolated_exactly() {
    let velocity = |[x, y, z]: [f64; 3]| [x * y * z, x - 2.0 * y + 3.0 * z, 1.0];
    let field = linear([4, 3, 5], velocity);
    for point in [[-1.0, 2.0, 0.5], [0.5, 6.0, 4.5], [-0.3, 3.1, 1.25], [0.45, 5.5, 4.4], [0.0, 4.0, 2.5]] {
        let expected = velocity(point.map(|x: f32| f64::from(x)));
        let found = field.at(point);
        let is_close = |k: usize| (found[k] - expected[k]).abs() < 1e-5 * (1.0 + expected[k].abs());
        assert!((0..3).all(is_close), "{point:?}: {found:?} and not {expected:?}");
    }
    assert_eq!(field.fastest(), [27.0, 11.5, 1.0]);
    assert!((field.steepest() - 27.0).abs() < 1e-5, "{}", field.steepest());
}

#[test]
fn velocity_outside_is_that_of_the_nearest_point() {
    let field = linear([4, 3, 1], |[x, y, z]| [x, y, z]);
    assert_eq!(field.at([-9.0, 3.0, 7.0]), [-1.0, 3.0, 0.5]);
    assert_eq!(field.at([9.0, f32::INFINITY, -7.0]), [0.5, 6.0, 0.5]);
    assert!(field.at([f32::NAN; 3]).iter().all(|v| v.is_nan()));
    assert_eq!([0, 1, 2].map(|axis| field.extent(axis).is_some()), [true, true, false]);
}

#[test]
fn faulty_fields_are_refused() {
    let refused = |origin_and_spacing, points, velocities: &[f32]| {
        FlowField::new(origin_and_spacing, points, velocities.to_vec()).unwrap_err().to_string()
    };
    assert!(refused(ORIGIN_AND_SPACING, [1, 1, 2], &[0.0; 5]).contains("5 numbers"));
    assert!(refused(ORIGIN_AND_SPACING, [1, 0, 1], &[]).contains("0 numbers"));
    assert!(refused([[0.0; 3], [1.0, 0.0, 1.0]], [1; 3], &[0.0; 3]).contains("spacing"));
    assert!(
        refused(ORIGIN_AND_SPACING, [1, 1, 2], &[0.0, 0.0, 0.0, f32::NAN, 0.0, 0.0])
            .contains("NaN at point 1")
    );
}

#[test]
fn checksums_differ_by_velocity_and_shape() {
    let sum = |points, velocities: &[f32]| {
        FlowField::new(ORIGIN_AND_SPACING, points, velocities.to_vec()).unwrap().checksum()
    };
    let zero = sum([1, 1, 2], &[0.0; 6]);
    assert_eq!(zero, sum([1, 1, 2], &[0.0; 6]));
    assert!(zero != sum([1, 2, 1], &[0.0; 6]) && zero != sum([1, 1, 2], &[0.0, 0.0, 0.0, 0.0, 0.0, 1.0]));
}

fn model(flow: Flow) -> Model {
    let species = |name: &str, diffusion| Species { name: name.into(), diffusion, ..Species::default() };
    let receiver = |x, kind| Receiver {
        name: "rx".into(),
        center: [x, 0.0, 0.0],
        radius: 0.5,
        kind,
        sees: vec![true; 2],
        ..Receiver::default()
    };
    Model {
        time_step: 0.02,
        species: vec![species("A", 1.0), species("B", 0.0)],
        transmitters: vec![Transmitter {
            name: "tx".into(),
            shape: Shape::Box([4.0; 3]),
            release: vec![(0, 500), (1, 500)],
            ..Transmitter::default()
        }],
        receivers: vec![
            receiver(-1.0, ReceiverKind::Absorbing),
            receiver(1.0, ReceiverKind::Partial(Adsorption::PerStep(0.5))),
        ],
        boundary: Boundary::reflecting([-2.0; 3], [2.0; 3]),
        flow: Some(flow),
        flow_pulse: Some([0.05, 0.31]),
        ..Model::default()
    }
}

#[test]
fn uniform_field_equals_plug_bit_for_bit() {
    let velocity = [3.0, -1.5, 0.25];
    let field = linear([2, 3, 2], |_| velocity);
    let states = [Flow::Plug(velocity), Flow::Field(Arc::new(field))].map(|flow| {
        let mut run = Simulation::new(model(flow), 3, Algorithm::Auto).unwrap();
        (0..30).for_each(|_| run.step().unwrap());
        run.state().clone()
    });
    assert!(
        states[0].totals.arrived.iter().all(|counts| counts[0] > 20 && counts[1] > 2),
        "{:?}",
        states[0].totals
    );
    assert!(states[0] == states[1]);
}
