//! The transmission error of a gear: wheels that are not round turn too far and too little, once
//! and twice in every turn of the motor.
//!
//! Source: D. B. Welbourn, "Fundamental knowledge of gear noise - a survey", Conference on Noise
//! and Vibrations of Engines and Transmissions, 1979 (the term, and its repetition with the turn).

use std::f64::consts::TAU;

use super::draw::{Draw, Pair};

/// Counts per motor turn of a 256-line encoder.
const TURN_COUNTS: f64 = 1024.0;

/// Sizes of the parts that repeat once and twice a turn, counts.
const SIZES: [[f64; 2]; 2] = [[3.0, 9.0], [1.0, 4.0]];

/// One motor: size, counts, and phase of each part.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Wheel([[f64; 2]; 2]);

impl Wheel {
    fn at(&self, turns: f64) -> f64 {
        let part = |[size, phase]: [f64; 2], times: f64| size * (TAU * times * turns + phase).sin();
        part(self.0[0], 1.0) + part(self.0[1], 2.0)
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct TransmissionError([Wheel; 2]);

impl TransmissionError {
    pub(super) fn draw(draw: &mut Draw) -> Self {
        let mut part = |[low, high]: [f64; 2]| [draw.uniform(low, high), draw.uniform(0.0, TAU)];
        Self([0, 1].map(|_| Wheel(SIZES.map(&mut part))))
    }

    /// Motor positions with the transmission error, counts. At 0 the error is 0.
    pub(super) fn turned(&self, counts: Pair) -> Pair {
        [0, 1].map(|motor: usize| {
            let wheel = &self.0[motor];
            counts[motor] + wheel.at(counts[motor] / TURN_COUNTS) - wheel.at(0.0)
        })
    }
}
