//! The expected goal: as sent by the followed client, scaled, and between commands extrapolated,
//! filtered and led as configured. With formulae of its own.

use i2ris::config::CommandConfig;
use i2ris::core::CycleReport;

use super::*;

/// Largest distance in counts at which a stream may begin.
pub fn first_step_counts(command: &CommandConfig) -> f64 {
    f64::from(command.max_step_counts) * command.first_step_deg / command.max_step_deg
}

pub type Angles = [f64; 2];

/// As in `goal_extrapolation`: a slower stream is not extrapolated.
const MAX_EXTRAPOLATION_S: f64 = 0.02;
/// The first line of an interpolated stream, and the shortest one.
const FIRST_LINE_S: f64 = 0.1;
const MIN_LINE_S: f64 = 0.005;
/// Rounding of steps, degrees.
const STEP_DEG: f64 = 1e-3;

/// The motion being followed.
#[derive(Debug, Clone, Copy)]
pub enum What {
    Nothing,
    Goal(Goal),
    /// Until it is stale, degrees per second.
    Rate {
        rate: Angles,
        at: Nanos,
        deadline_s: f64,
    },
    /// The end of a move.
    Pose(Angles),
    /// Counts, or the counts between which a conditioning cycle moves.
    Counts([[f64; 2]; 2]),
}

/// A line in time, and the origin of the next step, degrees.
#[derive(Debug, Clone, Copy)]
pub struct Goal {
    from: Angles,
    expected: Angles,
    end: Angles,
    rate: Angles,
    last: Angles,
    at: Nanos,
    for_s: f64,
    /// Uncertainty of `from`: the end of a preceding rate is known only to this.
    unsure: f64,
}

impl Goal {
    fn still(end: Angles, at: Nanos) -> Self {
        let (rate, last) = ([0.0; 2], [0.0; 2]);
        Self { from: end, expected: end, end, rate, last, at, for_s: 0.0, unsure: 0.0 }
    }

    fn unsure_after(&self, age_s: f64) -> f64 {
        self.unsure * (1.0 - age_s / self.for_s).max(0.0)
    }

    fn after(&self, age_s: f64) -> Angles {
        plus(self.from, self.rate, age_s.min(self.for_s))
    }
}

/// How a client is coupled to the snake.
#[derive(Debug, Clone, Copy)]
enum Coupling {
    Absolute,
    Open,
    Relative { master: Angles, snake: Angles },
}

pub struct Expected {
    pub what: What,
    wire: Wire,
    scale: f64,
    /// Degrees, or mm.
    first_step: f64,
    pub step: f64,
    tremor_gain: f64,
    lead_s: f64,
    coupling: (u64, Coupling),
    smooth: Option<Angles>,
    velocity: Angles,
}

impl Expected {
    pub fn new(config: &Config, wire: Wire) -> Self {
        let command = &config.command;
        // A tip position is compared in counts.
        let steps = match wire {
            Wire::Place => [first_step_counts(command), f64::from(command.max_step_counts)]
                .map(|counts| 2.0 * GAIN_DEG * LARGEST_GAIN * counts),
            _ => [command.first_step_deg, command.max_step_deg],
        };
        let delay_s = command.tremor_filter_delay_s().unwrap_or(0.0);
        let mut expected = Self {
            what: What::Nothing,
            scale: command.motion_scale,
            wire,
            first_step: steps[0],
            step: steps[1],
            tremor_gain: 1e-3 / (1e-3 + delay_s),
            lead_s: 1e-3 * config.compensation.lead_ms,
            coupling: (0, Coupling::Open),
            smooth: None,
            velocity: [0.0; 2],
        };
        expected.coupling.1 = expected.uncoupled();
        expected
    }

    fn uncoupled(&self) -> Coupling {
        if self.scale == 1.0 { Coupling::Absolute } else { Coupling::Open }
    }

    /// A command was accepted in the tick of this report; the snake was at `snake` before it.
    /// `pose`: the goal in degrees, or its rate.
    pub fn accept(
        &mut self,
        command: &ServoCommand,
        pose: Angles,
        snake: Angles,
        report: &CycleReport,
    ) {
        if let ServoGoal::Actuator(counts, _) = command.goal {
            self.what = What::Counts([[counts[0].as_f64(), counts[1].as_f64()]; 2]);
            return;
        }
        let is_first = !matches!(self.what, What::Goal(_) | What::Rate { .. });
        if command.client_id != self.coupling.0 || is_first && self.scale != 1.0 {
            self.coupling = (command.client_id, self.uncoupled());
        }
        if command.clutched {
            self.coupling.1 = Coupling::Open;
            self.what = What::Nothing;
            return;
        }
        let is_slow = matches!(command.goal, ServoGoal::Interpolated(..));
        let deadline_s = if is_slow { 0.25 } else { 0.05 };
        if let ServoGoal::Rate(..) | ServoGoal::TipRate(..) = command.goal {
            let rate = pose.map(|rate| self.scale * rate);
            self.what = What::Rate { rate, at: command.stamp, deadline_s };
            return;
        }
        if let Coupling::Open = self.coupling.1 {
            self.coupling.1 = Coupling::Relative { master: pose, snake };
        }
        let end = match self.coupling.1 {
            Coupling::Relative { master, snake } => {
                plus(snake, plus(pose, master, -1.0), self.scale)
            }
            _ => pose,
        };
        let next = self.next(end, command.stamp, snake, is_slow);
        let next = self.clipped(next, report, is_slow);
        // A goal moved by a region is not the one that was sent.
        if report.limited_by_fixture.is_none() {
            self.require_step(&next, snake);
        }
        self.what = What::Goal(next);
    }

    /// The goal advances by a step or starts at the snake. A goal that returns from beyond a limit
    /// moves no further than the hand, except for the first step of a stream. A tip goal is
    /// compared in counts, so its unreachable part is not a step.
    fn require_step(&self, next: &Goal, snake: Angles) {
        let is_place = matches!(self.wire, Wire::Place);
        let next = if is_place { &Goal { expected: next.end, ..*next } } else { next };
        let (step, most) = match self.what {
            What::Goal(before) if is_place && before.expected != before.end => {
                (distance(next.end, before.end), self.step + self.first_step)
            }
            What::Goal(before) if before.expected == before.end => {
                (distance(next.expected, before.expected), self.step)
            }
            What::Goal(before) => {
                let age_s = next.at.duration_since(before.at).as_seconds();
                let most = distance(next.expected, before.expected) + self.first_step;
                // It moves towards the clipped goal, and the same goal is sent again.
                let step = distance(next.end, before.after(age_s));
                let step = step.min(distance(next.end, before.end));
                (step, most + before.unsure_after(age_s))
            }
            What::Rate { rate, deadline_s, .. } => {
                (distance(next.expected, snake), self.step + self.led(rate, deadline_s))
            }
            _ => (distance(next.expected, snake), self.first_step),
        };
        assert!(step <= most + STEP_DEG, "{step} deg, {most}: {next:?} after {:?}", self.what);
    }

    /// Maximum distance of the goal from the snake when a rate ends.
    fn led(&self, rate: Angles, deadline_s: f64) -> f64 {
        3.0 * deadline_s * distance(rate, [0.0; 2]) + self.first_step
    }

    fn next(&self, end: Angles, stamp: Nanos, snake: Angles, is_slow: bool) -> Goal {
        let still = Goal::still(end, stamp);
        if is_slow {
            let age_s = |at: Nanos| stamp.duration_since(at).as_seconds();
            let (from, for_s, unsure) = match self.what {
                What::Goal(before) => {
                    let age_s = age_s(before.at);
                    (before.after(age_s), age_s, before.unsure_after(age_s))
                }
                What::Rate { rate, at, deadline_s } => {
                    (snake, age_s(at), self.led(rate, deadline_s))
                }
                _ => (snake, FIRST_LINE_S, 0.0),
            };
            let for_s = for_s.clamp(MIN_LINE_S, 0.25);
            let rate = plus(end, from, -1.0).map(|way| way / for_s);
            return Goal { from, rate, for_s, unsure, ..still };
        }
        let What::Goal(before) = self.what else { return still };
        let interval_s = stamp.duration_since(before.at).as_seconds();
        if interval_s == 0.0 || interval_s > MAX_EXTRAPOLATION_S {
            return still;
        }
        let last = plus(end, before.from, -1.0).map(|way| way / interval_s);
        let lesser = |at: usize| {
            let (a, b) = (last[at], before.last[at]);
            if a * b <= 0.0 { 0.0 } else { a.abs().min(b.abs()).copysign(a) }
        };
        Goal {
            rate: [lesser(0), lesser(1)],
            last,
            for_s: (2.0 * interval_s).min(MAX_EXTRAPOLATION_S),
            ..still
        }
    }

    /// The goal after clipping. Others check what clipped it.
    fn clipped(&self, goal: Goal, report: &CycleReport, is_slow: bool) -> Goal {
        // A goal that returns from there advances step by step.
        let was_cut = matches!(&self.what, What::Goal(before) if before.expected != before.end);
        let is_cut = (report.clipped || was_cut) && report.limited_by_fixture.is_none();
        let Some(joint) = report.joint.filter(|_| is_cut) else { return goal };
        let end = self.wire.angles(joint.goal);
        if !is_slow {
            // Between two commands it may continue as it moved to this one.
            let unsure = match &self.what {
                What::Goal(before) if was_cut => distance(end, before.end),
                _ => 0.0,
            };
            let still = Goal { for_s: MAX_EXTRAPOLATION_S, unsure, ..Goal::still(end, goal.at) };
            return Goal { expected: goal.expected, ..still };
        }
        let rate = plus(end, goal.from, -1.0).map(|way| way / goal.for_s);
        Goal { end, rate, ..goal }
    }

    /// The goal of this tick: as expected, and filtered and led. `None` without a goal.
    pub fn goals(&mut self, now: Nanos, snake: Angles) -> Option<[Angles; 2]> {
        let here = match &self.what {
            What::Goal(goal) => goal.after(now.duration_since(goal.at).as_seconds()),
            What::Pose(end) => *end,
            _ => {
                self.smooth = None;
                return None;
            }
        };
        let smooth = self.smooth.unwrap_or_else(|| {
            self.velocity = [0.0; 2];
            snake
        });
        let next = plus(smooth, plus(here, smooth, -1.0), self.tremor_gain);
        let moved = match &self.what {
            _ if self.tremor_gain < 1.0 => plus(next, smooth, -1.0).map(|way| 1e3 * way),
            What::Goal(goal) if now.duration_since(goal.at).as_seconds() <= goal.for_s => goal.rate,
            _ => [0.0; 2],
        };
        self.velocity = plus(self.velocity, plus(moved, self.velocity, -1.0), 1.0 / 11.0);
        self.smooth = Some(next);
        Some([here, plus(next, self.velocity, self.lead_s)])
    }

    /// The rate of this tick, and the maximum lead of its goal over the snake.
    pub fn rate(&self, now: Nanos) -> Option<(Angles, f64)> {
        let What::Rate { rate, at, deadline_s } = self.what else { return None };
        let rate = if now.duration_since(at).as_seconds() < deadline_s { rate } else { [0.0; 2] };
        Some((rate, self.first_step + deadline_s * distance(rate, [0.0; 2])))
    }
}
