//! One rolling joint: the wires over it, its angle, its stop.
//!
//! Two surfaces of radius `R` roll on each other. At the angle `theta` a wire through holes at the
//! lateral offset `s d` is as long between them as
//!
//! ```text
//! l(s) = 2 [R - b cos(theta / 2) - s d sin(theta / 2)]        b = sqrt(R^2 - d^2)
//! ```
//!
//! A motor winds one wire of a pair up as it lets the other one out. What both have in common, the
//! first two terms, is slack or strain and turns nothing; half the difference is what the joint
//! follows: `2 s d sin(theta / 2)`.

/// Radius of the rolling surfaces, mm (the robot's drawing).
pub(in crate::model) const ROLLING_RADIUS_MM: f64 = 0.75;

/// Distance of the holes for the wires from both planes of bending, mm (the robot's drawing).
pub(in crate::model) const HOLE_OFFSET_MM: f64 = 0.194;

/// Where a joint meets its stop, rad (8.75 deg by the robot's drawing).
pub(in crate::model) const STOP_RAD: f64 = 8.75 * std::f64::consts::PI / 180.0;

/// How much a joint still turns beyond its stop, relative to before: wires and links give way.
/// Without it the model would be flat there, and a search would not find back.
const GIVE: f64 = 0.01;

/// The angle of a joint, rad, and its derivative, from the sine of its half.
pub(in crate::model) fn angle(half_sine: f64) -> (f64, f64) {
    let stop = (0.5 * STOP_RAD).sin();
    let free = half_sine.clamp(-stop, stop);
    let slope = 2.0 / (1.0 - free * free).sqrt();
    let beyond = half_sine - free;
    // Also when it is not a number.
    if beyond == 0.0 {
        (2.0 * free.asin(), slope)
    } else {
        (2.0 * free.asin() + GIVE * slope * beyond, GIVE * slope)
    }
}

/// The sine of half the angle of a joint, from the angle, rad: the inverse of [`angle`].
pub(in crate::model) fn half_sine(angle: f64) -> f64 {
    let free = angle.clamp(-STOP_RAD, STOP_RAD);
    let (sine, cosine) = (0.5 * free).sin_cos();
    sine + (angle - free) * 0.5 * cosine / GIVE
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wire(side: f64, angle: f64) -> f64 {
        let (r, d) = (ROLLING_RADIUS_MM, HOLE_OFFSET_MM);
        2.0 * (r - (r * r - d * d).sqrt() * (0.5 * angle).cos() - side * d * (0.5 * angle).sin())
    }

    #[test]
    fn half_the_difference_of_a_pair_gives_the_angle() {
        for degrees in [-8.7_f64, -3.0, 0.0, 0.5, 6.0, 8.7] {
            let theta = degrees.to_radians();
            let travel = 0.5 * (wire(-1.0, theta) - wire(1.0, theta));
            let (found, slope) = angle(travel / (2.0 * HOLE_OFFSET_MM));
            assert!((found - theta).abs() < 1e-12, "{found} is not {theta}");
            assert!((slope - 2.0 / (0.5 * theta).cos()).abs() < 1e-12);
        }
    }

    #[test]
    fn a_wire_is_as_long_as_the_chord_between_its_holes() {
        // Both surfaces as circles that touch at the origin, the hole of each a quarter turn less
        // acos(d / R) from the contact: at the angle theta the lower circle has rolled by theta /
        // 2, and so has the upper one.
        let (r, d, theta) = (ROLLING_RADIUS_MM, HOLE_OFFSET_MM, 0.1_f64);
        let from_contact = (d / r).asin();
        let depth = |roll: f64| r * (1.0 - (from_contact - roll).cos());
        assert!((2.0 * depth(0.5 * theta) - wire(1.0, theta)).abs() < 1e-12);
        assert!((2.0 * depth(-0.5 * theta) - wire(-1.0, theta)).abs() < 1e-12);
    }

    #[test]
    fn beyond_its_stop_a_joint_hardly_turns() {
        let stop = (0.5 * STOP_RAD).sin();
        let ((at, free), (beyond, stiff)) = (angle(stop), angle(-2.0 * stop));
        assert!((at - STOP_RAD).abs() < 1e-12 && (stiff / free - GIVE).abs() < 1e-12);
        assert!(beyond < -STOP_RAD && beyond > -1.02 * STOP_RAD);
    }

    #[test]
    fn the_half_sine_of_an_angle_leads_back() {
        for at in [-0.3, -0.08, -0.01, 0.0, 0.05, 0.076, 0.2] {
            assert!((half_sine(angle(at).0) - at).abs() < 1e-12, "{at}");
        }
    }
}
