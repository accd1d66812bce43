//! Whether a particle met a receiver within a step, of which only the two ends are known.
//!
//! *Diffusion alone.* With both ends outside, at distances `a` and `b` from the surface, the path met the sphere with
//! probability exp(−ab/(DΔt)). On average over the angle between the ends that is exact for a sphere.
//!
//! *Drift alone.* The path is a straight line, which walls turn round.
//!
//! *Both.* The average no longer holds where a step of the drift is long: a particle may be carried from one side of the
//! sphere to the other. The path is then looked at in halves, and those in halves, as the Brownian bridge between their
//! ends has it, until the drift of a piece is short beside its diffusion or the sphere. Halves far from the sphere are
//! left alone. All receivers see the same path.
//!
//! *Receivers that move* are met in their own frame: their way is taken off that of the particle, and the diffusion of both
//! bends the path.

use crate::model::boundary::{Axis, Boundary};
use crate::model::receiver::{ReceiverKind, signed_distance};
use crate::motion::receiver_state::ReceiverState;
use crate::random::gaussian::normals;
use crate::random::philox::{Key, Purpose, open_unit};

/// A step of a particle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Path {
    /// The position at the beginning, in µm.
    pub before: [f32; 3],
    /// The position at the end without walls and images.
    pub end: [f32; 3],
    /// The position at the end.
    pub after: [f32; 3],
    /// The part of the way that is no diffusion.
    pub drift: [f32; 3],
    /// DΔt, in µm².
    pub diffusion: f32,
}

/// The source of random numbers: a particle in a step.
#[derive(Clone, Copy, Debug)]
pub struct DrawContext {
    /// The seed.
    pub key: Key,
    /// The particle.
    pub id: u32,
    /// The step.
    pub step: u32,
}

/// Beyond this exponent the probability is below the smallest random number.
const NEVER: f32 = 17.0;
/// The part of a receiver's radius that a drift may take a particle in one piece of its path, and the part of the
/// standard deviation of the piece.
const PIECE: [f32; 2] = [1.0 / 16.0, 1.0 / 8.0];
/// A path bends further than this many standard deviations from the line between its ends in one of 10⁸ cases.
pub(crate) const BEND: f32 = 3.1;
/// Pieces beyond this are not halved any more; the first has number 1, and those of piece `k` have 2k and 2k + 1.
const LAST: u32 = 1 << 12;

/// Returns `true` if a path met the receiver. `domain` is where the particle's centre may be.
#[inline]
pub fn hits(body: &ReceiverState, domain: &Boundary, path: &Path, who: DrawContext) -> bool {
    let b = signed_distance(body.receiver.radius, body.center_at(1.0), domain, path.after);
    if b <= 0.0 {
        return true;
    }
    if body.receiver.kind == ReceiverKind::Endpoint {
        return false;
    }
    let a = signed_distance(body.receiver.radius, body.center, domain, path.before);
    let diffusion = path.diffusion + body.diffusion;
    let drift: [f32; 3] = std::array::from_fn(|k| path.drift[k] - body.drift[k]);
    if drift == [0.0; 3] {
        return who.crosses(body.place, 0, a * b / diffusion);
    }
    if diffusion == 0.0 {
        return a < 0.0 || straight(body, domain, path);
    }
    let piece = PathSegment {
        number: 1,
        ends: [path.before, path.end],
        begin: 0.0,
        part: 1.0,
        spread: (2.0 * diffusion).sqrt(),
        drift: length(drift),
    };
    BrownianBridge { body, domain, who }.hits(piece)
}

/// Returns `true` if the ends of a piece do not tell whether it met a sphere: with this drift and standard deviation
/// along each axis it may have been carried past.
pub(crate) fn is_long(drift: f32, spread: f32, radius: f32) -> bool {
    drift > PIECE[0] * radius && drift > PIECE[1] * spread
}

impl DrawContext {
    /// Draws where chance decides whether a part of the path met the receiver at a `place` of the model, with
    /// probability exp(−`exponent`).
    #[inline]
    fn crosses(self, place: u32, part: u32, exponent: f32) -> bool {
        let Self { key, id, step } = self;
        let word = || key.draw_part([id, place], part, step, Purpose::Receiver)[0];
        // At rest on the surface that is 0/0; there the particle was met before.
        exponent < NEVER && open_unit(word()) < libm::expf(-exponent)
    }
}

struct BrownianBridge<'a> {
    body: &'a ReceiverState,
    domain: &'a Boundary,
    who: DrawContext,
}

/// A part of a path.
struct PathSegment {
    number: u32,
    /// Without walls and images.
    ends: [[f32; 3]; 2],
    /// Which part of the step is over where it begins.
    begin: f32,
    /// Which part of the step it takes.
    part: f32,
    /// Standard deviation of its diffusion along each axis, in µm.
    spread: f32,
    /// The displacement by drift, in µm.
    drift: f32,
}

impl BrownianBridge<'_> {
    /// The height of a point, at a part of the step.
    fn signed_distance(&self, point: [f32; 3], part: f32) -> f32 {
        signed_distance(
            self.body.receiver.radius,
            self.body.center_at(part),
            self.domain,
            self.domain.confine(point),
        )
    }

    fn hits(&self, piece: PathSegment) -> bool {
        let PathSegment { number, ends: [p, q], begin, part, spread, drift } = piece;
        let middle: [f32; 3] = std::array::from_fn(|k| p[k] + 0.5 * (q[k] - p[k]));
        let half = 0.5 * length(std::array::from_fn(|k| q[k] - p[k] - part * self.body.displacement[k]));
        let half_time = begin + 0.5 * part;
        // Walls and images bring no two points further apart.
        if self.signed_distance(middle, half_time) > half + BEND * spread {
            return false;
        }
        if number >= LAST || !is_long(drift, spread, self.body.receiver.radius) {
            let [a, b] = [(p, begin), (q, begin + part)].map(|(end, part)| self.signed_distance(end, part));
            let exponent = a * b / (0.5 * spread * spread);
            return b <= 0.0 || self.who.crosses(self.body.place, number - 1, exponent);
        }
        let DrawContext { key, id, step } = self.who;
        let z = normals(key.draw(id, number, step, Purpose::Path));
        let middle = std::array::from_fn(|k| middle[k] + 0.5 * spread * z[k]);
        let half_of = |number, begin, ends| PathSegment {
            number,
            ends,
            begin,
            part: 0.5 * part,
            spread: spread * std::f32::consts::FRAC_1_SQRT_2,
            drift: 0.5 * drift,
        };
        self.hits(half_of(2 * number, begin, [p, middle]))
            || self.hits(half_of(2 * number + 1, half_time, [middle, q]))
    }
}

fn length(v: [f32; 3]) -> f32 {
    (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()
}

/// How often a straight line may be cut on an axis. A particle that crosses a box more often in one step is nowhere in
/// particular.
const CUTS: usize = 1000;

/// Returns `true` if a straight path hits the receiver. It is cut where a wall turns it round, and where another image
/// of the receiver becomes the nearest one.
fn straight(body: &ReceiverState, domain: &Boundary, path: &Path) -> bool {
    let [from, to] = [path.before, path.end].map(|end| end.map(f64::from));
    let way: [f64; 3] = std::array::from_fn(|k| to[k] - from[k]);
    let radius = f64::from(body.receiver.radius);
    let mut cuts = Vec::new();
    for (k, axis) in domain.axes.into_iter().enumerate() {
        let (first, period, way) = match axis {
            Axis::Open => continue,
            Axis::Reflecting { low, high } => (f64::from(low), f64::from(high - low), way[k]),
            Axis::Periodic { low, high } => {
                let half = 0.5 * f64::from(high - low);
                (
                    f64::from(body.center[k]) + half,
                    f64::from(high - low),
                    way[k] - f64::from(body.displacement[k]),
                )
            }
        };
        let to = from[k] + way;
        let [low, high] = [from[k].min(to), from[k].max(to)].map(|x| (x - first) / period);
        let planes = (low.ceil() as i64..=high.floor() as i64).take(CUTS);
        cuts.extend(planes.map(|plane| (first + plane as f64 * period - from[k]) / way));
    }
    if cuts.is_empty() {
        let from = domain.displacement(body.center, path.before).map(f64::from);
        return passes(from, std::array::from_fn(|k| way[k] - f64::from(body.displacement[k])), radius);
    }
    cuts.extend([0.0, 1.0]);
    cuts.retain(|t| (0.0..=1.0).contains(t));
    cuts.sort_unstable_by(f64::total_cmp);
    cuts.windows(2).any(|cut| {
        let (middle, part) = (0.5 * (cut[0] + cut[1]), cut[1] - cut[0]);
        let point: [f32; 3] = std::array::from_fn(|k| (from[k] + middle * way[k]) as f32);
        let way: [f64; 3] = std::array::from_fn(|k| {
            let own = if domain.axes[k].turns(point[k]) { -part * way[k] } else { part * way[k] };
            own - part * f64::from(body.displacement[k])
        });
        let middle = domain.displacement(body.center_at(middle as f32), domain.confine(point)).map(f64::from);
        passes(std::array::from_fn(|k| middle[k] - 0.5 * way[k]), way, radius)
    })
}

/// Returns `true` if a line from a point goes through the sphere of this radius around the origin.
fn passes(from: [f64; 3], way: [f64; 3], radius: f64) -> bool {
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let to: [f64; 3] = std::array::from_fn(|k| from[k] + way[k]);
    let [x, y, z] = from;
    let [u, v, w] = way;
    let cross = [y * w - z * v, z * u - x * w, x * v - y * u];
    let reach = radius * radius;
    // It is nearest between its ends where it approaches from one and leaves towards the other.
    let between = dot(from, way) < 0.0 && dot(to, way) > 0.0;
    dot(from, from) <= reach || dot(to, to) <= reach || between && dot(cross, cross) <= reach * dot(way, way)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::receiver::Receiver;

    fn body(kind: ReceiverKind) -> ReceiverState {
        let receiver =
            Receiver { center: [1.0, 0.0, 0.0], radius: 1.0, kind, sees: vec![true], ..Receiver::default() };
        ReceiverState::new(0, receiver, 1.0)
    }

    const DRAWS: DrawContext = DrawContext { key: Key::new(1), id: 7, step: 3 };

    fn path(before: [f32; 3], end: [f32; 3], domain: &Boundary, diffusion: f32) -> Path {
        let drift = std::array::from_fn(|k| if diffusion == 0.0 { end[k] - before[k] } else { 0.0 });
        Path { before, end, after: domain.confine(end), drift, diffusion }
    }

    #[test]
    fn diffusion_follows_the_bridge() {
        let open = Boundary::default();
        let step = path([2.5, 0.0, 0.0], [1.0, 1.25, 0.0], &open, 0.25);
        let n = 20_000;
        let met =
            |kind| (0..n).filter(|&id| hits(&body(kind), &open, &step, DrawContext { id, ..DRAWS })).count();
        let p = (-0.5_f64).exp();
        let error =
            (met(ReceiverKind::Absorbing) as f64 - f64::from(n) * p) / (f64::from(n) * p * (1.0 - p)).sqrt();
        assert!(error.abs() < 4.0, "{error} standard errors");
        assert_eq!(met(ReceiverKind::Endpoint), 0);
        let at_rest = path([1.0, 1.25, 0.0], [1.0, 1.25, 0.0], &open, 0.0);
        assert!(!hits(&body(ReceiverKind::Absorbing), &open, &at_rest, DRAWS));
        let inside = path([9.0, 0.0, 0.0], [1.5, 0.0, 0.0], &open, 0.25);
        assert!(hits(&body(ReceiverKind::Endpoint), &open, &inside, DRAWS));
    }

    /// Any number of receivers, and every piece of a path, have draws of their own.
    #[test]
    fn neither_receivers_nor_pieces_share_draws() {
        let one = |place, part, id| DrawContext { id, ..DRAWS }.crosses(place, part, 0.7);
        let draws = |place, part| (0..256).map(|id| one(place, part, id)).collect::<Vec<bool>>();
        let places = [0, 1, 1 << 15, 1 << 16, (1 << 16) + 1, 1 << 24, u32::MAX];
        let parts = [0, 1, 2, 255, 256, 2 * LAST - 2];
        let all: std::collections::BTreeSet<_> =
            places.iter().flat_map(|&place| parts.map(|part| draws(place, part))).collect();
        assert_eq!(all.len(), places.len() * parts.len());
    }

    #[test]
    fn a_straight_path_is_followed_through_walls_and_images() {
        let met = |domain: &Boundary, before, end| {
            hits(&body(ReceiverKind::Absorbing), domain, &path(before, end, domain, 0.0), DRAWS)
        };
        let open = Boundary::default();
        assert!(met(&open, [-3.0, 0.5, 0.0], [9.0, 0.5, 0.0]));
        assert!(!met(&open, [-3.0, 1.125, 0.0], [9.0, 1.125, 0.0]));
        assert!(!met(&open, [-3.0, 0.5, 0.0], [-0.5, 0.5, 0.0]));
        assert!(!met(&open, [3.0, 0.5, 0.0], [9.0, 0.5, 0.0]));
        // Up to a wall above the sphere and down again; the line between both ends is far below.
        let below = |wall| Boundary::reflecting([-8.0, -4.0, -4.0], [8.0, wall, 4.0]);
        assert!(met(&below(1.1), [6.0, -2.0, 0.0], [-4.0, 4.2, 0.0]));
        assert!(!met(&below(1.5), [6.0, -2.0, 0.0], [-4.0, 5.0, 0.0]));
        assert!(met(&below(4.0), [4.0, 0.0, 0.0], [18.0, 0.0, 0.0]));
        // Once round the box.
        let periodic = Boundary::periodic([-8.0; 3], [8.0; 3]);
        assert!(!met(&periodic, [4.0, 0.5, 0.0], [14.0, 0.5, 0.0]));
        assert!(met(&periodic, [4.0, 0.5, 0.0], [20.0, 0.5, 0.0]));
        assert!(!met(&periodic, [4.0, 1.5, 0.0], [20.0, 1.5, 0.0]));
    }

    /// With a drift so strong that diffusion is nothing beside it, the path is the straight line.
    #[test]
    fn halves_of_a_path_follow_the_drift() {
        let open = Boundary::default();
        for (y, expected) in [(0.5, true), (1.2, false)] {
            let step = Path { diffusion: 1e-6, ..path([-3.0, y, 0.0], [9.0, y, 0.0], &open, 0.0) };
            assert_eq!(hits(&body(ReceiverKind::Absorbing), &open, &step, DRAWS), expected, "{y}");
        }
    }
}
