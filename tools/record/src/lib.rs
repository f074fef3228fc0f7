//! Recordings of trials: every stream of the controller at full rate in an MCAP file.
//!
//! | file | contains |
//! |---|---|
//! | `recorder` | writes messages into a file that survives its writer |
//! | `recovery` | makes a complete file of one that was cut off |
//! | `trial` | the trials of a study on disk, and what differs between its conditions |
//! | `export` | tables as CSV, pictures, attachments and commands as files |
//! | `pictures` | pictures of cameras as messages, and how late their stamps are |
//! | `report` | tracking errors, hysteresis loops, latencies and events of a trial |
//! | `messages` | payloads and standard messages, their encoding, definitions and topics |
//! | `read` | records of a file, complete or cut off |
//! | `generated` | payloads for C++, sentences of causes for Python |
//!
//! A topic `i2ris/NAME` has the payloads of the controller, bit by bit. The topic `NAME` has the
//! same as a standard ROS 2 or CRTK message, as a recording of a dVRK does. Stamps in payloads are
//! of the monotonic clock. Stamps of the file and of standard messages are Unix time; the offset
//! between both clocks is measured at the start and written to the metadata.

pub mod export;
pub mod generated;
pub mod messages;
pub mod pictures;
pub mod read;
pub mod recorder;
pub mod recovery;
pub mod report;
pub mod trial;
