//! Ageing of a snake: an extra gap at every motor, and zero and gain of the angles.

use i2ris::units::MotorVec;

/// How a snake differs from the one that was calibrated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ageing {
    /// Half of an extra gap, counts.
    pub gap_counts: f64,
    /// Factor on the angles.
    pub gain: f64,
    /// deg.
    pub zero_deg: [f64; 2],
}

impl Ageing {
    pub const NONE: Self = Self { gap_counts: 0.0, gain: 1.0, zero_deg: [0.0; 2] };
}

/// An extra gap: what the snake feels of the motors.
#[derive(Debug, Clone, Copy, Default)]
pub struct ExtraGap(MotorVec);

impl ExtraGap {
    pub fn follow(&mut self, positions: MotorVec, half_width: f64) -> MotorVec {
        for (felt, position) in self.0.iter_mut().zip(positions) {
            *felt = felt.clamp(position - half_width, position + half_width);
        }
        self.0
    }
}
