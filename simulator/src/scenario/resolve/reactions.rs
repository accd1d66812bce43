//! Reactions and decays.

use std::ops::Range;

use super::Names;
use crate::model::{Decay, Reaction};
use crate::rate;
use crate::scenario::{Problem, advice, file};

pub(super) fn reactions(
    many: &[file::Reaction],
    names: &Names<'_>,
    time_step: f64,
    advice: &mut Vec<Problem>,
) -> Result<Vec<Reaction>, Problem> {
    let all = many.iter().map(|one| reaction(one, names, time_step, advice));
    distinct(all.collect::<Result<_, _>>()?)
}

fn reaction(
    reaction: &file::Reaction,
    names: &Names<'_>,
    time_step: f64,
    advice: &mut Vec<Problem>,
) -> Result<(Range<usize>, Reaction), Problem> {
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
    let rate = reaction.rate.as_ref();
    let radius = match (&reaction.binding_radius, rate) {
        (Some(radius), None) => radius.get_ref().0,
        (None, Some(rate)) => {
            if let Some(p) = &reaction.probability {
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
    let numbers = (radius, diffusion, rate.map(|rate| rate.get_ref().0));
    let place = rate.map_or(span.clone(), |rate| rate.span());
    advice.extend(advice::long_step(text.trim(), numbers, time_step).map(|m| Problem::at(place, m)));
    let reaction = Reaction {
        name: text.trim().to_owned(),
        reactants: [a, b],
        products,
        binding_radius: radius as f32,
        unbinding_radius: reaction.unbinding_radius.0 as f32,
        probability: reaction.probability.as_ref().map_or(1.0, |p| p.get_ref().0),
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
fn distinct(reactions: Vec<(Range<usize>, Reaction)>) -> Result<Vec<Reaction>, Problem> {
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

pub(super) fn decay(decay: &file::Decay, names: &Names<'_>) -> Result<Decay, Problem> {
    let text = decay.equation.get_ref();
    let [left, right] = names.equation(&decay.equation)?;
    let (&[reactant], [] | [_]) = (left.as_slice(), right.as_slice()) else {
        let message = format!("'{text}' must have one reactant and at most one product");
        return Err(Problem::at(decay.equation.span(), message));
    };
    Ok(Decay { name: text.trim().to_owned(), reactant, product: right.first().copied(), rate: decay.rate.0 })
}
