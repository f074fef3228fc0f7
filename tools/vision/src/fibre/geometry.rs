//! Directions and positions in an image.
//!
//! Directions are radians, counter-clockwise as a person sees the image (its `y` runs down), 0 to
//! the right.

/// A position in the image, px.
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
