//! Messages in a recording.
//!
//! | file | contains |
//! |---|---|
//! | `cdr` | payloads as CDR, the encoding of ROS 2 messages, and back |
//! | `schema` | message definitions of ROS 2 |
//! | `standard` | standard messages of ROS 2 and CRTK, joints and shape of the snake |
//! | `topic` | topics of a recording |

pub mod cdr;
pub mod schema;
pub mod standard;
pub mod topic;
