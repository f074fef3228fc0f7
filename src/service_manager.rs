//! Messages to the service manager: the protocol of `sd_notify(3)`, a datagram per message.
//!
//! With `Type=notify`, systemd starts dependent services when the service reports ready, not when
//! its process exists. Without systemd, nothing is sent.

use std::os::linux::net::SocketAddrExt;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};

/// The service is ready.
pub const READY: &str = "READY=1";
/// The service is ending.
pub const STOPPING: &str = "STOPPING=1";
/// The service is alive, for `WatchdogSec=`.
pub(crate) const ALIVE: &str = "WATCHDOG=1";

/// Whether a service manager started this process, which then waits for missing devices.
pub fn is_supervised() -> bool {
    std::env::var_os("NOTIFY_SOCKET").is_some()
}

/// Sends a message if the service manager wants to know. Never waits.
pub fn notify(message: &str) {
    // The service manager may have gone, or read nothing: that must not stop the robot.
    let _ = std::env::var_os("NOTIFY_SOCKET").map(|address| {
        let address = match address.as_bytes() {
            [b'@', name @ ..] => SocketAddr::from_abstract_name(name),
            path => SocketAddr::from_pathname(std::ffi::OsStr::from_bytes(path)),
        }?;
        let socket = UnixDatagram::unbound()?;
        socket.set_nonblocking(true)?;
        socket.send_to_addr(message.as_bytes(), &address)
    });
}
