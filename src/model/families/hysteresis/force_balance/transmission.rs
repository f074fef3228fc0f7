//! Transmission error of a motor's gear: an eccentric pinion leads and lags once a turn, an oval
//! one twice.

use nalgebra::SVector;

use super::ForceBalance;

/// Steps of Newton's method from the counts without a transmission error to those with it.
const DRIVING_STEPS: usize = 2;

impl<const D: usize> ForceBalance<D> {
    /// Sine and cosine of the motor angle, and of twice the angle.
    pub(super) fn turn(&self, counts: f64) -> [f64; 4] {
        let (sine, cosine) = (self.turn_per_count * counts).sin_cos();
        [sine, cosine, 2.0 * sine * cosine, 1.0 - 2.0 * sine * sine]
    }

    /// The transmission error of a motor at some counts, and its slope; units of travel.
    #[inline]
    pub(super) fn transmission_error(&self, motor: usize, counts: f64) -> [f64; 2] {
        if !self.has_transmission_error {
            return [0.0; 2];
        }
        let ([a, b, c, d], [sin, cos, sin_2, cos_2]) =
            (self.motors[motor].transmission_error, self.turn(counts));
        let slope = a * cos - b * sin + 2.0 * (c * cos_2 - d * sin_2);
        [a * sin + b * cos + c * sin_2 + d * cos_2, slope * self.turn_per_count]
    }

    /// Pulley positions for motor counts, units of travel; and back.
    pub(super) fn driven(&self, counts: &SVector<f64, D>) -> SVector<f64, D> {
        let mut positions = self.positions(counts);
        for (i, position) in positions.iter_mut().enumerate() {
            *position += self.transmission_error(i, counts[i])[0];
        }
        positions
    }

    pub(super) fn driving(&self, positions: &SVector<f64, D>) -> SVector<f64, D> {
        let mut counts = self.counts(positions);
        if self.has_transmission_error {
            for _ in 0..DRIVING_STEPS {
                let apart = positions - self.driven(&counts);
                for (i, counts) in counts.iter_mut().enumerate() {
                    let slope = self.transmission_error(i, *counts)[1];
                    *counts += apart[i] / (self.motors[i].travel_per_count + slope);
                }
            }
        }
        counts
    }
}
