//! The streamed commands, and the camera frames between them.

use i2ris::model::kinematic::{TipPosition, tip_position};

use super::*;

/// Age of every other command when stamps run backwards.
const DISORDER_MS: u64 = 40;

impl Situation {
    pub(super) fn see(&mut self) {
        let is_due = (self.bench.now.0 / 1_000_000).is_multiple_of(33);
        if let Some((shift, rate)) = &mut self.camera
            && is_due
        {
            let at = self
                .oracle
                .snake
                .pose(self.bench.drives.each_ref().map(|drive| drive.feedback.position.as_f64()));
            shift[0] = (shift[0] + 0.033 * *rate).clamp(-3.0, 3.0);
            self.bench.external = Some(camera_frame(
                self.bench.now,
                self.wire.outputs([at[0] + shift[0], at[1] + shift[1]]),
            ));
        }
    }

    pub(super) fn stream(&mut self) {
        self.follow_route();
        if let Some(next) = self.hand.pop_front() {
            self.goal = next;
        }
        for (goal, rate) in self.goal.iter_mut().zip(&mut self.rate) {
            *goal += *rate * self.period as f64 * 1e-3;
            if goal.abs() > 9.0 {
                *rate = -*rate;
            }
        }
        self.bench.clutched = self.clutched;
        if let Some(kinds) = &mut self.kinds
            && kinds.one_in(100)
        {
            let kinds_of = if self.rates_only { &RATES[..] } else { &KINDS[..] };
            self.kind = kinds_of[kinds.below(kinds_of.len() as u64) as usize];
        }
        let ([pitch, yaw], [pitch_rate, yaw_rate]) = (self.goal, self.rate);
        let [angles, rates] = [self.output([pitch, yaw]), self.output([pitch_rate, yaw_rate])];
        let TipPosition { position_m, .. } = tip_position(angles[0], angles[1]);
        let [by_pitch, by_yaw] = {
            let [pitch, yaw, _] = self.bench.joints().setpoint;
            tip_position(pitch, yaw).slope_m_per_rad
        };
        let velocity = [0, 1, 2].map(|at| by_pitch[at] * rates[0] + by_yaw[at] * rates[1]);
        let is_led = !self.route.is_empty() || !self.hand.is_empty();
        let kind = if is_led { Kind::Angles } else { self.kind };
        let goal = match kind {
            Kind::Angles => ServoGoal::Joint(angles, 2),
            Kind::Interpolated => ServoGoal::Interpolated(angles, 2),
            Kind::Rate => ServoGoal::Rate(rates, 2),
            Kind::Tip => ServoGoal::Tip(position_m, 3),
            Kind::TipRate => ServoGoal::TipRate(velocity, 3),
        };
        let mut command = self.bench.servo(goal);
        let is_late = self.random.one_in(2);
        let mut late = if is_late { self.random.below(self.jitter) } else { 0 };
        if self.is_out_of_order && RATES.contains(&kind) {
            late = DISORDER_MS * (command.sequence % 2);
        }
        command.stamp = command.stamp - Nanos::from_millis(late);
        self.send(command);
    }

    /// One tick with a command, checked like any other; the first of a stream also for its start.
    pub(super) fn send(&mut self, command: ServoCommand) {
        let before = self.bench.joints();
        let refusal = self.bench.send(command);
        self.judge(&command, refusal);
        if refusal == Refusal::None {
            let pose = self.pose_of(&command);
            let snake = self.wire.angles(before.setpoint);
            self.oracle.path.expected.accept(&command, pose, snake, self.bench.report());
            let is_slow = matches!(command.goal, ServoGoal::Interpolated(..));
            self.oracle.accepted(command.stamp, Nanos::from_millis(if is_slow { 250 } else { 50 }));
            self.oracle.in_hull = !matches!(command.goal, ServoGoal::Actuator(..));
        } else if refusal == Refusal::StreamInterrupted && self.random.one_in(10) {
            self.quiet = BREAK.0 / 1_000_000 + 1;
        } else if refusal == Refusal::StepTooLarge && self.random.one_in(3) {
            self.goal = self.wire.angles(before.setpoint);
        }
        self.check();
    }

    /// Goal of a command, degrees or degrees per second.
    fn pose_of(&self, command: &ServoCommand) -> [f64; 2] {
        match command.goal {
            ServoGoal::Tip(..) => self.goal,
            ServoGoal::TipRate(..) => self.rate,
            ServoGoal::Joint(pose, _)
            | ServoGoal::Interpolated(pose, _)
            | ServoGoal::Rate(pose, _) => self.wire.angles(pose),
            ServoGoal::Actuator(..) => [0.0; 2],
        }
    }

    /// Whether its sender may command at all.
    pub(super) fn judge(&mut self, command: &ServoCommand, refusal: Refusal) {
        let now = self.bench.now;
        self.judge_motion(command.client_id, refusal);
        let at = usize::from(command.client_id != CLIENT);
        let goes_on = self.begun[at] == Some(false) && !command.clutched;
        assert!(refusal != Refusal::None || !goes_on, "motion without a session");
        let of_state = [Refusal::NotEnabled, Refusal::Paused, Refusal::InFault].contains(&refusal);
        if of_state || refusal == Refusal::None {
            self.begun[at] = Some(!of_state);
        }
        // An open clutch counts as silence.
        if !command.clutched {
            self.sent[at] = now;
        }
        if refusal == Refusal::None {
            let has_lease = |(client_id, renewed): (u64, Nanos)| {
                client_id == command.client_id || now.duration_since(renewed) >= LEASE
            };
            assert!(self.leader.is_none_or(has_lease), "two commanders");
            self.leader = Some((command.client_id, now));
        }
    }

    /// A known client needs a new session after a stop. Its stream resumes after its own `hold`
    /// only if it was silent.
    pub(super) fn note_session(&mut self, client_id: u64, command: StateCommand) {
        let now = self.bench.now;
        if command.only_stops() {
            self.begun = self.begun.map(|begun| begun.map(|_| false));
        }
        if client_id < THIRD {
            let at = usize::from(client_id != CLIENT);
            let is_silent = now.duration_since(self.sent[at]) >= BREAK;
            let may = !command.only_stops() || command == StateCommand::Hold && is_silent;
            self.begun[at] = Some(may);
        }
    }

    /// Checks that a client moves nothing while another holds, or has a motion in progress.
    pub(super) fn judge_motion(&mut self, client_id: u64, refusal: Refusal) {
        let (at, now) = (usize::from(client_id != CLIENT), self.bench.now);
        let since = self.held[at].map(|held| now.duration_since(held.max(self.sent[at])));
        let is_held = since.is_some_and(|silent| silent < BREAK);
        assert!(refusal != Refusal::None || !is_held, "a held client moves the snake");
        // A silence ends the hold, even if the first command after it is refused.
        self.held[at] = self.held[at].filter(|_| is_held);
        let is_anothers = self.mover.is_some_and(|mover| mover != client_id);
        assert!(refusal != Refusal::None || !is_anothers, "in the motion of another client");
    }
}
