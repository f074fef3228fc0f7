//! Parameters of another range as a start.

use i2ris::model::hysteresis::force_balance::BalanceParameters;
use nalgebra::DVector;

use super::layout::Layout;

/// The most deviations from what is usual at which a search begins: parameters of other origin may
/// be 0, whose logarithm is not finite.
const FARTHEST: f64 = 6.0;

impl Layout {
    /// The vector for a search from parameters of another range, which may be those of any model.
    pub fn start_at(&self, balance: &BalanceParameters) -> DVector<f64> {
        let at = self.encode(&self.rescaled(balance));
        at.map(|number| if number.is_nan() { 0.0 } else { number.clamp(-FARTHEST, FARTHEST) })
    }

    /// Parameters of another range in the units of this one, for the same bends.
    pub fn rescaled(&self, balance: &BalanceParameters) -> BalanceParameters {
        let mut scaled = balance.clone();
        let motors = || balance.motors.iter().zip(&self.scales);
        let by: Vec<f64> =
            motors().map(|(motor, (_, travel))| travel / motor.travel_per_count).collect();
        let moved: Vec<f64> = motors()
            .map(|(motor, (centre, travel))| (motor.centre_counts - centre) * travel)
            .collect();
        for (i, motor) in scaled.motors.iter_mut().enumerate() {
            let other = by.len() - 1 - i;
            let (own, across) = (by[i], by[other]);
            (motor.centre_counts, motor.travel_per_count) = self.scales[i];
            motor.coupling *= own / across;
            motor.neutral = own * motor.neutral + moved[i] + motor.coupling * moved[other];
            let lengths = [&mut motor.gap, &mut motor.friction].into_iter();
            let lengths = lengths.chain(&mut motor.preload).chain(&mut motor.transmission_error);
            lengths.for_each(|length| *length *= own);
            motor.preload_growth /= own;
            motor.preload_growth_by_other *= own / across.powi(2);
            motor.hardening /= own.powi(2);
            motor.hardening_by_other /= across.powi(2);
            motor.friction_by_other *= own / across;
            motor.friction_growth[0] /= own;
            motor.friction_growth[1] /= across;
            motor.friction_slope /= own;
        }
        let mean = by.iter().sum::<f64>() / by.len() as f64;
        scaled.softness *= mean;
        scaled.shared_growth /= mean;
        scaled
    }
}
