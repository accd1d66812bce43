use lazygrid::Pair;

use super::*;

fn passes(sequence: Sequence, tally: &mut Tally) {
    if let Some(FailedCase { name, what, .. }) = sequence.check(None, 300, tally) {
        panic!("{name}: {what}");
    }
}

#[test]
fn sequences_on_the_cpu_are_right() {
    let mut tally = Tally::default();
    for seed in 0..400 {
        let sequence = Sequence::drawn(seed, true, false);
        assert_eq!(sequence.to_string(), Sequence::drawn(seed, true, false).to_string());
        passes(sequence, &mut tally);
    }
    let Tally { sequences, calls, served, refused } = tally;
    let enough = sequences == 400 && calls > 2000 && served > 100 && refused > 100;
    assert!(enough, "{tally:?}");
}

#[test]
fn rounds_are_reproducible_and_pass_on_the_cpu() {
    let (mut kinds, mut triclinic, mut less) = ([0; 4], 0, 0);
    for seed in 0..300 {
        let round = Sequence::round(seed, true, false);
        assert_eq!(round.to_string(), Sequence::round(seed, true, false).to_string());
        let space = round.settings.space;
        for Step { scenario, request, .. } in &round.steps {
            assert_eq!(scenario.space, space, "{round}");
            triclinic += usize::from(space.triclinic_cell().is_some());
            less += usize::from(scenario.groups.is_some() || scenario.excluded.is_some());
            kinds[match request.output {
                Output::List => 0,
                Output::Count => 1,
                Output::Neighbors => 2,
                Output::Stream { .. } => 3,
            }] += 1;
        }
        passes(round, &mut Tally::default());
    }
    assert!(kinds.iter().all(|kind| *kind > 50), "{kinds:?}");
    assert!(triclinic > 80 && less > 80, "{triclinic} triclinic, {less} with exclusions");
}

fn answers(sequence: &Sequence, spoil: impl Fn(&mut Vec<Pair>)) -> Result<(), Wrong> {
    sequence.steps.iter().enumerate().try_for_each(|(k, step)| {
        let mut pairs = step.scenario.oracle();
        spoil(&mut pairs);
        let (found, limit) = (pairs.len() as u64, sequence.settings.max_pairs);
        let answer = match step.request.output {
            Output::Count => Answer::Count(found),
            Output::Stream { .. } => Answer::Pairs(pairs),
            _ if found > limit => Answer::Refused(lazygrid::Error::TooManyPairs { found, limit }),
            _ => Answer::Pairs(pairs),
        };
        Verifier::new(&sequence.settings, step).verdict(&answer).map_err(|what| (k, what))
    })
}

#[test]
fn broken_detector_is_detected_and_its_round_shrinks() {
    let (mut losing, mut doubling) = (0, 0);
    for seed in 0..60 {
        let round = Sequence::round(seed, true, false);
        assert_eq!(answers(&round, |_| ()), Ok(()), "{round}");
        let has_pairs = round.steps.iter().any(|step| !step.scenario.oracle().is_empty());
        let lose = |round: &Sequence| answers(round, |pairs| pairs.truncate(pairs.len().saturating_sub(1)));
        let lost = lose(&round);
        assert_eq!(lost.is_err(), has_pairs, "{round}");
        let double = |round: &Sequence| answers(round, |pairs| pairs.extend(pairs.last().copied()));
        doubling += usize::from(double(&round).is_err());
        if let Err(wrong) = lost {
            losing += 1;
            let (small, (_, what)) = reduce::reduce(round, wrong, 2000, lose);
            let spheres = small.steps[0].scenario.spheres.len();
            assert_eq!((small.steps.len(), spheres), (1, 2), "{small}: {what}");
        }
    }
    assert!(losing > 30 && doubling > 30, "{losing} {doubling}");
}
