use lazygrid::Backend;
use lazygrid_check::detectors::sequence::{Sequence, Tally};
use lazygrid_check::{DetectorVariant, Effort, Gpu};
use lazygrid_tests::variants;

/// Sequences per variant, on the CPU and on the GPU.
const COUNTS: [u64; 2] = [40, 8];

/// The default of `PROPTEST_CASES` is 256.
fn scaled(count: u64) -> u64 {
    let cases = std::env::var("PROPTEST_CASES").ok().and_then(|cases| cases.parse::<u64>().ok());
    cases.map_or(count, |cases| (count * cases / 256).max(2))
}

fn check(variants: &[DetectorVariant], gpu: Option<&Gpu>, count: u64) {
    let mut tally = Tally::default();
    for (k, &variant) in variants.iter().enumerate() {
        for seed in 0..scaled(count) {
            let sequence = Sequence::drawn_for(1000 * k as u64 + seed, variant);
            if let Some(failure) = sequence.check(gpu, 300, &mut tally) {
                panic!("{}: {}", failure.name, failure.what);
            }
        }
    }
    assert!(tally.calls > 0 && tally.refused > 0, "{tally:?}");
}

#[test]
fn cpu_answers_do_not_depend_on_earlier_calls() {
    if variants::all().iter().any(|variant| variant.backend() == Backend::Cpu) {
        check(&DetectorVariant::on_cpu(), None, COUNTS[0]);
    }
}

#[test]
fn gpu_answers_do_not_depend_on_earlier_calls() {
    let has_gpu = variants::all().iter().any(|variant| variant.backend() == Backend::Gpu);
    let Some(device) = lazygrid_tests::device().filter(|_| has_gpu) else { return };
    let gpu = Gpu { device, adapter: None };
    check(&DetectorVariant::on_gpu(&gpu.device, Effort::Quick), Some(&gpu), COUNTS[1]);
}
