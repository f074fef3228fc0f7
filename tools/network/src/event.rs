//! What either end reports while it runs.

use std::fmt;

use i2ris::units::Nanos;

#[derive(Debug, Clone, PartialEq, Eq)]
pub enum BridgeEvent {
    /// The other end is there, by its key or address.
    Joined { who: String, commands: bool },
    /// The other end has said that it ends.
    Left(String),
    /// The other end has been silent for too long.
    Lost(String),
    /// Who is refused or refuses, or cannot be reached, and why.
    Refused(String),
    /// The list of keys has changed, and everyone has to begin again.
    AccessChanged,
    /// The list of keys or the network cannot be used.
    Closed(String),
    /// Something that Zenoh warns of, for instance a certificate that was not accepted.
    Warning(String),
    /// The client's domain is served.
    Serving,
    /// There is no controller at the other end.
    NoController,
    /// Once a second: the smallest time there and back.
    RoundTrip(Nanos),
}

impl fmt::Display for BridgeEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Joined { who, commands: true } => write!(f, "{who}: joined, commands pass"),
            Self::Joined { who, commands: false } => write!(f, "{who}: joined, to watch only"),
            Self::Left(who) => write!(f, "{who}: left"),
            Self::Lost(who) => write!(f, "{who}: silent, connection lost"),
            Self::Refused(line) => f.write_str(line),
            Self::AccessChanged => write!(f, "the list of keys has changed; all sessions ended"),
            Self::Closed(reason) => write!(f, "nobody is served: {reason}"),
            Self::Warning(text) => write!(f, "warning: {text}"),
            Self::Serving => write!(f, "the controller is there"),
            Self::NoController => write!(f, "there is no controller at the other end"),
            Self::RoundTrip(span) => write!(f, "round trip {:.1} ms", span.as_seconds() * 1e3),
        }
    }
}
