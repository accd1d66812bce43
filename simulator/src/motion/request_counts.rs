//! Counts of requests for receptors, and warnings.
//!
//! A step binds min(Poisson(f·x), f) particles to f free receptors, with x = `binding-rate`·c·Δt. Refused requests are
//! missing from the equilibrium; at a single receptor about the fraction x/2.

use crate::model::Model;
use crate::motion::binding::{BindingRequest, rejected};

/// Largest fraction of refused requests without a warning.
const MAX_REFUSED_FRACTION: f64 = 0.01;
/// Refused requests from which their fraction is known well enough.
const MIN_REFUSED_COUNT: u64 = 10;

/// All and refused requests, by receptor type.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct RequestCounts(Vec<[u64; 2]>);

impl RequestCounts {
    /// Returns the refused ids in ascending order.
    pub(crate) fn reject(&mut self, requests: Vec<BindingRequest>, free: &[u32]) -> Vec<u32> {
        let mut of_step = vec![0_u64; free.len()];
        requests.iter().for_each(|request| of_step[request.receptor()] += 1);
        let counts = of_step.into_iter().zip(free);
        self.add(counts.map(|(all, &free)| [all, all.saturating_sub(free.into())]));
        rejected(requests, free)
    }

    pub(crate) fn add(&mut self, counts: impl ExactSizeIterator<Item = [u64; 2]>) {
        self.0.resize(counts.len(), [0; 2]);
        for (sum, count) in self.0.iter_mut().zip(counts) {
            *sum = [sum[0] + count[0], sum[1] + count[1]];
        }
    }

    pub(crate) fn warnings(&self, model: &Model) -> Vec<String> {
        let first = model.first_receptor_types();
        let receiver_counts = |k: usize| {
            let counts = self.0.get(first[k] as usize..first[k + 1] as usize).unwrap_or_default();
            counts.iter().fold([0; 2], |sum, counts| [sum[0] + counts[0], sum[1] + counts[1]])
        };
        let warning = |(k, receiver): (usize, &crate::Receiver)| {
            let [all, refused] = receiver_counts(k);
            let fraction = refused as f64 / all as f64;
            (fraction > MAX_REFUSED_FRACTION && refused >= MIN_REFUSED_COUNT).then(|| {
                format!(
                    "{}: {:.1} % of the requests for its receptors were refused, because other requests of the same step took the \
                     last free receptors, so it binds fewer particles than in equilibrium; with a time-step of about {:.2e} s, \
                     {:.0} % are refused",
                    receiver.name,
                    100.0 * fraction,
                    model.time_step * MAX_REFUSED_FRACTION / fraction,
                    100.0 * MAX_REFUSED_FRACTION
                )
            })
        };
        model.receivers.iter().enumerate().filter_map(warning).collect()
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use lazygrid::Algorithm;

    use super::*;
    use crate::model::receptors::ReceptorType;
    use crate::{Boundary, Receiver, ReceiverKind, Shape, Simulation, Species, Transmitter};

    pub(crate) fn request_model(time_step: f64) -> Model {
        let kind = ReceiverKind::Receptors(vec![ReceptorType::new(1, 5.0, 50.0, [0])]);
        let receiver =
            Receiver { name: "rx".into(), radius: 0.5, kind, sees: vec![true], ..Receiver::default() };
        let shape = Shape::Box([4.0; 3]);
        Model {
            time_step,
            species: vec![Species { name: "A".into(), diffusion: 20.0, ..Species::default() }],
            transmitters: vec![Transmitter { shape, release: vec![(0, 640)], ..Transmitter::default() }],
            receivers: vec![receiver],
            boundary: Boundary::periodic([-2.0; 3], [2.0; 3]),
            ..Model::default()
        }
    }

    #[test]
    fn refused_requests_for_a_receptor_are_warned_of() {
        let warnings = |time_step: f64, steps: u32| {
            let model = request_model(time_step);
            let mut simulation = Simulation::new(model.clone(), 3, Algorithm::Auto).unwrap();
            (0..steps).for_each(|_| simulation.step().unwrap());
            simulation.requests.warnings(&model)
        };
        let [message] = &warnings(0.004, 4000)[..] else { panic!("no warning") };
        assert!(
            message.starts_with("rx: ") && message.contains("of the requests for its receptors"),
            "{message}"
        );
        let percent = message.split(' ').nth(1).and_then(|percent| percent.parse::<f64>().ok()).unwrap();
        // 1 − (1 − exp(−x))/x with x = 0.2, less by the depletion at the surface.
        assert!((5.0..12.0).contains(&percent), "{message}");
        assert_eq!(warnings(0.0001, 4000), [""; 0]);
    }
}
