//! Recordings of trials: every stream of the controller at full rate in an MCAP file.
//!
//! | file | holds |
//! |---|---|
//! | `layout` | the fields of every payload, in one table: for schemas, columns and other languages |
//! | `cdr` | payloads as CDR, the bytes of ROS 2 messages, and back |
//! | `schema` | message definitions in the language of ROS 2 |
//! | `header` | the payloads as a C++ header |
//! | `joint` | the standard message `sensor_msgs/JointState` |
//! | `topic` | what a recording holds |
//! | `recorder` | from messages to a file that survives its writer |
//! | `read` | records of a file, whole or cut off |
//! | `recover` | a whole file from one that was cut off |
//! | `export` | tables as CSV and Parquet |
//! | `report` | what a trial shows: errors, loops, latencies, events; as numbers and as a page |
//!
//! A topic `i2ris/NAME` holds the controller's own payloads, bit by bit; `NAME` beside it holds the
//! same angles as the standard message that every tool knows. Stamps inside the payloads are of the
//! monotonic clock; those of the file and of standard messages are Unix time, by one offset that
//! was taken at the start and stands in the metadata.

pub mod cdr;
pub mod export;
pub mod header;
pub mod joint;
pub mod layout;
pub mod read;
pub mod recorder;
pub mod recover;
pub mod report;
pub mod schema;
pub mod topic;
