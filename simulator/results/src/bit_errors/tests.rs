use super::*;
use crate::log::LoggedArrival;
use crate::symbols::messages;
use crate::symbols::tests::{log, model, slots};
use lazygrid_sim::model::message::Symbols;

fn bit_errors(model: &Model, delay: u32) -> BitErrors {
    let (_, message) = messages(model).next().unwrap();
    BitErrors::new(model, message, [0, 0], SymbolDetector::Arrivals, delay)
}

fn sends(symbols: Vec<u32>, modulation: Modulation, release: Vec<(u32, u32)>) -> (Model, SymbolSlots) {
    let mut model = model();
    let Schedule::Message(message) = &mut model.transmitters[0].schedule else { panic!("no message") };
    (message.symbols, message.modulation) = (Symbols::Given(symbols), modulation);
    model.transmitters[0].release = release;
    let slots = SymbolSlots::new(messages(&model).next().unwrap().1, model.time_step, 0, 1000);
    (model, slots)
}

pub(crate) fn arrivals(counts: &[&[usize]]) -> Log {
    let mut arrivals = Vec::new();
    for (slot, counts) in counts.iter().enumerate() {
        for (species, &count) in counts.iter().enumerate() {
            let one = LoggedArrival { step: 6 + 10 * slot as u32, receiver: 0, species, origin: None };
            arrivals.extend(std::iter::repeat_n(one, count));
        }
    }
    Log { arrivals, ..Log::default() }
}

pub(crate) fn files(log: Log) -> ReplicaFiles {
    ReplicaFiles { seed: 1, log, series: Series::default() }
}

#[test]
fn momentary_counts_are_detected_by_peak_energy_and_strength() {
    let mut model = model();
    model.receivers[0].kind = lazygrid_sim::ReceiverKind::Transparent;
    let counts = [9, 2, 5, 6, 4, 3, 7, 1, 0];
    let series = Series {
        names: lazygrid_sim::series::names(&model),
        steps: (0..9).map(|k| 5 + 5 * k).collect(),
        times: Vec::new(),
        counts: counts.iter().flat_map(|&count| [0, count, 0, 0]).collect(),
    };
    let files = ReplicaFiles { seed: 1, log: Log::default(), series };
    let (_, message) = messages(&model).next().unwrap();
    for (detector, seen) in [
        (SymbolDetector::Peak, [9, 6, 4, 7]),
        (SymbolDetector::Energy, [85, 61, 25, 50]),
        (SymbolDetector::Strength, [11, 11, 7, 8]),
    ] {
        let mut errors = BitErrors::new(&model, message, [0, 0], detector, 0);
        errors.add(&files, &model, &slots(100));
        assert_eq!(errors.slots[0].iter().map(|slot| slot.seen).collect::<Vec<_>>(), seen, "{detector:?}");
        assert_eq!((errors.best(), errors.at(&errors.best()).1), (vec![0], 1), "{detector:?}");
        let mut thresholds: Vec<u64> = seen.iter().map(|seen| seen + 1).chain([0]).collect();
        thresholds.sort_unstable();
        thresholds.dedup();
        let expected = thresholds.into_iter().map(|threshold| (threshold, errors.at(&[threshold]).1));
        assert_eq!(errors.by_threshold(), expected.collect::<Vec<_>>());
    }
    assert_eq!(
        wilson(1, 4),
        BitErrors { bits: 4, ..BitErrors::new(&model, message, [0, 0], SymbolDetector::Peak, 0) }.interval(1)
    );
}

#[test]
fn slots_without_a_row_are_no_bits() {
    let mut model = model();
    model.receivers[0].kind = lazygrid_sim::ReceiverKind::Transparent;
    // Rows in the first and the third slot of 1 0 1 1.
    let series = Series {
        names: lazygrid_sim::series::names(&model),
        steps: vec![10, 30],
        times: Vec::new(),
        counts: [9, 8].into_iter().flat_map(|count| [0, count, 0, 0]).collect(),
    };
    let files = ReplicaFiles { seed: 1, log: Log::default(), series };
    let (_, message) = messages(&model).next().unwrap();
    for detector in SymbolDetector::MOMENTARY {
        let mut errors = BitErrors::new(&model, message, [0, 0], detector, 0);
        errors.add(&files, &model, &slots(100));
        assert_eq!((errors.bits, errors.ones, errors.at(&[1]).1), (2, 2, 0), "{detector:?}");
    }
}

#[test]
fn bit_errors_of_a_known_sequence() {
    let sent = log(&[(0, 0, 6), (0, 1, 3), (2, 2, 4), (3, 3, 2)]);
    let mut errors = bit_errors(&model(), 0);
    errors.add(&files(sent), &model(), &slots(100));
    let counts: Vec<u64> = (0..=7).map(|threshold| errors.at(&[threshold]).1).collect();
    assert_eq!(counts, [1, 1, 1, 2, 1, 2, 2, 3]);
    assert_eq!((errors.bits, errors.ones, errors.max_seen(), errors.best()), (4, 3, 6, vec![0]));
    errors.add(&files(log(&[(0, 0, 6), (2, 2, 4), (3, 3, 5)])), &model(), &slots(100));
    let (rates, all) = errors.at(&[4]);
    assert_eq!((rates.mean(), rates.standard_error(), all), (0.125, Some(0.125), 1));
    assert_eq!(errors.best(), [1]);
}

#[test]
fn a_delay_moves_the_slots_of_bits() {
    let model = model();
    let (_, message) = messages(&model).next().unwrap();
    let late = SymbolSlots::new(message, model.time_step, 10, 100);
    assert_eq!(late.bounds, [15, 25, 35, 45, 55]);
    let mut errors = bit_errors(&model, 10);
    errors.add(&files(log(&[(0, 1, 6), (2, 3, 4)])), &model, &late);
    assert_eq!(
        (errors.at(&[1]).1, errors.at(&[5]).1, errors.at(&[0]).1, errors.lowest_rate()),
        (1, 2, 1, 0.25)
    );
}

#[test]
fn concentrations_are_detected_by_thresholds() {
    let levels = Modulation::Concentration(vec![0.0, 0.75, 0.25, 1.0]);
    let (model, slots) = sends(vec![0, 2, 1, 3, 2, 1], levels, vec![(0, 100)]);
    let mut errors = bit_errors(&model, 0);
    errors.add(&files(arrivals(&[&[1], &[4], &[9], &[12], &[6], &[7]])), &model, &slots);
    assert_eq!((errors.bits, errors.ones, errors.thresholds()), (12, 6, 3));
    assert_eq!((errors.best(), errors.at(&[2, 7, 10]).1), (vec![2, 7, 10], 0));
    assert_eq!((errors.at(&[7, 7, 10]).1, errors.at(&[2, 7, 8]).1), (2, 1));
    // One wrong bit per 1.
    assert_eq!(errors.at(&[99, 99, 99]).1, 6);
    assert_eq!(errors.at(&[99, 99, 99]).0.mean(), 0.5);
}

#[test]
fn the_best_thresholds_leave_the_fewest_errors() {
    let sent: Vec<u32> = (0..40_u32).map(|k| k.wrapping_mul(0x9E37_79B9) >> 30).collect();
    let levels = Modulation::Concentration(vec![0.0, 0.25, 0.5, 1.0]);
    let (model, slots) = sends(sent.clone(), levels, vec![(0, 100)]);
    let noise = |k: usize| (k as u32).wrapping_mul(0x85EB_CA6B) as usize >> 29;
    let counts: Vec<[usize; 1]> = (0..40).map(|k| [2 * sent[k] as usize + noise(k)]).collect();
    let mut errors = bit_errors(&model, 0);
    errors.add(&files(arrivals(&counts.iter().map(|c| &c[..]).collect::<Vec<_>>())), &model, &slots);
    let last = errors.max_seen() + 1;
    let all = (0..=last).flat_map(|a| (a..=last).flat_map(move |b| (b..=last).map(move |c| [a, b, c])));
    let best = all.min_by_key(|thresholds| errors.at(thresholds).1).unwrap();
    assert!(errors.at(&best).1 > 0, "nothing to decide");
    assert_eq!(errors.best(), best);
}

#[test]
fn molecules_are_detected_by_the_species_with_the_most_arrivals() {
    let release = vec![(1, 10), (0, 10), (2, 10), (3, 10)];
    let (model, slots) = sends(vec![0, 1, 2, 3, 3], Modulation::Molecule, release);
    let mut errors = bit_errors(&model, 0);
    let counts: [&[usize]; 5] = [&[1, 3], &[5, 4, 0, 4], &[0, 4, 3], &[0, 0, 0, 2], &[7, 0, 0, 7]];
    errors.add(&files(arrivals(&counts)), &model, &slots);
    assert_eq!((errors.bits, errors.thresholds(), errors.best()), (10, 0, vec![]));
    assert_eq!((errors.at(&[]).1, errors.lowest_rate()), (2, 0.2));
}
