//! The input device of a running `i2ris teleop`.

use i2ris::ipc::Message;
use i2ris::ipc::payload::{TeleopMsg, unpadded_text};
use i2ris::units::Nanos;
use serde::Serialize;

use super::STALE;

/// An input device and its clutch.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Hand {
    /// Why the snake does not follow; `None`: it does.
    pub open: Option<String>,
    /// Share of the motion that reaches the snake.
    pub scale: f64,
    /// Where in the picture +pitch and +yaw go, deg counterclockwise from the right.
    pub directions_deg: [f64; 2],
}

impl Hand {
    /// `None`: no input device is in use now.
    pub(super) fn new(message: &TeleopMsg, now: Nanos) -> Option<Self> {
        let is_open = message.flags & TeleopMsg::OPEN != 0;
        let direction = |[right, up]: [f64; 2]| up.atan2(right).to_degrees().round();
        (message.age(now) <= STALE).then(|| Self {
            open: is_open.then(|| unpadded_text(&message.why_open)),
            scale: message.scale,
            directions_deg: message.view.map(direction),
        })
    }
}
