//! The virtual fixtures with their outlines in the plane of pitch and yaw, and the target of a
//! reach-and-hold task.

use std::f64::consts::TAU;

use i2ris::ipc::payload::{FIXTURES, ReachTarget, VirtualFixturesMsg, unpadded_text};
use i2ris::ipc::{FixtureKind, Message};
use i2ris::units::Nanos;
use serde::Serialize;

use super::json;

const CIRCLE_POINTS: u32 = 48;
/// How far the outline of a half-plane reaches, deg: beyond every picture.
const FAR_DEG: f64 = 180.0;
/// Age at which a task counts as over: its messages come 20 times a second.
const OVER: Nanos = Nanos::from_millis(1000);

/// A region that the tip may not enter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Fixture {
    pub name: String,
    /// Name and kind, and `OFF` if it is not active.
    pub text: String,
    pub active: bool,
    /// Pitch and yaw, degrees; `None` for a region of the tip.
    pub outline: Option<Vec<[f64; 2]>>,
}

pub(super) fn fixtures(message: &VirtualFixturesMsg) -> Vec<Fixture> {
    let fixture = |index: usize| {
        let kind = FixtureKind::from_number(message.kind[index])?;
        (kind != FixtureKind::None).then_some(())?;
        let name = unpadded_text(&message.name[index]);
        let active = message.active & (1 << index) != 0;
        let text = format!("{name} ({kind}){}", if active { "" } else { " OFF" });
        Some(Fixture { name, text, active, outline: outline(kind, &message.values[index]) })
    };
    (0..FIXTURES).filter_map(fixture).collect()
}

fn outline(kind: FixtureKind, values: &[f64; 17]) -> Option<Vec<[f64; 2]>> {
    let deg = |index: usize| values[index].to_degrees();
    let points: Vec<[f64; 2]> = match kind {
        FixtureKind::Circle => (0..CIRCLE_POINTS)
            .map(|k| TAU * f64::from(k) / f64::from(CIRCLE_POINTS))
            .map(|at| [deg(0) + deg(2) * at.cos(), deg(1) + deg(2) * at.sin()])
            .collect(),
        FixtureKind::HalfPlane => {
            let length = values[0].hypot(values[1]);
            let normal = [values[0] / length, values[1] / length];
            let at = |along: f64, beyond: f64| {
                let offset = deg(2) + beyond;
                [offset * normal[0] - along * normal[1], offset * normal[1] + along * normal[0]]
            };
            vec![at(-FAR_DEG, 0.0), at(FAR_DEG, 0.0), at(FAR_DEG, FAR_DEG), at(-FAR_DEG, FAR_DEG)]
        }
        FixtureKind::Polygon => {
            (0..(values[0] as usize).min(8)).map(|k| [deg(1 + 2 * k), deg(2 + 2 * k)]).collect()
        }
        FixtureKind::Ball | FixtureKind::HalfSpace | FixtureKind::None => return None,
    };
    Some(points.into_iter().map(|point| point.map(json::short)).collect())
}

/// The target that the operator must reach.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Target {
    pub deg: [f64; 2],
    pub tolerance_deg: f64,
    pub number: u32,
    pub total: u32,
    pub hold_s: f64,
    pub held_s: f64,
    /// The target must be followed for `hold_s`, of which `held_s` have passed.
    pub follow: bool,
    /// Pose compared with the target: `camera` or `estimate`.
    pub by: &'static str,
}

impl Target {
    /// `None`: there is no target any more.
    pub(super) fn new(message: &ReachTarget, now: Nanos) -> Option<Self> {
        let is_last = message.flags & ReachTarget::ENDED != 0 && message.number >= message.total;
        if is_last || message.age(now) > OVER {
            return None;
        }
        let by_camera = message.flags & ReachTarget::BY_CAMERA != 0;
        Some(Self {
            deg: [message.position[0].to_degrees(), message.position[1].to_degrees()],
            tolerance_deg: message.tolerance.to_degrees(),
            number: message.number,
            total: message.total,
            hold_s: Nanos(message.hold_ns).as_seconds(),
            held_s: Nanos(message.held_ns.min(message.hold_ns)).as_seconds(),
            follow: message.flags & ReachTarget::FOLLOW != 0,
            by: if by_camera { "camera" } else { "estimate" },
        })
    }
}

#[cfg(test)]
mod tests {
    use i2ris::ipc::payload::padded_text;

    use super::*;

    #[test]
    fn regions_have_a_name_and_an_outline_in_degrees() {
        let mut message = VirtualFixturesMsg::default();
        assert_eq!(fixtures(&message), []);
        message.active = 0b01;
        message.kind[..2].copy_from_slice(&[FixtureKind::HalfPlane.number(), 3]);
        message.values[0][..3].copy_from_slice(&[0.0, 2.0, 10.0_f64.to_radians()]);
        message.name[0] = padded_text("lens");
        message.name[1] = padded_text("retina");
        let [lens, retina] = &fixtures(&message)[..] else { panic!("two regions") };
        assert_eq!(lens.text, "lens (half-plane)");
        assert_eq!(retina.text, "retina (ball) OFF");
        assert!(lens.active && lens.outline.iter().flatten().all(|corner| corner[1] >= 10.0));
        assert!(retina.outline.is_none());
    }

    #[test]
    fn a_target_is_shown_until_the_task_is_over() {
        let now = Nanos::from_millis(5000);
        let message = ReachTarget {
            stamp_ns: now.0,
            position: [0.1, -0.2, 0.0],
            number: 2,
            total: 2,
            held_ns: 500_000_000,
            hold_ns: 1_000_000_000,
            ..ReachTarget::default()
        };
        let target = Target::new(&message, now).unwrap();
        assert_eq!((target.number, target.held_s, target.by), (2, 0.5, "estimate"));
        assert!((target.deg[1] + 11.459).abs() < 1e-3);
        let ended = ReachTarget { flags: ReachTarget::ENDED | ReachTarget::HELD, ..message };
        assert_eq!(Target::new(&ended, now), None);
        assert!(Target::new(&ReachTarget { number: 1, ..ended }, now).is_some());
        assert_eq!(Target::new(&message, now + Nanos::from_millis(1001)), None);
    }
}
