//! A client on another computer, over Zenoh.
//!
//! Two ends. The [`server`] runs beside the controller and is a client of it. The [`client`] runs
//! on the other computer and serves a domain there as a controller would, so `i2ris command`,
//! `i2ris monitor`, `i2ris record`, Python and C++ work there unchanged. The controller knows
//! nothing of either. A program that speaks Zenoh needs no [`client`]: the chapter on the network
//! in the manual has keys, payloads and a client in Python.
//!
//! | module | holds |
//! |---|---|
//! | [`keys`] | certificates, and the list of what each key may do |
//! | [`link`] | the configuration of Zenoh: QUIC, certificates of both ends, access control |
//! | [`names`] | key expressions |
//! | [`message`], [`request`], [`state`] | what goes over the network |
//! | `pace` | how often to send |
//! | `event`, `error`, `warnings` | what either end reports, what can go wrong, what Zenoh warns of |
//! | [`server`], [`client`] | the two ends |
//!
//! # Sessions
//!
//! A client chooses a random number, its session, and asks `alive` twenty times a second. The
//! first answer admits it, and says whether commands pass; a refusal has a reason. When one end is
//! silent for [`BridgeClient::lost_after`] ([`BridgeServer::lost_after`]) the session ends for
//! ever: the client's domain ends, so programs there see a controller that is gone, and the server
//! passes no more of its commands on. When the link is back the client begins another session, and
//! programs see a controller that was started anew, so nothing that was in motion goes on by
//! itself. The snake was stopped long before, by the deadline of the last command.
//!
//! # Time
//!
//! Clocks of two computers are never compared. Every answer to `alive` has the server's clock, and
//! [`i2ris_gateway::clock::ClockOffset`] keeps bounds of the lead of one clock over the other, as
//! far apart as the smallest round trip. The client puts the stamps of commands on the controller's
//! clock by the bound that makes them older, never younger. A command that was held up anywhere
//! arrives as old as it is or older, and the controller refuses it by its own deadline.
//!
//! # Streams and requests
//!
//! Streams go in QUIC datagrams, which are not sent again when they are lost: the next message is
//! newer. Where they queue on the link they are sent less often: Zenoh 1.10 sets neither the length
//! of QUIC's queue of datagrams nor its congestion control. Requests are Zenoh queries in QUIC
//! streams; a client asks again until it has an answer, and the server knows the numbers and
//! carries each out once. One that is older than half a second when it arrives is not carried out,
//! since nobody waits for it any more, unless it is one that stops.
//!
//! # Who may
//!
//! Every person has a certificate of the robot's own authority, the server has one too, and both
//! ends check each other (TLS 1.3). Zenoh lets every key send under its own name only, and put
//! commands only if the [`keys::AccessList`] says so; the server checks the list once more. There
//! is no access without a key, not even on one computer.

pub mod client;
mod error;
mod event;
pub mod keys;
pub mod link;
pub mod message;
pub mod names;
mod pace;
pub mod request;
pub mod server;
pub mod state;
mod warnings;

pub use client::BridgeClient;
pub use error::NetworkError;
pub use event::BridgeEvent;
pub use server::BridgeServer;

#[cfg(target_endian = "big")]
compile_error!("payloads go over the wire as they are in memory, little endian");
