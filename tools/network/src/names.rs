//! Key expressions.
//!
//! `i2ris/state/STREAM` is what the controller reports. `i2ris/from/ID/SESSION/WHAT` is what one
//! key sends in one session, so that access control of Zenoh holds every key to its own name.

use crate::request::Service;

/// All streams of the controller.
pub const STATES: &str = "i2ris/state/**";
/// The log of the controller. Of this stream and the next two every message counts.
pub const EVENTS: &str = "events";
/// Faults.
pub const ERROR: &str = "error";
/// Refusals, stops and clips.
pub const WARNING: &str = "warning";
/// Everything that keys send.
pub const FROM: &str = "i2ris/from";

/// A stream of the controller.
#[must_use]
pub fn state(stream: &str) -> String {
    format!("i2ris/state/{stream}")
}

/// The stream of a key expression.
#[must_use]
pub fn stream(key: &str) -> Option<&str> {
    key.strip_prefix("i2ris/state/")
}

/// What a client sends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum What {
    /// The sign of life.
    Alive,
    /// A command in angles.
    ServoJp,
    /// A command in counts.
    ServoActuators,
    /// A request.
    Request(Service),
}

impl What {
    /// Everything that is put.
    pub const COMMANDS: [Self; 2] = [Self::ServoJp, Self::ServoActuators];

    fn name(self) -> &'static str {
        match self {
            Self::Alive => "alive",
            Self::ServoJp => "servo_jp",
            Self::ServoActuators => "actuators/servo_jp",
            Self::Request(Service::StateCommand) => "request/state_command",
            Self::Request(Service::Move) => "request/move_jp",
            Self::Request(Service::Model) => "request/model",
            Self::Request(Service::BlackBox) => "request/black_box",
            Self::Request(Service::Fixture) => "request/virtual_fixture",
        }
    }

    fn named(name: &str) -> Option<Self> {
        let requests = Service::ALL.map(Self::Request);
        [Self::Alive, Self::ServoJp, Self::ServoActuators]
            .into_iter()
            .chain(requests)
            .find(|what| what.name() == name)
    }
}

/// A sender with one thing that it sends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Source<'a> {
    /// The key.
    pub id: &'a str,
    /// The session, chosen by the client.
    pub session: u64,
    /// What is sent.
    pub what: What,
}

impl<'a> Source<'a> {
    /// The key expression.
    #[must_use]
    pub fn key(&self) -> String {
        format!("{FROM}/{}/{:016x}/{}", self.id, self.session, self.what.name())
    }

    /// The sender of a key expression; `None` for everything else, wildcards too.
    #[must_use]
    pub fn of(key: &'a str) -> Option<Self> {
        let rest = key.strip_prefix(FROM)?.strip_prefix('/')?;
        let (id, rest) = rest.split_once('/')?;
        let (session, what) = rest.split_once('/')?;
        let is_number = session.len() == 16 && session.bytes().all(|it| it.is_ascii_hexdigit());
        let session = is_number.then(|| u64::from_str_radix(session, 16).ok())??;
        let is_plain = !id.contains(['*', '$']);
        Some(Self { id: is_plain.then_some(id)?, session, what: What::named(what)? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sender_is_read_again_and_anything_else_is_none() {
        for what in [What::Alive, What::ServoJp, What::ServoActuators, What::Request(Service::Move)]
        {
            let source = Source { id: "alice-1", session: 0xab, what };
            assert_eq!(Source::of(&source.key()), Some(source));
        }
        let key = "i2ris/from/alice-1/00000000000000ab/servo_jp";
        assert_eq!(Source::of(key).unwrap().what, What::ServoJp);
        for key in [
            "i2ris/from/*/00000000000000ab/servo_jp",
            "i2ris/from/alice-1/*/servo_jp",
            "i2ris/from/alice-1/00000000000000ab/*",
            "i2ris/from/alice-1/+0000000000000ab/servo_jp",
            "i2ris/from/alice-1/ab/servo_jp",
            "i2ris/from/alice-1/00000000000000ab",
            "i2ris/state/servo_jp",
            "",
        ] {
            assert_eq!(Source::of(key), None, "{key}");
        }
    }
}
