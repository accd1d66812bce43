//! Frames of an animation, `animation.frames`, as little-endian 32-bit words: step, shift, numbers of particles (two
//! words), drawn particles and moving receivers. Then id, species and position of each drawn particle, and the moving
//! receivers' centers.

use std::io::{self, Read, Write};
use std::num::NonZeroU32;

use crate::{Model, State};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Animation {
    pub every: u32,
    /// Above this number, a frame draws a half, a quarter and so on, by a hash of ids.
    pub particles: NonZeroU32,
}

/// The second line of the page.
pub const PAGE_MARK: &str = "<!-- animation of lazygrid simulate -->";

const HEADER_WORDS: usize = 6;
const PARTICLE_WORDS: usize = 5;
const CENTER_WORDS: usize = 3;

#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    pub step: u32,
    /// One in 2ˢʰⁱᶠᵗ particles is drawn.
    pub shift: u32,
    pub present: u64,
    pub rows: Vec<DrawnParticle>,
    /// Moving receivers, in the order of the model.
    pub centers: Vec<[f32; 3]>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DrawnParticle {
    pub id: u32,
    pub species: u32,
    pub position: [f32; 3],
}

/// Returns `true` if frames with one in 2ˢʰⁱᶠᵗ particles draw this one.
pub fn is_drawn(id: u32, shift: u32) -> bool {
    mixed(id).leading_zeros() >= shift
}

/// Finalizer of MurmurHash3: ids follow releases, and all species must be thinned alike.
fn mixed(id: u32) -> u32 {
    let a = (id ^ id >> 16).wrapping_mul(0x85EB_CA6B);
    let b = (a ^ a >> 13).wrapping_mul(0xC2B2_AE35);
    b ^ b >> 16
}

pub fn moving_receivers(model: &Model) -> impl Iterator<Item = usize> + '_ {
    (0..model.receivers.len()).filter(|&k| model.receivers[k].moves())
}

pub(crate) fn bytes_of(model: &Model, particles: u64) -> u64 {
    4 * (HEADER_WORDS as u64
        + PARTICLE_WORDS as u64 * particles
        + (CENTER_WORDS * moving_receivers(model).count()) as u64)
}

pub(crate) fn append(
    out: &mut impl Write,
    model: &Model,
    state: &State,
    max_particles: NonZeroU32,
) -> io::Result<()> {
    let particles = &state.particles;
    let mut ranks = [0_u64; 33];
    particles.id.iter().for_each(|&id| ranks[mixed(id).leading_zeros() as usize] += 1);
    let drawn = |shift: u32| ranks[shift as usize..].iter().sum::<u64>();
    let shift = (0..32).find(|&shift| drawn(shift) <= u64::from(max_particles.get())).unwrap_or(32);
    let present = particles.len() as u64;
    let receivers = moving_receivers(model).count() as u32;
    let head = [state.step, shift, present as u32, (present >> 32) as u32, drawn(shift) as u32, receivers];
    let mut bytes: Vec<u8> = head.iter().flat_map(|word| word.to_le_bytes()).collect();
    let mut order: Vec<usize> =
        (0..particles.len()).filter(|&at| is_drawn(particles.id[at], shift)).collect();
    // Independent of the order of storage.
    order.sort_unstable_by_key(|&at| particles.id[at]);
    for at in order {
        let [x, y, z] = particles.position_of(at).map(f32::to_bits);
        for word in [particles.id[at], particles.species[at], x, y, z] {
            bytes.extend(word.to_le_bytes());
        }
    }
    bytes.extend(moving_receivers(model).flat_map(|k| state.centers[k]).flat_map(f32::to_le_bytes));
    out.write_all(&bytes)
}

#[derive(Debug)]
pub struct Frames<R>(R);

impl<R: Read> Frames<R> {
    pub fn new(input: R) -> Self {
        Self(input)
    }

    fn words<const N: usize>(&mut self) -> io::Result<[u32; N]> {
        let mut words = [0; N];
        for word in &mut words {
            let mut bytes = [0; 4];
            self.0.read_exact(&mut bytes)?;
            *word = u32::from_le_bytes(bytes);
        }
        Ok(words)
    }

    fn frame(&mut self, first: u32) -> io::Result<Frame> {
        let [shift, low, high, count, receivers] = self.words()?;
        let row = |[id, species, x, y, z]: [u32; PARTICLE_WORDS]| DrawnParticle {
            id,
            species,
            position: [x, y, z].map(f32::from_bits),
        };
        let rows = (0..count).map(|_| self.words().map(row)).collect::<io::Result<_>>()?;
        let center = |words: [u32; CENTER_WORDS]| words.map(f32::from_bits);
        let centers = (0..receivers).map(|_| self.words().map(center)).collect::<io::Result<_>>()?;
        Ok(Frame { step: first, shift, present: u64::from(low) | u64::from(high) << 32, rows, centers })
    }
}

impl<R: Read> Iterator for Frames<R> {
    type Item = io::Result<Frame>;

    fn next(&mut self) -> Option<io::Result<Frame>> {
        let mut first = Vec::new();
        match self.0.by_ref().take(4).read_to_end(&mut first) {
            Ok(0) => None,
            Ok(_) => Some(match first.try_into() {
                Ok(bytes) => self.frame(u32::from_le_bytes(bytes)),
                Err(_) => Err(io::ErrorKind::UnexpectedEof.into()),
            }),
            Err(error) => Some(Err(error)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Particle, Particles, Receiver};

    fn model() -> Model {
        let receiver = |diffusion| Receiver { diffusion, ..Receiver::default() };
        Model { receivers: [1.0, 0.0, 2.0].map(receiver).into(), ..Model::default() }
    }

    fn state(count: u32) -> State {
        let mut particles = Particles::default();
        for id in 0..count {
            let x = id as f32;
            particles
                .push(Particle { position: [x, -x, 0.5], species: id % 3, id, ..Particle::default() }, false);
        }
        let centers = vec![[1.0; 3], [2.0; 3], [3.0, 4.0, count as f32]];
        State { particles, step: 7, centers, ..State::default() }
    }

    #[test]
    fn a_frame_is_read_back() {
        let mut file = Vec::new();
        for count in [0, 10, 3] {
            append(&mut file, &model(), &state(count), NonZeroU32::MAX).unwrap();
        }
        let bytes = |particles| bytes_of(&model(), particles);
        assert_eq!(file.len() as u64, bytes(0) + bytes(10) + bytes(3));
        let frames: Vec<Frame> = Frames::new(&file[..]).map(Result::unwrap).collect();
        assert_eq!(frames.iter().map(|frame| frame.rows.len()).collect::<Vec<_>>(), [0, 10, 3]);
        assert_eq!((frames[1].step, frames[1].shift, frames[1].present), (7, 0, 10));
        assert_eq!(frames[1].rows[4], DrawnParticle { id: 4, species: 1, position: [4.0, -4.0, 0.5] });
        assert_eq!(frames[2].centers, [[1.0; 3], [3.0, 4.0, 3.0]]);
        let ends = [0, bytes(0), bytes(0) + bytes(10), file.len() as u64];
        for length in 0..=file.len() {
            let is_whole = Frames::new(&file[..length]).all(|frame| frame.is_ok());
            assert_eq!(is_whole, ends.contains(&(length as u64)), "{length}");
        }
    }

    #[test]
    fn too_many_are_thinned_evenly_and_by_id() {
        let thinned = |max_particles| {
            let mut file = Vec::new();
            append(&mut file, &model(), &state(30_000), NonZeroU32::new(max_particles).unwrap()).unwrap();
            Frames::new(&file[..]).next().unwrap().unwrap()
        };
        let [half, less] = [thinned(20_000), thinned(5_000)];
        assert_eq!((half.shift, less.shift, less.present), (1, 3, 30_000));
        assert!(less.rows.iter().all(|row| half.rows.contains(row)), "others are drawn");
        for species in 0..3 {
            let count = less.rows.iter().filter(|row| row.species == species).count() as f64;
            assert!((count - 1250.0).abs() < 4.0 * 1250.0_f64.sqrt(), "{count} of species {species}");
        }
        assert!(thinned(1).rows.len() <= 1);
    }
}
