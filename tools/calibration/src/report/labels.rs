//! Numbers and names in the form of the report.

use i2ris::units::MotorVec;
use i2ris_report::number::{MINUS, fixed, significant};
use i2ris_report::{Color, Dash, Stroke};

use super::fit::OutputFacts;

/// Minimum part of a motor's motion that is named.
const NEGLIGIBLE: f64 = 0.05;

/// The chosen model.
pub(super) const CHOSEN: Stroke = Stroke::new(Color::BLUE, 1.6);
/// Lines at 0.
pub(super) const ZERO: Stroke = Stroke::new(Color::DARK, 0.6);
/// Levels of noise.
pub(super) const NOISE: Stroke = Stroke::new(Color::DARK, 0.8).dash(Dash::Dotted);

/// An error length, to three digits.
pub(super) fn error(value: f64) -> String {
    significant(value, 3)
}

/// `pitch (deg)`.
pub(super) fn with_unit(output: &OutputFacts) -> String {
    format!("{} ({})", output.name, output.unit)
}

/// Label of an axis of counts along a direction: `q₀`, or `0.83 q₀ − 0.56 q₁`.
pub(super) fn along(direction: &MotorVec, motors: usize) -> String {
    let named = direction.iter().zip(["₀", "₁"]).take(motors);
    let named: Vec<_> = named.filter(|(part, _)| part.abs() >= NEGLIGIBLE).collect();
    match named.as_slice() {
        [(part, index)] if **part > 0.0 => format!("q{index}"),
        [(_, index)] => format!("{MINUS}q{index}"),
        parts => {
            let term = |(i, (part, index)): (usize, &(&f64, &str))| match (i, **part < 0.0) {
                (0, _) => format!("{} q{index}", fixed(**part, 2)),
                (_, true) => format!(" {MINUS} {} q{index}", fixed(part.abs(), 2)),
                (_, false) => format!(" + {} q{index}", fixed(**part, 2)),
            };
            parts.iter().enumerate().map(term).collect()
        }
    }
}

/// A list of names: `a, b and c`.
pub(super) fn list(names: &[String]) -> String {
    match names {
        [] => String::new(),
        [one] => one.clone(),
        [front @ .., last] => format!("{} and {last}", front.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_are_named() {
        assert_eq!(along(&[1.0, 0.01], 2), "q₀");
        assert_eq!(along(&[0.0, -1.0], 2), "\u{2212}q₁");
        assert_eq!(along(&[0.8, -0.6], 2), "0.80 q₀ \u{2212} 0.60 q₁");
        assert_eq!(along(&[-0.6, 0.8], 2), "\u{2212}0.60 q₀ + 0.80 q₁");
        assert_eq!(along(&[1.0, 0.0], 1), "q₀");
    }

    #[test]
    fn names_are_joined() {
        let names = ["a", "b", "c"].map(str::to_owned);
        assert_eq!(
            [list(&names), list(&names[..2]), list(&names[..1]), list(&[])],
            ["a, b and c", "a and b", "a", ""]
        );
    }
}
