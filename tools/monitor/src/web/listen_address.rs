//! The address of the web page.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::str::FromStr;

const DEFAULT_PORT: u16 = 8766;
/// The address for `--web` without a value.
pub const DEFAULT_ADDRESS: &str = "127.0.0.1:8766";

/// An address and a port.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ListenAddress(pub SocketAddr);

/// Neither a port nor an address.
#[derive(Debug, thiserror::Error)]
#[error(
    "`{0}` is not PORT, ADDRESS or ADDRESS:PORT; for example 8080, 192.168.1.5 or 192.168.1.5:8080"
)]
pub struct InvalidAddress(String);

impl FromStr for ListenAddress {
    type Err = InvalidAddress;

    /// Names other than `localhost` are not resolved: an address names the network that gets
    /// access.
    fn from_str(text: &str) -> Result<Self, InvalidAddress> {
        let loopback = IpAddr::V4(Ipv4Addr::LOCALHOST);
        let local =
            text.strip_prefix("localhost").map(|rest| rest.strip_prefix(':').unwrap_or(rest));
        let text_or_port = local.filter(|port| !port.is_empty()).unwrap_or(text);
        if local == Some("") {
            return Ok(Self(SocketAddr::new(loopback, DEFAULT_PORT)));
        }
        if let Ok(port) = text_or_port.parse::<u16>() {
            return Ok(Self(SocketAddr::new(loopback, port)));
        }
        if let Ok(address) = text.parse::<SocketAddr>() {
            return Ok(Self(address));
        }
        let bare = text.trim_start_matches('[').trim_end_matches(']');
        let address = bare.parse::<IpAddr>().map_err(|_| InvalidAddress(text.to_owned()))?;
        Ok(Self(SocketAddr::new(address, DEFAULT_PORT)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_alone_is_local_and_names_are_refused() {
        for (text, wanted) in [
            (DEFAULT_ADDRESS, "127.0.0.1:8766"),
            ("8080", "127.0.0.1:8080"),
            ("localhost", "127.0.0.1:8766"),
            ("localhost:81", "127.0.0.1:81"),
            ("0.0.0.0", "0.0.0.0:8766"),
            ("192.168.1.5:80", "192.168.1.5:80"),
            ("::1", "[::1]:8766"),
            ("[::1]:9", "[::1]:9"),
        ] {
            assert_eq!(text.parse::<ListenAddress>().unwrap().0.to_string(), wanted, "{text}");
        }
        for text in ["", "example.org", "1.2.3", "70000", "localhost:x", "-1"] {
            let error = text.parse::<ListenAddress>().unwrap_err().to_string();
            assert!(error.contains("ADDRESS:PORT"), "{text}: {error}");
        }
    }
}
