//! Key expressions.
//!
//! `i2ris/state/STREAM` answers with the newest of what the controller reports. `i2ris/to/ID/STREAM`
//! is what one key gets of it as it comes, as fast as its own link can carry it.
//! `i2ris/from/ID/SESSION/WHAT` is what one key sends in one session, so that access control of Zenoh
//! holds every key to its own name.

use i2ris::ipc::{RequestService, Stream};

/// The newest of all streams of the controller.
pub const STATES: &str = "i2ris/state/**";
/// Everything that keys get.
const TO: &str = "i2ris/to";
/// Everything that keys send.
pub const FROM: &str = "i2ris/from";
/// The commands that clients may put.
pub const COMMANDS: [Stream; 3] = [Stream::ServoJp, Stream::ServoActuators, Stream::ServoJaw];

#[must_use]
pub fn state(stream: &str) -> String {
    format!("i2ris/state/{stream}")
}

/// What one key gets of a stream; `**`: of all.
#[must_use]
pub fn to(id: &str, stream: &str) -> String {
    format!("{TO}/{id}/{stream}")
}

/// The name of the stream of a key expression.
#[must_use]
pub fn stream(key: &str) -> Option<&str> {
    let own = || Some(key.strip_prefix(TO)?.strip_prefix('/')?.split_once('/')?.1);
    key.strip_prefix("i2ris/state/").or_else(own)
}

/// What a client sends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum What {
    /// The sign of life.
    Alive,
    /// One of [`COMMANDS`].
    Command(Stream),
    /// Anything but [`RequestService::Version`], which the other end answers by itself.
    Request(RequestService),
}

impl What {
    fn name(self) -> String {
        match self {
            Self::Alive => "alive".to_owned(),
            Self::Command(stream) => stream.name().to_owned(),
            Self::Request(service) => format!("request/{}", service.name()),
        }
    }

    fn named(name: &str) -> Option<Self> {
        let requests = RequestService::ALL.iter().filter(|it| **it != RequestService::Version);
        [Self::Alive]
            .into_iter()
            .chain(COMMANDS.map(Self::Command))
            .chain(requests.map(|service| Self::Request(*service)))
            .find(|what| what.name() == name)
    }
}

/// The key of a client, and the number that it chose for its session.
pub(crate) type SessionKey = (String, u64);

/// A sender with one thing that it sends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Source<'a> {
    pub id: &'a str,
    /// Chosen by the client.
    pub session: u64,
    pub what: What,
}

impl<'a> Source<'a> {
    #[must_use]
    pub fn key(&self) -> String {
        format!("{FROM}/{}/{:016x}/{}", self.id, self.session, self.what.name())
    }

    /// The key and the number of the session.
    pub(crate) fn session_key(&self) -> SessionKey {
        (self.id.to_owned(), self.session)
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
    fn the_stream_of_a_key_expression_is_found() {
        for key in ["i2ris/state/actuators/measured_js", &to("alice-1", "actuators/measured_js")] {
            assert_eq!(stream(key), Some("actuators/measured_js"));
        }
        assert_eq!((stream("i2ris/to/alice-1"), stream("i2ris/from/a/b")), (None, None));
    }

    #[test]
    fn a_sender_is_read_again_and_anything_else_is_none() {
        for (what, name) in [
            (What::Alive, "alive"),
            (What::Command(Stream::ServoJp), "servo_jp"),
            (What::Command(Stream::ServoActuators), "actuators/servo_jp"),
            (What::Request(RequestService::Move), "request/move_jp"),
        ] {
            let source = Source { id: "alice-1", session: 0xab, what };
            assert_eq!(source.key(), format!("i2ris/from/alice-1/00000000000000ab/{name}"));
            assert_eq!(Source::of(&source.key()), Some(source));
        }
        for key in [
            "i2ris/from/*/00000000000000ab/servo_jp",
            "i2ris/from/alice-1/*/servo_jp",
            "i2ris/from/alice-1/00000000000000ab/*",
            "i2ris/from/alice-1/+0000000000000ab/servo_jp",
            "i2ris/from/alice-1/ab/servo_jp",
            "i2ris/from/alice-1/00000000000000ab",
            "i2ris/from/alice-1/00000000000000ab/measured_js",
            "i2ris/from/alice-1/00000000000000ab/request/version",
            "i2ris/state/servo_jp",
            "",
        ] {
            assert_eq!(Source::of(key), None, "{key}");
        }
    }
}
