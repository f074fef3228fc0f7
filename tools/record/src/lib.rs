//! Recordings of trials: every stream of the controller at full rate in an MCAP file.
//!
//! | file | contains |
//! |---|---|
//! | `recorder` | writes messages into a file that survives a crash |
//! | `recovery` | repairs truncated files |
//! | `trial` | the trials of a study on disk, and the comparison of its conditions |
//! | `export` | tables as CSV, pictures, attachments and commands as files |
//! | `pictures` | pictures of cameras as messages, and the delay of their stamps |
//! | `report` | tracking errors, hysteresis loops, latencies and events of a trial |
//! | `messages` | payloads and standard messages, their encoding, definitions and topics |
//! | `read` | records of a file, complete or truncated |
//! | `other_languages` | payloads for C++, texts of causes for Python |
//!
//! A topic `i2ris/NAME` has the payloads of the controller, bit for bit. The topic `NAME` has the
//! same as a standard ROS 2 or CRTK message, as a recording of a dVRK does. Stamps in payloads are
//! from the monotonic clock. Stamps of the file and of standard messages are Unix time; the offset
//! between both clocks is measured at the start and written to the metadata.

pub mod export;
pub mod messages;
pub mod other_languages;
pub mod pictures;
pub mod read;
pub mod recorder;
pub mod recovery;
pub mod report;
pub mod trial;
