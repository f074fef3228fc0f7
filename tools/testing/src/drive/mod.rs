//! A drive, its line and its port in simulated time.

mod line;
mod mini_drive;
mod port_rig;
mod replayed;

pub use line::{
    Disturbance, LineState, ReceivedRequest, SERIAL_NUMBER, SimulatedLine, port_config,
};
pub use mini_drive::*;
pub use port_rig::{NODE, PortRig, bring_up, one_drive, open};
pub use replayed::replayed;
