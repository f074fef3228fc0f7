//! One rolling joint: its wires, its angle and its stop.
//!
//! Two surfaces of radius `R` roll on each other. At the angle `theta`, a wire through holes at the
//! lateral offset `s d` has the length between the surfaces
//!
//! ```text
//! l(s) = 2 [R - b cos(theta / 2) - s d sin(theta / 2)]        b = sqrt(R^2 - d^2)
//! ```
//!
//! A motor winds up one wire of a pair and lets out the other. The first two terms are common to
//! both wires: they are slack or strain and turn nothing. The joint follows half the difference of
//! the lengths: `2 s d sin(theta / 2)`.

/// Radius of the rolling surfaces, mm (the robot's drawing).
pub const ROLLING_RADIUS_MM: f64 = 0.75;

/// Distance of the holes for the wires from both planes of bending, mm (the robot's drawing).
pub(in crate::model) const HOLE_OFFSET_MM: f64 = 0.194;

/// Angle of the stop of a joint, rad (8.75 deg by the robot's drawing).
pub const STOP_RAD: f64 = 8.75 * std::f64::consts::PI / 180.0;

/// Relative slope of a joint beyond its stop: wires and links yield. Without it the model would be
/// flat there, and a search could not leave the flat region.
const YIELD_SLOPE: f64 = 0.01;

/// The angle of a joint, rad, and its derivative with respect to the sine of half the angle.
pub(in crate::model) fn angle(half_sine: f64) -> (f64, f64) {
    let stop = (0.5 * STOP_RAD).sin();
    let free = half_sine.clamp(-stop, stop);
    let slope = 2.0 / (1.0 - free * free).sqrt();
    let beyond = half_sine - free;
    // NaN takes the other branch and gives NaN.
    if beyond == 0.0 {
        (2.0 * free.asin(), slope)
    } else {
        (2.0 * free.asin() + YIELD_SLOPE * slope * beyond, YIELD_SLOPE * slope)
    }
}

/// The sine of half the angle of a joint, from the angle, rad: the inverse of [`angle`].
pub(in crate::model) fn half_sine(angle: f64) -> f64 {
    let free = angle.clamp(-STOP_RAD, STOP_RAD);
    let (sine, cosine) = (0.5 * free).sin_cos();
    sine + (angle - free) * 0.5 * cosine / YIELD_SLOPE
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wire(side: f64, angle: f64) -> f64 {
        let (r, d) = (ROLLING_RADIUS_MM, HOLE_OFFSET_MM);
        2.0 * (r - (r * r - d * d).sqrt() * (0.5 * angle).cos() - side * d * (0.5 * angle).sin())
    }

    #[test]
    fn half_the_length_difference_of_a_wire_pair_gives_the_angle() {
        for degrees in [-8.7_f64, -3.0, 0.0, 0.5, 6.0, 8.7] {
            let theta = degrees.to_radians();
            let travel = 0.5 * (wire(-1.0, theta) - wire(1.0, theta));
            let (found, slope) = angle(travel / (2.0 * HOLE_OFFSET_MM));
            assert!((found - theta).abs() < 1e-12, "{found} is not {theta}");
            assert!((slope - 2.0 / (0.5 * theta).cos()).abs() < 1e-12);
        }
    }

    #[test]
    fn wire_length_equals_the_chord_between_the_holes() {
        // Both surfaces are circles that touch at the origin. Each hole is a quarter turn less
        // acos(d / R) from the contact. At the angle theta each circle has rolled by theta / 2.
        let (r, d, theta) = (ROLLING_RADIUS_MM, HOLE_OFFSET_MM, 0.1_f64);
        let from_contact = (d / r).asin();
        let depth = |roll: f64| r * (1.0 - (from_contact - roll).cos());
        assert!((2.0 * depth(0.5 * theta) - wire(1.0, theta)).abs() < 1e-12);
        assert!((2.0 * depth(-0.5 * theta) - wire(-1.0, theta)).abs() < 1e-12);
    }

    #[test]
    fn a_joint_yields_only_slightly_beyond_its_stop() {
        let stop = (0.5 * STOP_RAD).sin();
        let ((at, free), (beyond, stiff)) = (angle(stop), angle(-2.0 * stop));
        assert!((at - STOP_RAD).abs() < 1e-12 && (stiff / free - YIELD_SLOPE).abs() < 1e-12);
        assert!(beyond < -STOP_RAD && beyond > -1.02 * STOP_RAD);
    }

    #[test]
    fn half_sine_is_the_inverse_of_angle() {
        for at in [-0.3, -0.08, -0.01, 0.0, 0.05, 0.076, 0.2] {
            assert!((half_sine(angle(at).0) - at).abs() < 1e-12, "{at}");
        }
    }
}
