use lazygrid_io::excerpt;
use lazygrid_scenario::{self as file, Positive};
use toml::Spanned;

use super::checks::span_of;
use super::network_index::NetworkIndex;
use super::schedule::single_radius;
use super::{Names, equation_name, number_equal_names};
use crate::model::probability::undoes;
use crate::model::{Decay, Model, Reaction, ReactionRate, Species, Unbinding};
use crate::reaction::rate;
use crate::scenario::{Problem, warnings};

/// Largest number of reactions of the same reactants.
const MAX_CHANNELS: usize = 1000;

pub(super) fn resolve(
    reactions: &[file::Reaction],
    decays: &[file::Decay],
    names: &Names<'_>,
    space: &Model,
    warnings: &mut Vec<Problem>,
) -> Result<(Vec<Reaction>, Vec<Decay>), Problem> {
    let mut drafts =
        reactions.iter().map(|one| Draft::new(one, names)).collect::<Result<Vec<Draft<'_>>, _>>()?;
    let mut parsed = decays.iter().map(|one| decay(one, names)).collect::<Result<Vec<Decay>, _>>()?;
    number_equal_names(drafts.iter_mut().map(|draft| &mut draft.bare.name));
    number_equal_names(parsed.iter_mut().map(|decay| &mut decay.name));
    let (time_step, dimensions) = (space.time_step, space.boundary.dimensions());
    let index = NetworkIndex::new(drafts.iter().map(|draft| &draft.bare), &parsed);
    let all = Network { drafts, decays: parsed, index, time_step, dimensions };
    all.drafts.iter().try_for_each(|draft| all.check_count(draft, names))?;
    let resolved = all.drafts.iter().map(|draft| all.reaction(draft)).collect::<Result<Vec<_>, _>>()?;
    all.drafts.iter().try_for_each(|draft| all.check_reverse(draft, &resolved))?;
    warnings
        .extend(all.drafts.iter().zip(&resolved).flat_map(|(draft, reaction)| all.warnings(draft, reaction)));
    let apart = all.decays.iter().zip(decays).map(|(decay, from)| all.unbinding(decay, from, &resolved));
    let unbindings = apart.collect::<Result<Vec<_>, _>>()?;
    let pairs = all.decays.into_iter().zip(unbindings);
    Ok((resolved, pairs.map(|(decay, unbinding)| Decay { unbinding, ..decay }).collect()))
}

struct Network<'a> {
    drafts: Vec<Draft<'a>>,
    decays: Vec<Decay>,
    index: NetworkIndex,
    time_step: f64,
    dimensions: usize,
}

/// The decay or reaction that undoes a reaction.
struct Reverse<'a> {
    name: &'a str,
    /// Distance of its products, in µm.
    apart: f64,
    /// Factor of the reaction's rate that keeps the equilibrium.
    rate_factor: f64,
}

struct Draft<'a> {
    file: &'a file::Reaction,
    /// Without binding radius and rate.
    bare: Reaction,
    /// Sum of the reactants' diffusion coefficients, in µm²/s.
    diffusion: f64,
    /// Sum of the reactants' radii, in µm.
    touch: f64,
    /// Relative speed of the reactants apart from diffusion, in µm/s.
    speed: f64,
}

impl<'a> Draft<'a> {
    fn new(file: &'a file::Reaction, names: &Names<'_>) -> Result<Self, Problem> {
        let span = file.equation.span();
        let [left, right] = names.equation(&file.equation)?;
        let name = excerpt(file.equation.get_ref().trim().as_bytes());
        let &[a, b] = left.as_slice() else {
            let message =
                format!("'{name}' must have two reactants; one alone is a [[decay]], none a [[source]]");
            return Err(Problem::at(span, message));
        };
        let Some(products) = assigned_products([a, b], &right) else {
            return Err(Problem::at(
                span,
                format!("'{name}' has {} products; two are the most", right.len()),
            ));
        };
        if products == [Some(a), Some(b)] {
            return Err(Problem::at(span, format!("'{name}' changes nothing; remove it")));
        }
        let bare = Reaction {
            name: equation_name(&file.equation),
            reactants: [a, b],
            products,
            unbinding_radius: unbinding_radius(&file.unbinding_radius, products, &file.equation)?,
            ..Reaction::default()
        };
        let sum = |value: fn(&crate::Species) -> f64| {
            [a, b].iter().map(|&s| value(&names.species[s as usize])).sum()
        };
        let speed = relative_speed([a, b].map(|species| &names.species[species as usize]));
        Ok(Self { file, bare, diffusion: sum(|s| s.diffusion), touch: sum(|s| s.radius.into()), speed })
    }

    fn refuse<T>(&self, message: String) -> Result<T, Problem> {
        Err(Problem::at(self.file.equation.span(), message))
    }
}

impl Network<'_> {
    fn channels(&self, draft: &Draft<'_>) -> impl Iterator<Item = &Draft<'_>> {
        self.index.channels(draft.bare.reactants).iter().map(|&index| &self.drafts[index])
    }

    /// Refuses more: probabilities take quadratic time and memory.
    fn check_count(&self, draft: &Draft<'_>, names: &Names<'_>) -> Result<(), Problem> {
        let count = self.index.channels(draft.bare.reactants).len();
        if count <= MAX_CHANNELS {
            return Ok(());
        }
        let [a, b] =
            draft.bare.reactants.map(|species| excerpt(names.species[species as usize].name.as_bytes()));
        draft.refuse(format!(
            "{a} and {b} have {count} reactions, more than the limit of {MAX_CHANNELS}; merge or remove some"
        ))
    }

    fn total_rate(&self, draft: &Draft<'_>) -> f64 {
        self.channels(draft).filter_map(|other| Some(other.file.rate.as_ref()?.get_ref().0)).sum()
    }

    fn reaction(&self, draft: &Draft<'_>) -> Result<Reaction, Problem> {
        let file::Reaction { rate, rate_inside, binding_radius, probability, .. } = draft.file;
        let name = excerpt(draft.bare.name.as_bytes());
        if let (Some(_), Some(p)) = (rate.as_ref().or(rate_inside.as_ref()), probability) {
            return Err(Problem::at(
                p.span(),
                "a probability goes with binding-radius, not with a rate".to_owned(),
            ));
        }
        let radius = binding_radius.as_ref().map(|radius| radius.get_ref().0);
        let (radius, chance) = match (rate, radius, rate_inside) {
            (Some(rate), None, None) => {
                let fraction = rate.get_ref().0 / self.total_rate(draft);
                (self.radius_for(draft, rate)?, ReactionRate::PerStep(fraction))
            }
            (Some(_), ..) => {
                return draft.refuse(format!(
                    "'{name}' has a rate, from which its binding radius follows; give only the rate, or in its place rate-inside, \
                     in 1/s within binding-radius"
                ));
            }
            _ if self.total_rate(draft) > 0.0 => {
                return draft.refuse(format!(
                    "'{name}' has no rate and another reaction of the same reactants has one; give all of them a rate, \
                     or none"
                ));
            }
            (None, Some(radius), None) => {
                (radius, ReactionRate::PerStep(probability.as_ref().map_or(1.0, |p| p.get_ref().0)))
            }
            (None, radius, Some(rate)) => {
                let radius = radius.unwrap_or(draft.touch);
                if radius == 0.0 {
                    return draft.refuse(format!(
                        "the reactants of '{name}' are points, which never touch; give a binding-radius"
                    ));
                }
                (radius, ReactionRate::PerTime(rate.get_ref().0))
            }
            (None, None, None) => {
                return draft.refuse(format!("'{name}' needs a rate, or a binding-radius, or rate-inside"));
            }
        };
        let span = span_of(rate).or_else(|| span_of(binding_radius));
        let binding_radius = single_radius(radius, span.unwrap_or_else(|| draft.file.equation.span()))?;
        Ok(Reaction { binding_radius, chance, ..draft.bare.clone() })
    }

    fn radius_for(&self, draft: &Draft<'_>, rate: &Spanned<Positive>) -> Result<f64, Problem> {
        if self.dimensions < 3 {
            let message = "a rate in µm³/s needs three dimensions; give a binding-radius, with a probability or rate-inside";
            return Err(Problem::at(rate.span(), message.to_owned()));
        }
        if draft.diffusion == 0.0 {
            let message = "the reactants do not diffuse, and a rate is that of diffusion; give one of them a diffusion coefficient, \
                           or the reaction a binding-radius and rate-inside";
            return Err(Problem::at(rate.span(), message.to_owned()));
        }
        let refused = |error: crate::Error| Problem::at(rate.span(), error.to_string());
        let (total, dt) = (self.total_rate(draft), self.time_step);
        let Some(Reverse { name, apart, rate_factor }) =
            self.channels(draft).find_map(|other| self.reverse(&other.bare))
        else {
            return rate::binding_radius(total, draft.diffusion, dt).map_err(refused);
        };
        if self.channels(draft).count() > 1 {
            let message = format!(
                "'{name}' undoes one of several reactions of the same reactants, whose rates cannot be kept then; give each of \
                 these reactions a binding-radius and rate-inside"
            );
            return Err(Problem::at(rate.span(), message));
        }
        rate::reversible_binding_radius(total * rate_factor, apart, draft.diffusion, dt).map_err(refused)
    }

    fn reverse(&self, reaction: &Reaction) -> Option<Reverse<'_>> {
        let by_decay = self.index.reverse_decay(reaction).map(|index| {
            let decay = &self.decays[index];
            let (Unbinding::Apart(apart) | Unbinding::Within(apart)) = decay.unbinding;
            // With the rate R of all decays, the fraction k(1 − exp(−RΔt))/R dissociates in a step, not kΔt.
            // Association must be lower by the same factor.
            let lost = self.index.decay_rate(decay.reactant) * self.time_step;
            Reverse { name: &decay.name, apart: apart.into(), rate_factor: -libm::expm1(-lost) / lost }
        });
        by_decay.or_else(|| {
            let back = &self.drafts[self.index.reverse_reaction(reaction)?].bare;
            Some(Reverse { name: &back.name, apart: back.unbinding_radius.into(), rate_factor: 1.0 })
        })
    }

    /// Refuses products that would react back in the next step.
    fn check_reverse(&self, draft: &Draft<'_>, resolved: &[Reaction]) -> Result<(), Problem> {
        let meets = |other: &&Reaction| {
            is_reverse(other, &draft.bare) && matches!(other.chance, ReactionRate::PerStep(_))
        };
        let [Some(a), Some(b)] = draft.bare.products else { return Ok(()) };
        let mut back = self.index.channels([a, b]).iter().map(|&index| &resolved[index]);
        match back.find(meets).filter(|_| draft.file.unbinding_radius.is_none()) {
            None => Ok(()),
            Some(back) => Err(Problem::at(draft.file.equation.span(), at_once(&draft.bare.name, &back.name))),
        }
    }

    /// Returns the radius in the file, otherwise the ball of the reverse reaction, otherwise 0.
    fn unbinding(
        &self,
        decay: &Decay,
        from: &file::Decay,
        resolved: &[Reaction],
    ) -> Result<Unbinding, Problem> {
        let ([Some(a), Some(b)], None) = (decay.products, &from.unbinding_radius) else {
            return Ok(decay.unbinding);
        };
        let mut reactions = self.index.channels([a, b]).iter().map(|&index| &resolved[index]);
        let undone = reactions.find(|reaction| undoes(decay, reaction));
        match undone.map(|reaction| (reaction, reaction.chance)) {
            None => Ok(decay.unbinding),
            Some((reaction, ReactionRate::PerTime(_))) => Ok(Unbinding::Within(reaction.binding_radius)),
            Some((reaction, ReactionRate::PerStep(_))) => {
                Err(Problem::at(from.equation.span(), at_once(&decay.name, &reaction.name)))
            }
        }
    }

    fn warnings(&self, draft: &Draft<'_>, reaction: &Reaction) -> Vec<Problem> {
        let total = self.total_rate(draft);
        let radius = reaction.binding_radius.into();
        let rate = (total > 0.0).then_some(total);
        let long = warnings::long_step(&reaction.name, radius, draft.diffusion, rate, self.time_step);
        let fast = match reaction.chance {
            ReactionRate::PerTime(rate) => warnings::fast_reaction(&reaction.name, rate, self.time_step),
            ReactionRate::PerStep(_) => None,
        };
        let swept =
            rate.and_then(|rate| warnings::swept_by_motion(&reaction.name, rate, radius, draft.speed));
        let file::Reaction { rate, rate_inside, equation, .. } = draft.file;
        let undone = rate.as_ref().and_then(|_| self.reverse(&draft.bare));
        let slow = undone.and_then(|back| {
            let numbers = [total, reaction.binding_radius.into(), back.apart];
            warnings::slow_relaxation(&reaction.name, numbers, draft.diffusion, self.time_step)
        });
        let span = rate.as_ref().or(rate_inside.as_ref()).map_or(equation.span(), Spanned::span);
        long.into_iter()
            .chain(fast)
            .chain(slow)
            .chain(swept)
            .map(|message| Problem::at(span.clone(), message))
            .collect()
    }
}

/// Returns the root mean square speed, apart from diffusion.
fn relative_speed(both: [&Species; 2]) -> f64 {
    let [a, b] = both.map(|species| species.drift);
    let by_drift: f64 = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum();
    let squared_speeds = both.map(|species| species.speed.powi(2) + 3.0 * species.thermal_speed.powi(2));
    (by_drift + squared_speeds.iter().sum::<f64>()).sqrt()
}

fn at_once(name: &str, back: &str) -> String {
    format!(
        "'{name}' places its products within the binding radius of '{back}', by which they react back in the next step; give \
         an unbinding-radius"
    )
}

fn is_reverse(a: &Reaction, b: &Reaction) -> bool {
    let leads = |from: &Reaction, to: &Reaction| {
        let [c, d] = to.reactants.map(Some);
        from.products == [c, d] || from.products == [d, c]
    };
    leads(a, b) && leads(b, a)
}

/// Returns the product of each reactant, its own species if possible; `None` for more than two products.
fn assigned_products(reactants: [u32; 2], products: &[u32]) -> Option<[Option<u32>; 2]> {
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

fn decay(decay: &file::Decay, names: &Names<'_>) -> Result<Decay, Problem> {
    let text = excerpt(decay.equation.get_ref().as_bytes());
    let [left, right] = names.equation(&decay.equation)?;
    let (&[reactant], [] | [_] | [_, _]) = (left.as_slice(), right.as_slice()) else {
        let message = format!("'{text}' must have one reactant and at most two products");
        return Err(Problem::at(decay.equation.span(), message));
    };
    let products = [right.first().copied(), right.get(1).copied()];
    let apart = unbinding_radius(&decay.unbinding_radius, products, &decay.equation)?;
    Ok(Decay {
        name: equation_name(&decay.equation),
        reactant,
        products,
        unbinding: Unbinding::Apart(apart),
        rate: decay.rate.get_ref().0,
    })
}

/// Returns 0 if absent. Fails for fewer than two products.
fn unbinding_radius(
    radius: &Option<Spanned<file::NotNegative>>,
    products: [Option<u32>; 2],
    equation: &Spanned<String>,
) -> Result<f32, Problem> {
    match radius {
        None => Ok(0.0),
        Some(radius) if products.contains(&None) => {
            let text = excerpt(equation.get_ref().as_bytes());
            Err(Problem::at(
                radius.span(),
                format!("'{text}' does not have two products to separate; remove this key"),
            ))
        }
        Some(radius) => single_radius(radius.get_ref().0, radius.span()),
    }
}
