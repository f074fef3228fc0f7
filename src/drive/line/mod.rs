//! Line: one request and its reply over a serial port.
//!
//! | file | contents |
//! |---|---|
//! | `transport`, `serial_transport` | the line and its clock; a serial port as a line |
//! | `line_turn` | whose turn it is on a line: that of the controller or of the watchdog |
//! | `latency_timer` | the timer of FTDI adapters that delays replies |
//! | `link` | one request, one reply, retries, and synchronising the line; its replay |

pub mod latency_timer;
pub(crate) mod line_turn;
pub mod link;
pub mod serial_transport;
pub mod transport;
