//! The planner of a port: which axis gets the next exchange, and for what.
//!
//! A line carries one exchange at a time, and little more than two hundred to five hundred of them
//! in a second. So every exchange goes where it is needed most. Nothing is queued: before every
//! exchange each axis says what it needs, and the greatest [`Urgency`] is served.
//!
//! | urgency, greatest first | of the same, first |
//! |---|---|
//! | a stop | the axis that waits longest |
//! | a read at its bound | the position, then the latest |
//! | a changed setpoint, or a step of a transition | a new command, then the largest change |
//! | a read that is due | the latest |
//! | a setpoint or a step after a setpoint | the same |
//! | a read that is not due | the one nearest to it |
//!
//! A setpoint that has not changed is not written again, unless its write was not confirmed. So the
//! fast axis gets more setpoints than the slow one, and one at rest gets none. No two reads follow
//! each other while a setpoint waits, so reads cost at most half of the line; a new command passes
//! a read that is due once, so that a stream of them keeps no read from the line.
//!
//! Reads are counted in turns: as many exchanges as the port has axes. What a port promises at
//! worst follows from the bounds (`config/line_timing.rs`).

use super::interface::{AxisRequest, Transfer};
use crate::config::{CURRENT_BOUND_TURNS, POSITION_BOUND_TURNS, STATUS_BOUND_TURNS};
use crate::drive::cia402::Controlword;

/// Turns until a value is due; of a position only axes that move count, while its own does.
const POSITION_TURNS: u64 = POSITION_BOUND_TURNS;
const STATUS_TURNS: u64 = STATUS_BOUND_TURNS * 3 / 4;
const SLOW_TURNS: u64 = CURRENT_BOUND_TURNS * 5 / 6;

/// Turns that an axis waits at most for a setpoint or a step, whatever the others change.
const COMMAND_BOUND_TURNS: u64 = 3;

/// The change of a setpoint, counts, that is as urgent as a step of a transition.
const STEP_COUNTS: u32 = 16;

/// Marks ranks that come before all others of their urgency.
const NEW_COMMAND: u64 = 1 << 48;
const AT_BOUND: u64 = 1 << 49;

/// Exchanges of a port, as its planner counts them.
#[derive(Debug, Clone, Copy)]
pub(in crate::drive) struct LineUse {
    axes: u64,
    /// Number of moving axes among them.
    pub(in crate::drive) moving: u64,
    /// Exchanges so far.
    exchanges: u64,
    /// The last one was a read.
    after_read: bool,
    /// A new command has passed a read that was due, since the last read.
    passed: bool,
}

impl LineUse {
    pub(in crate::drive) fn new(axes: usize) -> Self {
        let axes = axes.max(1) as u64;
        // Before the first exchange everything is due.
        Self { axes, moving: axes, exchanges: 1 << 20, after_read: true, passed: false }
    }

    /// Exchanges from the one with this number to the next one.
    fn since(&self, last: u64) -> u64 {
        self.exchanges + 1 - last
    }
}

/// How urgent the most urgent need of an axis is. Numbers rank within an urgency.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(in crate::drive) enum Urgency {
    /// A read that is not due.
    SpareRead(u64),
    /// A setpoint or a step.
    Command(u64),
    DueRead(u64),
    /// A setpoint or a step that passes reads that are due.
    FirstCommand(u64),
    /// A read at its bound.
    LateRead(u64),
    /// The drive must be sent a stop.
    Stop(u64),
}

/// Value of a setpoint or a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct CommandNeed {
    /// Change of the setpoint, counts.
    pub(super) change: u32,
    /// It is the first setpoint of a command.
    pub(super) is_new: bool,
}

impl CommandNeed {
    pub(super) const STEP: Self = Self { change: STEP_COUNTS, is_new: false };
}

/// A need, its urgency, and the value to read; `None`: the setpoint, or the next step.
pub(super) type Need = (Urgency, Option<Transfer>);

/// The values that are read all the time.
const VALUES: [Transfer; 4] =
    [Transfer::Position, Transfer::Status, Transfer::ErrorCode, Transfer::Current];

/// The place in [`VALUES`] of the value that a transfer reads.
fn place(transfer: Transfer) -> Option<usize> {
    VALUES.iter().position(|value| *value == transfer)
}

/// Exchanges until a value is due, and until it is at its bound.
fn periods(value: Transfer, line: &LineUse, is_moving: bool) -> [u64; 2] {
    match value {
        Transfer::Position => {
            let axes = if is_moving { line.moving } else { line.axes };
            [POSITION_TURNS * axes, POSITION_BOUND_TURNS * line.axes]
        }
        Transfer::Status => [STATUS_TURNS * line.axes, STATUS_BOUND_TURNS * line.axes],
        _ => [SLOW_TURNS * line.axes, CURRENT_BOUND_TURNS * line.axes],
    }
}

fn read_urgency(value: Transfer, age: u64, line: &LineUse, is_moving: bool) -> Urgency {
    let [due, bound] = periods(value, line, is_moving);
    let share = ((age << 16) / due).min(AT_BOUND - 1);
    if age > bound {
        let first = if value == Transfer::Position { AT_BOUND } else { 0 };
        return Urgency::LateRead(first + share);
    }
    if age >= due {
        return Urgency::DueRead(share);
    }
    // Two positions in a row would show a standstill in every motion.
    let is_early = value == Transfer::Position && age < 2 * line.axes;
    Urgency::SpareRead(if is_early { 0 } else { share })
}

/// Last service of an axis, counted in exchanges of its port.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Schedule {
    any: u64,
    command: u64,
    /// In the order of [`VALUES`]; 0: due at once.
    read: [u64; VALUES.len()],
    /// The command of the last setpoint, as numbered in [`AxisRequest::command_sequence`].
    pub(super) command_sequence: u64,
}

impl Schedule {
    pub(super) fn most_urgent(
        &self,
        command: Option<CommandNeed>,
        is_moving: bool,
        line: &LineUse,
    ) -> Need {
        let reads = VALUES.into_iter().zip(self.read).map(|(value, last)| {
            (read_urgency(value, line.since(last), line, is_moving), Some(value))
        });
        let command = command.map(|need| (self.command_urgency(need, line), None));
        let most = reads.chain(command).max_by_key(|(urgency, _)| *urgency);
        // There are always values to read.
        most.unwrap_or((Urgency::SpareRead(0), Some(Transfer::Position)))
    }

    fn command_urgency(&self, need: CommandNeed, line: &LineUse) -> Urgency {
        let age = line.since(self.command);
        let rank = if age > COMMAND_BOUND_TURNS * line.axes {
            AT_BOUND + age
        } else {
            let first = if need.is_new { NEW_COMMAND } else { 0 };
            first + u64::from(need.change.max(1)) * age
        };
        let passes = line.after_read || need.is_new && !line.passed;
        if passes { Urgency::FirstCommand(rank) } else { Urgency::Command(rank) }
    }

    pub(super) fn stop_urgency(&self, line: &LineUse) -> Urgency {
        Urgency::Stop(line.since(self.any))
    }

    /// Every other axis could be served since the last exchange.
    pub(super) fn has_waited(&self, line: &LineUse) -> bool {
        line.since(self.any) >= line.axes
    }

    /// A setpoint was written in the last rounds.
    pub(super) fn has_commanded(&self, line: &LineUse) -> bool {
        line.since(self.command) <= POSITION_TURNS * line.axes
    }

    pub(super) fn count(&mut self, need: Need, transfer: Transfer, line: &mut LineUse) {
        line.exchanges += 1;
        self.any = line.exchanges;
        if let Some(place) = place(transfer) {
            self.read[place] = line.exchanges;
        }
        let (urgency, value) = need;
        let is_read = value.is_some();
        if !is_read {
            self.command = line.exchanges;
            line.passed |= !line.after_read && matches!(urgency, Urgency::FirstCommand(_));
        }
        line.passed &= !is_read;
        line.after_read = is_read;
    }

    /// Reads a value again at the next opportunity.
    pub(super) fn repeat(&mut self, transfer: Transfer) {
        if let Some(place) = place(transfer) {
            self.read[place] = 0;
        }
    }
}

/// State of a setpoint that takes effect by an edge of the controlword: written, triggered, and
/// the bit lowered again before the next setpoint.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum TriggerState {
    #[default]
    Ready,
    /// A setpoint is written; its edge is next.
    Written(AxisRequest),
    /// The edge was sent, and may have been lost; the bit must be lowered next.
    Raised,
}

impl TriggerState {
    /// The transfer that must come before the next setpoint.
    pub(super) fn transfer(self) -> Option<Transfer> {
        match self {
            Self::Ready => None,
            Self::Written(request) => Some(Transfer::TriggerSetpoint(request)),
            Self::Raised => Some(Transfer::Control(Controlword::ENABLE_OPERATION)),
        }
    }

    /// A transfer failed. The edge may have arrived, so the bit is lowered; a setpoint follows.
    pub(super) fn handle_failure(&mut self) {
        if matches!(self, Self::Written(_)) {
            *self = Self::Raised;
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::*;

    /// Needs of an axis before an exchange.
    #[derive(Debug, Clone, Copy)]
    struct Needs {
        change: u32,
        is_new: bool,
        is_moving: bool,
    }

    /// A planner in front of axes that do not fail, with the number of the last exchange of every
    /// kind, and the longest time between two.
    struct Port {
        line: LineUse,
        axes: Vec<Schedule>,
        last: Vec<[u64; 5]>,
        longest: [u64; 5],
    }

    const COMMAND: usize = VALUES.len();

    impl Port {
        fn new(axes: usize) -> Self {
            let line = LineUse::new(axes);
            let last = vec![[line.exchanges; 5]; axes];
            Self { line, axes: vec![Schedule::default(); axes], last, longest: [0; 5] }
        }

        /// Runs one exchange. Returns the axis, and `true` for a setpoint.
        fn exchange(&mut self, needs: &[Needs]) -> (usize, bool) {
            let mut most: Option<(usize, Need)> = None;
            for (axis, need) in needs.iter().enumerate() {
                let command = (need.change > 0)
                    .then_some(CommandNeed { change: need.change, is_new: need.is_new });
                if command.is_none() {
                    self.last[axis][COMMAND] = self.line.exchanges;
                }
                let found = self.axes[axis].most_urgent(command, need.is_moving, &self.line);
                if most.is_none_or(|(_, most)| found.0 > most.0) {
                    most = Some((axis, found));
                }
            }
            self.line.moving = needs.iter().filter(|need| need.is_moving).count().max(1) as u64;
            let (axis, need) = most.unwrap();
            let transfer = need.1.unwrap_or(Transfer::Preload(0));
            let kind = place(transfer).unwrap_or(COMMAND);
            self.axes[axis].count(need, transfer, &mut self.line);
            let gap = self.line.exchanges - self.last[axis][kind];
            self.longest[kind] = self.longest[kind].max(gap);
            self.last[axis][kind] = self.line.exchanges;
            (axis, need.1.is_none())
        }
    }

    fn needs(axes: usize) -> impl Strategy<Value = Vec<Needs>> {
        let one = (prop_oneof![Just(0), 1..5u32, 1..2000u32], any::<bool>(), any::<bool>())
            .prop_map(|(change, is_new, is_moving)| Needs { change, is_new, is_moving });
        vec(one, axes)
    }

    fn history() -> impl Strategy<Value = Vec<(Vec<Needs>, usize)>> {
        (1..=4usize).prop_flat_map(|axes| vec((needs(axes), 1..120usize), 1..60))
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 256, ..ProptestConfig::default() })]

        /// Whatever the axes need, and however that changes: every value of every axis is read
        /// within its bound, and no setpoint waits for long.
        #[test]
        fn nothing_is_starved(history in history()) {
            let axes = history[0].0.len();
            let mut port = Port::new(axes);
            for (needs, exchanges) in &history {
                for _ in 0..*exchanges {
                    port.exchange(needs);
                }
            }
            let axes = axes as u64;
            let [position, status, error_code, current, command] = port.longest;
            prop_assert!(position <= (POSITION_BOUND_TURNS + 1) * axes, "{position} of {axes}");
            prop_assert!(status <= (STATUS_BOUND_TURNS + 2) * axes, "{status} of {axes}");
            let slow = error_code.max(current);
            prop_assert!(slow <= (CURRENT_BOUND_TURNS + 2) * axes, "{slow} of {axes}");
            prop_assert!(command <= 2 * (COMMAND_BOUND_TURNS + 1) * axes + 2, "{command}, {axes}");
        }
    }

    #[test]
    fn two_moving_axes_use_the_line_beside_one_at_rest() {
        // Counts per exchange of the others; share of the slower axis relative to the faster.
        for (axes, changes, least) in [(2, [9, 9], 0.99), (3, [9, 9], 0.99), (3, [40, 9], 0.4)] {
            let mut port = Port::new(axes);
            let mut written = vec![0; axes];
            let (mut setpoints, exchanges) = (vec![0; axes], 10_000);
            for now in 1..=exchanges {
                let needs: Vec<Needs> = (0..axes)
                    .map(|axis| match changes.get(axis) {
                        Some(change) => {
                            let change = change * (now - written[axis]);
                            Needs { change, is_new: false, is_moving: true }
                        }
                        None => Needs { change: 0, is_new: false, is_moving: false },
                    })
                    .collect();
                if let (axis, true) = port.exchange(&needs) {
                    (written[axis], setpoints[axis]) = (now, setpoints[axis] + 1);
                }
            }
            // Only a setpoint and a position of each moving axis in turn.
            let bare = f64::from(exchanges) / 4.0;
            let each = f64::from(setpoints[0] + setpoints[1]) / 2.0;
            assert!(each > 0.95 * bare, "{axes} axes: {setpoints:?} of {bare}");
            let slower = f64::from(setpoints[1]) / f64::from(setpoints[0]);
            assert!((least..=1.01).contains(&slower), "{setpoints:?}");
        }
    }

    #[test]
    fn the_trigger_bit_is_lowered_before_the_next_setpoint() {
        let request = AxisRequest::default();
        let lower = Some(Transfer::Control(Controlword::ENABLE_OPERATION));
        assert_eq!(TriggerState::default().transfer(), None);
        let mut state = TriggerState::Written(request);
        let trigger = Some(Transfer::TriggerSetpoint(request));
        assert_eq!(state.transfer(), trigger);
        state.handle_failure();
        assert_eq!(state.transfer(), lower);
        state.handle_failure();
        assert_eq!(state.transfer(), lower, "until it is acknowledged");
    }
}
