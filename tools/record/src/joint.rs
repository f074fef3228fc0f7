//! The standard message `sensor_msgs/JointState`: what every tool of ROS 2 knows how to plot.

use i2ris::ipc::payload::JointState;

use crate::cdr::Encoder;

/// Names of joints until a model says more.
pub const USUAL_NAMES: [&str; 2] = ["pitch", "yaw"];

/// The message for angles that are valid, with its stamp in Unix time. `None`: there are no angles
/// to tell.
#[must_use]
pub fn message(state: &JointState, unix_ns: u64, names: &[String]) -> Option<Vec<u8>> {
    let count = state.count as usize;
    if state.flags & JointState::VALID == 0 || count == 0 {
        return None;
    }
    let (position, velocity) = (state.position.get(..count)?, state.velocity.get(..count)?);
    let mut encoder = Encoder::default();
    encoder.i32(i32::try_from(unix_ns / 1_000_000_000).unwrap_or(i32::MAX));
    encoder.u32((unix_ns % 1_000_000_000) as u32);
    encoder.string("");
    encoder.u32(count as u32);
    (0..count).for_each(|joint| encoder.string(names.get(joint).map_or("", String::as_str)));
    encoder.f64s(position);
    encoder.f64s(velocity);
    encoder.f64s(&[]);
    Some(encoder.finish())
}
