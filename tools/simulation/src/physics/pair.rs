//! Pairs of values: pitch and yaw, or motor 0 and motor 1.

/// Pitch and yaw, or motor 0 and motor 1.
pub(super) type Pair = [f64; 2];

pub(super) fn dot(a: Pair, b: Pair) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

pub(super) fn add(a: Pair, b: Pair) -> Pair {
    [a[0] + b[0], a[1] + b[1]]
}

pub(super) fn subtract(a: Pair, b: Pair) -> Pair {
    [a[0] - b[0], a[1] - b[1]]
}

/// Interpolates from one pair to another.
pub(super) fn between(from: Pair, to: Pair, share: f64) -> Pair {
    [0, 1].map(|i: usize| from[i] + share * (to[i] - from[i]))
}
