//! Synthetic microscope images at known angles, for tests, for the accuracy table and for the
//! emulator.
//!
//! The images are made as a camera makes them: a curve in space is projected through a pinhole,
//! painted with its shading and the clutter in front of it, blurred by the optics, lit unevenly,
//! and sampled with noise. The detector uses nothing of this module.
//!
//! Axes of space: `z` along the straight base towards the tip, `x` in the direction of positive
//! pitch, `y` in the direction of positive yaw, origin at the start of the bending section. Lengths
//! in millimetres.
//!
//! | file | content |
//! |---|---|
//! | `synthetic_scene` | a scene, its image and its true values |
//! | `snake_shape` | the curve in space: straight base, arc, straight tip |
//! | `camera` | position of the camera; projection to pixels |
//! | `brightness` | grey levels |
//! | `raster` | anti-aliased rods and ellipses |
//! | `clutter` | instruments, specks, hairs in front |
//! | `optics` | blur, uneven light, noise |
//! | `rig` | the cameras around one snake |
//! | `random` | random scenes from a seed |

mod brightness;
mod camera;
mod clutter;
mod optics;
pub mod random;
mod raster;
mod rig;
mod snake_shape;
mod synthetic_scene;

pub use brightness::Brightness;
pub use camera::PinholeCamera;
pub use clutter::{Clutter, cover};
pub use optics::Optics;
pub use rig::Rig;
pub use snake_shape::{JointPose, SnakeShape};
pub use synthetic_scene::{Scene, Truth};
