//! Which view shows which axis, from motions of one axis at a time.
//!
//! While only pitch moves, the tangents of both views go `(cos phi_0, cos phi_1)` times that of
//! pitch; while only yaw moves, `(sin phi_0, sin phi_1)` times that of yaw (see
//! [`crate::joint_angles`]).
//! The directions of lines through the origin give the ratios, not the sizes: how far the snake was
//! bent is unknown. With the known angle between both cameras, each motion gives `phi_0`:
//!
//! ```text
//! phi_1 = phi_0 + delta
//! pitch motion along (a_0, a_1):  phi_0 = atan2(a_0 cos delta - a_1, a_0 sin delta)
//! yaw motion along (b_0, b_1):    phi_0 = atan2(b_0 sin delta, b_1 - b_0 cos delta)
//! ```
//!
//! both up to half a turn, which the sign of the motion decides. Their difference is the check.

use std::f64::consts::PI;

const MIN_COUNT: usize = 10;
/// A motion has to bend by this at least, tangent (5 deg).
const MIN_MOTION: f64 = 0.0875;
/// Part of a motion that may leave its line: the other axis moved, too, beyond this.
const MAX_ASIDE: f64 = 0.12;
/// Both motions must agree on the turn within this, rad (8 deg).
const MAX_DISAGREEMENT: f64 = 0.14;

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Alignment {
    /// Direction that each view calls positive, from pitch towards yaw, rad.
    pub planes_rad: [f64; 2],
    /// How far both motions disagree on it, rad.
    pub apart_rad: f64,
}

/// Why motions are unsuitable.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AlignError {
    #[error(
        "{motion} motion: only {found} frames can be measured, {MIN_COUNT} are needed; \
         look at them with `i2ris vision --overlays`"
    )]
    TooFew { motion: &'static str, found: usize },
    #[error(
        "{motion} motion: bends by {deg:.1} deg only; move by 5 deg or more, best to the limits"
    )]
    TooSmall { motion: &'static str, deg: f64 },
    #[error(
        "{motion} motion: both axes moved ({aside:.0} % off a straight line); \
         move {motion} alone, or the order is wrong"
    )]
    TwoAxes { motion: &'static str, aside: f64 },
    #[error(
        "the motions of pitch and yaw disagree by {deg:.1} deg on how the cameras are turned: \
         are the cameras really {between:.0} deg apart, was only one axis moved at a time?"
    )]
    Disagree { deg: f64, between: f64 },
}

/// Finds how both views are turned. `pitch` and `yaw` hold the tangents of both views while only
/// that axis moved, from rest first towards positive. `between_rad`: angle between the cameras,
/// either way round.
pub fn two_views(
    pitch: &[[f64; 2]],
    yaw: &[[f64; 2]],
    between_rad: f64,
) -> Result<Alignment, AlignError> {
    let (a, b) = (line("pitch", pitch)?, line("yaw", yaw)?);
    let candidate = |delta: f64| {
        let (sin, cos) = delta.sin_cos();
        // Of the two ends of the line the one whose sign the motion has.
        let by_pitch = signed((a[0] * cos - a[1]).atan2(a[0] * sin), |phi| {
            a[0] * phi.cos() + a[1] * (phi + delta).cos()
        });
        let by_yaw = signed((b[0] * sin).atan2(b[1] - b[0] * cos), |phi| {
            b[0] * phi.sin() + b[1] * (phi + delta).sin()
        });
        let apart = wrap(by_yaw - by_pitch);
        let phi = by_pitch + 0.5 * apart;
        Alignment { planes_rad: [wrap(phi), wrap(phi + delta)], apart_rad: apart.abs() }
    };
    let (left, right) = (candidate(between_rad), candidate(-between_rad));
    let best = if left.apart_rad <= right.apart_rad { left } else { right };
    if best.apart_rad > MAX_DISAGREEMENT {
        return Err(AlignError::Disagree {
            deg: best.apart_rad.to_degrees(),
            between: between_rad.to_degrees(),
        });
    }
    Ok(best)
}

/// Whether the positive direction of a motion bends clockwise in the one view there is.
pub fn is_reversed(motion: &'static str, tangents: &[f64]) -> Result<bool, AlignError> {
    let both: Vec<[f64; 2]> = tangents.iter().map(|t| [*t, 0.0]).collect();
    line(motion, &both).map(|[along, _]| along < 0.0)
}

/// The unit vector along which a motion goes from the origin, towards where it went first.
fn line(motion: &'static str, points: &[[f64; 2]]) -> Result<[f64; 2], AlignError> {
    if points.len() < MIN_COUNT {
        return Err(AlignError::TooFew { motion, found: points.len() });
    }
    let most = points.iter().map(|[u, v]| u.hypot(*v)).fold(0.0, f64::max);
    if most < MIN_MOTION {
        return Err(AlignError::TooSmall { motion, deg: most.atan().to_degrees() });
    }
    let moment = |i: usize, j: usize| points.iter().map(|p| p[i] * p[j]).sum::<f64>();
    let (uu, uv, vv) = (moment(0, 0), moment(0, 1), moment(1, 1));
    let angle = 0.5 * (2.0 * uv).atan2(uu - vv);
    let (sin, cos) = angle.sin_cos();
    let along = uu * cos * cos + 2.0 * uv * sin * cos + vv * sin * sin;
    let aside = ((uu + vv - along).max(0.0) / along).sqrt();
    if aside > MAX_ASIDE {
        return Err(AlignError::TwoAxes { motion, aside: 100.0 * aside });
    }
    let first =
        points.iter().map(|[u, v]| u * cos + v * sin).find(|s| s.abs() > 0.5 * most).unwrap_or(1.0);
    Ok([cos * first.signum(), sin * first.signum()])
}

/// `phi` or the opposite direction, whichever `projection` calls positive.
fn signed(phi: f64, projection: impl Fn(f64) -> f64) -> f64 {
    if projection(phi) < 0.0 { phi + PI } else { phi }
}

fn wrap(angle: f64) -> f64 {
    angle - 2.0 * PI * (angle / (2.0 * PI)).round()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Tangents of both views while one axis swings, first to its positive side, with a little
    /// noise.
    fn motion(planes: [f64; 2], axis: usize) -> Vec<[f64; 2]> {
        (0..200)
            .map(|i| {
                let bend = 0.6 * (f64::from(i) * 0.05).sin();
                let noise = 0.002 * (f64::from(i * 7919 % 13) / 6.0 - 1.0);
                planes.map(|phi| bend * if axis == 0 { phi.cos() } else { phi.sin() } + noise)
            })
            .collect()
    }

    proptest! {
        #[test]
        fn finds_axis_direction_and_turn_of_both_views(deg in -180.0..180.0_f64, left: bool) {
            let delta = if left { PI / 2.0 } else { -PI / 2.0 };
            let planes = [deg.to_radians(), deg.to_radians() + delta];
            let found = two_views(&motion(planes, 0), &motion(planes, 1), PI / 2.0).unwrap();
            for view in 0..2 {
                let error = wrap(found.planes_rad[view] - planes[view]);
                prop_assert!(error.abs() < 0.005, "{found:?} {planes:?}");
            }
        }
    }

    #[test]
    fn cameras_need_not_be_at_right_angles() {
        let planes = [0.1, 0.1 + f64::to_radians(70.0)];
        let (pitch, yaw) = (motion(planes, 0), motion(planes, 1));
        let found = two_views(&pitch, &yaw, f64::to_radians(70.0)).unwrap();
        assert!(wrap(found.planes_rad[1] - planes[1]).abs() < 0.005, "{found:?}");
        let error = two_views(&pitch, &yaw, f64::to_radians(90.0)).unwrap_err();
        assert!(matches!(error, AlignError::Disagree { .. }), "{error}");
    }

    #[test]
    fn unsuitable_motions_are_refused() {
        use AlignError::{TooFew, TooSmall, TwoAxes};
        let planes = [0.0, PI / 2.0];
        let (pitch, yaw) = (motion(planes, 0), motion(planes, 1));
        let align = |pitch: &[_], yaw: &[_]| two_views(pitch, yaw, PI / 2.0).unwrap_err();
        assert!(matches!(align(&pitch[..5], &yaw), TooFew { motion: "pitch", .. }));
        let small: Vec<_> = yaw.iter().map(|p| p.map(|v| 0.1 * v)).collect();
        assert!(matches!(align(&pitch, &small), TooSmall { motion: "yaw", .. }));
        let circle = |i| [f64::from(i).sin() * 0.5, f64::from(i).cos() * 0.5];
        let circle: Vec<_> = (0..100).map(circle).collect();
        assert!(matches!(align(&circle, &yaw), TwoAxes { .. }));
        // The same axis twice.
        align(&pitch, &pitch);
    }

    #[test]
    fn one_view_knows_its_direction() {
        let swing: Vec<f64> = (0..50).map(|i| -0.4 * (f64::from(i) * 0.1).sin()).collect();
        assert_eq!(is_reversed("yaw", &swing), Ok(true));
    }
}
