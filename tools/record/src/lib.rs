//! Recordings of trials: every stream of the controller at full rate in an MCAP file.
//!
//! | file | contains |
//! |---|---|
//! | `cdr` | payloads as CDR, the encoding of ROS 2 messages, and back |
//! | `schema` | message definitions of ROS 2 |
//! | `cpp_header` | the payloads as a C++ header |
//! | `python_reasons` | sentence and advice of every cause as a Python module |
//! | `standard` | standard messages of ROS 2 and CRTK |
//! | `joints` | names of the joints of a controller, and the shape of its snake |
//! | `topic` | topics of a recording |
//! | `recorder` | writes messages into a file that survives its writer |
//! | `read` | records of a file, complete or cut off |
//! | `recover` | makes a complete file of one that was cut off |
//! | `run_log` | the lines of a run in the log of the controller |
//! | `export` | tables as CSV and Parquet, pictures as files |
//! | `alignment` | how late the stamps of a camera are |
//! | `pictures` | pictures of cameras as messages |
//! | `extract` | attachments and commands as files |
//! | `report` | tracking errors, hysteresis loops, latencies and events of a trial |
//! | `study` | the trials of a study on disk, and what differs between its conditions |
//!
//! A topic `i2ris/NAME` has the payloads of the controller, bit by bit. The topic `NAME` has the
//! same as a standard ROS 2 or CRTK message, as a recording of a dVRK does. Stamps in payloads are
//! of the monotonic clock. Stamps of the file and of standard messages are Unix time; the offset
//! between both clocks is measured at the start and written to the metadata.

pub mod alignment;
pub mod cdr;
pub mod cpp_header;
pub mod export;
pub mod extract;
pub mod joints;
pub mod pictures;
pub mod python_reasons;
pub mod read;
pub mod recorder;
pub mod recover;
pub mod report;
pub mod run_log;
pub mod schema;
pub mod standard;
pub mod study;
pub mod topic;
