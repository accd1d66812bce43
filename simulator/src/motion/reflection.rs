//! Reflection of paths at surfaces of receivers.
//!
//! A particle moves along lines between reflections, each in the frame of the sphere. Such billiards conserve volumes,
//! so a uniform density stays uniform at any step length.

use crate::model::boundary::{Axis, Boundary};
use crate::model::receiver::signed_distance;
use crate::model::vessel::dot;
use crate::motion::path_hit::{Path, length};
use crate::motion::receiver_state::ReceiverState;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ReflectedPath {
    pub(crate) path: Path,
    /// First reflecting receiver.
    pub(crate) first: u32,
    /// Moving spheres lengthen it.
    pub(crate) path_length: f32,
    pub(crate) reflection: PathReflection,
}

/// The first contact with a sphere, and the last segment, extended backwards to the length of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PathReflection {
    pub(crate) contact: [f32; 3],
    pub(crate) last: [[f32; 3]; 2],
}

struct Obstacle<'a> {
    state: &'a ReceiverState,
    /// From the sphere's center to the beginning of the path.
    offset: [f64; 3],
    /// In the step, in µm.
    displacement: [f64; 3],
}

/// Reflections in a step; a particle with more stays at the last.
const BOUNCES: usize = 64;

/// Reflects a path that begins outside all spheres, and `velocity` in µm per step; `None` if it reaches none.
pub(crate) fn reflect_path(
    receivers: &[&ReceiverState],
    domain: &Boundary,
    path: &Path,
    velocity: &mut [f32; 3],
) -> Option<ReflectedPath> {
    let mut displacement: [f64; 3] = std::array::from_fn(|k| {
        // Walls have reflected the end already.
        let to = if matches!(domain.axes[k], Axis::Reflecting { .. }) { path.after[k] } else { path.end[k] };
        f64::from(to) - f64::from(path.before[k])
    });
    let obstacles = obstacles(receivers, domain, path, displacement);
    let (mut traveled, mut length, mut time, mut first) = ([0.0; 3], 0.0, 0.0, None);
    let at = |traveled: [f64; 3]| std::array::from_fn(|k| (f64::from(path.before[k]) + traveled[k]) as f32);
    for _ in 0..BOUNCES {
        let left = 1.0 - time;
        let meets = |o: &Obstacle<'_>| {
            Some((o.meeting(traveled, time, displacement).filter(|&s| s < left)?, o.state.index))
        };
        let next = obstacles.iter().filter_map(|o| Some((meets(o)?, o)));
        let Some(((after, index), obstacle)) = next.min_by(|(a, _), (b, _)| a.0.total_cmp(&b.0)) else {
            traveled = std::array::from_fn(|k| traveled[k] + left * displacement[k]);
            length += left * dot(displacement, displacement).sqrt();
            break;
        };
        traveled = std::array::from_fn(|k| traveled[k] + after * displacement[k]);
        first = first.or(Some((index, at(traveled))));
        length += after * dot(displacement, displacement).sqrt();
        time += after;
        let out = obstacle.offset_at(traveled, time);
        let distance = dot(out, out).sqrt();
        let normal = out.map(|c| c / distance);
        displacement = reflected_velocity(displacement, obstacle.displacement, normal);
        let drift = obstacle.state.drift.map(f64::from);
        *velocity = reflected_velocity(velocity.map(f64::from), drift, normal).map(|c| c as f32);
    }
    let (first, contact) = first?;
    let end = at(traveled);
    let reflection =
        PathReflection { contact, last: [at(std::array::from_fn(|k| traveled[k] - displacement[k])), end] };
    let after = outside(receivers, domain, path.before, domain.confine(end));
    Some(ReflectedPath { path: Path { end, after, ..*path }, first, path_length: length as f32, reflection })
}

/// Returns each sphere at its images nearest to the beginning and to the end of the path, if these differ.
fn obstacles<'a>(
    receivers: &[&'a ReceiverState],
    domain: &Boundary,
    path: &Path,
    displacement: [f64; 3],
) -> Vec<Obstacle<'a>> {
    let mut obstacles = Vec::with_capacity(receivers.len());
    for &state in receivers {
        let receiver_displacement = state.displacement.map(f64::from);
        let exact = |from: [f32; 3], to: [f64; 3]| -> [f64; 3] {
            std::array::from_fn(|k| domain.axes[k].displacement_exact(to[k] - f64::from(from[k])))
        };
        let before = path.before.map(f64::from);
        let offset = exact(state.center, before);
        let last = exact(
            state.center,
            std::array::from_fn(|k| before[k] + displacement[k] - receiver_displacement[k]),
        );
        let other: [f64; 3] = std::array::from_fn(|k| last[k] - (displacement[k] - receiver_displacement[k]));
        let differs = (0..3).any(|k| (other[k] - offset[k]).abs() > f64::from(state.receiver.radius));
        obstacles.push(Obstacle { state, offset, displacement: receiver_displacement });
        if differs {
            obstacles.push(Obstacle { state, offset: other, displacement: receiver_displacement });
        }
    }
    obstacles
}

impl Obstacle<'_> {
    fn offset_at(&self, traveled: [f64; 3], time: f64) -> [f64; 3] {
        std::array::from_fn(|k| self.offset[k] + traveled[k] - time * self.displacement[k])
    }

    /// Returns the time after `time`.
    fn meeting(&self, traveled: [f64; 3], time: f64, displacement: [f64; 3]) -> Option<f64> {
        let from = self.offset_at(traveled, time);
        let displacement: [f64; 3] = std::array::from_fn(|k| displacement[k] - self.displacement[k]);
        let (a, b) = (dot(displacement, displacement), dot(from, displacement));
        let c = (dot(from, from) - f64::from(self.state.receiver.radius).powi(2)).max(0.0);
        let root = b * b - a * c;
        (b < 0.0 && root >= 0.0).then(|| c / (root.sqrt() - b))
    }
}

fn reflected_velocity(velocity: [f64; 3], of_surface: [f64; 3], normal: [f64; 3]) -> [f64; 3] {
    let relative = std::array::from_fn(|k| velocity[k] - of_surface[k]);
    let out = dot(relative, normal);
    std::array::from_fn(|k| velocity[k] - 2.0 * out * normal[k])
}

/// Returns `after`, or `before` if walls or rounding moved `after` into a sphere. A sphere that covers both pushes the
/// particle out.
fn outside(receivers: &[&ReceiverState], domain: &Boundary, before: [f32; 3], after: [f32; 3]) -> [f32; 3] {
    let inside = |point: [f32; 3]| {
        let height = |state: &ReceiverState| {
            signed_distance(state.receiver.radius, state.center_at(1.0), domain, point)
        };
        receivers.iter().find(|state| height(state) < 0.0)
    };
    if inside(after).is_none() {
        return after;
    }
    let Some(state) = inside(before) else { return before };
    let center = state.center_at(1.0);
    let out = domain.displacement(center, before);
    let factor = state.receiver.radius / length(out).max(f32::MIN_POSITIVE) * (1.0 + 1e-5);
    domain.confine(std::array::from_fn(|k| center[k] + factor * out[k]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::receiver::{Receiver, ReceiverKind};
    use crate::random::philox::{open_unit, philox};

    fn state(center: [f32; 3], radius: f32) -> ReceiverState {
        let receiver = Receiver { center, radius, kind: ReceiverKind::Reflecting, ..Receiver::default() };
        ReceiverState::new(0, receiver, 1.0)
    }

    fn path(before: [f32; 3], end: [f32; 3], domain: &Boundary) -> Path {
        Path { before, end, after: domain.confine(end), free: end, drift: [0.0; 3], diffusion: 0.0 }
    }

    #[track_caller]
    fn close(found: [f32; 3], expected: [f32; 3]) {
        let near = found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5);
        assert!(near, "{found:?} and not {expected:?}");
    }

    #[test]
    fn reflected_paths_have_the_angle_of_incidence() {
        let (open, ball) = (Boundary::default(), state([0.0; 3], 1.0));
        let mut velocity = [-3.0, 5.0, 0.0];
        let mut end = |from, to| reflect_path(&[&ball], &open, &path(from, to, &open), &mut velocity);
        assert_eq!(end([3.0, 0.0, 0.0], [1.5, 2.0, 0.0]), None);
        close(end([3.0, 0.0, 0.0], [-1.0, 0.0, 0.0]).unwrap().path.after, [3.0, 0.0, 0.0]);
        let half = 0.5_f32.sqrt();
        let aside = end([3.0, half, 0.0], [half - 1.0, half, 0.0]).unwrap();
        close(aside.path.after, [half, half + 1.0, 0.0]);
        close(velocity, [-5.0, -3.0, 0.0]);
        let (left, right) = (state([-2.0, 0.0, 0.0], 1.0), state([2.0, 0.0, 0.0], 1.0));
        let to_and_fro = path([0.0; 3], [7.5, 0.0, 0.0], &open);
        close(
            reflect_path(&[&left, &right], &open, &to_and_fro, &mut velocity).unwrap().path.after,
            [-0.5, 0.0, 0.0],
        );
    }

    #[test]
    fn a_moving_receiver_pushes_a_resting_particle() {
        let open = Boundary::default();
        let mut ball = state([-3.0, 0.0, 0.0], 1.0);
        ball.displacement = [4.0, 0.0, 0.0];
        ball.drift = ball.displacement;
        let mut velocity = [0.0; 3];
        let pushed = reflect_path(&[&ball], &open, &path([0.0; 3], [0.0; 3], &open), &mut velocity).unwrap();
        close(pushed.path.after, [4.0, 0.0, 0.0]);
        close(velocity, [8.0, 0.0, 0.0]);
    }

    #[test]
    fn no_path_enters_a_sphere_across_periodic_boundaries_and_walls() {
        let domains = [Boundary::periodic([-2.0; 3], [2.0; 3]), Boundary::reflecting([-2.0; 3], [2.0; 3])];
        for domain in domains {
            let balls =
                [state([2.0, 0.0, 0.0], 1.0), state([-1.0, 0.5, 0.0], 0.9), state([0.4, -1.5, 1.0], 0.7)];
            let balls: Vec<&ReceiverState> = balls.iter().collect();
            let is_out = |p: [f32; 3]| {
                balls.iter().all(|b| signed_distance(b.receiver.radius, b.center, &domain, p) >= 0.0)
            };
            let mut from = [0.5, 1.5, -1.5];
            let mut reflections = 0;
            for k in 0..50_000_u32 {
                let [x, y, z, _] = philox([k, 0, 0, 0], [1, 2]).map(|word| 3.0 * (open_unit(word) - 0.5));
                let displacement = path(from, [from[0] + x, from[1] + y, from[2] + z], &domain);
                let reflected = reflect_path(&balls, &domain, &displacement, &mut [0.0; 3]);
                from = reflected.map_or(displacement.after, |reflected| reflected.path.after);
                reflections += u32::from(reflected.is_some());
                assert!(is_out(from), "{k}: {from:?}");
            }
            assert!(reflections > 5_000, "{reflections}");
        }
    }
}
