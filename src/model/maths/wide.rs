//! Loops over rows of numbers with the instructions of the processor, and the exponential.
//!
//! Of loops over rows of numbers the compiler makes one for each width of the processor's
//! instructions (`wide!`). The operations, their order and their rounding are the same in all of
//! them (nothing is fused), and so are the bits on every machine.

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

/// The exponential of a number up to 0; 0 below `least`. NaN stays. By `libm`, and not by the
/// library of the system: it gives the same bits everywhere.
#[inline(always)]
pub(in crate::model) fn exp_above(x: f64, least: f64) -> f64 {
    if x < least { 0.0 } else { libm::exp(x) }
}
