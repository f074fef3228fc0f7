//! The controller: a pure cycle, and the process around it.
//!
//! | file | holds |
//! |---|---|
//! | `cycle` | `step(now, inputs) -> outputs`: one tick, pure |
//! | `sight` | what the drives show in one tick, and what is wrong with it |
//! | `state` | the operating states and the one function that changes them |
//! | `table` | what every command does in every state |
//! | `progress` | what a state does by itself: time-outs, faults, arrivals |
//! | `gate` | servo commands: lease, sequence, stamp, deadline, and the order of all checks |
//! | `reach` | servo commands: model, range, step |
//! | `trend` | the goal between two commands |
//! | `aim` | from the goal to targets for the motors, by the inverse of the model |
//! | `stroke` | the decaying stroke of the command `condition` |
//! | `clutch` | clutch and motion scaling |
//! | `shape` | tremor filter, limits on the angles |
//! | `profile` | the way of `move_jp` |
//! | `limit` | velocity and acceleration limits on the set-point of one motor |
//! | `smooth` | the jerk limit: a mean over the last ticks |
//! | `axis` | the set-point of one motor, and what is asked of its drive |
//! | `load` | too many late ticks, too much current |
//! | `plausible` | whether the snake is where the model says |
//! | `joint` | joint space: the model, its memory, estimates |
//! | `slots` | the models at hand: in use, staged, former; swapping them |
//! | `trail` | the way of the motors, which all models are led along |
//! | `blend` | from one model to the next without a step |
//! | `steady` | turning band and correction filter: no chatter |
//! | `event` | what happened in one tick |
//! | [`rehearse`] | the cycle without a robot |
//! | `chronicle` | where the motors have been and which models are at hand, for slower threads |
//! | `keeper` | the thread of the models: reads, checks, compares, frees |
//! | `compare` | how two models differ, in counts |
//! | [`black_box`] | the last seconds of every tick, and how to live through them again |
//! | [`audit`] | the log of runs |
//! | `runtime` | the process: start, threads, end |
//! | `lane` | what passes between the threads |
//! | `relay` | the thread of shared memory |
//! | `convert` | between payloads and values |
//! | `log` | events as lines for a person |
//!
//! # States
//!
//! ```text
//!                            enable                       all drives enabled
//!             +--- DISABLED -------> DISABLED (enabling) --------------------> ENABLED <---------+
//!        home |     ^    ^                   | disable                         |    | pause      | resume
//!             v     |    |                   v                         disable |    v            |
//!   DISABLED (homing)    +------ DISABLED (powering off) <--+                  |  PAUSED --------+
//!                                            ^              |                  v    | disable
//!                                acknowledge |              +-- DISABLED (stopping, settling)
//!                                          FAULT <--- any state, when something fails
//! ```
//!
//! DISABLED in parentheses is what the world sees as DISABLED and busy. ENABLED is never claimed
//! before every drive is on nor after the first is told to go off.
//!
//! | command | DISABLED | DISABLED, busy | ENABLED | PAUSED | FAULT | FAULT, busy |
//! |---|---|---|---|---|---|---|
//! | `enable` | enabling (1) | Busy | State | State | State | State |
//! | `disable` | nothing | powering off (2) | stopping | stopping | drives off, stays FAULT | nothing |
//! | `pause` | State | Busy | PAUSED | nothing | State | State |
//! | `resume` | State | Busy | State | ENABLED, holding | State | State |
//! | `home` | homing (3) | Busy | State | State | State | State |
//! | `unhome` | zero forgotten | Busy | State | State | State | State |
//! | `condition` | State | Busy | a stroke, busy meanwhile (6) | State | State | State |
//! | `acknowledge` | State | State | State | State | (4) | Busy |
//! | `hold` | State | Busy | holding | nothing | State | State |
//! | `move` | State | Busy | a way, busy meanwhile (7) | State | State | State |
//! | `release` | lease free (5) | lease free (5) | lease free, holding (5) | lease free (5) | lease free (5) | lease free (5) |
//!
//! A word with a capital is a [`Refusal`]. A client id of 0 is refused as Malformed. Once the
//! process ends, what would set something going is refused with State. Commands that stop
//! (`disable`, `pause` of a robot that is on) are never refused, and repeating them is no error.
//!
//! 1. DrivesNotReady unless every drive is in phase Disabled with a fresh position; NotHomed unless
//!    every axis knows its zero: position limits, here and in the drive, mean nothing without it;
//!    Range if a motor stands outside its position limits, because a drive cuts the target to them.
//! 2. From stopping, settling and powering off: nothing, it is under way.
//! 3. DrivesNotReady as for `enable`. Homing is the drive's own affair: a counter is raised, and
//!    the drive answers with it.
//! 4. CausePersists unless every drive answers with a fresh position, is off, at fault or in quick
//!    stop, and the model is sound. If a drive is at fault, its reset counter is raised and FAULT
//!    stays, busy, until the drive has left its fault (or 1 s has passed: then the fault is latched
//!    again). Then DISABLED, powering off.
//! 5. Lease if another client holds it. The robot holds if the client was being followed.
//! 6. Busy if a stroke is under way; NotHomed and DrivesNotReady as for servo commands; Lease if
//!    another client holds it, because a stroke is motion; Range if the position limits leave less
//!    room than the model needs to forget. Ends the following of a command. Servo commands are
//!    refused with Busy until the stroke has ended, where it began, and the robot holds. `pause`,
//!    `disable`, a fault, positions that are not fresh and a zero that is lost end it at once.
//!
//! 7. By the request `move_jp`. Refused in this order: Malformed without a pose or with a wrong
//!    number of entries, NotFinite, Busy during a stroke, another way or while a set-point moves,
//!    NotHomed, DrivesNotReady, NoModel, Unsupported for a model of the tip position, Lease if
//!    another client holds it. A pose outside the hull is clipped to it and reported. Otherwise as
//!    a stroke: servo commands are refused with Busy meanwhile, and the same things end it.
//!
//! # What leads to FAULT, and what the drives do then
//!
//! | what | fault | seen in |
//! |---|---|---|
//! | phase Faulted | Drive | every state |
//! | phase Lost, or newest position older than `feedback_lost_ms` | Link | every state |
//! | phase Starting | Link | every state but DISABLED, idle or powering off |
//! | set-point written last and encoder too far apart | FollowingError | while the drive follows |
//! | any other phase than Enabled | DriveState | ENABLED, PAUSED, stopping, settling |
//! | enabling, powering off: 3 s; homing: 30 s | DriveTimeout | DISABLED, busy |
//! | homing ended without a zero | Homing | homing |
//! | model not finite | Model | every state |
//! | `overrun_ticks` within `overrun_window_ms` | Late | drives on |
//! | camera and model apart by `plausibility.distance_deg` for `debounce_ms` | Implausible | drives on, memory known |
//! | motor current above `over_current_ma` for `over_current_ms` | Current | while the drive follows |
//!
//! The reaction is the mildest that does not lean on what just failed. Cutting the power lets the
//! wires lose their tension and tissue push the snake, so **a drive that works holds**, by its own
//! quick stop, which once begun needs neither this loop nor the line. **The drive that is the cause
//! is switched off**: one that reports a fault has switched itself off; one that cannot follow, or
//! takes too much current, is blocked or pulls on something, and holding would go on pulling with
//! the whole current limit; one that left its state by itself is not to be trusted with power. The
//! gear hardly turns backwards, so the snake stays about where it is, only softer. **A drive that
//! does not answer** has held its last target since it was last heard, because no watchdog is known
//! on its serial lines; it is told to quick stop, for the case that it still hears. If power was
//! not yet on (enabling, homing) it stays off. A drive that does not reach its quick stop within 3
//! s is switched off. `disable` switches all off, and so does `acknowledge`: when a fault is over,
//! no drive is told to move.
//!
//! Milder than FAULT: with a position older than `feedback_stale_ms`, or an axis that lost its
//! zero, the robot slows down and holds, servo commands are refused, and it goes on with the first
//! valid command afterwards.
//!
//! # Motion
//!
//! A command is followed until it is older than its deadline; then the set-points slow down with
//! the stop deceleration and hold. At the default limits and 1 kHz the last set-point that moves is
//! the one of the tick that sees the deadline pass, and the first that stands comes one tick later.
//! The next valid command moves on from there.
//!
//! Angles are inverted in every tick, cut to the position limits of the axes, limited per motor and
//! rounded. `trend` tells what happens between commands, `limit` what the limits promise; together,
//! motion within the limits is followed without lag behind the commands, whatever their rate above
//! 50 Hz. What the limiter passes on its way to a *step* is not checked against the calibrated
//! hull, only its end is: motors that have unequal ways do not move on a straight line.
//!
//! A drive that is off or not yet enabled has its own position as set-point, always. When it
//! reports to be enabled, its set-point starts where it holds, at the target it was preloaded with,
//! and at rest.

pub(crate) mod command;
pub mod cycle;
pub(crate) mod event;
pub(crate) mod faults;
mod interface;
pub(crate) mod model_slots;
pub mod motion;
pub mod rehearsal;
pub(crate) mod states;

pub use interface::{
    Event, EventKind, External, Goal, Inputs, JointReport, Outputs, Report, ServoCommand,
    StateReply, StateRequest,
};
pub use model_slots::{
    Candidate, Carried, Mark, ModelChange, ModelReply, ModelRequest, ModelSlots,
};
