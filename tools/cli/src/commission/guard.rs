//! A drive with power: every motion of the commissioning goes through this file, and nothing else in
//! it switches power on, or writes a setpoint or a current.
//!
//! Power comes on for a [`Permit`] and goes off with the [`Guard`]. While it is on, every exchange
//! is followed by a look at encoder, current and state, which [`Watch`] judges; whatever is not as
//! it should be cuts the power at once. The drive holds the same limits itself.

use i2ris::config::AxisConfig;
use i2ris::drive::bring_up::{configure_axis, switch_off};
use i2ris::drive::cia402::{Controlword, DriveState, PowerGoal, PowerStep, power_step};
use i2ris::drive::error::{AxisError, LinkError};
use i2ris::drive::link::Retry;
use i2ris::drive::object::{self, Setting};
use i2ris::drive::transport::Transport;
use i2ris::units::{Counts, Nanos};

use super::node::Node;
use super::watch::{FEW, NEAR, Permit, SILENT, Seen, Trip, Watch};

/// A drive may take so long to switch its power on.
const ON_TIMEOUT: Nanos = Nanos::from_millis(2000);
/// Speed limits of the drive, as it counts: a turn in a second for a way; for pulses so much that
/// one shows, and that one which ends late by a stall of this computer goes few counts.
const SPEED_RPM: u32 = 60;
const PULSE_RPM: u32 = 20;
/// The drive itself stops a motor that is further from its setpoint, counts.
const WINDOW: u32 = 10;
/// Pause between single counts.
const STEP: Nanos = Nanos::from_millis(8);
/// A pulse lasts so long, or as long as two writes take; it acts until the other.
const PULSE: Nanos = Nanos::from_millis(3);
const COAST: Nanos = Nanos::from_millis(8);

/// So many replies in a row may be lost on a line that answers otherwise.
const MOST_MISSED: u32 = 2;

/// What the motor follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    Current,
    Position,
}

/// How power comes on.
#[derive(Debug, Clone, Copy)]
pub struct How {
    pub mode: Mode,
    /// At most that of the configuration.
    pub current_ma: u32,
    /// Position limits of the drive, counts from the start; `None`: what is permitted.
    pub limits: Option<i32>,
    /// Written behind the limits.
    pub extra: Option<Setting>,
    /// From where counts count; `None`: from where the motor is.
    pub origin: Option<i32>,
}

impl How {
    pub fn new(mode: Mode, current_ma: u32) -> Self {
        Self { mode, current_ma, limits: None, extra: None, origin: None }
    }
}

/// A drive with power. Dropping it switches the drive off.
pub struct Guard<'a, 'b, T: Transport> {
    node: &'a mut Node<'b, T>,
    watch: Watch,
    origin: i32,
    goal: i32,
    mode: Mode,
    unit_ma: f64,
    /// How long currents have flowed.
    pub flowed: Nanos,
    is_off: bool,
}

impl<'a, 'b, T: Transport> Guard<'a, 'b, T> {
    /// Writes the limits, then switches the power on where the motor is.
    pub fn on(node: &'a mut Node<'b, T>, permit: Permit, how: How) -> Result<Self, Trip> {
        let Permit { most } = permit;
        let state = node.state()?;
        if state == DriveState::Fault {
            return Err(Trip::Fault(node.fault()));
        }
        if !state.is_off() {
            return Err(Trip::Switched(state));
        }
        let current_ma = how.current_ma.clamp(1, node.axis.current_limit_ma);
        let begin = node.link.now();
        let watch = Watch { most, most_ma: current_ma.max(5).cast_signed(), begin, sent: None };
        let (mode, unit_ma) = (how.mode, node.current_unit_ma()?);
        let (origin, goal) = (0, 0);
        let mut guard =
            Self { node, watch, origin, goal, mode, unit_ma, flowed: Nanos::ZERO, is_off: false };
        match guard.prepare(most, current_ma, how).and_then(|()| guard.switch_on()) {
            Ok(()) => Ok(guard),
            Err(trip) => Err(guard.end(trip)),
        }
    }

    /// From where counts count.
    pub fn origin(&self) -> i32 {
        self.origin
    }

    fn prepare(&mut self, most: i32, current_ma: u32, how: How) -> Result<(), Trip> {
        let node = &mut *self.node;
        let position = node.read(object::POSITION)?;
        // It may have been turned by hand.
        let is_near = |origin: &i32| (position - origin).abs() <= NEAR;
        self.origin = how.origin.filter(is_near).unwrap_or(position);
        self.goal = position - self.origin;
        let around = how.limits.unwrap_or(most.max(FEW));
        let speed_rpm = if self.mode == Mode::Current { PULSE_RPM } else { SPEED_RPM };
        let axis = AxisConfig {
            position_min_counts: Counts(self.origin - around),
            position_max_counts: Counts(self.origin + around),
            current_limit_ma: current_ma,
            following_error_counts: WINDOW,
            motor_speed_rpm: speed_rpm.min(node.axis.motor_speed_rpm),
            ..node.axis.clone()
        };
        let mut written = || {
            configure_axis(node.link, node.family, &axis)?;
            if self.mode == Mode::Current {
                let number = if node.is_epos2() { -3 } else { 10 };
                node.write(object::MODE.set(number), Retry::Safe)?;
                node.write(node.current(0.0), Retry::Safe)?;
            }
            how.extra.map_or(Ok(Nanos::ZERO), |setting| node.write(setting, Retry::Safe))
        };
        written()?;
        self.send()
    }

    /// The target is where the motor is, however old the one in the drive was.
    fn send(&mut self) -> Result<(), Trip> {
        if self.mode == Mode::Current {
            return Ok(());
        }
        let target = self.node.family.object_map().target;
        let setting = target.set(self.origin + self.goal);
        self.node.write(setting, Retry::Safe)?;
        Ok(())
    }

    fn switch_on(&mut self) -> Result<(), Trip> {
        let end = self.node.link.now() + ON_TIMEOUT;
        let mut commanded = None;
        loop {
            let seen = self.see()?;
            self.judge(seen)?;
            match power_step(seen.state, PowerGoal::On) {
                PowerStep::Reached => return Ok(()),
                PowerStep::Command(word) if commanded != Some(word) => {
                    let write = object::CONTROLWORD.set(word.0);
                    self.node.write(write, Retry::Never)?;
                    commanded = Some(word);
                }
                PowerStep::Blocked => return Err(Trip::Fault(self.node.fault())),
                _ if seen.at > end => return Err(Trip::Switched(seen.state)),
                _ => {}
            }
        }
    }

    fn see(&mut self) -> Result<Seen, Trip> {
        let node = &mut *self.node;
        // A stall behind the reading is none of the motor.
        let at = node.link.now();
        let position = node.read(object::POSITION)?;
        let state = node.state()?;
        let current = node.family.object_map().current;
        let current_ma = match node.link.read_raw(node.axis.node_id, current) {
            Ok(reply) => current.signed(reply.value),
            // Old firmware does not have it.
            Err(LinkError::Refused(_)) => 0,
            Err(error) => {
                return Err(AxisError::Exchange { object: current, error }.into());
            }
        };
        Ok(Seen { at, counts: position.wrapping_sub(self.origin), current_ma, state })
    }

    fn judge(&mut self, seen: Seen) -> Result<(), Trip> {
        if (self.node.is_interrupted)() {
            return Err(Trip::Interrupted);
        }
        self.watch.judge(seen)
    }

    /// Looks, and cuts the power where something is not as it should be.
    pub fn look(&mut self) -> Result<Seen, Trip> {
        let looked = self.see().and_then(|seen| {
            self.judge(seen)?;
            match seen.state {
                DriveState::OperationEnabled => Ok(seen),
                state if state.is_fault() => Err(Trip::Fault(self.node.fault())),
                state => Err(Trip::Switched(state)),
            }
        });
        looked.map_err(|trip| self.end(trip))
    }

    /// Looks for some time.
    pub fn rest(&mut self, span: Nanos) -> Result<Seen, Trip> {
        let end = self.node.link.now() + span;
        loop {
            let seen = self.look()?;
            if seen.at >= end {
                return Ok(seen);
            }
        }
    }

    /// Leaves the drive alone, without an exchange.
    pub fn be_silent(&mut self, span: Nanos) {
        let until = self.node.link.now() + span;
        while self.node.link.now() < until && !(self.node.is_interrupted)() {
            let next = self.node.link.now() + SILENT;
            self.node.link.sleep_until(next.min(until));
        }
    }

    /// Lets a current flow for a few milliseconds. The counts that the encoder shows.
    pub fn pulse(&mut self, ma: f64) -> Result<i32, Trip> {
        let before = self.look()?.counts;
        let pulse = self.node.current(ma / self.unit_ma);
        let zero = self.node.current(0.0);
        let on = self.node.write(pulse, Retry::Never);
        if let Ok(sent) = on {
            self.node.link.sleep_until(sent + PULSE);
        }
        let off = self.node.write(zero, Retry::Safe);
        let (on, off) = match (on, off) {
            (Ok(on), Ok(off)) => (on, off),
            (Err(error), _) | (_, Err(error)) => return Err(self.end(error.into())),
        };
        self.flowed = self.flowed + (off - on);
        Ok(self.rest(COAST)?.counts - before)
    }

    /// Goes to a place, counts from the start, in steps of so many. Each waits for the encoder;
    /// `at` sees every place.
    pub fn go(&mut self, place: i32, step: i32, mut at: impl FnMut(Seen)) -> Result<Seen, Trip> {
        self.permit(place)?;
        while self.goal != place {
            self.goal += (place - self.goal).clamp(-step, step);
            self.send().map_err(|trip| self.end(trip))?;
            self.watch.sent = Some((self.goal, i32::MAX, self.node.link.now()));
            let mut seen = self.rest(STEP)?;
            while (self.goal - seen.counts).abs() > NEAR {
                seen = self.look()?;
            }
            at(seen);
        }
        self.watch.sent = None;
        self.look()
    }

    /// Sends the motor to a place where it may not arrive, and looks where it is after a time.
    pub fn try_place(&mut self, place: i32, span: Nanos) -> Result<Seen, Trip> {
        self.permit(place)?;
        self.goal = place;
        self.send().map_err(|trip| self.end(trip))?;
        self.rest(span)
    }

    fn permit(&mut self, place: i32) -> Result<(), Trip> {
        let most = self.watch.most;
        if place.abs() > most {
            return Err(self.end(Trip::NotPermitted { asked: place, most }));
        }
        Ok(())
    }

    /// Begins or ends a halt.
    pub fn halt(&mut self, halts: bool) -> Result<(), Trip> {
        let word = Controlword::ENABLE_OPERATION.0 | u16::from(halts) << 8;
        let written = self.node.write(object::CONTROLWORD.set(word), Retry::Safe);
        written.map(|_| ()).map_err(|error| self.end(error.into()))
    }

    /// Holds until something ends that: the last look that was good, when it was not, and why.
    /// Then the power may still be on.
    pub fn hold(mut self, span: Nanos) -> (Nanos, Nanos, Option<Trip>) {
        let mut good = self.node.link.now();
        let (end, mut missed) = (good + span, 0);
        loop {
            let looked = self.see().and_then(|seen| self.judge(seen).map(|()| seen));
            let now = self.node.link.now();
            match looked {
                Ok(seen) if seen.state == DriveState::OperationEnabled && seen.at < end => {
                    (good, missed) = (seen.at, 0);
                }
                Ok(seen) if seen.state == DriveState::OperationEnabled => {
                    return (good, now, self.off().err());
                }
                Ok(seen) => {
                    self.is_off = true;
                    return (good, now, Some(Trip::Switched(seen.state)));
                }
                // The line was synchronised behind it: a reply was lost, and the cable is in.
                Err(Trip::Drive(AxisError::Exchange {
                    error: LinkError::Unanswered(_), ..
                })) if missed < MOST_MISSED => {
                    missed += 1;
                }
                Err(trip @ Trip::Drive(_)) => {
                    // Nothing reaches it now.
                    self.is_off = true;
                    return (good, now, Some(trip));
                }
                Err(trip) => return (good, now, Some(self.end(trip))),
            }
        }
    }

    /// Switches off in order.
    pub fn off(mut self) -> Result<(), Trip> {
        self.is_off = true;
        match switch_off(self.node.link, self.node.axis.node_id) {
            Ok(()) => Ok(()),
            Err(_) => self.node.cut(),
        }
    }

    /// Switches off at once, for this reason.
    fn end(&mut self, trip: Trip) -> Trip {
        self.is_off = true;
        match self.node.cut() {
            Ok(()) => trip,
            Err(_) => Trip::NotOff(Box::new(trip)),
        }
    }
}

impl<T: Transport> Drop for Guard<'_, '_, T> {
    fn drop(&mut self) {
        if !self.is_off {
            let _ = self.node.cut();
        }
    }
}
