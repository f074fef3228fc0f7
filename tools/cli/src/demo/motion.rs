//! The motions of the demo: a stroke that calibrates, and a motion that the calibration has not seen.

use std::f64::consts::TAU;

/// Triangle wave of period 1 and amplitude 1, starting at 0 and rising.
fn triangle(phase: f64) -> f64 {
    let p = (phase + 0.25).rem_euclid(1.0);
    1.0 - 4.0 * (p - 0.5).abs()
}

/// Encoder positions of the calibration stroke at an instant, counts.
///
/// Two triangle waves whose periods have no common multiple in the stroke visit the whole square of motor positions, and
/// their slowly changing amplitude adds reversals at many depths: one axis at a time would leave the plane between
/// the axes unseen. It starts and ends at rest in the middle.
pub fn calibration_counts(t_s: f64, duration_s: f64, amplitude_counts: f64) -> [i32; 2] {
    let ends = (t_s / 2.0).min((duration_s - t_s) / 2.0).clamp(0.0, 1.0);
    let depth = 0.75 - 0.25 * (TAU * t_s / 17.0).cos();
    let wave = |period_s: f64| (amplitude_counts * ends * depth * triangle(t_s / period_s)).round() as i32;
    [wave(3.7), wave(2.6)]
}

/// Desired pitch and yaw of the unseen motion at an instant, degrees: slow sweeps with faster detail, as a hand would
/// move, within `amplitude_deg` of the straight pose.
pub fn unseen_deg(t_s: f64, amplitude_deg: f64) -> [f64; 2] {
    // Frequencies in Hz, shares, and phases in turns; shares sum to 1, so the amplitude bounds the sum.
    const PITCH: [(f64, f64, f64); 4] = [(0.11, 0.45, 0.13), (0.23, 0.3, 0.71), (0.41, 0.15, 0.37), (0.83, 0.1, 0.59)];
    const YAW: [(f64, f64, f64); 4] = [(0.13, 0.45, 0.83), (0.19, 0.3, 0.29), (0.47, 0.15, 0.61), (0.71, 0.1, 0.17)];
    let sum = |parts: &[(f64, f64, f64); 4]| {
        parts.iter().map(|(hz, share, turns)| share * (TAU * (hz * t_s + turns)).sin()).sum::<f64>()
    };
    [amplitude_deg * sum(&PITCH), amplitude_deg * sum(&YAW)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stroke_starts_and_ends_at_rest_and_stays_inside() {
        assert_eq!(calibration_counts(0.0, 40.0, 1000.0), [0, 0]);
        assert_eq!(calibration_counts(40.0, 40.0, 1000.0), [0, 0]);
        let all: Vec<[i32; 2]> = (0..8000).map(|i| calibration_counts(f64::from(i) * 0.005, 40.0, 1000.0)).collect();
        assert!(all.iter().flatten().all(|c| c.abs() <= 1000));
        assert!(all.windows(2).all(|w| (w[1][0] - w[0][0]).abs() <= 9 && (w[1][1] - w[0][1]).abs() <= 9));
    }

    #[test]
    fn the_stroke_visits_all_four_quadrants_far_out() {
        let far = |a: i32, b: i32| {
            (0..8000).any(|i| {
                let [x, y] = calibration_counts(f64::from(i) * 0.005, 40.0, 1000.0);
                x * a > 600 && y * b > 600
            })
        };
        assert!(far(1, 1) && far(1, -1) && far(-1, 1) && far(-1, -1));
    }

    #[test]
    fn the_unseen_motion_stays_within_its_amplitude() {
        assert!((0..20_000).flat_map(|i| unseen_deg(f64::from(i) * 0.01, 12.0)).all(|a| a.abs() <= 12.0));
    }
}
