//! From one picture to base line, tip line and tip position.
//!
//! The steps, each a file:
//!
//! 1. `entry`: where does the base come into the picture? Pairs of edges at the right distance from
//!    each other, at several stations behind the border, that lie on one line.
//! 2. `trace`: follow it. At each step the brightness across is read, two edges at the right
//!    distance are looked for near the place that the last stretch points to, and their middle is
//!    taken. Where something covers the fibre the trace bridges it; where ground shows it ends.
//! 3. `end`: where along its direction does the fibre end, and is there really nothing but ground
//!    beyond?
//! 4. `line`: straight lines through the first and the last stretch, blind to outliers.
//! 5. `reading`: the angle between them, and how far it can be trusted.
//!
//! Directions are radians, counter-clockwise as a person sees the picture (its `y` runs down), 0 to
//! the right.

mod end;
mod entry;
mod line;
mod profile;
mod reading;
mod settings;
mod trace;

pub use line::Line;
pub use reading::{Doubt, GOOD, Reading, measure};
pub use settings::{Ground, Settings, Side};

/// A place in the picture, px.
pub(crate) type Px = [f64; 2];

/// The unit step in a direction.
pub(crate) fn step(direction_rad: f64) -> Px {
    [direction_rad.cos(), -direction_rad.sin()]
}

/// The unit step to the left of a direction.
pub(crate) fn across(direction_rad: f64) -> Px {
    [-direction_rad.sin(), -direction_rad.cos()]
}

/// `from` and `length` times a unit step.
pub(crate) fn advance(from: Px, unit: Px, length: f64) -> Px {
    [from[0] + length * unit[0], from[1] + length * unit[1]]
}

/// Along and to the left of `direction_rad`, as seen from `origin`.
pub(crate) fn relative(point: Px, origin: Px, direction_rad: f64) -> Px {
    let ([ux, uy], [vx, vy]) = (step(direction_rad), across(direction_rad));
    let (dx, dy) = (point[0] - origin[0], point[1] - origin[1]);
    [dx * ux + dy * uy, dx * vx + dy * vy]
}
