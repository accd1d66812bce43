//! From names in a file to places in a model.

use toml::Spanned;

use super::file::{self, File, Finite};
use super::{Output, Problem};
use crate::boundary::Boundary;
use crate::model::{Contact, Decay, Model, Reaction, Species};
use crate::rate;
use crate::receiver::{Kind, Receiver};
use crate::transmitter::{Shape, Transmitter};

pub(super) fn resolve(file: File) -> Result<(Model, u32, u64, Output), Problem> {
    let mut model = Model {
        time_step: file.time_step.0,
        boundary: boundary(file.boundary)?,
        contact: match file.contact {
            file::Contact::Ignore => Contact::Ignore,
            file::Contact::Count => Contact::Count,
            file::Contact::Separate => Contact::Separate,
            file::Contact::Elastic => Contact::Elastic,
        },
        ..Model::default()
    };
    for one in &file.species {
        let (span, name) = (one.name.span(), &one.name.get_ref().0);
        if model.species.iter().any(|species| species.name == *name) {
            return Err(Problem::at(span, format!("there are two species '{name}'; rename one")));
        }
        model.species.push(Species {
            name: name.clone(),
            radius: one.radius.0 as f32,
            diffusion: one.diffusion.0,
            drift: one.drift.map(|Finite(v)| v),
            mass: one.mass.0.0,
            thermal_speed: one.thermal_speed.0,
        });
    }
    let names = Names(&model.species);
    let reactions = file.reactions.into_iter().map(|r| reaction(r, &names, model.time_step));
    let reactions = reactions.collect::<Result<Vec<_>, _>>()?;
    let decays = file.decays.into_iter().map(|d| decay(d, &names)).collect::<Result<_, _>>()?;
    let transmitters =
        file.transmitters.into_iter().map(|t| transmitter(t, &names)).collect::<Result<_, _>>()?;
    let receivers = file.receivers.into_iter().map(|r| receiver(r, &names)).collect::<Result<_, _>>()?;
    model = Model { reactions: distinct(reactions)?, decays, transmitters, receivers, ..model };
    let every = file.output.every.map_or(1, Into::into);
    let output = Output {
        every,
        frames_every: file.output.frames_every.map_or(every, Into::into),
        xyz: file.output.frames.contains(&file::FrameFormat::Xyz),
        npy: file.output.frames.contains(&file::FrameFormat::Npy),
        checkpoint_every: file.output.checkpoint_every.map(Into::into),
    };
    Ok((model, file.steps, file.seed, output))
}

/// Species by name.
struct Names<'a>(&'a [Species]);

impl Names<'_> {
    fn find(&self, name: &str, span: std::ops::Range<usize>) -> Result<u32, Problem> {
        let place = self.0.iter().position(|species| species.name == name).map(|place| place as u32);
        place.ok_or_else(|| {
            let known = self.0.iter().map(|species| species.name.as_str()).collect::<Vec<_>>().join(", ");
            Problem::at(span, format!("there is no species '{name}'; there are {known}"))
        })
    }

    fn get(&self, name: &Spanned<String>) -> Result<u32, Problem> {
        self.find(name.get_ref(), name.span())
    }

    /// The species on both sides of `A + B -> C`.
    fn equation(&self, equation: &Spanned<String>) -> Result<[Vec<u32>; 2], Problem> {
        let (text, span) = (equation.get_ref(), equation.span());
        let Some((left, right)) = text.split_once("->") else {
            return Err(Problem::at(span, format!("'{text}' has no '->'; write it as in 'A + B -> C'")));
        };
        let side = |side: &str| -> Result<Vec<u32>, Problem> {
            let names = side.split('+').map(str::trim).filter(|name| !name.is_empty() && *name != "0");
            names.map(|name| self.find(name, equation.span())).collect()
        };
        Ok([side(left)?, side(right)?])
    }
}

fn boundary(boundary: Option<file::Boundary>) -> Result<Boundary, Problem> {
    let Some(file::Boundary { kind, low, high }) = boundary else { return Ok(Boundary::default()) };
    let [from, to] = [low, *high.get_ref()].map(|corner| corner.map(|Finite(x)| x as f32));
    if (0..3).any(|k| from[k] >= to[k]) {
        let message = format!("{to:?} is not above low = {from:?} along every axis");
        return Err(Problem::at(high.span(), message));
    }
    Ok(match kind {
        file::BoundaryKind::Reflecting => Boundary::reflecting(from, to),
        file::BoundaryKind::Periodic => Boundary::periodic(from, to),
    })
}

fn reaction(
    reaction: file::Reaction,
    names: &Names<'_>,
    time_step: f64,
) -> Result<(std::ops::Range<usize>, Reaction), Problem> {
    let span = reaction.equation.span();
    let [left, right] = names.equation(&reaction.equation)?;
    let text = reaction.equation.get_ref();
    let &[a, b] = left.as_slice() else {
        return Err(Problem::at(span, format!("'{text}' must have two reactants; one alone is a [[decay]]")));
    };
    let Some(products) = places([a, b], &right) else {
        return Err(Problem::at(span, format!("'{text}' has {} products; two are the most", right.len())));
    };
    if products == [Some(a), Some(b)] {
        return Err(Problem::at(span, format!("'{text}' changes nothing; remove it")));
    }
    let diffusion: f64 = [a, b].iter().map(|&s| names.0[s as usize].diffusion).sum();
    let radius = match (reaction.binding_radius, reaction.rate) {
        (Some(radius), None) => radius.get_ref().0,
        (None, Some(rate)) => {
            if let Some(p) = reaction.probability {
                return Err(Problem::at(
                    p.span(),
                    "a probability goes with binding-radius, not with rate".into(),
                ));
            }
            let refused = |error: crate::Error| Problem::at(rate.span(), error.to_string());
            rate::binding_radius(rate.get_ref().0, diffusion, time_step).map_err(refused)?
        }
        _ => return Err(Problem::at(span, format!("'{text}' needs either binding-radius or rate"))),
    };
    let step = (2.0 * diffusion * time_step).sqrt();
    if step > rate::LONG_STEP * radius {
        log::warn!(
            "{text}: a step of {step:.3} µm of one reactant towards the other is long beside the binding radius of \
             {radius:.3} µm, so that reactants jump over each other; the rate is right only where they are well \
             mixed; shorten the time step below {:.3e} s",
            (rate::LONG_STEP * radius).powi(2) / (2.0 * diffusion)
        );
    }
    let reaction = Reaction {
        name: text.trim().to_owned(),
        reactants: [a, b],
        products,
        binding_radius: radius as f32,
        unbinding_radius: reaction.unbinding_radius.0 as f32,
        probability: reaction.probability.map_or(1.0, |p| p.get_ref().0),
    };
    Ok((span, reaction))
}

/// Which product takes the place of which reactant: that of its own species, else the first that is free.
fn places(reactants: [u32; 2], products: &[u32]) -> Option<[Option<u32>; 2]> {
    let mut placed = [None; 2];
    let mut others = Vec::new();
    for &product in products {
        match (0..2).find(|&k| placed[k].is_none() && reactants[k] == product) {
            Some(k) => placed[k] = Some(product),
            None => others.push(product),
        }
    }
    for product in others {
        let free = (0..2).find(|&k| placed[k].is_none())?;
        placed[free] = Some(product);
    }
    Some(placed)
}

/// One reaction for each pair of species.
fn distinct(reactions: Vec<(std::ops::Range<usize>, Reaction)>) -> Result<Vec<Reaction>, Problem> {
    let sorted = |reaction: &Reaction| {
        let [a, b] = reaction.reactants;
        [a.min(b), a.max(b)]
    };
    for (k, (span, second)) in reactions.iter().enumerate() {
        if let Some((_, first)) = reactions[..k].iter().find(|(_, r)| sorted(r) == sorted(second)) {
            let message = format!("'{}' has the same reactants; keep one of the two", first.name);
            return Err(Problem::at(span.clone(), message));
        }
    }
    Ok(reactions.into_iter().map(|(_, reaction)| reaction).collect())
}

fn decay(decay: file::Decay, names: &Names<'_>) -> Result<Decay, Problem> {
    let text = decay.equation.get_ref();
    let [left, right] = names.equation(&decay.equation)?;
    let (&[reactant], [] | [_]) = (left.as_slice(), right.as_slice()) else {
        let message = format!("'{text}' must have one reactant and at most one product");
        return Err(Problem::at(decay.equation.span(), message));
    };
    Ok(Decay { name: text.trim().to_owned(), reactant, product: right.first().copied(), rate: decay.rate.0 })
}

fn transmitter(transmitter: file::Transmitter, names: &Names<'_>) -> Result<Transmitter, Problem> {
    let release =
        |release: &file::Release| -> Result<_, Problem> { Ok((names.get(&release.species)?, release.count)) };
    Ok(Transmitter {
        name: transmitter.name.0,
        center: transmitter.center.map(|Finite(x)| x as f32),
        shape: match transmitter.shape {
            file::Shape::Point => Shape::Point,
            file::Shape::Gaussian { width } => Shape::Gaussian(width.0 as f32),
            file::Shape::Ball { inner_radius, radius } => {
                Shape::Shell(inner_radius.0 as f32, radius.0 as f32)
            }
            file::Shape::Box { size } => Shape::Box(size.map(|edge| edge.0 as f32)),
            file::Shape::Lattice { size, places } => {
                Shape::Lattice(size.map(|edge| edge.0 as f32), places.map(Into::into))
            }
        },
        times: transmitter.times.into_iter().map(|time| time.0).collect(),
        release: transmitter.release.iter().map(release).collect::<Result<_, _>>()?,
    })
}

fn receiver(receiver: file::Receiver, names: &Names<'_>) -> Result<Receiver, Problem> {
    let mut sees = vec![receiver.species.is_none(); names.0.len()];
    for name in receiver.species.iter().flatten() {
        sees[names.get(name)? as usize] = true;
    }
    Ok(Receiver {
        name: receiver.name.0,
        center: receiver.center.map(|Finite(x)| x as f32),
        radius: receiver.radius.0 as f32,
        kind: match receiver.kind {
            file::ReceiverKind::Absorbing => Kind::Absorbing,
            file::ReceiverKind::Endpoint => Kind::Endpoint,
            file::ReceiverKind::Transparent => Kind::Transparent,
        },
        sees,
    })
}
