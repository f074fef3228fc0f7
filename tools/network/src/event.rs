//! What either end reports while it runs.

use std::fmt;
use std::net::SocketAddr;

use i2ris::units::Nanos;

/// What either end reports while it runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BridgeEvent {
    /// The other end is there.
    Joined {
        /// Where.
        address: SocketAddr,
        /// Whether commands pass.
        commands: bool,
    },
    /// The other end has said that it ends.
    Left(SocketAddr),
    /// The other end has been silent for too long.
    Lost(SocketAddr),
    /// The server serves as many clients as it can.
    Full(SocketAddr),
    /// A client of another version of the interface was refused.
    Foreign {
        /// Where it is.
        address: SocketAddr,
        /// Its version.
        interface: u32,
    },
    /// The client's domain is served.
    Serving,
    /// There is no controller at the other end.
    NoController,
    /// Once a second: the time there and back.
    RoundTrip(Nanos),
}

impl fmt::Display for BridgeEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Joined {
                address,
                commands: true,
            } => write!(f, "{address}: joined, commands pass"),
            Self::Joined {
                address,
                commands: false,
            } => write!(f, "{address}: joined, to watch only"),
            Self::Left(address) => write!(f, "{address}: left"),
            Self::Lost(address) => write!(f, "{address}: silent, connection lost"),
            Self::Full(address) => write!(
                f,
                "{address}: refused, as many clients as possible are joined"
            ),
            Self::Foreign { address, interface } => {
                write!(
                    f,
                    "{address}: refused, it has interface version {interface}; build both from \
                     one release"
                )
            }
            Self::Serving => write!(f, "the controller is there"),
            Self::NoController => write!(f, "there is no controller at the other end"),
            Self::RoundTrip(span) => write!(f, "round trip {:.1} ms", span.as_seconds() * 1e3),
        }
    }
}
