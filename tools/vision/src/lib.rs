//! Bending angle and tip position of the snake, measured in microscope images.
//!
//! An optical fibre runs through the snake and sticks out of its tip. The angle between its
//! straight base and its straight tip, in the image plane, is the bending angle of that view.
//!
//! # Principles
//!
//! 1. **No confident wrong value.** Several checks apply to every reading: whether the tip is
//!    straight, its end at the expected place with background beyond it, and the length correct. A
//!    failed check is reported with the reading.
//! 2. **A missing value stays missing.** No image, a frozen image, a covered tip: the value is
//!    missing and the cause is counted. An old value is never repeated.
//! 3. **Images are independent.** A reading depends on its image only, so one bad image cannot
//!    affect the next.
//! 4. **The test is independent.** [`scene`] renders images like a camera and shares
//!    nothing with the detector but the image type.
//!
//! # Modules
//!
//! | module | content |
//! |---|---|
//! | [`image`] | a grey image, from PNG or JPEG; directions and positions in it |
//! | [`fibre`] | base line, tip line, tip position, quality, from one image |
//! | [`source`] | frames from folders and streams, with their timestamps |
//! | [`setup`] | description of the views, TOML |
//! | [`view_detector`] | one view: a frame in, a reading or a reason for none out |
//! | [`joint_angles`] | one or two views to pitch, yaw and tip position, from the straight pose |
//! | [`angle_csv`] | angles over time as CSV |
//! | [`session`] | frames in, in pairs of two views; rows out |
//! | [`drawing`] | readings drawn over their images |
//! | [`scene`] | synthetic images at known angles |
//! | [`scene_setup`] | the setup of such images |
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used))]

pub mod angle_csv;
pub mod drawing;
pub mod fibre;
pub mod image;
pub mod joint_angles;
pub mod scene;
pub mod scene_setup;
pub mod session;
pub mod setup;
pub mod source;
pub mod view_detector;
