//! The targets of a task: the same for the same seed.

use std::f64::consts::TAU;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use crate::command::trajectory::Angles;

/// Where targets lie.
#[derive(Debug, Clone, Copy)]
pub struct Disc {
    /// Its middle, deg.
    pub center: Angles,
    /// Its radius, deg.
    pub range_deg: f64,
}

/// Targets of a disc, evenly distributed over its area, each at least half of its radius from the
/// one before.
pub fn seeded_targets(number: usize, seed: u64, disc: Disc) -> Vec<Angles> {
    let mut random = Pcg64::seed_from_u64(seed);
    let mut last = disc.center;
    let next = |_| {
        loop {
            let (sin, cos) = random.random_range(0.0..TAU).sin_cos();
            let radius = disc.range_deg * random.random_range(0.0_f64..1.0).sqrt();
            let target = [disc.center[0] + radius * cos, disc.center[1] + radius * sin];
            // More than half of the disc is that far away from any point of it.
            if (target[0] - last[0]).hypot(target[1] - last[1]) >= 0.5 * disc.range_deg {
                last = target;
                return target;
            }
        }
    };
    (0..number).map(next).collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn targets_are_in_the_disc_apart_and_the_same_for_the_same_seed(
            seed in any::<u64>(), range_deg in 0.5..20.0_f64, pitch in -5.0..5.0_f64,
        ) {
            let disc = Disc { center: [pitch, 1.0], range_deg };
            let targets = seeded_targets(20, seed, disc);
            prop_assert_eq!(&targets, &seeded_targets(20, seed, disc));
            let distance = |a: Angles, b: Angles| (a[0] - b[0]).hypot(a[1] - b[1]);
            let is_inside = targets.iter().all(|at| distance(*at, disc.center) < range_deg + 1e-9);
            let mut steps = targets.windows(2).map(|pair| distance(pair[0], pair[1]));
            prop_assert!(is_inside && steps.all(|step| step >= 0.5 * range_deg));
        }
    }
}
