//! Transformation from the picture that the operator sees to pitch and yaw.
//!
//! A hand moves right and up in the picture; the snake bends in pitch and yaw. The rotation and
//! mirroring of the camera relate both: 2x2, `picture = V * [pitch, yaw]`. It is typed, or measured
//! by two small motions in view of the camera.
//!
//! | rotation | mirror | +pitch in the picture | +yaw in the picture |
//! |---|---|---|---|
//! | 0 | no | up | right |
//! | 90 | no | left | up |
//! | 180 | no | down | left |
//! | 0 | yes | up | left |
//! | 90 | yes | right | up |
//!
//! The mirror swaps right and left after the rotation. Right is right, also for the left hand.

use std::fmt;

/// Minimum angle between two directions, deg; closer ones cannot be distinguished.
const MIN_BETWEEN_DEG: f64 = 30.0;
/// A smaller rotation is attributed to the error of the measurement, deg.
const TURNED_DEG: f64 = 20.0;
/// Minimum ratio of an observed motion to its uncertainty.
const MIN_SIGMAS: f64 = 5.0;

/// Effect of a motion of one axis in the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SeenMotion {
    /// Motion of the axis, deg.
    pub moved_deg: f64,
    /// Motion in the picture, right and up, deg or any other unit.
    pub picture: [f64; 2],
    /// Standard deviation of each component.
    pub deviation: f64,
}

/// Reason why a view cannot be measured.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum ViewError {
    #[error(
        "the picture moved by {seen:.3} when {axis} moved by {moved_deg:.1} deg: too little for \
         its uncertainty of {deviation:.3}; is the snake in the picture, and does the camera see \
         it bend?"
    )]
    NotSeen { axis: &'static str, moved_deg: f64, seen: f64, deviation: f64 },
    #[error(
        "pitch and yaw move the picture in directions that are {between_deg:.0} deg apart; \
         {MIN_BETWEEN_DEG:.0} are needed to steer by it: turn the camera"
    )]
    TooNear { between_deg: f64 },
}

/// Orientation of the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// Right and up in the picture, for one of pitch (first) and of yaw.
    seen: [[f64; 2]; 2],
    /// Standard deviation of both directions, deg; zero for a typed view.
    deviation_deg: [f64; 2],
}

impl Default for View {
    fn default() -> Self {
        Self::typed(0.0, false)
    }
}

impl View {
    /// A picture that is rotated counterclockwise, and then mirrored.
    pub fn typed(rotation_deg: f64, mirror: bool) -> Self {
        let (sin, cos) = rotation_deg.to_radians().sin_cos();
        let mirrored = |[right, up]: [f64; 2]| [if mirror { -right } else { right }, up];
        Self { seen: [mirrored([-sin, cos]), mirrored([cos, sin])], deviation_deg: [0.0; 2] }
    }

    /// Measures the view from motions of pitch and of yaw alone. Fails if they do not determine it.
    pub fn measured(pitch: SeenMotion, yaw: SeenMotion) -> Result<Self, ViewError> {
        let column = |axis, motion: SeenMotion| {
            let SeenMotion { moved_deg, picture: [right, up], deviation } = motion;
            let seen = right.hypot(up);
            if seen.is_nan() || seen < MIN_SIGMAS * deviation || seen <= 0.0 || moved_deg == 0.0 {
                return Err(ViewError::NotSeen { axis, moved_deg, seen, deviation });
            }
            let deviation_deg = (deviation / seen).to_degrees();
            Ok(([right / moved_deg, up / moved_deg], deviation_deg))
        };
        let (pitch, pitch_deviation_deg) = column("pitch", pitch)?;
        let (yaw, yaw_deviation_deg) = column("yaw", yaw)?;
        let (cross, dot) = (cross(yaw, pitch), yaw[0] * pitch[0] + yaw[1] * pitch[1]);
        let angle_deg = cross.atan2(dot).to_degrees().abs();
        let between_deg = angle_deg.min(180.0 - angle_deg);
        if between_deg < MIN_BETWEEN_DEG {
            return Err(ViewError::TooNear { between_deg });
        }
        // The speed of a hand stays in deg/s of the snake, in any unit of the picture.
        let size = cross.abs().sqrt();
        let seen = [pitch, yaw].map(|[right, up]| [right / size, up / size]);
        Ok(Self { seen, deviation_deg: [pitch_deviation_deg, yaw_deviation_deg] })
    }

    /// Pitch and yaw that move the picture by right and up.
    pub fn joints(&self, [right, up]: [f64; 2]) -> [f64; 2] {
        let [pitch, yaw] = self.seen;
        // Not singular: the directions differ.
        let determinant = cross(yaw, pitch);
        [cross(yaw, [right, up]) / determinant, cross([right, up], pitch) / determinant]
    }

    /// Right and up in the picture, for one of pitch (first) and of yaw.
    pub fn seen(&self) -> [[f64; 2]; 2] {
        self.seen
    }

    /// Whether the picture is rotated: then the angles of a camera are not pitch and yaw.
    pub fn is_turned(&self) -> bool {
        let [pitch, yaw] = self.directions_deg();
        let off = |deg: f64| (deg + 180.0).rem_euclid(360.0) - 180.0;
        off(pitch - 90.0).abs().max(off(yaw).abs()) > TURNED_DEG
    }

    /// Directions of +pitch and +yaw in the picture, deg counterclockwise from the right.
    pub fn directions_deg(&self) -> [f64; 2] {
        self.seen.map(|[right, up]| up.atan2(right).to_degrees())
    }
}

fn cross(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

impl fmt::Display for View {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, axis) in ["pitch", "yaw"].into_iter().enumerate() {
            let direction_deg = self.directions_deg()[index];
            let arrow = ARROWS[((direction_deg / 45.0).round() as i64).rem_euclid(8) as usize];
            let comma = if index == 0 { "" } else { ", " };
            write!(f, "{comma}+{axis} goes {arrow} ({direction_deg:+.0}")?;
            if self.deviation_deg[index] > 0.0 {
                write!(f, " +- {:.1}", self.deviation_deg[index])?;
            }
            f.write_str(" deg)")?;
        }
        f.write_str(" in the picture")
    }
}

const ARROWS: [&str; 8] = ["→", "↗", "↑", "↖", "←", "↙", "↓", "↘"];

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn near(a: [f64; 2], b: [f64; 2]) -> bool {
        (a[0] - b[0]).abs().max((a[1] - b[1]).abs()) < 1e-9
    }

    /// Typed views and their effect on pitch and yaw in the picture, written by hand.
    #[test]
    fn right_and_up_hold_for_every_rotation_and_mirror() {
        const TABLE: [(f64, bool, [f64; 2], [f64; 2]); 8] = [
            (0.0, false, [0.0, 1.0], [1.0, 0.0]),
            (90.0, false, [-1.0, 0.0], [0.0, 1.0]),
            (180.0, false, [0.0, -1.0], [-1.0, 0.0]),
            (270.0, false, [1.0, 0.0], [0.0, -1.0]),
            (0.0, true, [0.0, 1.0], [-1.0, 0.0]),
            (90.0, true, [1.0, 0.0], [0.0, 1.0]),
            (180.0, true, [0.0, -1.0], [1.0, 0.0]),
            (270.0, true, [-1.0, 0.0], [0.0, -1.0]),
        ];
        for (rotation_deg, mirror, pitch_seen, yaw_seen) in TABLE {
            let view = View::typed(rotation_deg, mirror);
            for push in [[1.0, 0.0], [0.0, 1.0], [-0.3, 0.8]] {
                let [pitch, yaw] = view.joints(push);
                let picture = [0, 1].map(|axis| pitch * pitch_seen[axis] + yaw * yaw_seen[axis]);
                assert!(near(picture, push), "{rotation_deg} {mirror} {push:?}: {picture:?}");
            }
        }
        let shown = "+pitch goes ← (+180 deg), +yaw goes ↑ (+90 deg) in the picture";
        assert_eq!(View::typed(90.0, false).to_string(), shown);
    }

    #[test]
    fn rotated_or_mirrored_picture_is_detected() {
        for (rotation_deg, mirror, turned) in [
            (0.0, false, false),
            (10.0, false, false),
            (-350.0, false, false),
            (37.0, false, true),
            (180.0, false, true),
            (0.0, true, true),
        ] {
            assert_eq!(View::typed(rotation_deg, mirror).is_turned(), turned, "{rotation_deg}");
        }
    }

    #[test]
    fn invisible_or_nearly_parallel_motions_are_refused() {
        let motion =
            |right, up| SeenMotion { moved_deg: 1.0, picture: [right, up], deviation: 0.02 };
        let view = View::measured(motion(-0.6, 0.8), motion(0.8, 0.6)).unwrap();
        assert!(near(view.joints([0.8, 0.6]), [0.0, 1.0]), "{view}");
        assert!(view.to_string().contains("+yaw goes ↗ (+37 +- 1.1 deg)"), "{view}");
        let not_seen = View::measured(motion(0.05, 0.0), motion(0.8, 0.6)).unwrap_err();
        assert!(matches!(not_seen, ViewError::NotSeen { axis: "pitch", .. }));
        for yaw in [motion(0.9, 0.4), motion(-0.9, -0.4)] {
            let near = View::measured(motion(1.0, 0.1), yaw).unwrap_err();
            assert!(matches!(near, ViewError::TooNear { .. }));
            assert!(near.to_string().contains("18 deg"));
        }
        assert!(View::measured(motion(f64::NAN, 0.0), motion(0.0, 1.0)).is_err());
    }

    proptest! {
        #[test]
        fn view_measured_without_noise_equals_the_typed_one(
            rotation_deg in -180.0..180.0_f64, mirror in any::<bool>(), size in 0.1..10.0_f64,
            moved_deg in -2.0..2.0_f64, push in prop::array::uniform2(-1.0..1.0_f64),
        ) {
            prop_assume!(moved_deg.abs() > 0.1);
            let typed = View::typed(rotation_deg, mirror);
            let motion = |axis: usize| SeenMotion {
                moved_deg,
                picture: typed.seen[axis].map(|seen| seen * size * moved_deg),
                deviation: 0.0,
            };
            let measured = View::measured(motion(0), motion(1)).unwrap();
            prop_assert!(near(measured.joints(push), typed.joints(push)));
        }
    }
}
