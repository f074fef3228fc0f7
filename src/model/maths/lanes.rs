//! Numbers side by side: arithmetic that the compiler turns into instructions on all of them.
//!
//! Of loops over rows of numbers the compiler makes one for each width of the processor's
//! instructions (`wide!`). The operations, their order and their rounding are the same in all of
//! them (nothing is fused), and so are the bits on every machine.

use std::ops::{Add, Mul, Sub};

/// Defines functions that the compiler also makes for AVX2 and AVX-512; the processor decides at
/// run time. What they call must be `#[inline(always)]`.
macro_rules! wide {
    ($(#[$attribute:meta])* $visibility:vis fn $name:ident($($argument:ident: $type:ty),* $(,)?)
     $body:block) => {
        $(#[$attribute])*
        $visibility fn $name($($argument: $type),*) {
            #[inline(always)]
            fn usual($($argument: $type),*) $body

            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx512f")]
                fn avx512($($argument: $type),*) {
                    usual($($argument),*);
                }

                #[target_feature(enable = "avx2")]
                fn avx2($($argument: $type),*) {
                    usual($($argument),*);
                }

                if std::arch::is_x86_feature_detected!("avx512f") {
                    // SAFETY: this processor has the instructions.
                    return unsafe { avx512($($argument),*) };
                }
                if std::arch::is_x86_feature_detected!("avx2") {
                    // SAFETY: this processor has the instructions.
                    return unsafe { avx2($($argument),*) };
                }
            }
            usual($($argument),*);
        }
    };
}

pub(in crate::model) use wide;

/// Lanes of the instructions that every 64-bit processor of x86 and ARM has.
pub(in crate::model) const LANES: usize = 2;

/// One number per lane.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(16))]
pub(in crate::model) struct Lanes(pub [f64; LANES]);

/// log2 e.
const LOG2_E: f64 = std::f64::consts::LOG2_E;
/// ln 2 in two parts: a whole number of the first has no rounding error (W. J. Cody and W. Waite,
/// "Software Manual for the Elementary Functions", 1980).
const LN_2_HIGH: f64 = 6.931_471_803_691_238e-1;
const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;
/// Added to a number of moderate size, it leaves the nearest whole number in the last bits.
const TO_WHOLE: f64 = 6_755_399_441_055_744.0;
/// Bits of the mantissa.
const MANTISSA_BITS: u32 = 52;
/// The exponent of 1.
const ONE_EXPONENT: u64 = 1023;

/// 1 / n! from n = 13 down to 2: for |x| <= ln 2 / 2 the rest of the series is below half a unit in
/// the last place of 1.
const FACTORIALS: [f64; 12] = [
    1.0 / 6_227_020_800.0,
    1.0 / 479_001_600.0,
    1.0 / 39_916_800.0,
    1.0 / 3_628_800.0,
    1.0 / 362_880.0,
    1.0 / 40_320.0,
    1.0 / 5_040.0,
    1.0 / 720.0,
    1.0 / 120.0,
    1.0 / 24.0,
    1.0 / 6.0,
    0.5,
];

impl Lanes {
    pub const ZERO: Self = Self([0.0; LANES]);

    #[inline(always)]
    pub const fn splat(value: f64) -> Self {
        Self([value; LANES])
    }

    /// One value per entry, and 0 where there is none.
    pub fn of<T>(entries: &[T], value: impl Fn(&T) -> f64) -> Self {
        let mut lanes = Self::ZERO;
        for (lane, entry) in lanes.0.iter_mut().zip(entries) {
            *lane = value(entry);
        }
        lanes
    }

    #[inline(always)]
    pub fn sum(self) -> f64 {
        self.0[0] + self.0[1]
    }

    /// The larger value, lane by lane; of a NaN and a number, `self`.
    #[inline(always)]
    pub fn max(self, other: Self) -> Self {
        let larger = |lane: usize| {
            if other.0[lane] > self.0[lane] { other.0[lane] } else { self.0[lane] }
        };
        Self([larger(0), larger(1)])
    }

    #[inline(always)]
    pub fn highest(self) -> f64 {
        if self.0[1] > self.0[0] { self.0[1] } else { self.0[0] }
    }

    /// The first lane with a value.
    #[inline(always)]
    pub fn position(self, value: f64) -> Option<usize> {
        match self.0 {
            [first, _] if first == value => Some(0),
            [_, second] if second == value => Some(1),
            _ => None,
        }
    }

    /// See [`exp_above`].
    #[inline(always)]
    pub fn exp_above(self, least: f64) -> Self {
        let [power, shifted] = power_and_exponent(self, Self::splat);
        let lane = |lane: usize| scaled(self.0[lane], power.0[lane], shifted.0[lane], least);
        Self([lane(0), lane(1)])
    }
}

/// The exponential of a number up to 0; 0 below `least`, which must be above -700. NaN stays.
///
/// It is computed here and not by the library of the system: without a call and a branch it works
/// on several numbers at once, and it gives the same bits everywhere.
#[inline(always)]
pub(in crate::model) fn exp_above(x: f64, least: f64) -> f64 {
    let [power, shifted] = power_and_exponent(x, |value| value);
    scaled(x, power, shifted, least)
}

/// `e^x` is the first times 2 to the whole number in the last bits of the second.
#[inline(always)]
fn power_and_exponent<N>(x: N, splat: impl Fn(f64) -> N) -> [N; 2]
where
    N: Copy + Add<Output = N> + Sub<Output = N> + Mul<Output = N>,
{
    let shifted = x * splat(LOG2_E) + splat(TO_WHOLE);
    let whole = shifted - splat(TO_WHOLE);
    let rest = x - whole * splat(LN_2_HIGH) - whole * splat(LN_2_LOW);
    let [first, others @ ..] = FACTORIALS;
    let mut series = splat(first);
    for factor in others {
        series = series * rest + splat(factor);
    }
    [series * (rest * rest) + rest + splat(1.0), shifted]
}

#[inline(always)]
fn scaled(x: f64, power: f64, shifted: f64, least: f64) -> f64 {
    let exponent = shifted.to_bits().wrapping_add(ONE_EXPONENT) << MANTISSA_BITS;
    if x < least { 0.0 } else { power * f64::from_bits(exponent) }
}

impl Add for Lanes {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self([self.0[0] + other.0[0], self.0[1] + other.0[1]])
    }
}

impl Sub for Lanes {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self([self.0[0] - other.0[0], self.0[1] - other.0[1]])
    }
}

impl Mul for Lanes {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self([self.0[0] * other.0[0], self.0[1] * other.0[1]])
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn the_exponential_is_right_to_the_last_digits(
            a in -40.0..=0.0_f64,
            b in -700.0..=0.0_f64,
        ) {
            let found = Lanes([a, b]).exp_above(-700.0);
            for (found, x) in found.0.into_iter().zip([a, b]) {
                let expected = x.exp();
                prop_assert!((found - expected).abs() <= 4.5e-16 * expected, "{found} {expected}");
            }
        }
    }

    #[test]
    fn the_exponential_is_exact_at_0_drops_what_is_negligible_and_keeps_nan() {
        assert_eq!(Lanes([0.0, -40.5]).exp_above(-40.0).0, [1.0, 0.0]);
        assert_eq!(Lanes([f64::NEG_INFINITY, -0.0]).exp_above(-40.0).0, [0.0, 1.0]);
        assert!(Lanes([f64::NAN, -f64::NAN]).exp_above(-40.0).0.iter().all(|x| x.is_nan()));
    }

    #[test]
    fn a_nan_is_never_the_highest() {
        let start = Lanes::splat(f64::NEG_INFINITY);
        let found = start.max(Lanes([f64::NAN, -3.0])).max(Lanes([-5.0, -4.0]));
        assert_eq!((found.0, found.highest()), ([-5.0, -3.0], -3.0));
        assert_eq!(found.position(-3.0), Some(1));
        assert_eq!(Lanes([f64::NAN, 0.0]).position(f64::NAN), None);
    }
}
