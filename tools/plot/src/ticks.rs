//! Where to mark an axis: round numbers, as many as fit.

use crate::number::fixed;
use crate::scale::{Scale, Spacing};

/// The most marks on an axis, whatever the range.
const MOST: usize = 50;

/// A logarithmic axis whose ends differ by less than this factor has few powers of ten in sight.
const NARROW: f64 = 50.0;

/// A mark with its number.
#[derive(Debug, Clone, PartialEq)]
pub struct Tick {
    /// Where.
    pub value: f64,
    /// What is written there; nothing at a small mark between two numbers.
    pub label: Option<String>,
}

/// The marks of a scale, about `count` of them with numbers, in rising order.
#[must_use]
pub fn ticks(scale: &Scale, count: usize) -> Vec<Tick> {
    match scale.spacing() {
        Spacing::Linear => linear(scale.low(), scale.high(), count.clamp(2, MOST / 2)),
        Spacing::Log => logarithmic(scale.low(), scale.high(), count.clamp(2, MOST / 2)),
    }
}

/// Multiples of 1, 2 or 5 times a power of ten.
fn linear(low: f64, high: f64, count: usize) -> Vec<Tick> {
    let rough = (high - low) / count as f64;
    let power = 10f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .find(|m| m * power >= rough * (1.0 - 1e-9))
        .unwrap_or(10.0)
        * power;
    // A range that ends at a round number has a mark there, in spite of rounding.
    let (first, last) = ((low / step - 1e-6).ceil(), (high / step + 1e-6).floor());
    let decimals = (-step.log10().floor()).max(0.0) as usize;
    let many = ((last - first + 1.0) as usize).min(MOST);
    if many < 2 && count < MOST {
        return linear(low, high, count + 1);
    }
    (0..many)
        .map(|i| {
            let value = (first + i as f64) * step;
            Tick {
                value,
                label: Some(label(value, step, decimals)),
            }
        })
        .collect()
}

fn label(value: f64, step: f64, decimals: usize) -> String {
    let size = value.abs().max(step);
    if (1e-4..1e7).contains(&step) && size < 1e7 {
        fixed(value, decimals)
    } else {
        scientific(value, step)
    }
}

/// As `1.5e-7`, with as many digits as neighbours need to differ.
fn scientific(value: f64, step: f64) -> String {
    if value.abs() < step / 2.0 {
        return "0".to_owned();
    }
    let power = |value: f64| (value.abs().log10() + 1e-9).floor();
    let digits = (power(value) - power(step)).clamp(0.0, 15.0) as usize;
    format!("{value:.digits$e}").replace('-', "\u{2212}")
}

/// Powers of ten with numbers, and small marks at their multiples while there is room.
fn logarithmic(low: f64, high: f64, count: usize) -> Vec<Tick> {
    let (first, last) = (
        (low.log10() + 1e-9).floor() as i32,
        (high.log10() - 1e-9).ceil() as i32,
    );
    let stride = ((last - first) as usize / count + 1) as i32;
    let within = |value: f64| value >= low * (1.0 - 1e-9) && value <= high * (1.0 + 1e-9);
    // Then there are numbers at 2 and 5, too.
    let narrow = high / low <= NARROW;
    let mut ticks = Vec::new();
    for power in (first..=last).filter(|power| (power - first) % stride == 0) {
        for multiple in 1..=9 {
            let value = f64::from(multiple) * 10f64.powi(power);
            let named = multiple == 1 || narrow && (multiple == 2 || multiple == 5);
            if within(value) && (named || stride == 1) {
                ticks.push(Tick {
                    value,
                    label: named.then(|| log_label(value, power, narrow)),
                });
            }
        }
    }
    ticks
}

fn log_label(value: f64, power: i32, plain: bool) -> String {
    if plain && (-4..=5).contains(&power) || (-2..=3).contains(&power) {
        return fixed(value, (-power).max(0) as usize);
    }
    let multiple = (value / 10f64.powi(power)).round();
    let factor = if multiple == 1.0 {
        String::new()
    } else {
        format!("{multiple}·")
    };
    format!("{factor}10{}", superscript(power))
}

fn superscript(number: i32) -> String {
    let raised = |c: char| match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        c => c
            .to_digit(10)
            .and_then(|digit| char::from_u32('⁰' as u32 + digit))
            .unwrap_or(c),
    };
    number.to_string().chars().map(raised).collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn labels(spacing: Spacing, low: f64, high: f64, count: usize) -> Vec<String> {
        let ticks = ticks(&Scale::new(spacing, low, high, 0.0, 100.0), count);
        ticks.into_iter().filter_map(|tick| tick.label).collect()
    }

    #[test]
    fn round_numbers_are_marked() {
        assert_eq!(
            labels(Spacing::Linear, -41.0, 38.0, 5),
            ["\u{2212}40", "\u{2212}20", "0", "20"]
        );
        assert_eq!(
            labels(Spacing::Linear, 0.0, 0.3, 3),
            ["0.0", "0.1", "0.2", "0.3"]
        );
        assert_eq!(
            labels(Spacing::Linear, 0.0, 3e-7, 3),
            ["0", "1e\u{2212}7", "2e\u{2212}7", "3e\u{2212}7"]
        );
        assert_eq!(
            labels(Spacing::Log, 0.5, 2000.0, 6),
            ["1", "10", "100", "1000"]
        );
        assert_eq!(labels(Spacing::Log, 0.9, 11.0, 6), ["1", "2", "5", "10"]);
        assert_eq!(
            labels(Spacing::Log, 1e-9, 1e9, 4),
            ["10⁻⁹", "10⁻⁴", "10", "10⁶"]
        );
    }

    proptest! {
        #[test]
        fn marks_are_in_range_rising_and_told_apart(
            middle in -1e5..1e5_f64, size in 1e-3..1e6_f64, count in 2..9_usize
        ) {
            let scale = Scale::new(Spacing::Linear, middle - size, middle + size, 0.0, 300.0);
            let found = ticks(&scale, count);
            prop_assert!((2..=count.max(4) + 1).contains(&found.len()), "{} marks", found.len());
            let slack = 1e-5 * size;
            prop_assert!(found.iter().all(|t| t.value >= scale.low() - slack && t.value <= scale.high() + slack));
            prop_assert!(found.windows(2).all(|pair| pair[0].value < pair[1].value && pair[0].label != pair[1].label));
        }

        #[test]
        fn labels_say_what_the_value_is(middle in -1e4..1e4_f64, size in 1e-2..1e4_f64) {
            let scale = Scale::new(Spacing::Linear, middle - size, middle + size, 0.0, 300.0);
            for tick in ticks(&scale, 6) {
                let said: f64 = tick.label.unwrap().replace('\u{2212}', "-").parse().unwrap();
                prop_assert!((said - tick.value).abs() < 1e-6 * size);
            }
        }

        #[test]
        fn every_scale_has_marks(log in any::<bool>(), low in any::<f64>(), high in any::<f64>()) {
            let spacing = if log { Spacing::Log } else { Spacing::Linear };
            let found = ticks(&Scale::new(spacing, low, high, 0.0, 300.0), 5);
            prop_assert!(found.len() <= 9 * MOST && found.iter().all(|tick| tick.value.is_finite()));
        }
    }
}
