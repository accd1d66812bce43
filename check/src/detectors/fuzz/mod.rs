//! Rounds of random scenes, settings and calls, determined by the seed.

use std::ops::ControlFlow;

use lazygrid::Error::TooManyPairs;
use lazygrid::{Config, Detector, Order, Pair};

use crate::detectors::compare::FailedCase;
use crate::detectors::variant::text;
use crate::scenes::motion::skin_of;
use crate::{DetectorVariant, Gpu, TestInput, Tolerance, catch_panic, difference, shrink};

pub(crate) mod draw;

#[derive(Clone, Debug)]
pub struct Round {
    pub seed: u64,
    variant: DetectorVariant,
    order: Order,
    max_pairs: u64,
    calls: Vec<(Call, TestInput)>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Call {
    List,
    Count,
    Neighbors,
    Stream { chunk: usize },
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum Answer {
    Pairs(Vec<Pair>),
    Count(u64),
    TooMany(u64),
}

impl Round {
    /// Uses a new detector. Returns a failure with as few calls and spheres as [`shrink`] finds in `tries` attempts.
    pub fn check(self, gpu: Option<&Gpu>, tries: usize) -> Option<FailedCase> {
        let variant = self.variant;
        self.check_with(tries, |round| catch_panic(|| round.run(gpu))).map(|(round, what)| {
            let is_plain = round.calls.len() == 1 && round.calls[0].1.mixture.is_none();
            let (call, scenario) = round.calls.last().cloned().unzip();
            let own = variant.options(gpu);
            let options = match (is_plain && !own.is_empty(), call) {
                (true, Some(call)) => own + &round.detect_options(call),
                _ => String::new(),
            };
            FailedCase {
                name: round.to_string(),
                what,
                scenario,
                options,
                environment: variant.environment(),
            }
        })
    }

    fn check_with(self, tries: usize, run: impl Fn(&Self) -> Result<(), String>) -> Option<(Self, String)> {
        let mut what = run(&self).err()?;
        let mut round = self;
        // Removes calls, starting with the last, before spheres of calls.
        for k in (0..round.calls.len()).rev().filter(|_| tries > 0) {
            let mut fewer = round.clone();
            fewer.calls.remove(k);
            if let (false, Err(still)) = (fewer.calls.is_empty(), run(&fewer)) {
                (round, what) = (fewer, still);
            }
        }
        for k in (0..round.calls.len()).rev() {
            let mut smaller = round.clone();
            let failing = |scenario: &TestInput| {
                smaller.calls[k].1 = scenario.clone();
                run(&smaller).err()
            };
            let (scenario, still) = shrink(round.calls[k].1.clone(), what, tries, failing);
            round.calls[k].1 = scenario;
            what = still;
        }
        Some((round, what))
    }

    fn run(&self, gpu: Option<&Gpu>) -> Result<(), String> {
        let config = self.variant.config(gpu).order(self.order).max_pairs(self.max_pairs);
        let with_first = |config: Config, (_, first): &(Call, TestInput)| {
            first.config(config.skin(skin_of(&first.spheres, self.variant.skin)))
        };
        let config = self.calls.iter().take(1).try_fold(config, with_first);
        let mut detector = Detector::new(config.map_err(text)?).map_err(text)?;
        self.verify(|call, scenario| answer(&mut detector, call, scenario))
    }

    fn verify(
        &self,
        mut answer: impl FnMut(Call, &TestInput) -> Result<Answer, String>,
    ) -> Result<(), String> {
        self.calls.iter().enumerate().try_for_each(|(k, (call, scenario))| {
            let answer = answer(*call, scenario);
            let verdict = answer.and_then(|answer| self.judge_one(*call, scenario, &answer));
            verdict.map_err(|what| format!("call {} of {}: {what}", k + 1, self.calls.len()))
        })
    }

    fn judge_one(&self, call: Call, scenario: &TestInput, answer: &Answer) -> Result<(), String> {
        let (expected, tolerance) = (scenario.oracle(), self.variant.tolerance());
        let [least, most] = counts(scenario, &expected, tolerance);
        let in_range = |found: u64| match (least..=most).contains(&found) {
            true => Ok(()),
            false => Err(format!("{found} pairs counted, expected {least} to {most}")),
        };
        let is_limited = matches!(call, Call::List | Call::Neighbors);
        match answer {
            Answer::Count(found) => in_range(*found),
            Answer::TooMany(found) if is_limited && *found > self.max_pairs => in_range(*found),
            Answer::TooMany(found) => Err(format!("refused {found} pairs below the limit")),
            Answer::Pairs(pairs) if is_limited && pairs.len() as u64 > self.max_pairs => {
                Err(format!("{} pairs above the limit of {}", pairs.len(), self.max_pairs))
            }
            Answer::Pairs(pairs) => {
                difference(scenario, pairs, &expected, tolerance)?;
                let ordered = self.order == Order::Unordered || call == Call::Neighbors || pairs.is_sorted();
                if ordered { Ok(()) } else { Err("the pairs are not in canonical order".to_owned()) }
            }
        }
    }

    fn detect_options(&self, call: Call) -> String {
        let unordered = if self.order == Order::Unordered { " --unordered" } else { "" };
        let limit = format!(" --max-pairs {}", self.max_pairs);
        match call {
            Call::Count => " --count".to_owned(),
            Call::Neighbors => format!(" --neighbors{limit} -o neighbors.csv"),
            Call::List | Call::Stream { .. } => format!("{unordered}{limit} -o pairs.csv"),
        }
    }
}

impl std::fmt::Display for Round {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let calls: Vec<String> = self
            .calls
            .iter()
            .map(|(call, scenario)| format!("{call:?} of {} spheres", scenario.spheres.len()))
            .collect();
        let Self { seed, variant, order, max_pairs, .. } = self;
        let calls = calls.join(", then ").to_lowercase();
        write!(f, "fuzz seed {seed}: {variant}, {order:?}, at most {max_pairs} pairs: {calls}")
    }
}

/// Smallest and largest number within the tolerance.
pub(crate) fn counts(scenario: &TestInput, expected: &[Pair], tolerance: Tolerance) -> [u64; 2] {
    if tolerance == Tolerance::Exact {
        return [expected.len() as u64; 2];
    }
    let spheres = scenario.spheres.len() as u32;
    let all = (0..spheres).flat_map(|i| (i + 1..spheres).map(move |j| Pair { i, j }));
    let tangent = all.filter(|&pair| tolerance.allows(scenario, pair));
    let (mut least, mut most) = (expected.len() as u64, expected.len() as u64);
    for pair in tangent {
        match expected.binary_search(&pair) {
            Ok(_) => least -= 1,
            Err(_) => most += 1,
        }
    }
    [least, most]
}

fn answer(detector: &mut Detector, call: Call, scenario: &TestInput) -> Result<Answer, String> {
    let refused = |error| match error {
        TooManyPairs { found, .. } => Ok(Answer::TooMany(found)),
        other => Err(other.to_string()),
    };
    let view = scenario.query();
    match call {
        Call::List => detector.pairs(view).map(|pairs| Answer::Pairs(pairs.to_vec())).or_else(refused),
        Call::Count => detector.count(view).map(Answer::Count).or_else(refused),
        Call::Neighbors => match detector.neighbors(view) {
            Ok(lists) => pairs_of(scenario.spheres.len(), |i| lists.neighbors_of(i)).map(Answer::Pairs),
            Err(error) => refused(error),
        },
        Call::Stream { chunk } => {
            let (mut pairs, mut longest) = (Vec::new(), 0);
            let streamed = detector.stream(view, chunk, |part| {
                longest = longest.max(part.len());
                pairs.extend_from_slice(part);
                ControlFlow::Continue(())
            });
            match streamed {
                Ok(handed) if handed != pairs.len() as u64 => {
                    Err(format!("stream returned {handed} pairs but delivered {}", pairs.len()))
                }
                Ok(_) if longest > chunk => Err(format!("{longest} pairs in a chunk of {chunk}")),
                Ok(_) => Ok(Answer::Pairs(pairs)),
                Err(error) => refused(error),
            }
        }
    }
}

/// Each pair must be in the lists of both spheres.
pub(crate) fn pairs_of<'a>(spheres: usize, list: impl Fn(usize) -> &'a [u32]) -> Result<Vec<Pair>, String> {
    let mut pairs = Vec::new();
    for i in 0..spheres {
        if !list(i).windows(2).all(|two| two[0] < two[1]) {
            return Err(format!("the neighbors of {i} do not ascend"));
        }
        for &j in list(i) {
            if j as usize >= spheres || list(j as usize).binary_search(&(i as u32)).is_err() {
                return Err(format!("{j} is in the list of {i}, but {i} is not in the list of {j}"));
            }
            if j > i as u32 {
                pairs.push(Pair { i: i as u32, j });
            }
        }
    }
    Ok(pairs)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounds_are_reproducible_and_pass_on_the_cpu() {
        let (mut kinds, mut triclinic, mut less) = ([0; 4], 0, 0);
        for seed in 0..300 {
            let round = Round::drawn(seed, true, false);
            assert_eq!(round.to_string(), Round::drawn(seed, true, false).to_string());
            let space = round.calls[0].1.space;
            assert!(round.calls.iter().all(|(_, scenario)| scenario.space == space), "{round}");
            for (call, scenario) in &round.calls {
                triclinic += usize::from(space.triclinic_cell().is_some());
                less += usize::from(scenario.groups.is_some() || scenario.excluded.is_some());
                kinds[match call {
                    Call::List => 0,
                    Call::Count => 1,
                    Call::Neighbors => 2,
                    Call::Stream { .. } => 3,
                }] += 1;
            }
            if let Some(FailedCase { name, what, .. }) = round.check(None, 100) {
                panic!("{name}: {what}");
            }
        }
        assert!(kinds.iter().all(|kind| *kind > 50), "{kinds:?}");
        assert!(triclinic > 80 && less > 80, "{triclinic} triclinic, {less} with exclusions");
    }

    /// Answers by the definition, after `spoil` has changed the pairs.
    fn answers(round: &Round, spoil: impl Fn(&mut Vec<Pair>)) -> Result<(), String> {
        round.verify(|call, scenario| {
            let mut pairs = scenario.oracle();
            spoil(&mut pairs);
            Ok(match call {
                Call::Count => Answer::Count(pairs.len() as u64),
                Call::Stream { .. } => Answer::Pairs(pairs),
                _ if pairs.len() as u64 > round.max_pairs => Answer::TooMany(pairs.len() as u64),
                _ => Answer::Pairs(pairs),
            })
        })
    }

    #[test]
    fn broken_detector_is_detected_and_its_round_shrinks() {
        let (mut losing, mut doubling) = (0, 0);
        for seed in 0..60 {
            let round = Round::drawn(seed, true, false);
            assert_eq!(answers(&round, |_| ()), Ok(()), "{round}");
            let has_pairs = round.calls.iter().any(|(_, scenario)| !scenario.oracle().is_empty());
            let lose = |round: &Round| {
                answers(round, |pairs| {
                    let _ = pairs.pop();
                })
            };
            match round.clone().check_with(400, lose) {
                None => assert!(!has_pairs, "{round}"),
                Some((small, what)) => {
                    losing += 1;
                    assert_eq!(
                        (small.calls.len(), small.calls[0].1.spheres.len()),
                        (1, 2),
                        "{small}: {what}"
                    );
                }
            }
            let double = |round: &Round| answers(round, |pairs| pairs.extend(pairs.last().copied()));
            doubling += usize::from(round.check_with(0, double).is_some());
        }
        assert!(losing > 30 && doubling > 30, "{losing} {doubling}");
    }

    #[test]
    fn one_sided_neighbors_are_detected() {
        let lists: [&[u32]; 3] = [&[1, 2], &[0], &[0]];
        assert_eq!(pairs_of(3, |i| lists[i]), Ok(vec![Pair { i: 0, j: 1 }, Pair { i: 0, j: 2 }]));
        let lists: [&[u32]; 3] = [&[1, 2], &[0], &[]];
        assert!(pairs_of(3, |i| lists[i]).is_err());
        let lists: [&[u32]; 3] = [&[2, 1], &[0], &[0]];
        assert!(pairs_of(3, |i| lists[i]).is_err());
    }
}
