//! Pipeline: a goal in joint space on its way to the inverse, through stages 4 to 8 of the table in
//! `gate`.

use serde::{Deserialize, Serialize};

use crate::config::CompensationConfig;
use crate::core::motion::GoalStep;
use crate::core::motion::joint_filter::JointFilter;
use crate::core::motion::virtual_fixtures::{GoalSpace, VirtualFixtures};
use crate::core::vector::{difference, distance, zip_map};
use crate::units::{Nanos, OutputVec};

/// The stages that belong to a model, with the state that they keep from tick to tick. The black
/// box depends on order and types of the fields.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Pipeline {
    pub dead_band: BacklashDeadBand,
    filter: JointFilter,
    /// The goal of the last tick after the dead-band, while angles are followed.
    dead_banded: Option<OutputVec>,
    blend: Option<ModelBlend>,
    /// How far the stages up to the dead-band kept the goal of the last tick back, rad.
    pub held_back: OutputVec,
}

pub(crate) struct PipelineTick<'a> {
    /// The pose at the setpoints: where a goal begins.
    pub start: OutputVec,
    pub space: GoalSpace<'a>,
    pub now: Nanos,
    /// Start of the tick before.
    pub before: Nanos,
}

pub(crate) struct PassedGoal {
    /// After the virtual fixtures, for the report.
    pub limited: OutputVec,
    /// For the inverse.
    pub goal: GoalStep,
}

impl Pipeline {
    pub(super) fn new(dead_band: BacklashDeadBand, filter: JointFilter) -> Self {
        let held_back = OutputVec::default();
        Self { dead_band, filter, dead_banded: None, blend: None, held_back }
    }

    /// Takes the goal of this tick through the stages.
    pub(super) fn pass(
        &mut self,
        goal: GoalStep,
        fixtures: &mut VirtualFixtures,
        tick: &PipelineTick<'_>,
    ) -> PassedGoal {
        let filtered = self.filter.filter(goal, tick.start);
        // Regions that begin to count during a blend begin with a goal that it is not yet added to.
        let start = difference(&tick.start, &self.blended(OutputVec::default(), tick.before));
        let limited = fixtures.limit(filtered, start, &tick.space);
        let banded = self.dead_banded(limited, &goal.now);
        let blended = GoalStep {
            now: self.blended(banded.now, tick.now),
            before: self.blended(banded.before, tick.before),
        };
        PassedGoal { limited: limited.now, goal: blended }
    }

    /// The goal after the dead-band. Records how far it is from the `requested` one.
    fn dead_banded(&mut self, goal: GoalStep, requested: &OutputVec) -> GoalStep {
        let banded = self.dead_band.apply(&goal.now);
        self.dead_banded = Some(banded.goal);
        let led = zip_map(requested, &self.filter.lead(), |requested, lead| requested + lead);
        self.held_back = difference(&led, &banded.goal);
        let before = if banded.is_held { banded.goal } else { goal.before };
        GoalStep { now: banded.goal, before }
    }

    /// A goal with the offset of the last model swap.
    fn blended(&self, goal: OutputVec, now: Nanos) -> OutputVec {
        let offset = self.blend.and_then(|blend| blend.offset_at(now));
        offset.map_or(goal, |offset| zip_map(&goal, &offset, |a, b| a + b))
    }

    /// No angles are followed in this tick.
    pub(super) fn release_goal(&mut self) {
        self.dead_band.release_goal();
        self.filter.reset();
        (self.dead_banded, self.blend) = (None, None);
        self.held_back = OutputVec::default();
    }

    /// Takes over from the model that was active before. The difference of their poses at the
    /// present setpoints becomes a [`ModelBlend`]; motion that remains to the goal does not, or it
    /// would continue after the hand has stopped.
    pub(super) fn take_over(&mut self, before: Option<(&Self, OutputVec)>, now: Nanos) {
        self.dead_band.take_over(before.map(|(before, _)| &before.dead_band));
        (self.dead_banded, self.blend, self.held_back) = (None, None, OutputVec::default());
        let Some((before, difference)) = before else { return };
        self.filter = before.filter;
        (self.dead_banded, self.held_back) = (before.dead_banded, before.held_back);
        let offset = before.blended(difference, now);
        self.blend = self.dead_banded.map(|_| ModelBlend::new(offset, now));
    }
}

const BLEND: Nanos = Nanos::from_millis(500);

/// Blend of a swap from one model to the next, without a step of the motors: an offset of the goal
/// that fades out.
///
/// Two models disagree about the angles at the present setpoints. When the second one takes over,
/// the disagreement is added to the goal, so that the motors stay, or stay on their way. The motors
/// move only by the difference of the models, smoothly and within all limits.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct ModelBlend {
    /// Offset at the start, rad (m).
    offset: OutputVec,
    started: Nanos,
}

impl ModelBlend {
    pub(super) fn new(offset: OutputVec, started: Nanos) -> Self {
        Self { offset, started }
    }

    /// The offset at a time, rad (m); `None` once it has faded out.
    fn offset_at(&self, now: Nanos) -> Option<OutputVec> {
        let age = now.duration_since(self.started);
        (age < BLEND).then(|| {
            let left = 1.0 - least_jerk(age.as_seconds() / BLEND.as_seconds());
            self.offset.map(|offset| left * offset)
        })
    }
}

/// Blend from 0 at 0 to 1 at 1, with velocity and acceleration 0 at both ends: the polynomial of
/// least jerk between two rests (T. Flash and N. Hogan 1985).
fn least_jerk(s: f64) -> f64 {
    s * s * s * (10.0 + s * (6.0 * s - 15.0))
}

const RESIDUAL_FILTER_S: f64 = 0.05;
/// Changes of the residual below this are not followed.
const RESIDUAL_DEAD_BAND_DEG: f64 = 0.02;

/// Backlash dead-band: keeps a model with memory from making the motors chatter.
///
/// Where the motion reverses, the exact inverse jumps across the backlash. A trembling hand would
/// send the motors back and forth across it, and a residual of the model that is inverted
/// unfiltered reacts to its own motion. Two filters prevent this:
///
/// - **turning band**: a dead-band on the goal. A goal that keeps its direction is followed without
///   lag. A goal that turns back by less than the band is held until it reaches the other side of
///   the band. It is a disc: a goal outside of the disc pulls the disc along with its edge.
/// - **correction filter**: the residual of the model passes a first-order low-pass filter and a
///   dead-band of its own.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct BacklashDeadBand {
    /// Radius of the disc, rad; 0: off.
    radius: f64,
    /// Fraction of the distance that the low-pass filter moves per tick.
    gain: f64,
    /// Half-width of the dead-band after the low-pass filter, rad; 0: off.
    correction_half_width: f64,
    turning_band: Option<TurningBand>,
    correction: Option<CorrectionFilter>,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct TurningBand {
    centre: OutputVec,
    /// The goal that was let through last.
    output: OutputVec,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct CorrectionFilter {
    low_pass: OutputVec,
    output: OutputVec,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct DeadBandedGoal {
    pub goal: OutputVec,
    /// The goal is held, because it turned back by less than the band.
    pub is_held: bool,
}

/// Outputs of a model, for its bands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Outputs {
    /// Bands in degrees mean nothing for them.
    Others,
    Angles,
    /// The inverse jumps where the motion reverses.
    AnglesWithBacklash,
}

impl BacklashDeadBand {
    pub(crate) fn new(config: &CompensationConfig, outputs: Outputs, tick: Nanos) -> Self {
        let band = |is_on: bool, degrees: f64| if is_on { degrees.to_radians() } else { 0.0 };
        let tick_s = tick.as_seconds();
        Self {
            radius: band(outputs == Outputs::AnglesWithBacklash, config.reversal_dead_band_deg),
            gain: tick_s / (tick_s + RESIDUAL_FILTER_S),
            correction_half_width: band(outputs != Outputs::Others, RESIDUAL_DEAD_BAND_DEG),
            turning_band: None,
            correction: None,
        }
    }

    /// The largest distance of the output from the goal, rad.
    pub(crate) fn width(&self) -> f64 {
        2.0 * self.radius
    }

    /// No goal is followed: the next goal is taken unchanged.
    pub(crate) fn release_goal(&mut self) {
        self.turning_band = None;
    }

    /// Takes the goal over from the model that was in use before. The correction starts again.
    pub(crate) fn take_over(&mut self, before: Option<&Self>) {
        self.turning_band = before.and_then(|before| before.turning_band);
        self.correction = None;
    }

    /// Forgets everything: the memory of the model has been reset.
    pub(crate) fn reset(&mut self) {
        self.turning_band = None;
        self.correction = None;
    }

    pub(crate) fn apply(&mut self, goal: &OutputVec) -> DeadBandedGoal {
        let band = self.turning_band.get_or_insert(TurningBand { centre: *goal, output: *goal });
        let offset = distance(goal, &band.centre);
        let is_held = offset <= self.radius && self.radius > 0.0 && band.output != *goal;
        if !is_held {
            band.output = *goal;
            if offset > self.radius {
                let fraction = 1.0 - self.radius / offset;
                let pull = |centre: f64, goal: f64| centre + fraction * (goal - centre);
                band.centre = zip_map(&band.centre, goal, pull);
            }
        }
        DeadBandedGoal { goal: band.output, is_held }
    }

    /// Takes the correction of this tick through the correction filter. It must be finite.
    pub(crate) fn filter_correction(&mut self, correction: &OutputVec) {
        let filter = self
            .correction
            .get_or_insert(CorrectionFilter { low_pass: *correction, output: *correction });
        let gain = self.gain;
        filter.low_pass =
            zip_map(&filter.low_pass, correction, |low, value| low + gain * (value - low));
        let half_width = self.correction_half_width;
        filter.output = zip_map(&filter.output, &filter.low_pass, |output, low| {
            output.max(low - half_width).min(low + half_width)
        });
    }

    pub(crate) fn correction(&self) -> Option<OutputVec> {
        self.correction.map(|filter| filter.output)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn offset_fades_out_without_a_step() {
        let ms = Nanos::from_millis;
        let blend = ModelBlend::new([1.0, -2.0, 0.0], ms(100));
        assert_eq!(blend.offset_at(ms(100)), Some([1.0, -2.0, 0.0]));
        assert_eq!(blend.offset_at(ms(600)), None);
        let mut before = 1.0;
        for tick in 1..500 {
            let [now, ..] = blend.offset_at(ms(100 + tick)).unwrap();
            // The steepest slope is 15/8 of the average.
            let change = before - now;
            assert!((0.0..=1.876 / 500.0).contains(&change), "{tick}");
            before = now;
        }
        assert!(before < 1e-6);
    }

    fn dead_band() -> BacklashDeadBand {
        let config =
            CompensationConfig { reversal_dead_band_deg: 1.0, ..CompensationConfig::default() };
        BacklashDeadBand::new(&config, Outputs::AnglesWithBacklash, Nanos::from_millis(1))
    }

    fn degrees(pitch: f64, yaw: f64) -> OutputVec {
        [pitch.to_radians(), yaw.to_radians(), 0.0]
    }

    #[test]
    fn goal_is_held_after_small_reversal() {
        let mut dead_band = dead_band();
        for (goal, output) in [
            (degrees(0.0, 0.0), degrees(0.0, 0.0)),
            (degrees(1.5, 0.0), degrees(1.5, 0.0)),
            (degrees(3.0, 0.0), degrees(3.0, 0.0)),
            // The disc is at 2 deg.
            (degrees(2.5, 0.0), degrees(3.0, 0.0)),
            (degrees(1.1, 0.3), degrees(3.0, 0.0)),
            (degrees(0.9, 0.0), degrees(0.9, 0.0)),
        ] {
            let found = dead_band.apply(&goal);
            let is_held = goal != output;
            assert_eq!(found, DeadBandedGoal { goal: output, is_held });
        }
        // A new model keeps the goal but not the correction.
        let mut next = self::dead_band();
        next.filter_correction(&degrees(1.0, 0.0));
        next.take_over(Some(&dead_band));
        assert!(next.correction().is_none() && next.apply(&degrees(1.0, 0.0)).is_held);
        next.reset();
        assert!(!next.apply(&degrees(1.0, 0.0)).is_held);
        dead_band.release_goal();
        assert!(!dead_band.apply(&degrees(1.0, 0.0)).is_held);
    }

    #[test]
    fn the_correction_is_low_passed_and_small_changes_are_ignored() {
        let mut dead_band = dead_band();
        dead_band.filter_correction(&degrees(0.0, 0.0));
        let mut after = |pitch: f64, ticks: u32| {
            for _ in 0..ticks {
                dead_band.filter_correction(&degrees(pitch, 0.0));
            }
            dead_band.correction().unwrap()[0].to_degrees()
        };
        assert_eq!(after(0.015, 1000), 0.0);
        // One time constant of 50 ms to 10: 10 (1 - 1/e) minus the dead-band.
        let found = after(10.0, 51);
        assert!((found - (10.0 * 0.632 - 0.02)).abs() < 0.1, "{found}");
        assert!((after(10.0, 1000) - 9.98).abs() < 1e-6);
    }

    #[test]
    fn tremor_inside_the_band_moves_nothing() {
        let mut dead_band = dead_band();
        let first = dead_band.apply(&degrees(5.0, 5.0)).goal;
        for tick in 0..500 {
            let phase = f64::from(tick) * 0.0628;
            let found = dead_band.apply(&degrees(5.0 + 0.9 * phase.sin(), 5.0));
            assert_eq!(found.goal, first);
        }
    }

    proptest! {
        #[test]
        fn output_stays_within_twice_the_band(
            goals in prop::collection::vec((-30.0..30.0_f64, -30.0..30.0_f64), 1..200)
        ) {
            let mut dead_band = dead_band();
            for (pitch, yaw) in goals {
                let goal = degrees(pitch, yaw);
                let found = dead_band.apply(&goal);
                let largest = 2.0_f64.to_radians() * (1.0 + 1e-9);
                prop_assert!(distance(&found.goal, &goal) <= largest);
                prop_assert!((dead_band.width() - largest).abs() < 1e-8);
                prop_assert_eq!(found.is_held, found.goal != goal);
            }
        }
    }
}
