//! A client on another computer.
//!
//! Two ends over UDP. The [`server`] runs beside the controller and is a client of it. The
//! [`client`] runs on the other computer and serves a domain there as a controller would, so
//! `i2ris command`, `i2ris monitor`, `i2ris record`, Python and C++ work there unchanged. The
//! controller knows nothing of either.
//!
//! # Time
//!
//! Clocks of two computers are never compared. Every packet carries three numbers: its sender's
//! clock `now`, the `now` of the newest packet that the sender had received (`echo`), and how long
//! ago that was on the sender's clock (`held`). To the receiver, `echo` is a moment of its own
//! clock, and the packet was sent `held` after it *or later*, because the echoed packet was on its
//! way for some time. So `echo + held` is a moment of the receiver's clock **before** which the
//! packet was not sent: the age counted from it is never too small, and too large by no more than
//! the way of the echoed packet (the bound of F. Cristian, "Probabilistic clock synchronization",
//! 1989). Stamps inside the packet move by the same shift. A command that was held up anywhere
//! arrives as old as it is or older, and the controller refuses it by its own deadline.
//!
//! # Packets
//!
//! Little endian, at most [`packet::LONGEST`] bytes, one per datagram.
//!
//! | bytes | what |
//! |---|---|
//! | 0-3 | `I2N1` |
//! | 4 | kind: [`packet::Kind`]; 5-7 are 0 |
//! | 8-15 | session; in a hello, a number chosen by the client |
//! | 16-23 | number of the packet, rising by one per sender and session |
//! | 24-31 | `now`, ns |
//! | 32-39 | `echo`, ns; 0: nothing received yet |
//! | 40-47 | `held`, ns |
//! | 48- | body |
//! | last 16 | first half of HMAC-SHA256 over everything before, under the shared key |
//!
//! | kind | from | body |
//! |---|---|---|
//! | hello | client | version of the interface (u32), 0 (u32) |
//! | welcome | server | number of the hello (u64), interface version (u32), 1: commands (u32) |
//! | refused | server | number of the hello (u64), why (u32), version of the interface (u32) |
//! | heartbeat | client | nothing; 50 times a second, so that the server knows it lives |
//! | state | server | payload bits (u32), 1: a controller is there (u32), payloads in bit order |
//! | servo, counts | client | `ServoJp`, `ServoActuator` |
//! | request | client | number (u64), `now` of the request (u64), service (u32), 0, payload |
//! | reply | server | number (u64), what became of it (u32), 0 (u32), the payload |
//! | end | both | nothing |
//!
//! Streams are not repeated when lost: the next one is newer. Requests are repeated every 50 ms
//! until they are answered; the server knows their numbers and carries each out once. One that is
//! older than half a second when it arrives is not carried out, since nobody waits for it any more,
//! unless it is one that stops.
//!
//! # When the link is cut
//!
//! The controller stops the snake by the deadline of the last command, as when a commander dies.
//! After the agreed silence ([`BridgeClient::lost_after`], [`BridgeServer::lost_after`]) both
//! ends forget the session and the client's domain ends, so programs there see a controller that
//! is gone. When the link is back they see one that was started anew, and nothing that was in
//! motion goes on by itself.
//!
//! # Who may
//!
//! Everyone who holds the key. Without one, only addresses of this very computer are served.
//! Packets are not encrypted: who can listen can watch the snake. A packet that is recorded and
//! sent again is refused by its number.

pub mod client;
mod error;
mod event;
mod key;
pub mod packet;
mod peer;
mod request;
pub mod server;
mod state;
mod wire;

pub use client::BridgeClient;
pub use error::NetworkError;
pub use event::BridgeEvent;
pub use key::Key;
pub use server::BridgeServer;

#[cfg(target_endian = "big")]
compile_error!("payloads go over the wire as they stand in memory, little endian");
