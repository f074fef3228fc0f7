//! Operator input: input devices, dead-man, clutch, and the view of the operator.
//!
//! It runs outside the controller, as an ordinary client: nothing of it runs in the control loop.
//!
//! ```text
//! device ([`device`]: evdev, hidraw, a recording that is played)
//!    | raw bytes                        [`recording`]: the same bytes with their times, as a file
//! decoders ([`evdev_decoder`], [`space_mouse`]): bytes to events
//!    |
//! [`state`]: values of axes and keys, with their times
//!    | [`profile`]: their meaning, by the identity of the device
//! [`control`]: one device as deflection and dead-man; silence, repetition, invalid values
//!    |
//! [`clutch`]: all devices together: closed or open, and why
//!    |
//! [`view`]: from the picture that the operator sees to pitch and yaw
//!    |
//! [`master`]: rate, position or hybrid: the pose that is commanded
//! ```
//!
//! Directions of a hand are those of the picture: right, and up, which is away from the person.

pub mod clutch;
pub mod control;
pub mod device;
pub mod evdev_decoder;
pub mod finder;
pub mod identity;
pub mod learning;
pub mod master;
pub mod profile;
pub mod recording;
pub mod space_mouse;
pub mod state;
#[cfg(test)]
mod tests;
pub mod view;
