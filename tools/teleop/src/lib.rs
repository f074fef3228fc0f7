//! What a hand holds: input devices, dead-man, clutch, and the view of the operator.
//!
//! A program beside the controller, a client like any other: nothing of this runs in its loop.
//!
//! ```text
//! device ([`device`]: evdev, hidraw, a recording that is played)
//!    | raw bytes                        [`recording`]: the same bytes with their times, as a file
//! decoders ([`evdev_decoder`], [`space_mouse`]): bytes to events
//!    |
//! [`state`]: what axes and keys are now, and since when
//!    | [`profile`]: which of them mean what, by the identity of the device
//! [`control`]: one device as deflection and dead-man; silence, repetition and nonsense
//!    |
//! [`clutch`]: all devices together: closed or open, and why
//!    |
//! [`view`]: from the picture that the operator sees to pitch and yaw
//!    |
//! [`master`]: rate, position or hybrid: the pose that is commanded
//! ```
//!
//! Directions of a hand are those of the picture: right, and up. A control that is pushed away from
//! the person is pushed up.

#[cfg(test)]
mod captures;
pub mod clutch;
pub mod control;
pub mod device;
pub mod evdev_decoder;
#[cfg(test)]
mod faults;
pub mod finder;
pub mod identity;
pub mod learning;
pub mod master;
pub mod profile;
pub mod recording;
pub mod space_mouse;
pub mod state;
pub mod view;
