//! The virtual fixtures with their outlines in the plane of pitch and yaw; the distance of the tip
//! to one, or to the edge of the calibrated range of the model, for a sound or a pulse. Never a
//! command.

use std::f64::consts::TAU;

use i2ris::ipc::FixtureKind;
use i2ris::ipc::payload::{FIXTURES, VirtualFixturesMsg, unpadded_text};
use i2ris::units::Nanos;
use serde::Serialize;

use super::{View, short};
use crate::statistics::distance_to_segment;

const CIRCLE_POINTS: u32 = 48;
/// How far the outline of a half-plane reaches, deg: beyond every picture.
const FAR_DEG: f64 = 180.0;
/// A border nearer than this is signalled, deg.
const NEAR_DEG: f64 = 3.0;
/// Nearer than this the tip touches, deg.
const TOUCH_DEG: f64 = 0.1;
/// Time between two beats, s: at [`NEAR_DEG`], and at contact.
const BEATS_S: [f64; 2] = [1.0, 0.1];

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
    Some(points.into_iter().map(|point| point.map(short)).collect())
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Near {
    Fixture,
    Hull,
}

/// The nearest boundary and its distance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Cue {
    pub kind: Near,
    pub deg: f64,
    pub touches: bool,
    /// Time between two beats, s.
    pub beat_s: f64,
}

impl Cue {
    fn new((kind, deg): (Near, f64)) -> Self {
        let [slow, fast] = BEATS_S;
        let touches = deg < TOUCH_DEG;
        let share = if touches { 0.0 } else { deg / NEAR_DEG };
        let beat_s = short(fast + (slow - fast) * share);
        Self { kind, deg: short(deg), touches, beat_s }
    }

    pub fn beat(&self) -> Nanos {
        Nanos((1e9 * self.beat_s) as u64)
    }
}

impl View {
    /// The nearest boundary; `None`: nothing is near, or the angles are not known. `hull`: the edge
    /// of the model's hull, pitch and yaw in degrees, closed; empty if it is not known.
    pub fn cue(&self, hull: &[[f64; 2]]) -> Option<Cue> {
        let tip = self.estimate?.fresh()?;
        let fixtures = self.fixtures.iter().filter(|fixture| fixture.active);
        let outlines = fixtures.filter_map(|fixture| fixture.outline.as_deref());
        let mut near: Vec<(Near, f64)> =
            outlines.map(|outline| (Near::Fixture, to_edge(tip, outline))).collect();
        if hull.len() > 2 {
            near.push((Near::Hull, to_edge(tip, hull)));
        }
        // Backlash and load keep the tip away from a limit that holds the goal.
        let state = self.state.as_ref().filter(|state| !state.age.stale);
        near.extend(state.filter(|state| state.clipped).map(|_| (Near::Hull, 0.0)));
        near.extend(state.filter(|state| state.at_fixture).map(|_| (Near::Fixture, 0.0)));
        let nearest = near.into_iter().min_by(|(_, a), (_, b)| a.total_cmp(b));
        nearest.filter(|(_, deg)| *deg <= NEAR_DEG).map(Cue::new)
    }
}

/// Distance of a point from the edge of a closed outline.
fn to_edge(point: [f64; 2], outline: &[[f64; 2]]) -> f64 {
    let next = outline.iter().cycle().skip(1);
    let sides = outline.iter().zip(next);
    let distances = sides.map(|(from, to)| distance_to_segment(point, *from, *to));
    distances.fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use i2ris::ipc::payload::{OperatingStateMsg, padded_text};

    use super::super::{Age, LatestMessages, Pose};
    use super::*;

    const HULL: [[f64; 2]; 4] = [[-10.0, -10.0], [10.0, -10.0], [10.0, 10.0], [-10.0, 10.0]];

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

    fn at(deg: [f64; 2], stale: bool) -> View {
        let age = Age { age: Some(Nanos::ZERO), stale };
        let estimate = Pose { deg: Some(deg), deviation_deg: None, is_position: false, age };
        View { estimate: Some(estimate), ..View::default() }
    }

    #[test]
    fn the_nearest_edge_counts_from_inside_and_outside() {
        let near = |deg| at(deg, false).cue(&HULL).map(|cue| (cue.kind, cue.deg, cue.beat_s));
        assert_eq!(near([0.0, 9.0]), Some((Near::Hull, 1.0, 0.4)));
        assert_eq!(near([-13.0, 14.0]), None, "5 deg from the corner");
        assert_eq!(near([-10.0, 12.5]), Some((Near::Hull, 2.5, 0.85)));
        assert_eq!(near([9.95, 3.0]), Some((Near::Hull, 0.05, 0.1)));
        assert_eq!(at([0.0, 9.0], true).cue(&HULL), None, "a stale pose gives no cue");
        assert_eq!(at([0.0, 9.0], false).cue(&[]), None, "no hull is known");
    }

    #[test]
    fn inactive_fixture_is_silent_and_limiting_fixture_touches() {
        let outline = Some(vec![[0.0, 4.0], [1.0, 4.0], [1.0, 5.0]]);
        let fixture = Fixture { name: "lens".into(), text: "lens".into(), active: true, outline };
        let mut view = View { fixtures: vec![fixture], ..at([0.5, 2.0], false) };
        assert_eq!(view.cue(&HULL).map(|cue| (cue.kind, cue.deg)), Some((Near::Fixture, 2.0)));
        view.fixtures[0].active = false;
        assert_eq!(view.cue(&HULL), None);
        let held =
            OperatingStateMsg { flags: OperatingStateMsg::FIXTURE, ..OperatingStateMsg::default() };
        let messages = LatestMessages { state: Some(held), ..LatestMessages::default() };
        view.state = View::new(&messages, Nanos::ZERO).state;
        assert!(view.cue(&HULL).is_some_and(|cue| cue.touches && cue.kind == Near::Fixture));
    }
}
