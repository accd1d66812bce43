use lazygrid::{Error, InputError, Order, Pair, Report, Sphere};

use super::request::{Answer, Ending, Layout, Output};
use super::{Settings, Step, definition};
use crate::{Tolerance, difference};

pub(super) struct Verifier<'a> {
    settings: &'a Settings,
    step: &'a Step,
    tolerance: Tolerance,
    expected: Expected,
}

enum Expected {
    /// Texts, because NaN differs from itself.
    Refused(Vec<String>),
    /// Pairs, and the bounds of their number within the tolerance.
    Pairs(Vec<Pair>, [u64; 2]),
}

impl<'a> Verifier<'a> {
    pub(super) fn new(settings: &'a Settings, step: &'a Step) -> Self {
        let refusals = refusals(settings, step);
        let tolerance = settings.variant.tolerance();
        let expected = match refusals.is_empty() {
            false => Expected::Refused(refusals),
            true => {
                let mut pairs = definition::pairs(&step.scenario, step.request.layout == Layout::WideRows);
                let split = step.request.split.map(|split| split.min(step.scenario.spheres.len()) as u32);
                pairs.retain(|pair| is_requested(*pair, split));
                let range = counts(step, &pairs, tolerance);
                Expected::Pairs(pairs, range)
            }
        };
        Self { settings, step, tolerance, expected }
    }

    pub(super) fn verdict(&self, answer: &Answer) -> Result<(), String> {
        let (expected, range) = match (&self.expected, answer) {
            (Expected::Refused(errors), Answer::Refused(error)) => {
                return match errors.contains(&format!("{error:?}")) {
                    true => Ok(()),
                    false => Err(format!("refused with {error:?}, expected {}", errors.join(" or "))),
                };
            }
            (Expected::Refused(errors), _) => {
                return Err(format!("accepted, expected {}", errors.join(" or ")));
            }
            (Expected::Pairs(expected, range), _) => (expected, *range),
        };
        match answer {
            Answer::Refused(error) => self.is_refused_rightly(error, range),
            Answer::Count(found) => in_range(*found, range),
            Answer::Part(pairs) => self.verify_part(pairs, expected),
            Answer::Pairs(pairs) if self.is_limited() && pairs.len() as u64 > self.settings.max_pairs => {
                Err(format!("{} pairs above the limit of {}", pairs.len(), self.settings.max_pairs))
            }
            Answer::Pairs(pairs) => {
                difference(&self.step.scenario, pairs, expected, self.tolerance)?;
                self.in_order(pairs)
            }
        }
    }

    fn is_refused_rightly(&self, error: &Error, range: [u64; 2]) -> Result<(), String> {
        let max_pairs = self.settings.max_pairs;
        match *error {
            Error::Cancelled if self.step.request.is_stopped => Ok(()),
            Error::TooManyPairs { found, limit }
                if self.is_limited() && found > limit && limit == max_pairs =>
            {
                in_range(found, range)
            }
            _ => Err(format!("valid input was refused: {error}")),
        }
    }

    /// Requires distinct pairs, and in canonical order a complete beginning.
    fn verify_part(&self, pairs: &[Pair], expected: &[Pair]) -> Result<(), String> {
        self.in_order(pairs)?;
        let mut all: Vec<Pair> = match (self.settings.order, pairs.last()) {
            // Tangent pairs before the last one may be missing.
            (Order::Canonical, Some(last)) => {
                expected.iter().copied().take_while(|pair| pair <= last).collect()
            }
            _ => pairs.to_vec(),
        };
        all.retain(|pair| expected.binary_search(pair).is_ok());
        all.sort_unstable();
        all.dedup();
        difference(&self.step.scenario, pairs, &all, self.tolerance)
    }

    fn in_order(&self, pairs: &[Pair]) -> Result<(), String> {
        let is_free =
            self.settings.order == Order::Unordered || self.step.request.output == Output::Neighbors;
        match is_free || pairs.is_sorted() {
            true => Ok(()),
            false => Err("the pairs are not in canonical order".to_owned()),
        }
    }

    fn is_limited(&self) -> bool {
        matches!(self.step.request.output, Output::List | Output::Neighbors)
    }

    pub(super) fn report(&self, answer: &Answer, report: &Report) -> Result<(), String> {
        let found = match answer {
            Answer::Pairs(pairs) => pairs.len() as u64,
            Answer::Count(found) => *found,
            Answer::Part(_) | Answer::Refused(_) => return Ok(()),
        };
        let spheres = self.step.scenario.spheres.len() as u64;
        match (report.pairs, report.spheres) == (found, spheres) {
            true => Ok(()),
            false => Err(format!(
                "{} pairs of {} spheres reported, {found} of {spheres} found",
                report.pairs, report.spheres
            )),
        }
    }

    pub(super) fn alike(&self, answer: &Answer, fresh: &Answer) -> Result<(), String> {
        use Answer::{Count, Pairs, Part, Refused};
        if let Err(what) = self.verdict(fresh) {
            return Err(format!("a new detector is wrong: {what}"));
        }
        let ends_early =
            matches!(self.step.request.output, Output::Stream { ending, .. } if ending != Ending::All);
        let may_fall_either_way = self.tolerance != Tolerance::Exact;
        let same = match (answer, fresh) {
            _ if self.step.request.is_stopped || ends_early => true,
            (Refused(Error::TooManyPairs { .. }), Refused(Error::TooManyPairs { .. }))
                if may_fall_either_way =>
            {
                true
            }
            (Refused(a), Refused(b)) => format!("{a:?}") == format!("{b:?}"),
            // The verdict already allowed for the tolerance.
            (Pairs(_), Pairs(_)) | (Count(_), Count(_)) if may_fall_either_way => true,
            (Pairs(a), Pairs(b)) if self.settings.order == Order::Unordered => sorted(a) == sorted(b),
            (Pairs(a), Pairs(b)) => a == b,
            (Count(a), Count(b)) => a == b,
            (Part(_), Part(_)) => true,
            (Refused(Error::TooManyPairs { .. }), _) | (_, Refused(Error::TooManyPairs { .. })) => {
                may_fall_either_way
            }
            _ => false,
        };
        match same {
            true => Ok(()),
            false => {
                Err(format!("a new detector gives another answer: {}, not {}", brief(fresh), brief(answer)))
            }
        }
    }
}

fn sorted(pairs: &[Pair]) -> Vec<Pair> {
    let mut pairs = pairs.to_vec();
    pairs.sort_unstable();
    pairs
}

fn brief(answer: &Answer) -> String {
    match answer {
        Answer::Pairs(pairs) => format!("{} pairs", pairs.len()),
        Answer::Count(found) => format!("a count of {found}"),
        Answer::Part(pairs) => format!("{} pairs and no more", pairs.len()),
        Answer::Refused(error) => format!("{error:?}"),
    }
}

fn in_range(found: u64, [least, most]: [u64; 2]) -> Result<(), String> {
    match (least..=most).contains(&found) {
        true => Ok(()),
        false => Err(format!("{found} pairs counted, expected {least} to {most}")),
    }
}

fn is_requested(pair: Pair, split: Option<u32>) -> bool {
    split.is_none_or(|split| pair.i < split && pair.j >= split)
}

fn counts(step: &Step, expected: &[Pair], tolerance: Tolerance) -> [u64; 2] {
    if tolerance == Tolerance::Exact {
        return [expected.len() as u64; 2];
    }
    let n = step.scenario.spheres.len() as u32;
    let split = step.request.split.map(|split| (split as u32).min(n));
    let all = (0..n).flat_map(|i| (i + 1..n).map(move |j| Pair { i, j }));
    let requested = all.filter(|&pair| is_requested(pair, split));
    let (mut least, mut most) = (expected.len() as u64, expected.len() as u64);
    for pair in requested.filter(|&pair| tolerance.allows(&step.scenario, pair)) {
        match expected.binary_search(&pair) {
            Ok(_) => least -= 1,
            Err(_) => most += 1,
        }
    }
    [least, most]
}

fn refusals(settings: &Settings, step: &Step) -> Vec<String> {
    let n = step.scenario.spheres.len();
    let split = step.request.split.map(|split| split.min(n));
    let first = split.unwrap_or(n);
    let mut errors = set_refusals(settings, step, 0..first);
    if split.is_some() {
        let second = set_refusals(settings, step, first..n);
        errors.extend(second.into_iter().map(|error| InputError::SecondSet(Box::new(error))));
    }
    if step.request.has_foreign_exclusions {
        let (made_for, given) = match split {
            None => ((n, Some(3)), (n, None)),
            Some(split) => ((split, None), (split, Some(n - split))),
        };
        errors.push(InputError::ExclusionSizeMismatch { made_for, given });
    }
    errors.into_iter().map(|error| format!("{:?}", Error::Input(error))).collect()
}

fn set_refusals(settings: &Settings, step: &Step, range: std::ops::Range<usize>) -> Vec<InputError> {
    let spheres = &step.scenario.spheres[range.clone()];
    let mut errors = Vec::new();
    match (&settings.rows, &step.scenario.mixture) {
        (Some(_), None) => errors.push(InputError::SpeciesMissing),
        (Some(rows), Some(mixture)) => {
            let (ids, count) = (&mixture.species[range], rows.len() as u32);
            if let Some(k) = ids.iter().position(|&id| id >= count) {
                errors.push(InputError::SpeciesId { index: Some(k as u32), id: ids[k], count });
            }
        }
        (None, _) => {}
    }
    let is_bad = |s: &Sphere| !(s.center.is_finite() && s.radius.is_finite() && s.radius >= 0.0);
    if let Some(k) = spheres.iter().position(is_bad) {
        let count = spheres.iter().filter(|s| is_bad(s)).count() as u64;
        let (index, total) = (k as u32, spheres.len() as u64);
        let Sphere { center, radius } = spheres[k];
        let (center, radius) = (center.to_array().map(f64::from), f64::from(radius));
        errors.push(InputError::Sphere { index, center, radius, count, total });
    }
    errors
}
