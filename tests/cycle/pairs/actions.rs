//! Actions of other clients, and the motion expected after them.

use super::*;

/// Conditioning stroke to both sides of the start, counts, unless the hull is wider.
const CONDITIONING: f64 = 300.0;

impl Situation {
    /// Another client commands, with a clock or a step of its own.
    pub(super) fn compete(&mut self) {
        let goal = [self.random.within(-9.0, 9.0), self.random.within(-9.0, 9.0)];
        let age = Nanos::from_millis(self.random.below(80));
        self.send_as_other(goal, age);
    }

    fn send_as_other(&mut self, goal: [f64; 2], age: Nanos) {
        self.sequence += 1;
        let goal = ServoGoal::Joint(self.output(goal), 2);
        let (client_id, sequence, stamp) = (OTHER, self.sequence, self.bench.now - age);
        let command = self.bench.servo(goal);
        self.send(ServoCommand { client_id, sequence, stamp, clutched: false, ..command });
    }

    pub(super) fn begin_in_counts(&mut self) {
        let near = [0, 1].map(|_| self.random.within(-24.0, 24.0) as i32);
        let [a, b] = self.bench.targets();
        let goal = ServoGoal::Actuator([Counts(a + near[0]), Counts(b + near[1])], 2);
        let command = self.bench.servo(goal);
        if self.zones_on && !self.zones.is_empty() {
            assert_ne!(self.bench.send(command), Refusal::None, "counts while fixtures count");
            self.check();
        } else {
            self.send(command);
        }
    }

    pub(super) fn change_zones(&mut self) {
        let new = Zone::draw(&mut self.random, self.wire);
        let changes = [
            FixtureChange::Add(new.request()),
            FixtureChange::SwitchOn,
            FixtureChange::SwitchOff,
            FixtureChange::RemoveAdded,
        ];
        let change = changes[self.random.below(4) as usize];
        let client_id = if self.random.one_in(2) { CLIENT } else { OTHER };
        if self.bench.change_fixtures(client_id, change) == Refusal::None {
            self.note_session(client_id, StateCommand::Fixture);
            match change {
                FixtureChange::Add(_) => {
                    self.zones.push(new);
                    self.zones_on = true;
                }
                FixtureChange::SwitchOn => self.zones_on = true,
                FixtureChange::SwitchOff => self.zones_on = false,
                FixtureChange::RemoveAdded => self.zones.truncate(self.configured),
            }
            let counting = if self.zones_on { &self.zones[..] } else { &[] };
            self.oracle.set_zones(&self.bench, counting);
        }
        self.check();
    }

    pub(super) fn swap(&mut self) {
        let gain = self.random.within(0.85, LARGEST_GAIN);
        let next = self.wire.model(gain, self.hull);
        if self.random.one_in(2) || self.next.is_none() {
            self.bench.offer(self.bench.candidate(&next));
            self.bench.tick();
            self.check();
            self.next = Some((next, gain));
        }
        let is_followed = self.oracle.is_followed(&self.bench);
        let holder = self.bench.report().lease_client_id;
        let client_id = if self.random.one_in(4) { OTHER } else { CLIENT };
        let staged = self.next.take_if(|_| !self.random.one_in(4));
        let change = match &staged {
            Some((next, _)) => ModelChange::Activate(next.id()),
            None => ModelChange::Rollback,
        };
        let refusal = self.bench.change_model_as(client_id, change, true);
        let [now, before] = self.gains;
        if refusal != Refusal::None {
            self.next = staged.or(self.next.take());
            self.check();
            return;
        }
        assert!(!is_followed || holder == client_id, "a swap during another client's stream");
        let is_anothers = self.mover.is_some_and(|mover| mover != client_id);
        assert!(!is_anothers, "a swap during another client's motion");
        self.gains = [staged.map_or(before, |(_, gain)| gain), now];
        let before = self.oracle.seen(&self.bench);
        self.oracle.snake.gain = self.gains[0] * GAIN_DEG;
        let until = self.bench.now + Nanos::from_millis(500);
        let by = distance(self.oracle.seen(&self.bench), before);
        self.oracle.reset_view(&self.bench);
        self.oracle.path.swapped(by, until);
        self.check();
    }

    pub(super) fn move_to(&mut self, client_id: u64) {
        let pose = [self.random.within(-9.0, 9.0), self.random.within(-9.0, 9.0)];
        self.bench.pose = Some((self.output(pose), 2));
        let refusal = self.ask_for_motion(client_id, StateCommand::Move, What::Pose(pose));
        let limits = self.oracle.limits;
        let is_cut = [0, 1].into_iter().any(|at| {
            limits.low.is_some_and(|low| pose[at] < low[at] - 0.01)
                || limits.high.is_some_and(|high| pose[at] > high[at] + 0.01)
        });
        assert!(refusal != Refusal::None || !is_cut, "a move beyond the joint limits");
    }

    /// Conditions as far as the hull, or as the model needs.
    pub(super) fn condition(&mut self) {
        let start = self.bench.targets().map(f64::from);
        let ends = [f64::min, f64::max].map(|end| {
            [0, 1].map(|motor: usize| {
                let from = end(start[motor] - CONDITIONING, start[motor] + CONDITIONING);
                self.hull.iter().fold(from, |at, corner| end(at, corner[motor]))
            })
        });
        self.ask_for_motion(CLIENT, StateCommand::Condition, What::Counts(ends));
    }

    pub(super) fn condition_after_a_stop(&mut self) {
        let _ = self.ask(CLIENT, StateCommand::Hold);
        for _ in 0..self.random.below(80) {
            self.see();
            self.tick();
        }
        self.is_streaming = false;
        self.condition();
    }

    /// Requests a motion, which is the expected one from now on if it is accepted.
    fn ask_for_motion(&mut self, client_id: u64, command: StateCommand, what: What) -> Refusal {
        let refusal = self.bench.ask_as(client_id, command).refusal;
        self.judge_motion(client_id, refusal);
        if refusal == Refusal::None {
            self.note_session(client_id, command);
            self.oracle.path.expected.what = what;
            self.mover = Some(client_id);
        }
        self.check();
        refusal
    }

    /// Another client stops the robot and enables motion again while the hand keeps moving.
    pub(super) fn go_on_through_a_stop(&mut self) {
        let by = if self.random.one_in(2) { OTHER } else { THIRD };
        let (stop, start) = match self.random.below(2) {
            0 => (StateCommand::Pause, StateCommand::Resume),
            _ => (StateCommand::Disable, StateCommand::Enable),
        };
        let _ = self.ask(by, stop);
        // Another client, possibly unknown, sends during the stop and after it.
        let joins = self.random.one_in(3);
        let ticks = if joins { LEASE.0 / 1_000_000 } else { self.random.below(200) };
        for tick in 0..ticks {
            self.see();
            match tick % 5 {
                0 => self.stream(),
                1 if joins => self.send_as_other(self.present(), Nanos::ZERO),
                _ => self.tick(),
            }
        }
        self.bench.idle();
        self.jaw.iter_mut().for_each(Jaw::begin);
        // A client that kept sending is refused.
        if self.ask(by, start) != Refusal::None {
            assert_eq!(self.ask(THIRD + self.bench.now.0, start), Refusal::None);
        }
        self.bench.until("enabled", |bench| bench.state() == OperatingState::Enabled);
        self.oracle.reset_view(&self.bench);
        self.jaw.iter_mut().for_each(Jaw::begin);
        self.check();
        // At the present pose, only its session can cause a refusal.
        if joins {
            self.send_as_other(self.present(), Nanos::ZERO);
        }
    }

    pub(super) fn disable_and_enable(&mut self) {
        let _ = self.ask(CLIENT, StateCommand::Disable);
        self.bench.idle();
        // A client that kept sending is refused.
        if self.ask(CLIENT, StateCommand::Enable) != Refusal::None {
            assert_eq!(self.ask(THIRD + self.bench.now.0, StateCommand::Enable), Refusal::None);
        }
        self.bench.until("enabled", |bench| bench.state() == OperatingState::Enabled);
        self.oracle.reset_view(&self.bench);
        self.jaw.iter_mut().for_each(Jaw::begin);
        // No client is followed, and nothing moves.
        self.check();
    }
}
