//! Events as lines for `error`, `warning` and `status`.

use i2ris::ipc::MaskedClientId;
use i2ris::ipc::client::ClientError;
use i2ris::ipc::payload::{OperatingStateMsg, ReasonMsg};
use i2ris::robot::{Cause, OperatingState, Reason, Refusal};
use i2ris::units::Nanos;

use crate::event::ClientNames;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Level {
    Error,
    Warning,
    Status,
}

impl Level {
    pub const fn word(self) -> &'static str {
        match self {
            Self::Error => "error",
            Self::Warning => "warning",
            Self::Status => "status",
        }
    }
}

/// Maximum age of an event that is reported without its age.
const RECENT: Nanos = Nanos::from_millis(5000);

#[derive(Debug)]
pub(super) struct Lines {
    names: ClientNames,
    last: Option<OperatingStateMsg>,
    absent: bool,
}

impl Lines {
    pub fn new(names: ClientNames) -> Self {
        Self { names, last: None, absent: false }
    }

    pub fn absent(&mut self, error: &ClientError) -> Option<(Level, String)> {
        self.last = None;
        let is_first = !std::mem::replace(&mut self.absent, true);
        is_first.then(|| (Level::Error, error.to_string()))
    }

    pub fn state(&mut self, now: &OperatingStateMsg) -> Vec<(Level, String)> {
        self.absent = false;
        let before = self.last.replace(*now);
        let mut lines = Vec::new();
        if before.is_none_or(|before| before.state != now.state) {
            lines.push(match OperatingState::from_number(now.state) {
                Some(state) => (Level::Status, format!("the robot is {state}")),
                None => (Level::Error, format!("state {} is of another release", now.state)),
            });
        }
        let lease = now.lease_client_id;
        if before.map_or(0, |before| before.lease_client_id) != lease {
            let who = if lease == 0 { "no client".to_owned() } else { self.client(lease) };
            lines.push((Level::Status, format!("{who} commands")));
        }
        // "No longer busy" says nothing about the effect.
        let was = before.and_then(|before| before.broken_off());
        if let Some(stop) = now.broken_off().filter(|stop| before.is_some() && was != Some(*stop)) {
            let why = Reason::from(Cause::Stop(stop));
            lines.push((Level::Warning, format!("a motion or homing was not carried out: {why}")));
        }
        lines
    }

    /// Returns news since an instant. Earlier reasons are over, except the present fault.
    pub fn news(
        &self,
        mut reasons: Vec<(Level, ReasonMsg)>,
        since: Nanos,
    ) -> Vec<(Level, ReasonMsg)> {
        let is_old = |message: &ReasonMsg| Nanos(message.stamp_ns) < since;
        let in_fault = |state: &OperatingStateMsg| state.state == OperatingState::Fault.number();
        let fault = self.last.filter(in_fault).map(|state| state.fault);
        let is_fault = |(level, message): &&(Level, ReasonMsg)| {
            *level == Level::Error && is_old(message) && Some(message.number) == fault
        };
        let present = reasons.iter().rfind(is_fault).copied();
        reasons.retain(|(_, message)| !is_old(message));
        present.into_iter().chain(reasons).collect()
    }

    /// A reason from the controller, with the client that it concerns, and its age if not recent.
    pub fn reason(&self, message: &ReasonMsg, now: Nanos) -> String {
        let (text, advice) = (message.text(), message.advice());
        let lease = Cause::Refusal(Refusal::Lease);
        let holder = self.last.map_or(0, |state| state.lease_client_id);
        let is_held = holder != 0 && message.reason().is_some_and(|it| it.cause == lease);
        let by = if is_held { format!(": {}", self.client(holder)) } else { String::new() };
        let age = now.duration_since(Nanos(message.stamp_ns));
        let ago = match age < RECENT {
            true => String::new(),
            false => format!(" ({:.0} s ago)", age.as_seconds()),
        };
        let line = format!("{text}{by}{ago}; action: {advice}");
        match message.client_id {
            0 => line,
            client_id => format!("{}: {line}", self.client(client_id)),
        }
    }

    fn client(&self, client_id: u64) -> String {
        let name = self.names.of(client_id);
        name.unwrap_or_else(|| format!("{} outside of ROS", MaskedClientId(client_id)))
    }
}

#[cfg(test)]
mod tests {
    use i2ris::robot::Fault;

    use super::*;

    fn message(state: OperatingState) -> OperatingStateMsg {
        OperatingStateMsg { state: state.number(), ..OperatingStateMsg::default() }
    }

    #[test]
    fn every_change_is_reported_once() {
        let names = ClientNames::default();
        names.note(7, "/console");
        let mut lines = Lines::new(names);
        let shown = lines.state(&message(OperatingState::Enabled));
        assert_eq!(shown, [(Level::Status, "the robot is ENABLED".to_owned())]);
        let leased = OperatingStateMsg { lease_client_id: 7, ..message(OperatingState::Enabled) };
        let commands = (Level::Status, "/console commands".to_owned());
        assert_eq!(lines.state(&leased), [commands]);
        assert_eq!(lines.state(&leased), []);
    }

    #[test]
    fn refused_client_learns_who_commands_and_what_to_do() {
        let names = ClientNames::default();
        names.note(7, "/console");
        names.note(8, "/intruder");
        let mut lines = Lines::new(names);
        lines.state(&OperatingStateMsg { lease_client_id: 7, ..message(OperatingState::Enabled) });
        let reason = |cause: Cause, client_id| {
            lines.reason(&ReasonMsg::new(&cause.into(), client_id, Nanos(1)), Nanos(1))
        };
        let line = reason(Cause::Refusal(Refusal::Lease), 8);
        assert!(line.starts_with("/intruder: refusal 4: another client"), "{line}");
        assert!(line.contains(": /console; action: "), "{line}");
        let line = reason(Cause::Fault(Fault::Link), 0);
        assert!(line.starts_with("fault 2: ") && line.contains("; action: "), "{line}");
    }
}
