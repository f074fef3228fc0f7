//! The core of the controller: one pure function, [`cycle::ControlCycle::step`], per tick.
//!
//! The core has no clock, no I/O, no locks and no threads, and it allocates nothing after its
//! construction. Clippy enforces this: see `clippy.toml`. The process around it is in
//! `crate::process`.
//!
//! From the bottom up; a part uses only parts above it in this list:
//!
//! - `vector`: arithmetic on small arrays.
//! - `inputs`, `outputs`, `event`: what the cycle reads and writes.
//! - `drive_status`: status of the drives in one tick.
//! - `faults`: `fault_detection`, `following_error`, `over_current`, `overrun` (late ticks),
//!   `plausibility`, `debounce`.
//! - `motion`: from a goal to the setpoints of the motors, by `goal_extrapolation`,
//!   `tremor_filter`, `joint_limits`, `virtual_fixtures`, `backlash_dead_band`, `velocity_limit`
//!   and `jerk_limit`;
//!   `joint_trajectory` of `move_jp`; `conditioning`; `axis_control` of one motor.
//! - `joint_space`: `joint_model`, a model with its memory; `inverse_setpoint`; `model_blend`;
//!   `position_history`.
//! - [`adaptation`]: follows the drift of a calibration by the camera, inside fences.
//! - `model_slots`: the loaded models, `model_swap`, `rollback`.
//! - `command`: `admission` of servo commands, `refusal_record`, `sequence_record`, `lease`,
//!   `deadline`, `range_check`, `clutch`, `motion_scaling`.
//! - `states`: `control_state`, `state_machine`, `command_transitions`, `automatic_transitions`,
//!   `homing`, `acknowledge`, `shutdown`.
//! - `setpoint_generation`: moves all setpoints by one tick, as the state says.
//! - [`cycle`]: one tick, inputs to outputs, with `cycle_commands`, `cycle_events`
//!   and `cycle_excess`.
//!   `snapshot`: its state between two ticks, for the black box. [`simulated_loop`], [`rehearsal`]:
//!   the cycle without a robot.
//!
//! # States
//!
//! ```text
//!                            enable                   all drives enabled
//!             +--- DISABLED -------> DISABLED (enabling) ------------> ENABLED <---------+
//!        home |     ^    ^                   | disable                 |    | pause      | resume
//!             v     |    |                   v                 disable |    v            |
//!   DISABLED (homing)    +------ DISABLED (powering off) <--+          |  PAUSED --------+
//!                                            ^              |          v    | disable
//!                                acknowledge |              +-- DISABLED (stopping, settling)
//!                                          FAULT <--- any state, when a fault is detected
//! ```
//!
//! A state in parentheses is reported as DISABLED and busy. ENABLED is reported only while every
//! drive is on and none has the demand to switch off.
//!
//! | command | DISABLED | DISABLED, busy | ENABLED | PAUSED | FAULT | FAULT, busy |
//! |---|---|---|---|---|---|---|
//! | `enable` | enabling (1) | Busy | State | State | State | State |
//! | `disable` | no change | powering off (2) | stopping | stopping | drives off | no change |
//! | `pause` | State | Busy | PAUSED | no change | State | State |
//! | `resume` | State | Busy | State | ENABLED, holding | State | State |
//! | `home` | homing (3) | Busy | State | State | State | State |
//! | `unhome` | zero invalid | Busy | State | State | State | State |
//! | `condition` | State | Busy | conditioning cycle, busy (6) | State | State | State |
//! | `acknowledge` | State | State | State | State | (4) | Busy |
//! | `hold` | State | Busy | holding | no change | State | State |
//! | `move` | State | Busy | trajectory, busy (7) | State | State | State |
//! | `release` | (5) | (5) | (5), holding | (5) | (5) | (5) |
//! | `fixture` | (8) | (8) | (8) | (8) | (8) | (8) |
//!
//! Busy, State and other words with a capital are [`Refusal`](crate::robot::Refusal)s. A client id
//! of 0 is refused as Malformed. During shutdown, commands that would start something are refused
//! with State. Commands that stop (`disable`, and `pause` of a robot that is on) are never refused,
//! and repeating them is no error.
//!
//! 1. DrivesNotReady unless every drive is in phase Disabled with a fresh position. NotHomed unless
//!    every axis has a valid zero: without it, position limits mean nothing, here and in the drive.
//!    Range if a motor is outside its position limits, because a drive clamps its target to them.
//! 2. No change from stopping, settling and powering off: it is in progress.
//! 3. DrivesNotReady as for `enable`. The drive does the homing itself: a counter is raised, and
//!    the drive answers with it.
//! 4. CausePersists unless every drive reports a fresh position and is off, at fault or in quick
//!    stop, and the model gives finite values. If a drive is at fault, its reset counter is raised
//!    and FAULT stays, busy, until the drive has left its fault. After 1 s the fault is latched
//!    again. Then DISABLED, powering off.
//! 5. The lease becomes free; Lease if another client holds it. The robot holds if the client was
//!    being followed.
//! 6. Busy during a conditioning cycle or a trajectory; NotHomed and DrivesNotReady as for servo
//!    commands; Lease if another client holds it, because conditioning is motion; Range if the
//!    position limits leave less room than the model needs to forget. The robot stops following the
//!    present command. Servo commands are refused with Busy until the cycle has ended, where it
//!    began, and the robot holds. `pause`, `disable`, a fault, positions that are not fresh and a
//!    lost zero end it at once.
//! 7. By the request `move_jp`. Refused in this order: Busy, NotHomed and DrivesNotReady as for
//!    (6), Malformed without a pose, NoModel, Malformed with a wrong number of entries, Unsupported
//!    for a model of the tip position, NotFinite, Busy while a setpoint moves, Lease if another
//!    client holds it. A pose outside the hull is clipped to it and reported. Otherwise as (6):
//!    servo commands are refused with Busy meanwhile, and the same events end it. There is no
//!    time-out: the trajectory ends at rest after a time that is known when it starts, at most
//!    [`LONGEST_MOVE`] (Range for a longer one), and a client that dies
//!    after its request has asked for nothing that it must go on confirming. `hold`, `pause` and
//!    `disable` of any client end it.
//! 8. By the request `virtual_fixture`. Malformed without a change. Switching on and adding is
//!    allowed to every client at any time: it makes motion less. Switching off and removing: Lease
//!    if another client holds it, Busy while a goal in joint space is followed. Range when there is
//!    no place for one more. While fixtures count, servo commands in counts and `condition` are
//!    refused with Fixture, and `move` if its line meets one.
//!
//! # Faults and the reaction of the drives
//!
//! | condition | fault | detected in |
//! |---|---|---|
//! | phase Faulted | Drive | every state |
//! | phase Lost, or newest position older than `feedback_lost_ms` | Link | every state |
//! | phase Starting | Link | every state but DISABLED, idle or powering off |
//! | last written setpoint and encoder too far apart | FollowingError | while the drive follows |
//! | any other phase than Enabled | DriveState | ENABLED, PAUSED, stopping, settling |
//! | enabling, powering off: 3 s; homing: 30 s | DriveTimeout | DISABLED, busy |
//! | homing ended without a zero | Homing | homing |
//! | model not finite | Model | every state |
//! | `overrun_ticks` within `overrun_window_ms` | Late | on |
//! | camera and model apart, in all frames of `debounce_ms` | Implausible | on, memory known |
//! | current above `over_current_ma` for `over_current_ms` | Current | while the drive follows |
//!
//! The reaction is the mildest that does not depend on what has just failed.
//!
//! - **A drive that works holds.** Without power the wires lose their tension, and tissue can push
//!   the snake. So the drive gets a quick stop, which needs neither this loop nor the line once it
//!   has begun.
//! - **The drive that is the cause is switched off.** A drive that reports a fault has switched
//!   itself off. A motor that cannot follow or takes too much current is blocked or pulls on
//!   something; holding would go on pulling with the whole current limit. A drive that left its
//!   state by itself cannot be trusted with power. The gear hardly turns backwards, so the snake
//!   stays about where it is, only softer.
//! - **A drive that does not answer** has held its last target since its last answer, because its
//!   serial line is not known to have a watchdog. It gets a quick stop in case it still receives.
//! - Without power (enabling, homing) it stays off. A drive that does not reach its quick stop
//!   within 3 s is switched off. `disable` and `acknowledge` switch all drives off: after a fault
//!   no drive gets a demand to move.
//!
//! Milder than FAULT: with a position older than `feedback_stale_ms`, or an axis that has lost its
//! zero, the robot slows down and holds. Servo commands are refused. The robot moves again with the
//! first valid command afterwards.
//!
//! # Motion
//!
//! A command is followed until it is older than its deadline. Then the setpoints slow down with the
//! stop deceleration and hold. At the default limits and 1 kHz, the last setpoint that moves is in
//! the tick that detects the stale command, and the first at rest is one tick later. The next valid
//! command moves on from there.
//!
//! Angles are inverted in every tick, clamped to the position limits of the axes, limited per motor
//! and rounded. `goal_extrapolation` defines what happens between commands, `velocity_limit` what
//! the limits guarantee. Together: motion within the limits is followed without lag behind the
//! commands, at every command rate above 50 Hz. The path of the limiter towards a *step* is not
//! checked against the calibrated hull, only its end is: motors with unequal distances do not move
//! on a straight line.
//!
//! A drive that is off or not yet enabled has its own position as setpoint. When it reports to be
//! enabled, its setpoint starts where the drive holds, at the target that was preloaded, and at
//! rest.

// Not in tests, which may allocate.
#![cfg_attr(
    not(test),
    deny(clippy::disallowed_macros, clippy::disallowed_methods, clippy::disallowed_types)
)]

pub mod adaptation;
pub mod cycle;
pub mod rehearsal;
pub mod simulated_loop;

mod clip_events;
mod command;
mod cycle_commands;
mod cycle_events;
mod cycle_excess;
mod drive_status;
mod event;
mod event_fold;
mod faults;
mod inputs;
mod joint_space;
mod model_slots;
mod motion;
mod outputs;
mod setpoint_generation;
mod snapshot;
mod states;
mod vector;

pub use command::admission::{AdmissionContext, CommandAdmission, CommandCheck};
pub use command::deadline::stale_age;
pub use command::move_planning::LONGEST_MOVE;
pub use command::refusal_record::{ClientRefusals, REFUSED_CLIENTS};
pub use event::{CycleEvent, CycleEventKind, EventList};
pub use faults::plausibility::PlausibilityCheck;
pub use inputs::{
    CycleInputs, ExternalPose, ModelChange, ModelSwapRequest, ServoCommand, ServoGoal, StateRequest,
};
pub use joint_space::position_history::HistoryCursor;
pub use model_slots::{CandidateState, ModelCandidate};
pub use motion::velocity_limit;
pub use motion::virtual_fixtures::{FixtureChange, FixtureSpace, SimpleRegion, SimpleShape};
pub use outputs::{CycleOutputs, CycleReport, JointReport, ModelSlots, ModelSwapReply, StateReply};
pub use snapshot::CycleSnapshot;
