//! Bending angle and tip position of the snake, seen through a microscope.
//!
//! An optical fibre runs through the snake and sticks out of its tip. The angle between the
//! straight base and the straight tip of it, in the plane of the picture, is the bending angle of
//! that view.
//!
//! # Principles
//!
//! 1. **Never a confident wrong value.** Every reading is checked from several sides (is the tip
//!    straight, does it end where it should, does ground lie beyond it, is it as long as it was)
//!    and says what it doubts.
//! 2. **A gap is a gap.** No picture, a frozen picture, a covered tip: the value is missing and the
//!    cause is counted. An old value is never repeated.
//! 3. **Each picture for itself.** A reading depends on its picture only, so one bad picture cannot
//!    spoil the next.
//! 4. **The proof is not the inverse.** [`scene`] draws pictures the way a camera makes them and
//!    shares nothing with the detector but the picture type.
//!
//! # Map
//!
//! | module | holds |
//! |---|---|
//! | [`accuracy`] | how exact readings are, and how often wrong without saying so |
//! | [`align`] | which view shows which axis, from motions of one axis |
//! | [`image`] | a grey picture |
//! | [`fibre`] | base line, tip line, tip position, quality, from one picture |
//! | [`joint`] | one or two views to pitch, yaw and tip position |
//! | [`look`] | one view: a shot in, a reading or a cause out |
//! | [`pair`] | which pictures of two views belong together |
//! | [`record`] | angles over time as CSV |
//! | [`rest`] | the straight pose that angles count from |
//! | [`scene`] | synthetic pictures at known angles |
//! | [`session`] | the whole way of the pictures, rows out |
//! | [`setup`] | what a person tells about the views, TOML |
//! | [`source`] | pictures from folders and streams, with their stamps |
//! | [`show`] | overlays and contact sheets |
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used))]

pub mod accuracy;
pub mod align;
pub mod fibre;
pub mod image;
pub mod joint;
pub mod look;
pub mod pair;
pub mod record;
pub mod rest;
pub mod scene;
pub mod session;
pub mod setup;
pub mod show;
pub mod source;
