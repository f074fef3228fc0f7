//! The gate that servo commands pass: who may command, and when. What may be asked is judged by
//! `reach`.
//!
//! A command is judged whole before anything changes. The first check that fails names the reason,
//! in this order:
//!
//! | | check | reason | where |
//! |---|---|---|---|
//! | 1 | client named, number of entries possible | `Malformed` | here |
//! | 2 | every entry finite | `NotFinite` | here |
//! | 3 | stamp at most 2 ms in the future, deadline at most 1 s | `Stamp` | here |
//! | 4 | younger than its deadline | `Stale` | here |
//! | 5 | state ENABLED, | `NotEnabled` | here |
//! |   | and no motion of its own under way | `Busy` | here |
//! | 6 | every axis homed | `NotHomed` | here |
//! | 7 | positions of all drives fresh | `DrivesNotReady` | here |
//! | 8 | lease free, or held by this client | `Lease` | here |
//! | 9 | sequence above that of the last accepted command of this client | `Sequence` | here |
//! | 10 | angles: a model is loaded | `NoModel` | `reach` |
//! | 11 | number of entries as the model or the motors have | `Malformed` | `reach` |
//! | 12 | counts: inside the position limits of the axes | `Range` | `reach` |
//! | 13 | near the goal before, or near the present set-point | `Step` | `reach` |
//!
//! What is wrong with a command by itself comes before what is wrong with it here and now. A
//! refused command changes nothing but counters: it neither renews the lease nor uses up its
//! sequence number.
//!
//! The lease: taken by the first accepted command while it is free, renewed by every accepted
//! command, lost after `command.lease_timeout_ms` without one, or given back with the state command
//! `release`.

use serde::{Deserialize, Serialize};

use crate::config::CommandConfig;
use crate::core::event::Events;
use crate::core::{EventKind, Goal, ServoCommand};
use crate::robot::{OperatingState, Refusal};
use crate::units::{MAX_MOTORS, MAX_OUTPUTS, Nanos};

/// A tick begins before it reads the newest command, and commands are stamped on other processors
/// of the machine.
const FUTURE_MARGIN: Nanos = Nanos::from_millis(2);

/// A robot that moves on for more than a second after its commander died has no commander.
const LONGEST_DEADLINE: Nanos = Nanos::from_millis(1000);

/// What the gate has to know of the robot.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scene {
    /// The tick.
    pub now: Nanos,
    /// The state.
    pub state: OperatingState,
    /// The robot moves by itself.
    pub occupied: bool,
    /// Every axis knows its zero.
    pub homed: bool,
    /// Every position is fresh.
    pub fresh: bool,
}

/// The client that commands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
struct Holder {
    client_id: u64,
    /// When it took or last renewed the lease.
    renewed: Nanos,
}

/// The gate, the lease and the counters.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Gate {
    default_deadline: Nanos,
    lease: Nanos,
    holder: Option<Holder>,
    /// Client and sequence of the last accepted command. Outlives the lease, so that a replay is
    /// told from a new command.
    last: Option<(u64, u64)>,
    /// Client and reason of the last refusal that was an event, until a command is accepted.
    folded: Option<(u64, Refusal)>,
    /// Servo commands taken.
    pub accepted: u64,
    /// Servo commands refused.
    pub refused: u64,
    /// The last refusal of any command.
    pub last_refusal: Refusal,
}

impl Gate {
    /// A gate that nobody has passed.
    pub fn new(config: &CommandConfig) -> Self {
        Self {
            default_deadline: Nanos::from_millis(config.deadline_ms),
            lease: Nanos::from_millis(config.lease_timeout_ms),
            holder: None,
            last: None,
            folded: None,
            accepted: 0,
            refused: 0,
            last_refusal: Refusal::None,
        }
    }

    /// The client that holds the lease; 0: no one.
    pub fn holder(&self) -> u64 {
        self.holder.map_or(0, |holder| holder.client_id)
    }

    /// That no other client commands.
    pub fn unheld_by_others(&self, client_id: u64) -> Result<(), Refusal> {
        if self
            .holder
            .is_some_and(|holder| holder.client_id != client_id)
        {
            Err(Refusal::Lease)
        } else {
            Ok(())
        }
    }

    /// Checks 1 to 9. The answer is the deadline of the command: a commander that has lost its
    /// lease is not followed, so it is never longer than that.
    pub fn permits(&self, command: &ServoCommand, scene: &Scene) -> Result<Nanos, Refusal> {
        well_formed(command)?;
        let deadline = self.in_time(command, scene.now)?;
        allowed_here(scene)?;
        self.entitled(command)?;
        Ok(deadline.min(self.lease))
    }

    /// Takes note of an accepted command.
    pub fn accept(&mut self, command: &ServoCommand, now: Nanos, events: &mut Events) {
        let client_id = command.client_id;
        if self.holder() != client_id {
            events.push(EventKind::Lease { client_id });
        }
        self.holder = Some(Holder {
            client_id,
            renewed: now,
        });
        self.last = Some((client_id, command.sequence));
        self.folded = None;
        self.accepted = self.accepted.saturating_add(1);
    }

    /// Takes note of a refused command.
    pub fn refuse(&mut self, client_id: u64, refusal: Refusal, events: &mut Events) {
        self.refused = self.refused.saturating_add(1);
        self.last_refusal = refusal;
        if self.folded != Some((client_id, refusal)) {
            self.folded = Some((client_id, refusal));
            events.push(EventKind::Refused { client_id, refusal });
        }
    }

    /// Takes the lease from a client that has been silent for too long.
    pub fn expire(&mut self, now: Nanos, events: &mut Events) {
        if self
            .holder
            .is_some_and(|holder| now.since(holder.renewed) >= self.lease)
        {
            self.free(events);
        }
    }

    /// Gives the lease back. Nothing to give back is no error, but it cannot be taken from another
    /// client.
    pub fn release(&mut self, client_id: u64, events: &mut Events) -> Result<(), Refusal> {
        match self.holder {
            Some(holder) if holder.client_id == client_id => {
                self.free(events);
                Ok(())
            }
            Some(_) => Err(Refusal::Lease),
            None => Ok(()),
        }
    }

    fn free(&mut self, events: &mut Events) {
        self.holder = None;
        events.push(EventKind::Lease { client_id: 0 });
    }

    fn in_time(&self, command: &ServoCommand, now: Nanos) -> Result<Nanos, Refusal> {
        if command.stamp.since(now) > FUTURE_MARGIN || command.deadline > LONGEST_DEADLINE {
            return Err(Refusal::Stamp);
        }
        let deadline = if command.deadline == Nanos::ZERO {
            self.default_deadline
        } else {
            command.deadline
        };
        if now.since(command.stamp) < deadline {
            Ok(deadline)
        } else {
            Err(Refusal::Stale)
        }
    }

    fn entitled(&self, command: &ServoCommand) -> Result<(), Refusal> {
        self.unheld_by_others(command.client_id)?;
        let repeats =
            |(client_id, sequence)| client_id == command.client_id && command.sequence <= sequence;
        if self.last.is_some_and(repeats) {
            Err(Refusal::Sequence)
        } else {
            Ok(())
        }
    }
}

fn well_formed(command: &ServoCommand) -> Result<(), Refusal> {
    let (entries, most, finite) = match &command.goal {
        Goal::Joint(angles, entries) => (
            *entries as usize,
            MAX_OUTPUTS,
            angles
                .iter()
                .take(*entries as usize)
                .all(|angle| angle.is_finite()),
        ),
        Goal::Actuator(_, entries) => (*entries as usize, MAX_MOTORS, true),
    };
    if command.client_id == 0 || !(1..=most).contains(&entries) {
        return Err(Refusal::Malformed);
    }
    if finite {
        Ok(())
    } else {
        Err(Refusal::NotFinite)
    }
}

fn allowed_here(scene: &Scene) -> Result<(), Refusal> {
    match scene.state {
        OperatingState::Enabled => {}
        OperatingState::Disabled | OperatingState::Paused | OperatingState::Fault => {
            return Err(Refusal::NotEnabled);
        }
    }
    if scene.occupied {
        return Err(Refusal::Busy);
    }
    if !scene.homed {
        return Err(Refusal::NotHomed);
    }
    if scene.fresh {
        Ok(())
    } else {
        Err(Refusal::DrivesNotReady)
    }
}
