//! The state of the modelled system. Times are ages in steps; sequence numbers count back from the
//! newest of their client. Both end at a bound beyond which nothing depends on them.

use i2ris::units::Nanos;

/// Length of a step: the time in which loop and watchdog run once.
pub const STEP: Nanos = Nanos::from_millis(10);

/// Deadline of a command, steps.
pub const DEADLINE: u8 = 3;
/// Lease without a command, steps.
pub const LEASE: u8 = 4;
/// Age of positions at which the line counts as lost, steps.
pub const LOST: u8 = 3;
/// A step and a half: a ticking controller is never silent for this long.
pub const SILENCE: Nanos = Nanos(STEP.0 / 2 * 3);
/// Commands older than this are forgotten, steps. At this age they are stale.
pub const FORGOTTEN: u8 = 3;
/// Upper bound of the number of later commands of the same client, plus one, for a command that is
/// not forgotten.
pub const MAX_NEWER: u8 = FORGOTTEN + 1;
/// The watchdog acts on a heartbeat of this age, steps.
pub const SILENT: u8 = 2;

/// A commander. The second one sends through a middleware.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Client {
    /// In shared memory.
    Near,
    /// Connected through a middleware such as ROS.
    Far,
}

impl Client {
    pub const ALL: [Self; 2] = [Self::Near, Self::Far];

    pub fn id(self) -> u64 {
        self as u64 + 1
    }
}

/// A servo command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Command {
    /// Commands that its client has sent since.
    pub newer: u8,
    /// Since it was sent.
    pub age: u8,
    /// Since its stamp, as the controller sees it.
    pub stamp_age: u8,
}

impl Command {
    /// A command that has just been sent.
    pub fn new(newer: u8) -> Self {
        Self { newer, age: 0, stamp_age: 0 }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Process {
    /// Since the last look of the watchdog.
    Killed,
    Dead,
    Runs,
    Hangs,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Robot {
    Disabled,
    /// `enable` was accepted, and no drive has power yet: it takes several exchanges on the line.
    /// In this time the watchdog sees that drives may be on.
    Enabling,
    PoweringOn,
    Enabled,
    Fault,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Drive {
    Off,
    On,
    QuickStopped,
    Faulted,
}

/// The last accepted command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Accepted {
    pub client: Client,
    pub newer: u8,
    /// Since it was accepted.
    pub age: u8,
    /// Its client has given the lease back.
    pub is_released: bool,
}

/// The command that is followed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Followed {
    pub client: Client,
    pub command: Command,
    /// Since it was accepted.
    pub accepted_age: u8,
}

/// Memory of the watchdog: the last heartbeat.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct LastHeartbeat {
    pub age: u8,
    pub drives_off: bool,
    /// The heartbeat is of the present start of the controller.
    pub is_current: bool,
    /// The silence has been reported.
    pub reported: bool,
}

/// Facts that no part of the system knows, but the properties need.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Truth {
    /// The newest accepted command of every client, counted back from the newest sent one.
    pub accepted: [Option<u8>; 2],
    pub had_two_leaders: bool,
    pub accepted_twice: bool,
    pub has_open_fault: bool,
    /// The operator has enabled the robot since the start of the controller.
    pub was_enabled: bool,
    /// Steps without a tick while drives may be on.
    pub silent: u8,
    /// The watchdog could not reach the drive.
    pub was_unreachable: bool,
    pub stopped_a_live_controller: bool,
    /// A setpoint beyond a limit went to the drive.
    pub broke_limit: bool,
    /// A fault was acknowledged before.
    pub has_recovered: bool,
}

/// State of the system between two actions.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct State {
    pub process: Process,
    pub robot: Robot,
    pub drive: Drive,
    pub line_up: bool,
    /// Age of the newest position.
    pub position_age: u8,
    pub accepted: Option<Accepted>,
    pub followed: Option<Followed>,
    /// The newest command of every client that waits for the loop.
    pub waiting: [Option<Command>; 2],
    /// Packets on their way, oldest first.
    pub network: [Option<Command>; 2],
    /// The client has sent in this step.
    pub has_sent: [bool; 2],
    pub heartbeat: Option<Heartbeat>,
    pub last_heartbeat: Option<LastHeartbeat>,
    /// The setpoint moved along this command in the tick that has just ended.
    pub motion: Option<Followed>,
    pub truth: Truth,
}

/// The word in shared memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Heartbeat {
    pub age: u8,
    pub drives_off: bool,
}

/// One step older, up to a bound.
pub fn raise(age: &mut u8, bound: u8) {
    *age = (*age + 1).min(bound);
}
