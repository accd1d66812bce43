use std::collections::HashMap;

use crate::model::receiver::{Receiver, ReceiverKind, WallFace};
use crate::model::{Model, share_species};

/// Surfaces that coincide if they are equal. Floats are compared by their bits.
#[derive(PartialEq, Eq, Hash)]
enum SurfaceKey {
    Wall(u8, usize),
    Sphere([u32; 3], u32),
}

impl Model {
    /// Returns a receiver on the surface of an earlier one, and a message. Each of them would absorb.
    pub(crate) fn faulty_absorber(&self) -> Option<(usize, String)> {
        let mut known: HashMap<SurfaceKey, Vec<&Receiver>> = HashMap::new();
        for (k, receiver) in self.receivers.iter().enumerate() {
            let Some(surface_key) = surface_key(receiver) else { continue };
            let others = known.entry(surface_key).or_default();
            let shares = |other: &&&Receiver| share_species(&other.sees, &receiver.sees);
            if let Some(other) = others.iter().find(shares) {
                let message = format!(
                    "{} has the same surface as {}, and both would absorb the same particles; remove one, or let them see \
                     different species",
                    receiver.name, other.name
                );
                return Some((k, message));
            }
            others.push(receiver);
        }
        None
    }
}

fn surface_key(receiver: &Receiver) -> Option<SurfaceKey> {
    match receiver.kind {
        ReceiverKind::Wall(WallFace::Low(axis)) => Some(SurfaceKey::Wall(0, axis)),
        ReceiverKind::Wall(WallFace::High(axis)) => Some(SurfaceKey::Wall(1, axis)),
        ReceiverKind::Wall(WallFace::Side) => Some(SurfaceKey::Wall(2, 0)),
        // Moving receivers part at once.
        ReceiverKind::Absorbing | ReceiverKind::Partial(_) if !receiver.moves() => {
            let center = receiver.center.map(|c| (c + 0.0).to_bits());
            Some(SurfaceKey::Sphere(center, receiver.radius.to_bits()))
        }
        _ => None,
    }
}
