//! Conversion of the controller's messages to those of ROS, and times of states. Without I/O.
//!
//! The state is published on change. A motion by `move_jp` is two messages, busy and then not busy,
//! also when its path has no length: CRTK's client waits for both.

use i2ris::ipc::payload::{JointState as Payload, OperatingStateMsg, PeriodStatistics};
use i2ris::robot::OperatingState;
use i2ris::units::Nanos;
use i2ris_report::snake::{Bend, Snake};

use crate::clock::Moment;
use crate::message::{
    Header, IntervalStatistics, JOINTS, JointState, MultiArray, MultiArrayDimension, Pose,
    PoseStamped, Transforms, TwistStamped,
};

/// Values older than this are not valid: the controller is gone or hangs.
const FRESH: Nanos = Nanos::from_millis(200);

fn valid<'a>(state: Option<&'a Payload>, now: &Moment) -> Option<&'a Payload> {
    state.filter(|state| {
        state.flags & Payload::VALID != 0
            && (1..=JOINTS.len()).contains(&(state.count as usize))
            && now.monotonic.duration_since(Nanos(state.stamp_ns)) < FRESH
    })
}

fn header(state: Option<&Payload>, now: &Moment, frame_id: &str) -> Header {
    Header::new(state.map_or(0, |state| now.unix_ns_at(Nanos(state.stamp_ns))), frame_id)
}

/// Angles and their velocities. Without valid ones: stamp 0 and no values.
pub(super) fn joint_state(state: Option<&Payload>, now: &Moment) -> JointState {
    let state = valid(state, now);
    let count = state.map_or(0, |state| state.count as usize);
    let values = |of: fn(&Payload) -> &[f64]| {
        let all = state.map_or(&[][..], of);
        all.get(..count).unwrap_or_default().to_vec()
    };
    JointState {
        header: header(state, now, ""),
        name: JOINTS.map(str::to_owned).to_vec(),
        position: values(|state| &state.position),
        velocity: values(|state| &state.velocity),
        effort: Vec::new(),
    }
}

/// The auxiliary axis. Its velocity is not known.
pub(super) fn jaw(state: &Payload, now: &Moment) -> JointState {
    let state = valid(Some(state), now);
    JointState {
        header: header(state, now, ""),
        name: vec!["jaw".to_owned()],
        position: state.map(|state| state.position[0]).into_iter().collect(),
        ..JointState::default()
    }
}

fn bend(state: &Payload) -> Bend {
    let given = state.count as usize;
    let angle = |joint| if joint < given { state.position[joint] } else { 0.0 };
    Bend { pitch: angle(0), yaw: angle(1) }
}

/// The tip in the frame of the base. Without valid angles: stamp 0.
pub(super) fn tip(snake: &Snake, state: Option<&Payload>, now: &Moment) -> PoseStamped {
    let state = valid(state, now);
    let pose = state.map_or_else(Pose::default, |state| snake.tip_pose(bend(state)).into());
    PoseStamped { header: header(state, now, &snake.base()), pose }
}

/// The velocity of the tip in the frame of the base. Without valid angles: stamp 0.
pub(super) fn twist(snake: &Snake, state: Option<&Payload>, now: &Moment) -> TwistStamped {
    let state = valid(state, now);
    let velocity = state.map_or([0.0; 6], |state| {
        let [pitch, yaw, _] = state.velocity;
        snake.jacobian(bend(state)).map(|[by_pitch, by_yaw]| by_pitch * pitch + by_yaw * yaw)
    });
    let [x, y, z, about_x, about_y, about_z] = velocity;
    TwistStamped {
        header: header(state, now, &snake.base()),
        linear: [x, y, z].into(),
        angular: [about_x, about_y, about_z].into(),
    }
}

/// Linear and angular velocity of the tip by that of the joints, by rows; `None` without angles.
pub(super) fn jacobian(snake: &Snake, state: Option<&Payload>, now: &Moment) -> Option<MultiArray> {
    let jacobian = snake.jacobian(bend(valid(state, now)?));
    let (rows, columns) = (jacobian.len() as u32, jacobian[0].len() as u32);
    let dimension =
        |label: &str, size, stride| MultiArrayDimension { label: label.to_owned(), size, stride };
    Some(MultiArray {
        dim: vec![dimension("rows", rows, rows * columns), dimension("cols", columns, columns)],
        data_offset: 0,
        data: jacobian.concat(),
    })
}

/// Timing of the control loop; NaN for values that the controller does not count.
pub(super) fn statistics(of: &PeriodStatistics, now: &Moment) -> IntervalStatistics {
    let seconds = |ns: u64| Nanos(ns).as_seconds();
    IntervalStatistics {
        header: Header::new(now.unix_ns_at(Nanos(of.stamp_ns)), ""),
        period_avg: seconds(of.window_ns) / of.ticks.max(1) as f64,
        period_std_dev: f64::NAN,
        period_min: f64::NAN,
        period_max: seconds(of.period.max_ns),
        compute_time_avg: f64::NAN,
        compute_time_std_dev: f64::NAN,
        compute_time_min: f64::NAN,
        compute_time_max: seconds(of.compute.max_ns),
        number_of_samples: of.ticks as i64,
        number_of_overruns: of.missed as i64,
        statistics_interval: seconds(of.window_ns),
        user_data: 0,
    }
}

/// All links; `None` without valid angles: a frame with stamp 0 would be valid for all times.
pub(super) fn links(snake: &Snake, state: Option<&Payload>, now: &Moment) -> Option<Transforms> {
    let state = valid(state, now)?;
    let unix_ns = now.unix_ns_at(Nanos(state.stamp_ns));
    Some(Transforms::of_links(snake, bend(state), unix_ns))
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Snapshot {
    pub state: &'static str,
    pub homed: bool,
    pub busy: bool,
}

/// Without a controller, or with one of another release.
pub(super) const UNDEFINED: Snapshot = Snapshot { state: "UNDEFINED", homed: false, busy: false };

#[derive(Debug)]
pub(super) struct StateReport {
    pub published: Snapshot,
    /// A motion was requested, and is not answered yet: the busy flag may belong to it, and waits.
    requested: bool,
    moving: Option<Nanos>,
}

impl Default for StateReport {
    fn default() -> Self {
        Self { published: UNDEFINED, requested: false, moving: None }
    }
}

impl StateReport {
    pub fn state(&mut self, message: &OperatingStateMsg) -> Option<Snapshot> {
        let has = |flag| message.flags & flag != 0;
        let busy = has(OperatingStateMsg::BUSY);
        let Some(state) = OperatingState::from_number(message.state) else {
            return self.change(UNDEFINED);
        };
        self.moving = self.moving.filter(|since| busy || message.stamp_ns <= since.0);
        let busy = match (self.moving, self.requested) {
            (Some(_), _) => true,
            (None, true) => self.published.busy,
            (None, false) => busy,
        };
        self.change(Snapshot { state: state.text(), homed: has(OperatingStateMsg::HOMED), busy })
    }

    pub fn absent(&mut self) -> Option<Snapshot> {
        self.moving = None;
        self.change(UNDEFINED)
    }

    pub fn move_requested(&mut self) {
        self.requested = true;
    }

    /// Sets the start of the motion, or its refusal. An accepted motion is always published.
    pub fn move_answered(&mut self, since: Option<Nanos>) -> Option<Snapshot> {
        self.requested = false;
        let since = since?;
        self.moving = Some(since);
        self.published.busy = true;
        Some(self.published)
    }

    fn change(&mut self, next: Snapshot) -> Option<Snapshot> {
        let changed = next != self.published;
        self.published = next;
        changed.then_some(next)
    }
}

/// The stamp of the next message, Unix time. It rises also when the wall clock is set back: CRTK's
/// client ignores an operating state that is not newer than the last one.
pub(super) fn rising(last: u64, now: u64) -> u64 {
    now.max(last + 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::Time;

    const NOW: Moment =
        Moment { monotonic: Nanos(10_000_000_000), unix_ns: 1_795_000_000_000_000_000 };

    fn payload() -> Payload {
        Payload {
            stamp_ns: NOW.monotonic.0 - 1_000_000,
            position: [0.1, -0.2, 0.0],
            velocity: [1.0, 2.0, 0.0],
            count: 2,
            flags: Payload::VALID,
            ..Payload::default()
        }
    }

    #[test]
    fn stamp_is_the_wall_clock_time_of_the_values() {
        let message = joint_state(Some(&payload()), &NOW);
        let stamp = message.header.stamp.unix_ns().unwrap();
        assert_eq!(stamp, NOW.unix_ns - 1_000_000);
        assert_eq!(message.name, ["pitch", "yaw"]);
        assert_eq!(message.position, [0.1, -0.2]);
        assert_eq!(message.velocity, [1.0, 2.0]);
    }

    #[test]
    fn invalid_values_are_omitted_with_stamp_zero() {
        let not_valid = Payload { flags: 0, ..payload() };
        let old = Payload { stamp_ns: NOW.monotonic.0 - FRESH.0, ..payload() };
        let of_the_tip = Payload { count: 3, ..payload() };
        let snake = Snake::new("eye");
        for state in [None, Some(&not_valid), Some(&old), Some(&of_the_tip)] {
            let message = joint_state(state, &NOW);
            assert_eq!(message.header.stamp, Time::INVALID);
            assert!(message.position.is_empty() && message.velocity.is_empty());
            assert_eq!(tip(&snake, state, &NOW).header.stamp, Time::INVALID);
            assert_eq!(links(&snake, state, &NOW), None);
        }
    }

    #[test]
    fn stamps_rise_also_when_the_clock_is_set_back() {
        let mut last = 0;
        let found = [100, 100, 40, 41, 200].map(|now| {
            last = rising(last, now);
            last
        });
        assert_eq!(found, [100, 101, 102, 103, 200]);
    }

    fn message(ms: u64, busy: bool) -> OperatingStateMsg {
        OperatingStateMsg {
            stamp_ns: ms * 1_000_000,
            state: OperatingState::Enabled.number(),
            flags: OperatingStateMsg::HOMED | if busy { OperatingStateMsg::BUSY } else { 0 },
            ..OperatingStateMsg::default()
        }
    }

    fn busy(snapshot: Option<Snapshot>) -> Option<bool> {
        snapshot.map(|snapshot| snapshot.busy)
    }

    const fn at(ms: u64) -> Option<Nanos> {
        Some(Nanos::from_millis(ms))
    }

    fn enabled() -> StateReport {
        let mut report = StateReport::default();
        let first = report.state(&message(1, false)).unwrap();
        assert_eq!((first.state, first.homed, first.busy), ("ENABLED", true, false));
        assert_eq!(report.state(&message(2, false)), None, "nothing new");
        report
    }

    #[test]
    fn motion_that_ends_before_its_answer_is_one_pair() {
        let mut report = enabled();
        report.move_requested();
        assert_eq!(report.state(&message(5, true)), None, "waits for the answer");
        assert_eq!(report.state(&message(6, false)), None);
        assert_eq!(busy(report.move_answered(at(4))), Some(true));
        assert_eq!(busy(report.state(&message(7, false))), Some(false));
    }

    #[test]
    fn refused_motion_leaves_the_running_one_unchanged() {
        let mut report = enabled();
        report.move_requested();
        assert_eq!(report.move_answered(None), None);
        assert_eq!(report.state(&message(20, false)), None);
        report.move_requested();
        report.move_answered(at(30));
        report.move_requested();
        assert_eq!(report.move_answered(None), None, "busy");
        assert_eq!(report.state(&message(40, true)), None);
        assert_eq!(busy(report.state(&message(50, false))), Some(false));
    }
}
