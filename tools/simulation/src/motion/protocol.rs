//! The calibration motions. Pure; the same seed gives the same motion.
//!
//! All stay in a disc around a centre, because the motors act on both angles: the corners of a
//! square would bend the snake further than either motor does alone.

use std::f64::consts::TAU;

use i2ris::units::MotorVec;

use super::paced_motion::{Motion, STEP_S};
use super::reversals;

/// Turns of a decaying sine.
const DECAYING_TURNS: f64 = 8.0;

/// Parses an option that must be above 0. An error names the valid range.
pub fn above_zero(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|number: &f64| number.is_finite() && *number > 0.0);
    number.ok_or_else(|| "must be a number above 0".to_owned())
}

/// The motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum, strum::IntoStaticStr)]
#[strum(serialize_all = "kebab-case")]
pub enum Protocol {
    /// Both motors alternately wander over the whole disc and make strokes of all sizes (best
    /// calibration)
    Reversals,
    /// The laboratory's sawtooth: full-range strokes of both motors that cross the disc on changing
    /// lines
    Cycles,
    /// Sines of both motors that decay
    DecayingSine,
    /// One motor at a time; the model does not know combined motions
    Axes,
}

impl Protocol {
    /// The name on the command line.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

/// The region of the motors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Region {
    /// Counts.
    pub centre: MotorVec,
    /// Counts.
    pub radius: f64,
    /// 1 or 2.
    pub motors: usize,
}

impl Region {
    /// Counts at a point of the unit disc.
    fn counts(&self, unit: MotorVec) -> MotorVec {
        let [x, y] = if self.motors == 2 { unit } else { [unit[0], 0.0] };
        let scale = self.radius / x.hypot(y).max(1.0);
        [self.centre[0] + scale * x, self.centre[1] + scale * y]
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionRequest {
    pub protocol: Protocol,
    pub region: Region,
    /// Speed of the faster motor.
    pub speed_counts_s: f64,
    /// `None`: the default duration of the protocol.
    pub duration_s: Option<f64>,
    pub seed: u64,
}

impl MotionRequest {
    /// Default duration of the protocol, s: five minutes of reversals, eight strokes of the
    /// sawtooth, four decaying sines, four rounds for each axis.
    pub fn duration_s(&self) -> f64 {
        let cycles = match self.protocol {
            Protocol::Reversals => return self.duration_s.unwrap_or(300.0),
            Protocol::Cycles => 9.0 * self.stroke_s(),
            Protocol::DecayingSine => 4.0 * DECAYING_TURNS * self.turn_s(),
            Protocol::Axes => 2.0 * 8.0 * self.stroke_s(),
        };
        self.duration_s.unwrap_or(cycles)
    }

    /// There and back once at full speed.
    fn stroke_s(&self) -> f64 {
        4.0 * self.region.radius / self.speed_counts_s
    }

    /// One round of a sine that reaches full speed.
    fn turn_s(&self) -> f64 {
        TAU * self.region.radius / self.speed_counts_s
    }

    /// The motion: from `from` to the centre, through the protocol, and back to the centre.
    pub fn motion(&self, from: MotorVec) -> Motion {
        let centre = self.region.centre;
        let middle = Motion::paced(
            self.points().into_iter().map(|unit| self.region.counts(unit)),
            self.speed_counts_s,
        )
        .truncated(self.duration_s());
        let points =
            [from, centre].into_iter().chain(middle.positions().iter().copied()).chain([centre]);
        Motion::paced(points, self.speed_counts_s)
    }

    /// The protocol in the unit disc, [`STEP_S`] apart.
    fn points(&self) -> Vec<MotorVec> {
        let steps = (self.duration_s() / STEP_S) as usize;
        let at = |k: usize| k as f64 * STEP_S;
        match self.protocol {
            Protocol::Reversals => {
                reversals::points(steps, self.region.radius, self.speed_counts_s, self.seed)
            }
            Protocol::Cycles => (0..steps).map(|k| self.cycles(at(k))).collect(),
            Protocol::DecayingSine => (0..steps).map(|k| self.decaying(at(k))).collect(),
            Protocol::Axes => (0..steps).map(|k| self.axes(at(k))).collect(),
        }
    }

    /// Motor 1 makes one stroke more than motor 0, at the speed limit, so the phase between them
    /// goes once around.
    fn cycles(&self, time_s: f64) -> MotorVec {
        let strokes = (self.duration_s() / self.stroke_s()).round().max(2.0);
        let share = time_s / self.duration_s();
        [triangle(share * (strokes - 1.0)), triangle(share * strokes)]
    }

    /// Grows over the first turn, decays over the others; the motors are a quarter of a turn apart.
    fn decaying(&self, time_s: f64) -> MotorVec {
        let turns = (time_s / self.turn_s()).rem_euclid(DECAYING_TURNS);
        let size = turns.min((DECAYING_TURNS - turns) / (DECAYING_TURNS - 1.0));
        let (sine, cosine) = (TAU * turns).sin_cos();
        [size * sine, size * cosine]
    }

    /// Strokes of full, three quarter, half and quarter size, one motor after the other.
    fn axes(&self, time_s: f64) -> MotorVec {
        let strokes = time_s / self.stroke_s();
        let round = strokes.rem_euclid(8.0);
        let size = 1.0 - 0.25 * (round / 2.0).floor();
        let value = size * triangle(round);
        let motor = (strokes / 8.0).floor() as usize % self.region.motors;
        std::array::from_fn(|other| if other == motor { value } else { 0.0 })
    }
}

/// Triangle wave of period 1 and amplitude 1, starting at 0 and rising.
fn triangle(phase: f64) -> f64 {
    1.0 - 4.0 * ((phase + 0.25).rem_euclid(1.0) - 0.5).abs()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::paced_motion::distance;

    const ALL: [Protocol; 4] =
        [Protocol::Reversals, Protocol::Cycles, Protocol::DecayingSine, Protocol::Axes];

    fn request(protocol: Protocol) -> MotionRequest {
        let region = Region { centre: [100.0, -50.0], radius: 1000.0, motors: 2 };
        MotionRequest { protocol, region, speed_counts_s: 500.0, duration_s: None, seed: 7 }
    }

    fn from_centre(request: &MotionRequest, place: &MotorVec) -> f64 {
        (place[0] - request.region.centre[0]).hypot(place[1] - request.region.centre[1])
    }

    #[test]
    fn protocols_keep_disc_and_speed_and_end_centred() {
        for protocol in ALL {
            let request = request(protocol);
            let motion = request.motion([0.0, 0.0]);
            let positions = motion.positions();
            assert_eq!(
                (positions.first(), positions.last()),
                (Some(&[0.0, 0.0]), Some(&request.region.centre)),
                "{protocol:?}"
            );
            let farthest =
                positions.iter().map(|place| from_centre(&request, place)).fold(0.0, f64::max);
            assert!((950.0..=1000.0 + 1e-6).contains(&farthest), "{protocol:?}: {farthest}");
            for pair in positions.windows(2) {
                let speed = distance(&pair[0], &pair[1]) / STEP_S;
                assert!(speed <= 500.0 + 1e-6, "{protocol:?}: {speed}");
            }
            let longest = request.duration_s() + 10.0;
            assert!(
                (request.duration_s()..longest).contains(&motion.length_s()),
                "{protocol:?}: {}",
                motion.length_s()
            );
        }
    }

    #[test]
    fn one_motor_leaves_the_other_alone() {
        for protocol in ALL {
            let mut request = request(protocol);
            request.region = Region { motors: 1, centre: [0.0, 0.0], ..request.region };
            let motion = request.motion([0.0, 0.0]);
            assert!(motion.positions().iter().all(|place| place[1] == 0.0), "{protocol:?}");
            assert!(motion.positions().iter().any(|place| place[0] > 900.0), "{protocol:?}");
        }
    }

    #[test]
    fn all_but_axes_visit_every_part_of_the_plane() {
        for protocol in ALL {
            let request = request(protocol);
            let mut visited = [false; 8];
            for place in request
                .motion([0.0, 0.0])
                .positions()
                .iter()
                .filter(|place| from_centre(&request, place) > 500.0)
            {
                let [x, y] = [place[0] - 100.0, place[1] + 50.0];
                visited[((y.atan2(x) / TAU).rem_euclid(1.0) * 8.0) as usize % 8] = true;
            }
            let every = visited.iter().all(|visited| *visited);
            assert_eq!(every, protocol != Protocol::Axes, "{protocol:?}: {visited:?}");
        }
    }

    #[test]
    fn the_seed_decides_and_the_duration_is_kept() {
        let request = MotionRequest { duration_s: Some(30.0), ..request(Protocol::Reversals) };
        assert_eq!(request.motion([0.0; 2]), request.motion([0.0; 2]));
        assert_ne!(request.motion([0.0; 2]), MotionRequest { seed: 8, ..request }.motion([0.0; 2]));
        assert!((30.0..34.0).contains(&request.motion([0.0; 2]).length_s()));
    }
}
