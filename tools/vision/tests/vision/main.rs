//! Readings and refusals of the detector, and the program around it.
#![allow(clippy::unwrap_used)]

mod fibre;
mod program;
mod session;

use i2ris_vision::scene::Rig;

fn rig() -> Rig {
    Rig::laboratory(640, 480, 100.0)
}
