//! From values to places on paper.

/// How values are laid out along an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Spacing {
    /// Equal steps, equal distances.
    #[default]
    Linear,
    /// Equal factors, equal distances; values above 0 only.
    Log,
}

/// The least factor from the low to the high end of a logarithmic scale.
const LEAST_FACTOR: f64 = 1.2;

/// The smallest value on a logarithmic scale.
const SMALLEST: f64 = 1e-150;

/// The largest size of a value, so that widths and ratios of ranges are numbers, too.
const LARGEST: f64 = 1e150;

/// A range of values on a stretch of paper.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    spacing: Spacing,
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

impl Scale {
    /// `low` comes to lie at `from`, `high` at `to`. A range that is empty or no range is widened
    /// to one.
    #[must_use]
    pub fn new(spacing: Spacing, low: f64, high: f64, from: f64, to: f64) -> Self {
        let (low, high) = widened(spacing, low, high);
        Self {
            spacing,
            low,
            high,
            from,
            to,
        }
    }

    /// The lowest value.
    #[must_use]
    pub fn low(&self) -> f64 {
        self.low
    }

    /// The highest value.
    #[must_use]
    pub fn high(&self) -> f64 {
        self.high
    }

    /// How values are laid out.
    #[must_use]
    pub fn spacing(&self) -> Spacing {
        self.spacing
    }

    /// The stretch of paper, its length without sign.
    #[must_use]
    pub fn length(&self) -> f64 {
        (self.to - self.from).abs()
    }

    /// Where a value lies; `None` if it has no place: not finite, or not above 0 on a logarithmic
    /// scale. A value outside the range lies outside the stretch, at most so far that the place is
    /// still a sensible number.
    #[must_use]
    pub fn place(&self, value: f64) -> Option<f64> {
        let share = match self.spacing {
            Spacing::Linear => (value - self.low) / (self.high - self.low),
            Spacing::Log if value > 0.0 => (value / self.low).ln() / (self.high / self.low).ln(),
            Spacing::Log => return None,
        };
        (value.is_finite() && share.is_finite())
            .then(|| self.from + share.clamp(-10.0, 11.0) * (self.to - self.from))
    }
}

fn widened(spacing: Spacing, low: f64, high: f64) -> (f64, f64) {
    let usable = |value: f64| value.is_finite().then(|| value.clamp(-LARGEST, LARGEST));
    let (low, high) = match (usable(low), usable(high)) {
        (Some(low), Some(high)) => (low.min(high), low.max(high)),
        (Some(one), None) | (None, Some(one)) => (one, one),
        (None, None) if spacing == Spacing::Log => (1.0, 10.0),
        (None, None) => (0.0, 1.0),
    };
    match spacing {
        Spacing::Linear => {
            // Below this part of their size, neighbouring ticks would have the same label.
            let least = (1e-9 * low.abs().max(high.abs())).max(1e-150);
            if high - low > least {
                (low, high)
            } else {
                (low - least.max(0.5), high + least.max(0.5))
            }
        }
        Spacing::Log => {
            let high = high.max(SMALLEST * LEAST_FACTOR);
            let low = if low > 0.0 {
                low.max(SMALLEST)
            } else {
                1e-3 * high
            };
            if high / low >= LEAST_FACTOR {
                (low, high)
            } else {
                (low / LEAST_FACTOR, high * LEAST_FACTOR)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn ends_come_to_lie_at_the_ends() {
        let scale = Scale::new(Spacing::Linear, -2.0, 6.0, 100.0, 20.0);
        assert_eq!(
            [-2.0, 2.0, 6.0].map(|v| scale.place(v)),
            [Some(100.0), Some(60.0), Some(20.0)]
        );
        let log = Scale::new(Spacing::Log, 0.01, 100.0, 0.0, 40.0);
        for (value, place) in [(0.01, 0.0), (0.1, 10.0), (1.0, 20.0), (100.0, 40.0)] {
            assert!((log.place(value).unwrap() - place).abs() < 1e-9);
        }
        assert_eq!(log.place(0.0), None);
        assert_eq!(scale.place(f64::NAN), None);
    }

    fn any_spacing() -> impl Strategy<Value = Spacing> {
        prop_oneof![Just(Spacing::Linear), Just(Spacing::Log)]
    }

    proptest! {
        #[test]
        fn every_scale_is_a_scale(spacing in any_spacing(), low in any::<f64>(), high in any::<f64>()) {
            let scale = Scale::new(spacing, low, high, 10.0, 90.0);
            prop_assert!(scale.low() < scale.high() && scale.low().is_finite() && scale.high().is_finite());
            prop_assert!((scale.place(scale.low()).unwrap() - 10.0).abs() < 1e-6);
            prop_assert!((scale.place(scale.high()).unwrap() - 90.0).abs() < 1e-6);
        }

        #[test]
        fn what_is_more_lies_further(spacing in any_spacing(), a in 0.001..1e6_f64, b in 0.001..1e6_f64) {
            let scale = Scale::new(spacing, 0.5, 2e5, 0.0, 500.0);
            let places = (scale.place(a.min(b)).unwrap(), scale.place(a.max(b)).unwrap());
            prop_assert!(places.0 <= places.1);
        }

        #[test]
        fn places_are_finite(spacing in any_spacing(), low in any::<f64>(), high in any::<f64>(), value in any::<f64>()) {
            let place = Scale::new(spacing, low, high, 0.0, 700.0).place(value);
            prop_assert!(place.is_none_or(|place| place.is_finite() && place.abs() < 1e4));
        }
    }
}
