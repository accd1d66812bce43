use lazygrid_sim::{Axis, Boundary, Flow, Model, Shape, Transmitter, Vessel};

use super::device;
use super::models::{burst, gpu, species};

#[test]
fn drift_to_the_end_of_a_cylinder_has_the_exponential_layer() {
    let Some(device) = device() else { return };
    let (n, speed, diffusion, length) = (20_000_u32, 100.0, 100.0, 200.0);
    let burst = Transmitter { center: [0.0, 0.0, length - 1.0], ..burst(Shape::Point, &[(0, n)]) };
    let axes = [Axis::Open, Axis::Open, Axis::Reflecting { low: 0.0, high: length }];
    let vessel = Some(Vessel { along: Some(2), center: [0.0; 3], radius: 5.0 });
    let model = Model {
        time_step: 0.01,
        species: vec![species("A", diffusion, [0.0; 3])],
        flow: Some(Flow::Plug([0.0, 0.0, speed])),
        transmitters: vec![burst],
        boundary: Boundary { axes, vessel },
        ..Model::default()
    };
    let mut run = gpu(&device, &model, 33);
    run.run(40).expect("steps");
    let state = run.state().expect("a state");
    let heights = state.particles.position[2].iter().map(|&z| f64::from(length - z));
    let mean = heights.sum::<f64>() / f64::from(n);
    let expected = diffusion / speed;
    assert!((mean - expected).abs() < 4.0 * expected / f64::from(n).sqrt(), "{mean}, not {expected}");
}
