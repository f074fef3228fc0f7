//! Which bend brings the tip to a place, and which rates move it with a velocity.

use super::{JOINTS_PER_AXIS, STOP_RAD, TipPosition, tip_position};

/// The stops of the joints hold the whole bend within this, rad.
const MAX_BEND_RAD: f64 = JOINTS_PER_AXIS as f64 * STOP_RAD;

/// Damping of the steps towards a place, m^2: little against the squares of the snake's lengths.
const DAMPING_M2: f64 = 1e-11;

/// A place that can be reached needs a tenth of these steps, one far from all others the most.
const STEPS: usize = 40;

/// A step below this is the last one, rad: a thousandth of an atom's diameter at the tip.
const DONE_RAD: f64 = 1e-10;

/// Pitch and yaw, rad, that bring the tip nearest to a place (m, base frame), and the remaining
/// distance, m; NaN for a place that is not finite. The search begins at a bend, by damped
/// Gauss-Newton steps (K. Levenberg, 1944).
#[must_use]
pub fn bend_to(place: [f64; 3], from: [f64; 2]) -> ([f64; 2], f64) {
    let mut bend = from;
    for _ in 0..STEPS {
        let tip = tip_position(bend[0], bend[1]);
        let step = rates(&tip, left(place, &tip));
        let next = [0, 1].map(|at: usize| (bend[at] + step[at]).clamp(-MAX_BEND_RAD, MAX_BEND_RAD));
        let moved = (next[0] - bend[0]).abs().max((next[1] - bend[1]).abs());
        bend = next;
        if moved.is_nan() || moved < DONE_RAD {
            break;
        }
    }
    let [x, y, z] = left(place, &tip_position(bend[0], bend[1]));
    (bend, (x * x + y * y + z * z).sqrt())
}

/// The rates of pitch and yaw, rad/s, at a bend, with which the tip moves nearest to a velocity,
/// m/s.
pub(crate) fn bend_rates(velocity_m_s: [f64; 3], at: [f64; 2]) -> [f64; 2] {
    rates(&tip_position(at[0], at[1]), velocity_m_s)
}

fn left(place: [f64; 3], tip: &TipPosition) -> [f64; 3] {
    [0, 1, 2].map(|at: usize| place[at] - tip.position_m[at])
}

/// The damped least-squares solution of `slope rates = wanted`.
fn rates(tip: &TipPosition, wanted: [f64; 3]) -> [f64; 2] {
    let [pitch, yaw] = &tip.slope_m_per_rad;
    let dot = |a: &[f64; 3], b: &[f64; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let (a, b, d) = (dot(pitch, pitch) + DAMPING_M2, dot(pitch, yaw), dot(yaw, yaw) + DAMPING_M2);
    let (right_pitch, right_yaw) = (dot(pitch, &wanted), dot(yaw, &wanted));
    // At least the square of the damping.
    let determinant = a * d - b * b;
    [
        (d * right_pitch - b * right_yaw) / determinant,
        (a * right_yaw - b * right_pitch) / determinant,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    const BENDS: [[f64; 2]; 6] =
        [[0.0, 0.0], [0.6, 0.0], [0.0, -0.5], [-0.4, 0.7], [0.8, 0.8], [-0.7, -0.2]];

    #[test]
    fn bend_search_finds_the_nearest_bend_from_any_start() {
        for bend in BENDS {
            let place = tip_position(bend[0], bend[1]).position_m;
            for from in BENDS {
                let (found, away_m) = bend_to(place, from);
                assert!(away_m < 1e-9, "{away_m}");
                let apart = [0, 1].map(|at: usize| (found[at] - bend[at]).abs());
                assert!(apart[0] < 1e-6 && apart[1] < 1e-6, "{found:?} {bend:?}");
            }
        }
        let [x, y, z] = tip_position(0.0, 0.0).position_m;
        let (bend, away_m) = bend_to([x, y, z + 1e-3], [0.3, 0.2]);
        assert!((away_m - 1e-3).abs() < 1e-6, "straight is nearest: {away_m}");
        assert!(bend.iter().all(|angle| angle.abs() < 1e-3), "{bend:?}");
        let (_, away_m) = bend_to([1.0, f64::NAN, 0.0], [0.0; 2]);
        assert!(away_m.is_nan(), "nowhere");
    }

    #[test]
    fn tip_moves_as_requested_except_along_itself() {
        for bend in BENDS {
            let [pitch, yaw] = tip_position(bend[0], bend[1]).slope_m_per_rad;
            let along = [0, 1, 2].map(|at: usize| 0.3 * pitch[at] - 0.2 * yaw[at]);
            let [first, second] = bend_rates(along, bend);
            assert!((first - 0.3).abs() < 1e-4 && (second + 0.2).abs() < 1e-4, "{first} {second}");
        }
        let [first, second] = bend_rates([0.0, 0.0, 1e-3], [0.0; 2]);
        assert!(first.abs() < 1e-9 && second.abs() < 1e-9, "{first} {second}");
    }
}
