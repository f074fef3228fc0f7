//! A drive with power. Every motion of the commissioning goes through this file; nothing else in it
//! switches power on, or writes a setpoint or a current.
//!
//! Power comes on for a [`Permit`] and goes off with the [`PoweredDrive`]. While it is on, encoder,
//! current and state are read after every exchange and judged by [`Watch`]; any violation cuts the
//! power at once. The same limits are set in the drive.

use i2ris::drive::bring_up::{configure_axis, switch_off};
use i2ris::drive::cia402::{Controlword, DriveState, PowerGoal, PowerStep, power_step};
use i2ris::drive::error::{AxisError, LinkError};
use i2ris::drive::object::{self, Setting};
use i2ris::units::{Counts, Nanos};
use i2ris::{config::AxisConfig, drive::link::Retry, drive::transport::Transport};

use super::node::Node;
use super::watch::{FEW, NEAR, Permit, PowerCutReason, SILENT, Seen, Watch};

const ON_TIMEOUT: Nanos = Nanos::from_millis(2000);
/// Speed limits set in the drive: one turn per second for motions; for pulses, enough for one to be
/// seen, but few counts if a stall of this computer ends it late.
const SPEED_RPM: u32 = 60;
const PULSE_RPM: u32 = 20;
/// Distance from the setpoint at which the drive itself stops the motor, counts.
const WINDOW: u32 = 10;
const STEP: Nanos = Nanos::from_millis(8);
/// Duration of a pulse, or that of two writes, if longer: the second write ends it.
const PULSE: Nanos = Nanos::from_millis(3);
const COAST: Nanos = Nanos::from_millis(8);
const MAX_LOST_REPLIES: u32 = 2;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    Current,
    Position,
}

#[derive(Debug, Clone, Copy)]
pub struct PowerOn {
    pub permit: Permit,
    pub mode: Mode,
    /// Current limit; capped by that of the configuration.
    pub current_ma: u32,
    /// Position limits of the drive, counts from the start; `None`: the permitted range.
    pub limits: Option<i32>,
    pub extra: Option<Setting>,
    /// Origin of the counts; `None`: the present position.
    pub origin: Option<i32>,
}

impl PowerOn {
    pub fn new(permit: Permit, mode: Mode, current_ma: u32) -> Self {
        Self { permit, mode, current_ma, limits: None, extra: None, origin: None }
    }
}

/// A drive with power. Dropping it switches the drive off.
pub struct PoweredDrive<'a, 'b, T: Transport> {
    node: &'a mut Node<'b, T>,
    watch: Watch,
    /// Origin of the counts.
    pub origin: i32,
    goal: i32,
    mode: Mode,
    unit_ma: f64,
    pub flowed: Nanos,
    is_off: bool,
}

impl<'a, 'b, T: Transport> PoweredDrive<'a, 'b, T> {
    /// Writes the limits, then switches the power on at the present position.
    pub fn on(node: &'a mut Node<'b, T>, how: PowerOn) -> Result<Self, PowerCutReason> {
        let Permit { most } = how.permit;
        let state = node.state()?;
        if state == DriveState::Fault {
            return Err(PowerCutReason::Fault(node.fault()));
        }
        if !state.is_off() {
            return Err(PowerCutReason::Switched(state));
        }
        let current_ma = how.current_ma.clamp(1, node.axis.current_limit_ma);
        let begin = node.link.now();
        let watch = Watch { most, most_ma: current_ma.max(5).cast_signed(), begin, sent: None };
        let (mode, unit_ma, flowed) = (how.mode, node.current_unit_ma()?, Nanos::ZERO);
        let (origin, goal, is_off) = (0, 0, false);
        let mut guard = Self { node, watch, origin, goal, mode, unit_ma, flowed, is_off };
        match guard.prepare(current_ma, how).and_then(|()| guard.switch_on()) {
            Ok(()) => Ok(guard),
            Err(trip) => Err(guard.end(trip)),
        }
    }

    fn prepare(&mut self, current_ma: u32, how: PowerOn) -> Result<(), PowerCutReason> {
        let node = &mut *self.node;
        let position = node.read(object::POSITION)?;
        // The motor may have been turned by hand.
        let is_near = |origin: &i32| (position - origin).abs() <= NEAR;
        self.origin = how.origin.filter(is_near).unwrap_or(position);
        self.goal = position - self.origin;
        let around = how.limits.unwrap_or(how.permit.most.max(FEW));
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

    /// Sends the goal, to replace any old target in the drive.
    fn send(&mut self) -> Result<(), PowerCutReason> {
        if self.mode == Mode::Current {
            return Ok(());
        }
        let target = self.node.family.object_map().target.set(self.origin + self.goal);
        self.node.write(target, Retry::Safe)?;
        Ok(())
    }

    fn switch_on(&mut self) -> Result<(), PowerCutReason> {
        let end = self.node.link.now() + ON_TIMEOUT;
        let mut commanded = None;
        loop {
            let seen = self.see()?;
            self.judge(seen)?;
            match power_step(seen.state, PowerGoal::On) {
                PowerStep::Reached => return Ok(()),
                PowerStep::Command(word) if commanded != Some(word) => {
                    self.node.write(object::CONTROLWORD.set(word.0), Retry::Never)?;
                    commanded = Some(word);
                }
                PowerStep::Blocked => return Err(PowerCutReason::Fault(self.node.fault())),
                _ if seen.at > end => return Err(PowerCutReason::Switched(seen.state)),
                _ => {}
            }
        }
    }

    fn see(&mut self) -> Result<Seen, PowerCutReason> {
        let node = &mut *self.node;
        // A stall of this computer after the reading says nothing about the motor.
        let at = node.link.now();
        let position = node.read(object::POSITION)?;
        let state = node.state()?;
        let current = node.family.object_map().current;
        let current_ma = match node.link.read_raw(node.axis.node_id, current) {
            Ok(reply) => current.signed(reply.value),
            // Old firmware does not have this object.
            Err(LinkError::Refused(_)) => 0,
            Err(error) => return Err(AxisError::Exchange { object: current, error }.into()),
        };
        Ok(Seen { at, counts: position.wrapping_sub(self.origin), current_ma, state })
    }

    fn judge(&mut self, seen: Seen) -> Result<(), PowerCutReason> {
        if (self.node.is_interrupted)() {
            return Err(PowerCutReason::Interrupted);
        }
        self.watch.judge(seen)
    }

    pub fn look(&mut self) -> Result<Seen, PowerCutReason> {
        let looked = self.see().and_then(|seen| {
            self.judge(seen)?;
            match seen.state {
                DriveState::OperationEnabled => Ok(seen),
                state if state.is_fault() => Err(PowerCutReason::Fault(self.node.fault())),
                state => Err(PowerCutReason::Switched(state)),
            }
        });
        looked.map_err(|trip| self.end(trip))
    }

    pub fn rest(&mut self, span: Nanos) -> Result<Seen, PowerCutReason> {
        let end = self.node.link.now() + span;
        loop {
            let seen = self.look()?;
            if seen.at >= end {
                return Ok(seen);
            }
        }
    }

    pub fn be_silent(&mut self, span: Nanos) {
        let until = self.node.link.now() + span;
        while self.node.link.now() < until && !(self.node.is_interrupted)() {
            let next = self.node.link.now() + SILENT;
            self.node.link.sleep_until(next.min(until));
        }
    }

    pub fn pulse(&mut self, ma: f64) -> Result<i32, PowerCutReason> {
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

    /// Moves to `place`, counts from the start. Each step waits for the encoder, then calls `at`.
    pub fn go(
        &mut self,
        place: i32,
        step: i32,
        mut at: impl FnMut(Seen),
    ) -> Result<Seen, PowerCutReason> {
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

    /// Sends the motor to a place that it may not reach, and reads its position after `span`.
    pub fn try_place(&mut self, place: i32, span: Nanos) -> Result<Seen, PowerCutReason> {
        self.permit(place)?;
        self.goal = place;
        self.send().map_err(|trip| self.end(trip))?;
        self.rest(span)
    }

    fn permit(&mut self, place: i32) -> Result<(), PowerCutReason> {
        let most = self.watch.most;
        if place.abs() > most {
            return Err(self.end(PowerCutReason::NotPermitted { requested: place, most }));
        }
        Ok(())
    }

    pub fn halt(&mut self, halts: bool) -> Result<(), PowerCutReason> {
        let word = Controlword::ENABLE_OPERATION.0 | u16::from(halts) << 8;
        let written = self.node.write(object::CONTROLWORD.set(word), Retry::Safe);
        written.map(|_| ()).map_err(|error| self.end(error.into()))
    }

    /// Holds for `span` or until interrupted. Returns the time of the last good reading, the end
    /// time, and the reason; then the power may still be on.
    pub fn hold(mut self, span: Nanos) -> (Nanos, Nanos, Option<PowerCutReason>) {
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
                    return (good, now, Some(PowerCutReason::Switched(seen.state)));
                }
                // The line was synchronised afterwards: a reply was lost, but the cable is in.
                Err(PowerCutReason::Drive(AxisError::Exchange {
                    error: LinkError::Unanswered(_),
                    ..
                })) if missed < MAX_LOST_REPLIES => {
                    missed += 1;
                }
                Err(trip @ PowerCutReason::Drive(_)) => {
                    // The drive is out of reach now.
                    self.is_off = true;
                    return (good, now, Some(trip));
                }
                Err(trip) => return (good, now, Some(self.end(trip))),
            }
        }
    }

    pub fn off(mut self) -> Result<(), PowerCutReason> {
        self.is_off = true;
        match switch_off(self.node.link, self.node.axis.node_id) {
            Ok(()) => Ok(()),
            Err(_) => self.node.cut(),
        }
    }

    fn end(&mut self, trip: PowerCutReason) -> PowerCutReason {
        self.is_off = true;
        match self.node.cut() {
            Ok(()) => trip,
            Err(_) => PowerCutReason::NotOff(Box::new(trip)),
        }
    }
}

impl<T: Transport> Drop for PoweredDrive<'_, '_, T> {
    fn drop(&mut self) {
        if !self.is_off {
            let _ = self.node.cut();
        }
    }
}
