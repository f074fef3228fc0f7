//! Names of the joints of a controller, and the shape of its snake.

use i2ris::ipc::payload::{Version, unpadded_text};
use i2ris_report::snake::Snake;

/// Names of the joints where a controller tells none.
pub const DEFAULT_NAMES: [&str; 2] = ["pitch", "yaw"];

/// The snake in URDF and frames. All robots have the same; where several are shown together, each
/// has a recording of its own.
const SNAKE: &str = "i2ris";

/// Names of the joints of a controller.
pub fn names(version: &Version) -> Vec<String> {
    let named = version.output_names.iter().map(|name| unpadded_text(name));
    let named: Vec<String> = named.take(usize::from(version.shape[1])).collect();
    if named.is_empty() { DEFAULT_NAMES.map(str::to_owned).to_vec() } else { named }
}

/// The snake.
pub fn snake() -> Snake {
    Snake::new(SNAKE)
}
