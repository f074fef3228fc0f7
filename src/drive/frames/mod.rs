//! Frames: the bytes of a message on a serial line.
//!
//! | file | contents |
//! |---|---|
//! | `serial_frame`, `serial_frame_parser` | the V2 frame: stuffing, CRC, encoder; its parser |

pub mod serial_frame;
pub mod serial_frame_parser;
