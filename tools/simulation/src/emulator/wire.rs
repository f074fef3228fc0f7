//! The wires between the motors and the snake, intact or damaged.

/// A wire. Positions are counts of the motor.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) enum Wire {
    #[default]
    Intact,
    /// It follows the motor with play.
    Slack {
        /// Total play of both directions, counts.
        counts: f64,
        position: f64,
    },
    /// It stays at this position.
    Broken(f64),
}

impl Wire {
    /// Adds play at the present position.
    pub(crate) fn slacken(&mut self, motor: f64, counts: f64) {
        let position = self.position(motor);
        *self = Self::Slack { counts, position };
    }

    /// Breaks it at the present position.
    pub(crate) fn break_at(&mut self, motor: f64) {
        *self = Self::Broken(self.position(motor));
    }

    fn position(self, motor: f64) -> f64 {
        match self {
            Self::Intact => motor,
            Self::Slack { position, .. } | Self::Broken(position) => position,
        }
    }

    /// Moves the motor to `motor`. Returns the motor position that the snake experiences.
    pub(crate) fn pull(&mut self, motor: f64) -> f64 {
        if let Self::Slack { counts, position } = self {
            *position = position.clamp(motor - *counts / 2.0, motor + *counts / 2.0);
        }
        self.position(motor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slack_wires_lag_by_their_play_and_broken_wires_stay() {
        let mut wire = Wire::default();
        assert_eq!(wire.pull(100.0), 100.0);
        wire.slacken(100.0, 40.0);
        let pulled = [110.0, 120.0, 150.0, 140.0].map(|motor| wire.pull(motor));
        assert_eq!(pulled, [100.0, 100.0, 130.0, 130.0]);
        wire.break_at(140.0);
        assert_eq!(wire.pull(900.0), 130.0);
    }
}
