//! From values to coordinates.

/// How values are laid out along an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Spacing {
    /// Equal differences, equal distances.
    Linear,
    /// Equal ratios, equal distances; values above 0 only.
    Log,
}

/// The least ratio of the ends of a logarithmic scale.
const LEAST_RATIO: f64 = 1.2;

/// The smallest value on a logarithmic scale.
const SMALLEST: f64 = 1e-150;

/// The largest size of a value. Differences and ratios of ends stay finite.
const LARGEST: f64 = 1e150;

/// The map from a range of values to a range of coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    pub spacing: Spacing,
    /// The ends of the range of values; `low` is less than `high`.
    pub low: f64,
    pub high: f64,
    from: f64,
    to: f64,
}

impl Scale {
    /// Maps `low` to `from` and `high` to `to`. An empty or invalid range is widened.
    pub fn new(spacing: Spacing, (low, high): (f64, f64), from: f64, to: f64) -> Self {
        let (low, high) = valid_range(spacing, low, high);
        Self { spacing, low, high, from, to }
    }

    /// The length of the range of coordinates.
    pub fn length(&self) -> f64 {
        (self.to - self.from).abs()
    }

    /// The coordinate of a value; `None` if it is not finite, or not above 0 on a logarithmic
    /// scale. A value outside the range has a coordinate outside, at a limited distance.
    pub fn position(&self, value: f64) -> Option<f64> {
        let share = match self.spacing {
            Spacing::Linear => (value - self.low) / (self.high - self.low),
            Spacing::Log if value > 0.0 => (value / self.low).ln() / (self.high / self.low).ln(),
            Spacing::Log => return None,
        };
        (value.is_finite() && share.is_finite())
            .then(|| self.from + share.clamp(-10.0, 11.0) * (self.to - self.from))
    }
}

fn valid_range(spacing: Spacing, low: f64, high: f64) -> (f64, f64) {
    let usable = |value: f64| value.is_finite().then(|| value.clamp(-LARGEST, LARGEST));
    let (low, high) = match (usable(low), usable(high)) {
        (Some(low), Some(high)) => (low.min(high), low.max(high)),
        (Some(one), None) | (None, Some(one)) => (one, one),
        (None, None) if spacing == Spacing::Log => (1.0, 10.0),
        (None, None) => (0.0, 1.0),
    };
    if spacing == Spacing::Linear {
        // Below this part of their size, neighbouring ticks would have the same label.
        let least = (1e-9 * low.abs().max(high.abs())).max(1e-150);
        let margin = if high - low > least { 0.0 } else { least.max(0.5) };
        return (low - margin, high + margin);
    }
    let high = high.max(SMALLEST * LEAST_RATIO);
    let low = if low > 0.0 { low.max(SMALLEST) } else { 1e-3 * high };
    let margin = if high / low >= LEAST_RATIO { 1.0 } else { LEAST_RATIO };
    (low / margin, high * margin)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_ends_of_the_range_are_at_the_ends() {
        let scale = Scale::new(Spacing::Linear, (-2.0, 6.0), 100.0, 20.0);
        for (value, expected) in [(-2.0, 100.0), (2.0, 60.0), (6.0, 20.0)] {
            assert_eq!(scale.position(value), Some(expected));
        }
        let log = Scale::new(Spacing::Log, (0.01, 100.0), 0.0, 40.0);
        for (value, expected) in [(0.01, 0.0), (0.1, 10.0), (1.0, 20.0), (100.0, 40.0)] {
            assert!((log.position(value).unwrap() - expected).abs() < 1e-9);
        }
        assert_eq!([log.position(0.0), scale.position(f64::NAN)], [None; 2]);
    }

    fn any_spacing() -> impl Strategy<Value = Spacing> {
        prop_oneof![Just(Spacing::Linear), Just(Spacing::Log)]
    }

    proptest! {
        #[test]
        fn every_range_gives_a_valid_scale(
            spacing in any_spacing(),
            low in any::<f64>(),
            high in any::<f64>(),
            value in any::<f64>(),
        ) {
            let scale = Scale::new(spacing, (low, high), 10.0, 90.0);
            prop_assert!(scale.low < scale.high && scale.low.is_finite() && scale.high.is_finite());
            prop_assert!((scale.position(scale.low).unwrap() - 10.0).abs() < 1e-6);
            prop_assert!((scale.position(scale.high).unwrap() - 90.0).abs() < 1e-6);
            let position = scale.position(value);
            prop_assert!(position.is_none_or(|x| x.is_finite() && x.abs() < 1e3));
        }

        #[test]
        fn a_scale_keeps_the_order(
            spacing in any_spacing(), a in 0.001..1e6_f64, b in 0.001..1e6_f64
        ) {
            let scale = Scale::new(spacing, (0.5, 2e5), 0.0, 500.0);
            prop_assert!(scale.position(a.min(b)).unwrap() <= scale.position(a.max(b)).unwrap());
        }
    }
}
