//! The wires between the motors and the snake, sound or not.

/// A wire.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) enum Wire {
    /// It pulls as it should.
    #[default]
    Sound,
    /// It pulls only after so many counts of play.
    Slack {
        /// The play, counts, both ways together.
        counts: f64,
        /// Where it last pulled to.
        pulled: f64,
    },
    /// It pulls nothing any more.
    Broken {
        /// Where it last pulled to.
        pulled: f64,
    },
}

impl Wire {
    /// Becomes slack by so many counts, where it is.
    pub(crate) fn slacken(&mut self, motor: f64, counts: f64) {
        *self = Self::Slack {
            counts,
            pulled: self.pulled(motor),
        };
    }

    /// Breaks, where it is.
    pub(crate) fn tear(&mut self, motor: f64) {
        *self = Self::Broken {
            pulled: self.pulled(motor),
        };
    }

    fn pulled(self, motor: f64) -> f64 {
        match self {
            Self::Sound => motor,
            Self::Slack { pulled, .. } | Self::Broken { pulled } => pulled,
        }
    }

    /// The motor goes to `motor`; what the snake sees of it.
    pub(crate) fn pull(&mut self, motor: f64) -> f64 {
        match self {
            Self::Sound => motor,
            Self::Slack { counts, pulled } => {
                *pulled = pulled.clamp(motor - *counts / 2.0, motor + *counts / 2.0);
                *pulled
            }
            Self::Broken { pulled } => *pulled,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slack_wire_pulls_after_its_play_and_a_broken_one_never() {
        let mut wire = Wire::default();
        assert_eq!(wire.pull(100.0), 100.0);
        wire.slacken(100.0, 40.0);
        assert_eq!(
            [110.0, 120.0, 150.0, 140.0].map(|motor| wire.pull(motor)),
            [100.0, 100.0, 130.0, 130.0]
        );
        wire.tear(140.0);
        assert_eq!(wire.pull(900.0), 130.0);
    }
}
