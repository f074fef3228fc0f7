//! Streams out of the controller: joints, motors and state with every tick; adaptation; timing.

use iceoryx2::prelude::ZeroCopySend;

use super::definition::payload;
use crate::robot::{AxisPhase, KnownPower, REFUSED_CLIENTS, Refusal, Stop};
use crate::units::{MAX_MOTORS, MAX_OUTPUTS};

payload! {
    /// `measured_js`, `setpoint_js`, `goal_js`, out: angles.
    ///
    /// `measured_js` is the model's estimate from the encoders, `setpoint_js` the estimate at the
    /// setpoints, `goal_js` the requested goal, clipped to the calibrated hull. All three
    /// are invalid while no model is loaded.
    JointState "I2risJointStateV1": outgoing {
        /// Pitch and yaw, rad (x, y, z, m).
        pub position: [f64; MAX_OUTPUTS],
        /// Time derivative of `position`, per second.
        pub velocity: [f64; MAX_OUTPUTS],
        /// Standard deviation of `position`, by the law of total covariance. 0: not applicable.
        pub deviation: [f64; MAX_OUTPUTS],
        /// SHA-256 of the model that computed it.
        pub model_id: [u8; 32],
        /// Number of valid entries in the arrays.
        pub count: u32,
        /// Sum of [`JointState::VALID`], [`JointState::MEMORY_KNOWN`], [`JointState::CLIPPED`],
        /// [`JointState::FIXTURE`].
        pub flags: u32,
    }

    /// `actuators/measured_js`, out: state of the motors.
    ActuatorState "I2risActuatorStateV1": outgoing {
        /// Time of reading each encoder position. 0: never.
        pub measured_stamp_ns: [u64; MAX_MOTORS],
        /// Time of writing each setpoint to the operating system. 0: never.
        pub written_stamp_ns: [u64; MAX_MOTORS],
        /// [`stamp_ns`](super::ServoJp::stamp_ns) of the command that led to the written setpoint.
        /// 0: none.
        pub command_stamp_ns: [u64; MAX_MOTORS],
        /// [`sequence`](super::ServoJp::sequence) of the command that led to the written setpoint.
        pub command_sequence: [u64; MAX_MOTORS],
        /// Replies from each drive since the start.
        pub exchanges: [u64; MAX_MOTORS],
        /// Encoder positions, counts.
        pub measured_counts: [i32; MAX_MOTORS],
        /// Setpoints of this tick, counts.
        pub setpoint_counts: [i32; MAX_MOTORS],
        /// Setpoints written last, counts.
        pub written_counts: [i32; MAX_MOTORS],
        /// Motor currents, mA.
        pub current_ma: [i32; MAX_MOTORS],
        /// Statuswords (0x6041).
        pub statusword: [u16; MAX_MOTORS],
        /// Error codes (0x603F).
        pub error_code: [u16; MAX_MOTORS],
        /// Phase of each drive: [`AxisPhase`].
        pub phase: [u8; MAX_MOTORS],
        /// 0.
        pub reserved: [u8; 2],
        /// Number of valid entries in the arrays.
        pub count: u32,
    }

    /// `operating_state`, out: state of the controller and its reason.
    OperatingStateMsg "I2risOperatingStateV2": outgoing {
        /// Start of the present state.
        pub since_ns: u64,
        /// Client that commands by lease, move, conditioning cycle or homing; 0: none.
        pub lease_client_id: u64,
        /// Servo commands taken since the start.
        pub accepted: u64,
        /// Servo commands refused since the start.
        pub refused: u64,
        /// Number of times that a followed client exceeded its deadline.
        pub stale_stops: u64,
        /// [`crate::robot::OperatingState`].
        pub state: u32,
        /// [`crate::robot::Fault`]; of the last fault when the state is not FAULT.
        pub fault: u32,
        /// [`crate::robot::Refusal`] of the last refused command of any client. A client asks
        /// [`OperatingStateMsg::refusals_of`] for its own.
        pub last_refusal: u32,
        /// Sum of [`OperatingStateMsg::HOMED`] and the other flags.
        pub flags: u32,
        /// Clients whose servo commands were refused.
        pub refused_client_id: [u64; REFUSED_CLIENTS],
        /// Number of refused servo commands per client. 0: the entry is not in use.
        pub refused_commands: [u64; REFUSED_CLIENTS],
        /// [`crate::robot::Refusal`] of the last refused servo command, per client.
        pub refused_reason: [u32; REFUSED_CLIENTS],
    }

    /// `health`, out, once a second: what failed or was lost since the start of the controller. All
    /// 0 in a healthy one.
    Health "I2risHealthV1": outgoing {
        /// Failed calls into shared memory; a message was lost each time.
        pub ipc_failures: u64,
        /// Events not in the log: there were too many in one tick, or the log stalled.
        pub lost_events: u64,
        /// Ticks that are in no stream, because the thread of shared memory stalled.
        pub lost_reports: u64,
        /// Ticks and snapshots that are not in the black box, because it stalled.
        pub lost_records: u64,
        /// Replies to requests that were lost.
        pub lost_replies: u64,
        /// Requests to each drive without a reply in time.
        pub timeouts: [u64; MAX_MOTORS],
        /// Replies of each drive with a wrong CRC.
        pub crc_errors: [u64; MAX_MOTORS],
        /// Number of searches for a frame start, per drive.
        pub resynchronisations: [u64; MAX_MOTORS],
        /// Requests to each drive that were sent again.
        pub retries: [u64; MAX_MOTORS],
    }

    /// `events`, out: a line of the log, stamped when written; its text has the event's time.
    EventMsg "I2risEventV1": outgoing {
        /// The line, UTF-8, padded with 0; a longer one is truncated.
        pub text: [u8; 232],
    }
}

impl JointState {
    /// Flag: the values are valid.
    pub const VALID: u32 = 1;
    /// Flag: the hysteresis memory is known, so the estimate is on the right branch of the loop.
    pub const MEMORY_KNOWN: u32 = 2;
    /// Flag: the goal was outside the calibrated hull and was clipped to it.
    pub const CLIPPED: u32 = 4;
    /// Flag: a virtual fixture limited the goal.
    pub const FIXTURE: u32 = 8;
}

impl ActuatorState {
    /// The phase of a drive, in words.
    #[must_use]
    pub fn phase_text(&self, motor: usize) -> &'static str {
        let phase = self.phase.get(motor).and_then(|it| AxisPhase::from_number(u32::from(*it)));
        phase.map_or("unknown", AxisPhase::text)
    }
}

impl OperatingStateMsg {
    /// Number of refused servo commands of a client, and the reason of the last refusal. The number
    /// starts again after a second without one, if other clients need the entry.
    #[must_use]
    pub fn refusals_of(&self, client_id: u64) -> (u64, Refusal) {
        let clients = self.refused_client_id.iter().zip(&self.refused_commands);
        let entries = clients.zip(&self.refused_reason);
        let own =
            |((client, count), _): &((&u64, &u64), &u32)| **client == client_id && **count > 0;
        { entries }
            .find(own)
            .and_then(|((_, count), reason)| Some((*count, Refusal::from_number(*reason)?)))
            .unwrap_or((0, Refusal::None))
    }

    /// Power as reported by the drives.
    #[must_use]
    pub fn power(&self) -> KnownPower {
        match self.flags & (Self::OFF | Self::STOPPED) {
            0 => KnownPower::NotOff,
            Self::STOPPED => KnownPower::Stopped,
            _ => KnownPower::Off,
        }
    }

    /// Flag: every axis is homed.
    pub const HOMED: u32 = 1;
    /// Flag: a motion or a state transition is in progress.
    pub const BUSY: u32 = 2;
    /// Flag: a model is loaded.
    pub const MODEL: u32 = 4;
    /// Flag: the hysteresis memory is known.
    pub const MEMORY_KNOWN: u32 = 8;
    /// Flag: the robot holds because no fresh command is present.
    pub const HOLDING: u32 = 16;
    /// Flag: the goal was outside the calibrated hull and was clipped.
    pub const CLIPPED: u32 = 32;
    /// Flag: the loop runs under SCHED_FIFO, as read back.
    pub const FIFO: u32 = 64;
    /// Flag: memory is locked.
    pub const MEMORY_LOCKED: u32 = 128;
    /// Flag: the loop is pinned to one CPU, as read back.
    pub const PINNED: u32 = 256;
    /// Flag: a watchdog is running and holds every port.
    pub const WATCHED: u32 = 512;
    /// Flag: the pose is compared with a camera; see `plausibility` of the configuration.
    pub const COMPARED: u32 = 1024;
    /// Flag: a virtual fixture limited the goal; see [`super::VirtualFixturesMsg`].
    pub const FIXTURE: u32 = 2048;
    /// Flag: no setpoint moves, that of the auxiliary axis included.
    pub const AT_REST: u32 = 4096;
    /// Flag: every drive says that it has no power.
    pub const OFF: u32 = 8192;
    /// Flag: every drive says that it has no power, or that it is in quick stop.
    pub const STOPPED: u32 = 16384;
    /// Bit position of the [`Stop`] that interrupted a command's last activity.
    const BROKEN_OFF: u32 = 28;

    /// Interruption of the last enabling, homing, conditioning cycle or move, or of a later stream;
    /// `None`: it is running, or is complete.
    #[must_use]
    pub fn broken_off(&self) -> Option<Stop> {
        Stop::from_number(self.flags >> Self::BROKEN_OFF)
    }

    /// The same as flags.
    #[must_use]
    pub fn broken_off_by(stop: Option<Stop>) -> u32 {
        stop.map_or(0, Stop::number) << Self::BROKEN_OFF
    }
}

/// Regions at the same time.
pub const FIXTURES: usize = 8;

payload! {
    /// `virtual_fixtures`, out, once a second and after every change.
    VirtualFixturesMsg "I2risVirtualFixturesV1": outgoing {
        /// The regions that count: bit 0 for the first.
        pub active: u32,
        /// Number of the region that limited the goal last, from 1; 0: none did.
        pub limited_by: u32,
        /// [`crate::robot::FixtureKind`] of every region.
        pub kind: [u32; FIXTURES],
        /// The values of every region, rad or m, without the margin.
        pub values: [[f64; 17]; FIXTURES],
        /// Name of every region, UTF-8, padded with 0.
        pub name: [[u8; 24]; FIXTURES],
    }
}

payload! {
    /// `adaptation`, out, 50 times a second; once a second while the adaptation is off: the drift
    /// from the calibration that the camera shows.
    ///
    /// Arrays of 14 are in the order zero of both outputs (rad), gain of output 0 by outputs 0 and
    /// 1, of output 1 by outputs 0 and 1, gap growth of both motors, camera latency (s), slow state
    /// (rad), preload loss of both motors beyond the gap and growth of half the play of both gears
    /// (shares of half the calibrated range).
    AdaptationMsg "I2risAdaptationV2": outgoing {
        /// SHA-256 of the model whose drift it is.
        pub model_id: [u8; 32],
        /// Estimate from the camera.
        pub estimate: [f64; 14],
        /// Standard deviation of `estimate`.
        pub deviation: [f64; 14],
        /// Applied correction. The slow state is part of the zero; the latency is not applied.
        pub applied: [f64; 14],
        /// Share of the budget that `estimate` uses.
        pub budget_used: [f64; 14],
        /// Share of the total budget, at the corners of the calibrated hull.
        pub total_used: f64,
        /// Root mean square distance between camera and calibrated model in the last window of
        /// 10 s, rad. 0: no window yet.
        pub calibrated_error: f64,
        /// The same of the adapted model.
        pub adapted_error: f64,
        /// Frames since the start: learned from.
        pub frames_used: u64,
        /// Too far from what was expected.
        pub frames_refused: u64,
        /// In order, while nothing was learned.
        pub frames_paused: u64,
        /// Dropped frames: duplicate, out of sequence, from the future, too old, too frequent, bad.
        pub frames_dropped: [u64; 6],
        /// Number of reverted corrections.
        pub taken_back: u32,
        /// 0: none, 1: filter, 2: integral.
        pub method: u32,
        /// Why learning is paused: sum of `Pause` values; 0: learning.
        pub pauses: u32,
        /// Bit `i` is set if the motion shows entry `i` of `estimate`.
        pub excited: u32,
        /// [`AdaptationMsg::ON`], or 0.
        pub flags: u32,
        /// 0.
        pub reserved: u32,
    }
}

impl AdaptationMsg {
    /// Flag: the adaptation is on.
    pub const ON: u32 = 1;
}

payload! {
    /// Percentiles of durations, ns.
    SpanSummary "I2risSpanSummaryV1" {
        /// Median.
        pub p50_ns: u64,
        /// 90th percentile.
        pub p90_ns: u64,
        /// 99th percentile.
        pub p99_ns: u64,
        /// 99.9th percentile.
        pub p999_ns: u64,
        /// Largest.
        pub max_ns: u64,
    }

    /// `period_statistics`, out, once a second: timing of the control loop in the window that ends
    /// at its stamp.
    PeriodStatistics "I2risPeriodStatisticsV2": outgoing {
        /// Length of the window.
        pub window_ns: u64,
        /// Intended length of a tick.
        pub period_ns: u64,
        /// Ticks in the window.
        pub ticks: u64,
        /// Ticks skipped in the window because they were overdue.
        pub missed: u64,
        /// Ticks since the start.
        pub total_ticks: u64,
        /// Ticks skipped since the start.
        pub total_missed: u64,
        /// Time between the starts of two ticks.
        pub period: SpanSummary,
        /// Start of the tick after its planned instant.
        pub lateness: SpanSummary,
        /// Time that the cycle took.
        pub compute: SpanSummary,
        /// Setpoints a second for each axis that the slowest line allows while all axes move.
        pub line_setpoints_hz: f64,
        /// An exchange with a drive on the slowest line, as measured at start.
        pub line_exchange_ns: u64,
        /// Longest time until a stop reaches the last drive.
        pub line_stop_ns: u64,
        /// Age of a position at which the motion stops.
        pub line_stale_ns: u64,
        /// SCHED_FIFO priority as read back; 0: normal scheduling.
        pub priority: u32,
        /// CPU that the loop is pinned to, as read back; `u32::MAX`: not pinned.
        pub cpu: u32,
        /// 1: memory is locked.
        pub memory_locked: u32,
        /// 0.
        pub reserved: u32,
    }
}
