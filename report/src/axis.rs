use std::ops::Range;

use crate::number::{count, time};

/// Maximum number of labels of an axis.
const MAX_LABELS: usize = 8;
/// Labeled values of a decade, from few to many labels.
const DECADES: [&[f64]; 4] = [&[1.0], &[1.0, 3.0], &[1.0, 2.0, 5.0], &[1.0, 2.0, 3.0, 5.0, 7.0]];
/// Distances of labels on narrow and on linear axes, times powers of ten.
const STEPS: [f64; 3] = [1.0, 2.0, 5.0];
/// Ratio of the largest to the smallest value below which decades give too few labels.
const NARROW_RATIO: f64 = 6.0;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    Logarithmic,
    Linear,
}

impl Scale {
    pub(crate) fn position(self, value: f64) -> f64 {
        match self {
            Self::Logarithmic => value.ln(),
            Self::Linear => value,
        }
    }

    pub(crate) fn holds(self, value: f64) -> bool {
        value.is_finite() && (self == Self::Linear || value > 0.0)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Spheres: `100 k`.
    Count,
    /// Seconds: `1 ms`.
    Time,
    /// Other numbers: `0.75`.
    Number,
}

impl Quantity {
    pub(crate) fn label(self, value: f64) -> String {
        match self {
            Self::Count if value.fract() == 0.0 && (1.0..1e15).contains(&value) => count(value as usize),
            Self::Time => match time(value).split_once(' ') {
                Some((number, unit)) => format!("{} {unit}", without_zeros(number)),
                None => time(value),
            },
            _ => number(value),
        }
    }
}

/// Uses three digits, or all of an integer below 10,000, and an exponent outside 0.001 to a million.
fn number(value: f64) -> String {
    let size = value.abs();
    if value.fract() == 0.0 && size < 1e4 {
        return value.to_string();
    }
    let scientific = format!("{value:.2e}");
    let (digits, exponent) = scientific.split_once('e').unwrap_or((&scientific, "0"));
    if (1e-3..1e6).contains(&size) {
        scientific.parse::<f64>().map_or_else(|_| scientific.clone(), |rounded| rounded.to_string())
    } else {
        format!("{}e{exponent}", without_zeros(digits))
    }
}

fn without_zeros(number: &str) -> &str {
    if number.contains('.') { number.trim_end_matches('0').trim_end_matches('.') } else { number }
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct LabelSpace {
    pub(crate) axis: f64,
    pub(crate) gap: f64,
    pub(crate) character: f64,
    pub(crate) scale: Scale,
}

impl LabelSpace {
    fn holds(&self, ticks: &[f64], range: &Range<f64>, quantity: Quantity) -> bool {
        let [low, high] = [range.start, range.end].map(|value| self.scale.position(value));
        let position = |value: f64| (self.scale.position(value) - low) / (high - low) * self.axis;
        let width = |value: f64| quantity.label(value).chars().count() as f64 * self.character;
        ticks.windows(2).all(|pair| {
            let [a, b] = [pair[0], pair[1]];
            position(b) - position(a) >= self.gap + 0.5 * (width(a) + width(b))
        })
    }
}

pub(crate) fn ticks(range: &Range<f64>, quantity: Quantity, space: LabelSpace) -> Vec<f64> {
    if space.scale == Scale::Linear {
        return even(range, quantity, space);
    }
    let decades = DECADES.iter().map(|values| decade_values(range, values));
    let fits = |ticks: &Vec<f64>| ticks.len() <= MAX_LABELS && space.holds(ticks, range, quantity);
    let candidates = decades.chain(sparse(range)).chain(steps(range)).filter(fits);
    candidates.reduce(|best, next| if next.len() > best.len() { next } else { best }).unwrap_or_default()
}

/// Returns the `measured` values if all their labels fit, else [`ticks`].
pub(crate) fn ticks_at(
    measured: &[f64],
    range: &Range<f64>,
    quantity: Quantity,
    space: LabelSpace,
) -> Vec<f64> {
    let mut values = measured.to_vec();
    values.sort_by(f64::total_cmp);
    values.dedup();
    if space.holds(&values, range, quantity) { values } else { ticks(range, quantity, space) }
}

fn decade_values(range: &Range<f64>, values: &[f64]) -> Vec<f64> {
    let exponents = range.start.log10().floor() as i32..=range.end.log10().ceil() as i32;
    let all = exponents.flat_map(|exponent| values.iter().map(move |value| scaled(*value, exponent)));
    all.filter(|value| range.contains(value)).collect()
}

fn sparse(range: &Range<f64>) -> impl Iterator<Item = Vec<f64>> {
    let powers = decade_values(range, &[1.0]);
    (2..powers.len().max(2)).map(move |step| powers.iter().copied().step_by(step).collect())
}

fn steps(range: &Range<f64>) -> impl Iterator<Item = Vec<f64>> {
    let exponent = range.end.log10().floor() as i32;
    let is_narrow = range.end / range.start < NARROW_RATIO;
    let sizes = (exponent - 3..=exponent).rev().flat_map(|k| STEPS.map(|step| scaled(step, k)));
    sizes.filter(move |_| is_narrow).filter_map(move |step| {
        let (first, last) = ((range.start / step).ceil() as u64, (range.end / step).floor() as u64);
        let value = |k: u64| rounded(k as f64 * step);
        (last.saturating_sub(first) <= MAX_LABELS as u64).then(|| (first.max(1)..=last).map(value).collect())
    })
}

fn even(range: &Range<f64>, quantity: Quantity, space: LabelSpace) -> Vec<f64> {
    let exponent = (range.end - range.start).log10().floor() as i32;
    let sizes = (exponent - 2..=exponent).flat_map(|k| STEPS.map(|step| scaled(step, k)));
    let multiples = |step: f64| {
        let (first, last) = ((range.start / step).ceil() as i64, (range.end / step).floor() as i64);
        // Adding 0 removes the sign of −0.
        let value = |k: i64| rounded(k as f64 * step) + 0.0;
        (first..=last).take(MAX_LABELS + 1).map(value).collect::<Vec<f64>>()
    };
    let fits = |ticks: &Vec<f64>| ticks.len() <= MAX_LABELS && space.holds(ticks, range, quantity);
    sizes.map(multiples).find(fits).unwrap_or_default()
}

/// Rounds to ten digits, because a multiple of 0.1 is not exact.
fn rounded(value: f64) -> f64 {
    format!("{value:.9e}").parse().unwrap_or(value)
}

/// Returns the number nearest to `value` · 10^`exponent`, which a product may miss.
fn scaled(value: f64, exponent: i32) -> f64 {
    format!("{value}e{exponent}").parse().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ACROSS: LabelSpace =
        LabelSpace { axis: 640.0, gap: 18.0, character: 10.0, scale: Scale::Logarithmic };
    const UP: LabelSpace = LabelSpace { axis: 460.0, gap: 32.0, character: 0.0, scale: Scale::Logarithmic };

    fn labels(range: Range<f64>, quantity: Quantity, space: LabelSpace) -> Vec<String> {
        ticks(&range, quantity, space).into_iter().map(|value| quantity.label(value)).collect()
    }

    #[test]
    fn times_have_units() {
        let label = |seconds| Quantity::Time.label(seconds);
        assert_eq!([1e-3, 2.5e-5, 4e-8, 1.0, 30.0].map(label), ["1 ms", "25 µs", "40 ns", "1 s", "30 s"]);
        assert_eq!(label(1.05e-4), "105 µs");
    }

    #[test]
    fn no_label_has_more_than_a_few_figures() {
        let label = |value| Quantity::Number.label(value);
        assert_eq!(label(0.1 + 0.2), "0.3");
        assert_eq!(label(1.0 / 3.0), "0.333");
        assert_eq!(label(123_456_789_012_345_678_901.0), "1.23e20");
        assert_eq!(label(1e-7), "1e-7");
        assert_eq!([1024.0, 0.75, 12_345.6].map(label), ["1024", "0.75", "12300"]);
        assert_eq!([100.0, 3000.0, 1e6].map(|n| Quantity::Count.label(n)), ["100", "3 k", "1 M"]);
    }

    #[test]
    fn decades_have_round_labels() {
        assert_eq!(
            labels(5e-6..3.0, Quantity::Time, UP),
            ["10 µs", "100 µs", "1 ms", "10 ms", "100 ms", "1 s"]
        );
        assert_eq!(labels(0.8..150.0, Quantity::Number, UP), ["1", "2", "5", "10", "20", "50", "100"]);
        let many = labels(1e-12..1e12, Quantity::Number, ACROSS);
        assert!((3..=MAX_LABELS).contains(&many.len()), "{many:?}");
    }

    #[test]
    fn a_narrow_range_has_labels_too() {
        assert_eq!(labels(2.3e-3..4.1e-3, Quantity::Time, UP), ["2.5 ms", "3 ms", "3.5 ms", "4 ms"]);
        for [low, high] in [[0.95, 1.7], [76.0, 131.0], [0.38, 10.4]] {
            let labels = labels(low..high, Quantity::Number, UP);
            assert!(labels.len() >= 3, "{low} to {high}: {labels:?}");
        }
    }

    #[test]
    fn labels_keep_apart_and_say_different_things() {
        assert!(!ACROSS.holds(&[900.0, 1000.0], &(100.0..20_000.0), Quantity::Number));
        for space in [ACROSS, UP] {
            for quantity in [Quantity::Count, Quantity::Time, Quantity::Number] {
                for k in -80..60 {
                    for span in [1.69, 3.0, 9.0, 12.0, 90.0, 1e3, 1e5, 1e9] {
                        let low = 1.37_f64.powi(k);
                        let range = low..low * span;
                        let ticks = ticks(&range, quantity, space);
                        assert!(ticks.len() >= 2 && space.holds(&ticks, &range, quantity), "{range:?}");
                        for &tick in ticks.iter().filter(|_| quantity == Quantity::Number) {
                            let labeled: f64 = quantity.label(tick).parse().unwrap();
                            assert!((labeled / tick - 1.0).abs() < 1e-9, "{labeled} at {tick}");
                        }
                        let mut labels: Vec<String> = ticks.iter().map(|&t| quantity.label(t)).collect();
                        labels.dedup();
                        assert_eq!(labels.len(), ticks.len(), "{labels:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn measured_values_are_labeled_if_they_fit() {
        let ratios = [0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0];
        assert_eq!(ticks_at(&ratios, &(0.38..10.4), Quantity::Number, ACROSS), ratios);
        let near: Vec<f64> = (0..40).map(|k| 1.0 + 0.1 * f64::from(k)).collect();
        assert_ne!(ticks_at(&near, &(0.77..6.4), Quantity::Number, ACROSS), near);
        assert_eq!(ticks_at(&[2.0, 1.0, 2.0], &(0.77..2.6), Quantity::Number, ACROSS), [1.0, 2.0]);
    }

    #[test]
    fn a_linear_axis_has_even_labels_and_zero() {
        let linear = |space: LabelSpace| LabelSpace { scale: Scale::Linear, ..space };
        let labels = |range| labels(range, Quantity::Number, linear(ACROSS));
        assert_eq!(labels(0.0..2.05), ["0", "0.5", "1", "1.5", "2"]);
        assert_eq!(labels(-1.2..1.2), ["-1", "-0.5", "0", "0.5", "1"]);
        assert_eq!(labels(0.0..5300.0), ["0", "1000", "2000", "3000", "4000", "5000"]);
        for space in [ACROSS, UP].map(linear) {
            for k in -60..60 {
                for fraction in [0.0, 0.3, 0.9] {
                    let high = 1.37_f64.powi(k);
                    let range = fraction * high..high;
                    let ticks = ticks(&range, Quantity::Number, space);
                    assert!(
                        ticks.len() >= 2 && space.holds(&ticks, &range, Quantity::Number),
                        "{range:?}: {ticks:?}"
                    );
                    assert!(ticks.iter().all(|tick| *tick >= range.start && *tick <= range.end), "{range:?}");
                }
            }
        }
    }
}
