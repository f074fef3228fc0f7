//! Where an axis has numbers: round values, as many as fit.

use crate::number::{MINUS, fixed};
use crate::scale::{Scale, Spacing};

/// The most ticks of an axis.
const MOST: usize = 50;

/// Below this ratio of its ends a logarithmic axis contains few powers of ten: 2 and 5 have
/// numbers, too.
const NARROW: f64 = 50.0;

/// A tick of an axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Tick {
    pub value: f64,
    /// The number; `None` for a minor tick.
    pub label: Option<String>,
}

/// The ticks of a scale, about `count` of them with numbers, in rising order.
pub fn ticks(scale: &Scale, count: usize) -> Vec<Tick> {
    let count = count.clamp(2, MOST / 2);
    match scale.spacing {
        Spacing::Linear => linear(scale.low, scale.high, count),
        Spacing::Log => logarithmic(scale.low, scale.high, count),
    }
}

/// Multiples of 1, 2 or 5 times a power of ten.
fn linear(low: f64, high: f64, count: usize) -> Vec<Tick> {
    let rough = (high - low) / count as f64;
    let power = 10f64.powf(rough.log10().floor());
    let is_enough = |factor: &f64| factor * power >= rough * (1.0 - 1e-9);
    let step = power * [1.0, 2.0, 5.0].into_iter().find(is_enough).unwrap_or(10.0);
    // A range that ends at a round number has a tick there, in spite of rounding.
    let (first, last) = ((low / step - 1e-6).ceil(), (high / step + 1e-6).floor());
    let found = ((last - first + 1.0) as usize).min(MOST);
    if found < 2 && count < MOST {
        return linear(low, high, count + 1);
    }
    let tick = |index| {
        let value = (first + index as f64) * step;
        let label = Some(linear_label(value, step));
        Tick { value, label }
    };
    (0..found).map(tick).collect()
}

fn linear_label(value: f64, step: f64) -> String {
    if (1e-4..1e7).contains(&step) && value.abs().max(step) < 1e7 {
        return fixed(value, (-step.log10().floor()).max(0.0) as usize);
    }
    if value.abs() < step / 2.0 {
        return "0".to_owned();
    }
    // As `1.5e-7`, with as many digits as neighbours need to differ.
    let power = |value: f64| (value.abs().log10() + 1e-9).floor();
    let digits = (power(value) - power(step)).clamp(0.0, 15.0) as usize;
    format!("{value:.digits$e}").replace('-', &MINUS.to_string())
}

/// Powers of ten with numbers, and minor ticks at their multiples if there is room.
fn logarithmic(low: f64, high: f64, count: usize) -> Vec<Tick> {
    let first = (low.log10() + 1e-9).floor() as i32;
    let last = (high.log10() - 1e-9).ceil() as i32;
    let stride = ((last - first) as usize / count + 1) as i32;
    let is_inside = |value: f64| value >= low * (1.0 - 1e-9) && value <= high * (1.0 + 1e-9);
    let is_narrow = high / low <= NARROW;
    let mut ticks = Vec::new();
    for power in (first..=last).step_by(stride as usize) {
        for multiple in 1..=9 {
            let value = f64::from(multiple) * 10f64.powi(power);
            let has_label = multiple == 1 || is_narrow && (multiple == 2 || multiple == 5);
            if is_inside(value) && (has_label || stride == 1) {
                let label = has_label.then(|| log_label(value, power, is_narrow));
                ticks.push(Tick { value, label });
            }
        }
    }
    ticks
}

fn log_label(value: f64, power: i32, is_narrow: bool) -> String {
    if is_narrow && (-4..=5).contains(&power) || (-2..=3).contains(&power) {
        return fixed(value, (-power).max(0) as usize);
    }
    let exponent = superscript(power);
    match (value / 10f64.powi(power)).round() {
        1.0 => format!("10{exponent}"),
        multiple => format!("{multiple}·10{exponent}"),
    }
}

fn superscript(number: i32) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let raised = |c: char| c.to_digit(10).map_or('⁻', |digit| DIGITS[digit as usize]);
    number.to_string().chars().map(raised).collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn round_values_have_ticks() {
        use Spacing::{Linear, Log};
        let cases: [(Spacing, f64, f64, usize, &[&str]); 6] = [
            (Linear, -41.0, 38.0, 5, &["\u{2212}40", "\u{2212}20", "0", "20"]),
            (Linear, 0.0, 0.3, 3, &["0.0", "0.1", "0.2", "0.3"]),
            (Linear, 0.0, 3e-7, 3, &["0", "1e\u{2212}7", "2e\u{2212}7", "3e\u{2212}7"]),
            (Log, 0.5, 2000.0, 6, &["1", "10", "100", "1000"]),
            (Log, 0.9, 11.0, 6, &["1", "2", "5", "10"]),
            (Log, 1e-9, 1e9, 4, &["10⁻⁹", "10⁻⁴", "10", "10⁶"]),
        ];
        for (spacing, low, high, count, expected) in cases {
            let found = ticks(&Scale::new(spacing, (low, high), 0.0, 100.0), count);
            let labels: Vec<String> = found.into_iter().filter_map(|tick| tick.label).collect();
            assert_eq!(labels, expected);
        }
    }

    proptest! {
        #[test]
        fn ticks_are_inside_the_range_rising_and_different(
            middle in -1e5..1e5_f64, size in 1e-3..1e6_f64, count in 2..9_usize
        ) {
            let scale = Scale::new(Spacing::Linear, (middle - size, middle + size), 0.0, 300.0);
            let found = ticks(&scale, count);
            prop_assert!((2..=count.max(4) + 1).contains(&found.len()), "{} ticks", found.len());
            let range = scale.low - 1e-5 * size..=scale.high + 1e-5 * size;
            prop_assert!(found.iter().all(|tick| range.contains(&tick.value)));
            for pair in found.windows(2) {
                prop_assert!(pair[0].value < pair[1].value && pair[0].label != pair[1].label);
            }
        }

        #[test]
        fn the_label_is_the_value(middle in -1e4..1e4_f64, size in 1e-2..1e4_f64) {
            let scale = Scale::new(Spacing::Linear, (middle - size, middle + size), 0.0, 300.0);
            for tick in ticks(&scale, 6) {
                let label: f64 = tick.label.unwrap().replace(MINUS, "-").parse().unwrap();
                prop_assert!((label - tick.value).abs() < 1e-6 * size);
            }
        }

        #[test]
        fn every_scale_has_finite_ticks(is_log: bool, low in any::<f64>(), high in any::<f64>()) {
            let spacing = if is_log { Spacing::Log } else { Spacing::Linear };
            let found = ticks(&Scale::new(spacing, (low, high), 0.0, 300.0), 5);
            prop_assert!(found.len() <= 9 * MOST);
            prop_assert!(found.iter().all(|tick| tick.value.is_finite()));
        }
    }
}
