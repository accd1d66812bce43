//! Moving receivers, whose surfaces membranes reflect as walls do.
//!
//! A membrane keeps a receiver on one side if both act on a common species. A receiver that reflects particles turns at
//! the least distance of a resting one.

use super::{Membrane, MembraneSurface};
use crate::model::boundary::{Axis, Boundary};
use crate::model::receiver::Receiver;
use crate::model::vessel::dot;
use crate::model::{Model, Species};

/// Least distance of a membrane from a surface that reflects particles, in √(2DΔt) with D the sum of the diffusion
/// coefficients of particle and surface. One step in 16 000 is longer along an axis.
pub(super) const STEPS_APART: f64 = 4.0;
/// Largest number of reflections in a step; a receiver with more stays where it was.
const MAX_REFLECTIONS: u32 = 8;

struct Side {
    center: [f32; 3],
    /// Distance of both centers at which the membrane reflects the receiver, in µm.
    limit: f64,
    is_inside: bool,
}

impl Model {
    /// Returns the fastest species that both act on.
    pub(crate) fn fastest_shared(&self, receiver: &Receiver, membrane: &Membrane) -> Option<&Species> {
        if !receiver.kind.is_active_sphere() {
            return None;
        }
        let sees = |species: &usize| membrane.sees[*species] && receiver.sees[*species];
        let seen = (0..self.species.len()).filter(sees).map(|species| &self.species[species]);
        seen.max_by(|a, b| a.diffusion.total_cmp(&b.diffusion))
    }

    /// Returns the least distance of a receiver's surface from a membrane, in µm.
    pub(super) fn least_gap(&self, receiver: &Receiver, fastest: &Species) -> f64 {
        if !receiver.kind.reflects() {
            return 0.0;
        }
        let Receiver { velocity, diffusion, .. } = *receiver;
        let spread = (2.0 * (fastest.diffusion + diffusion) * self.time_step).sqrt();
        // A moving surface pushes particles ahead by up to its displacement.
        STEPS_APART * spread + dot(velocity, velocity).sqrt() * self.time_step
    }

    pub(crate) fn held_receiver(
        &self,
        receiver: &Receiver,
        domain: &Boundary,
        [center, end]: [[f32; 3]; 2],
    ) -> [f32; 3] {
        let surface_and_distance = |membrane: &Membrane| {
            let gap = self.least_gap(receiver, self.fastest_shared(receiver, membrane)?);
            Some((membrane.surface, f64::from(receiver.radius) + gap))
        };
        let surfaces: Vec<(MembraneSurface, f64)> =
            self.membranes.iter().filter_map(surface_and_distance).collect();
        if surfaces.is_empty() {
            return end;
        }
        let bounds = [0, 1, 2].map(|axis| bounds(&surfaces, axis, domain, center));
        let sides: Vec<Side> =
            surfaces.iter().filter_map(|&surface| Side::new(surface, domain, center)).collect();
        let mut held = end;
        for _ in 0..MAX_REFLECTIONS {
            held = std::array::from_fn(|axis| mirrored(bounds[axis], held[axis], center[axis]));
            match sides.iter().find_map(|side| side.mirrored(domain, held)) {
                Some(mirrored) if mirrored.into_iter().all(f32::is_finite) => held = mirrored,
                // The center of a sphere has no mirror image.
                Some(_) => break,
                None => return held,
            }
        }
        center
    }
}

impl Receiver {
    /// Returns the time step, in s, for which `gap`, in µm, is the least allowed distance.
    pub(crate) fn time_of_gap(&self, gap: f64, diffusion: f64) -> f64 {
        let spread = STEPS_APART * (2.0 * (diffusion + self.diffusion)).sqrt();
        let speed = dot(self.velocity, self.velocity).sqrt();
        // The root of the time, without cancellation.
        (2.0 * gap / (spread + (spread * spread + 4.0 * speed * gap).sqrt())).powi(2)
    }
}

fn bounds(surfaces: &[(MembraneSurface, f64)], axis: usize, domain: &Boundary, center: [f32; 3]) -> [f32; 2] {
    let [mut low, mut high] = match domain.axes[axis] {
        Axis::Reflecting { low, high } => [low, high],
        _ => [f32::NEG_INFINITY, f32::INFINITY],
    };
    for &(surface, distance) in surfaces {
        let MembraneSurface::Plane { axis: across, position } = surface else { continue };
        for at in domain.axes[axis].plane_images(position).filter(|_| across == axis) {
            match at <= center[axis] {
                true => low = low.max((f64::from(at) + distance) as f32),
                false => high = high.min((f64::from(at) - distance) as f32),
            }
        }
    }
    [low, high]
}

/// Returns `before` if the interval is empty.
fn mirrored([low, high]: [f32; 2], x: f32, before: f32) -> f32 {
    match [low, high].map(f32::is_finite) {
        [true, true] if low >= high => before,
        [true, true] => Axis::Reflecting { low, high }.confine(x),
        [true, false] if x < low => 2.0 * low - x,
        [false, true] if x > high => 2.0 * high - x,
        _ => x,
    }
}

impl Side {
    fn new(
        (surface, distance): (MembraneSurface, f64),
        domain: &Boundary,
        receiver: [f32; 3],
    ) -> Option<Self> {
        let MembraneSurface::Sphere { center, radius } = surface else { return None };
        let radius = f64::from(radius);
        let away = vector(domain, [center, receiver]);
        let is_inside = dot(away, away).sqrt() < radius;
        Some(Self { center, limit: if is_inside { radius - distance } else { radius + distance }, is_inside })
    }

    fn mirrored(&self, domain: &Boundary, point: [f32; 3]) -> Option<[f32; 3]> {
        let away = vector(domain, [self.center, point]);
        let distance = dot(away, away).sqrt();
        let is_beyond = if self.is_inside { distance > self.limit } else { distance < self.limit };
        let factor = (2.0 * self.limit - distance).max(0.0) / distance.max(f64::MIN_POSITIVE) - 1.0;
        let image = |axis: usize| (f64::from(point[axis]) + factor * away[axis]) as f32;
        is_beyond.then(|| std::array::from_fn(image))
    }
}

fn vector(domain: &Boundary, [from, to]: [[f32; 3]; 2]) -> [f64; 3] {
    std::array::from_fn(|k| domain.axes[k].displacement_exact(f64::from(to[k]) - f64::from(from[k])))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::receiver::{ReceiverKind, signed_distance};
    use crate::motion::receiver_state::move_receivers;
    use crate::random::philox::Key;

    fn membrane(surface: MembraneSurface) -> Membrane {
        Membrane { name: "m".into(), surface, permeability: 1.0, sees: vec![true] }
    }

    fn receiver(center: [f32; 3], kind: ReceiverKind) -> Receiver {
        Receiver { center, radius: 0.125, kind, sees: vec![true], diffusion: 0.5, ..Receiver::default() }
    }

    fn model(boundary: Boundary, time_step: f64, surfaces: &[MembraneSurface]) -> Model {
        Model {
            boundary,
            time_step,
            species: vec![Species { diffusion: 0.5, ..Species::default() }],
            membranes: surfaces.iter().copied().map(membrane).collect(),
            ..Model::default()
        }
    }

    fn heights(model: &Model, [x, y, z]: [f32; 3]) -> Vec<f32> {
        let height = |membrane: &Membrane| match membrane.surface {
            MembraneSurface::Plane { position, .. } => x - position,
            MembraneSurface::Sphere { center, radius } => {
                signed_distance(radius, center, &model.boundary, [x, y, z])
            }
        };
        model.membranes.iter().map(height).collect()
    }

    #[test]
    fn moving_receivers_stay_away_from_membranes_on_their_side() {
        let center = [1.0, -2.0, 0.5];
        let sphere = |radius| MembraneSurface::Sphere { center, radius };
        let surfaces = [sphere(0.5), sphere(1.5), MembraneSurface::Plane { axis: 0, position: 3.0 }];
        let domains = [
            Boundary::default(),
            Boundary::periodic([-1.0, -4.0, -2.0], [6.0, 0.0, 3.0]),
            Boundary::reflecting([-1.0, -4.0, -2.0], [6.0, 0.0, 3.0]),
        ];
        let starts = [center, [1.0, -2.0, -0.5], [2.75, -2.0, 0.5], [4.5, -1.0, 1.0]];
        let cases = domains.into_iter().flat_map(|domain| [1e-4, 1e-3, 0.2].map(|dt| (domain, dt)));
        for (domain, time_step) in cases {
            let kinds = [ReceiverKind::Absorbing, ReceiverKind::Reflecting];
            let mut model = model(domain, time_step, &surfaces);
            let all = kinds.iter().flat_map(|kind| starts.map(|start| receiver(start, kind.clone())));
            // Others begin too near to a membrane.
            let fits = |one: &Receiver| {
                let gap = f64::from(one.radius) + model.least_gap(one, &model.species[0]);
                heights(&model, one.center).iter().all(|height| f64::from(height.abs()) >= gap)
            };
            model.receivers = all.filter(fits).collect();
            model.receivers[0].velocity = [3.0, -2.0, 1.0];
            assert!(model.receivers.len() >= 4, "{}", model.receivers.len());
            let mut centers: Vec<_> = model.receivers.iter().map(|one| one.center).collect();
            let mut moves = vec![0; centers.len()];
            for step in 0..400 {
                let receiver_moves = move_receivers(&model, &centers, Key::new(7), step);
                for (k, receiver_move) in receiver_moves.into_iter().enumerate() {
                    let (one, before) = (&model.receivers[k], &mut centers[k]);
                    let gap = f64::from(one.radius) + model.least_gap(one, &model.species[0]);
                    for (a, b) in
                        heights(&model, *before).into_iter().zip(heights(&model, receiver_move.center))
                    {
                        // The far side of a periodic box is on both sides of the plane.
                        let is_beside = a * b > 0.0 || matches!(domain.axes[0], Axis::Periodic { .. });
                        let is_away = f64::from(b.abs()) >= gap - 1e-5;
                        assert!(is_beside && is_away, "{domain:?} {time_step} {a} {b} {gap}");
                    }
                    moves[k] += u32::from(*before != receiver_move.center);
                    *before = receiver_move.center;
                }
            }
            assert!(moves.iter().all(|&moves| moves > 100), "{moves:?}");
        }
    }

    #[test]
    fn receivers_diffuse_evenly_between_a_membrane_and_a_wall() {
        let mut model = model(
            Boundary::reflecting([-2.0, -9.0, -9.0], [1.0, 9.0, 9.0]),
            0.1,
            &[MembraneSurface::Plane { axis: 0, position: 0.0 }],
        );
        let all = (0..4000).map(|_| receiver([0.5, 0.0, 0.0], ReceiverKind::Absorbing));
        model.receivers = all.collect();
        let mut centers: Vec<_> = model.receivers.iter().map(|one| one.center).collect();
        for step in 0..30 {
            centers = move_receivers(&model, &centers, Key::new(8), step).iter().map(|p| p.center).collect();
        }
        // From 0.125 to 0.875.
        let fractions: Vec<f64> =
            centers.iter().map(|center| (f64::from(center[0]) - 0.125) / 0.75).collect();
        for power in 1..4 {
            let mean =
                fractions.iter().map(|fraction| fraction.powi(power)).sum::<f64>() / fractions.len() as f64;
            let expected = 1.0 / f64::from(power + 1);
            assert!((mean - expected).abs() < 4.0 * 0.3 / 4000_f64.sqrt(), "{power}: {mean}");
        }
    }

    #[test]
    fn time_of_a_gap_gives_the_gap() {
        for (diffusion, velocity) in [(0.0, [0.0; 3]), (2.0, [0.0; 3]), (0.5, [3.0, 4.0, 0.0])] {
            let kind = ReceiverKind::Reflecting;
            let one = Receiver { diffusion, velocity, ..receiver([0.0; 3], kind) };
            let time_step = one.time_of_gap(0.25, 0.5);
            let model = model(Boundary::default(), time_step, &[]);
            assert!((model.least_gap(&one, &model.species[0]) - 0.25).abs() < 1e-12);
        }
    }
}
