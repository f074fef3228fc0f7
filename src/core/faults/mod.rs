//! Fault detection and reaction of the drives.
//!
//! | condition | fault | detected in |
//! |---|---|---|
//! | phase Faulted | Drive | every state |
//! | phase Lost, or latest position older than 3 times `feedback_stale_ms` | Link | every state |
//! | phase Starting | Link | every state but DISABLED, idle or powering off |
//! | last written setpoint and encoder too far apart | FollowingError | while the drive follows |
//! | any other phase than Enabled | DriveState | ENABLED, PAUSED, stopping, settling |
//! | enabling, powering off: 3 s; homing: 30 s | DriveTimeout | DISABLED, busy |
//! | homing ended without a zero | Homing | homing |
//! | model not finite | Model | every state |
//! | `overrun_ticks` within a second | Late | on |
//! | camera and model apart, in all frames of 300 ms | Implausible | on, memory known |
//! | current above `over_current_ma` for 200 ms or longer | Current | while the drive follows |
//!
//! The reaction is the mildest that does not depend on what has just failed.
//!
//! - **A drive that works holds.** Without power the wires lose their tension, and tissue can push
//!   the snake. So the drive gets a quick stop, which needs neither this loop nor the line once it
//!   has begun.
//! - **The drive that is the cause is switched off.** A drive that reports a fault has switched
//!   itself off. A motor that cannot follow or takes too much current is blocked or pulls on
//!   something; holding would keep pulling at the full current limit. A drive that left its state
//!   uncommanded cannot be trusted with power. The gear hardly turns backwards, so the snake stays
//!   about where it is, only softer.
//! - **A drive that does not answer** has held its last target since its last answer, because its
//!   serial line is not known to have a watchdog. It gets a quick stop in case it still receives.
//! - Without power (enabling, homing) it stays off. A drive that does not reach its quick stop
//!   within 3 s is switched off. `disable` and `acknowledge` switch all drives off: after a fault
//!   no drive gets a demand to move.
//!
//! Milder than FAULT: with a position older than `feedback_stale_ms`, or an axis that has lost its
//! zero, the robot slows down and holds. Servo commands are refused. The robot moves again with the
//! first valid command afterwards.

pub(super) mod debounce;
pub(super) mod fault_detection;
pub(super) mod following_error;
pub(super) mod over_current;
pub(super) mod overrun;
pub(super) mod plausibility;
