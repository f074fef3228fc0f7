//! A measured value that broke a limit.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::units::Nanos;

numbered_enum! {
    /// Quantity of a [`Measurement`].
    Quantity {
        /// Nothing.
        None = 0, "";
        /// An angle, degrees.
        Degrees = 1, "deg";
        /// Encoder counts.
        Counts = 2, "counts";
        /// A current, milliamperes.
        Milliamperes = 3, "mA";
        /// An age or a duration, milliseconds.
        Milliseconds = 4, "ms";
        /// Late ticks within the window of the monitor.
        LateTicks = 5, "late ticks";
        /// Values in a command.
        Values = 6, "values";
        /// Error code of a drive (0x603F).
        ErrorCode = 7, "error code";
        /// Statusword of a drive (0x6041).
        Statusword = 8, "statusword";
        /// Sequence number of a command.
        Sequence = 9, "sequence number";
        /// A length, millimetres.
        Millimetres = 10, "mm";
    }
}

/// A measured value, and the limit that it broke.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Measurement {
    /// Index of the motor, if the value belongs to one.
    pub motor: Option<u8>,
    /// Measured quantity.
    pub quantity: Quantity,
    /// The measured value, in the unit of `quantity`.
    pub measured: f64,
    /// The limit; `None` where there is none, as for an error code.
    pub limit: Option<f64>,
}

impl Measurement {
    /// Creates a value of the whole robot.
    #[must_use]
    pub const fn new(quantity: Quantity, measured: f64, limit: Option<f64>) -> Self {
        Self { motor: None, quantity, measured, limit }
    }

    /// Only the motor is known.
    #[must_use]
    pub const fn nothing() -> Self {
        Self::new(Quantity::None, 0.0, None)
    }

    /// Creates an age or a duration with its limit.
    #[must_use]
    pub(crate) fn from_age(age: Nanos, limit: Nanos) -> Self {
        let ms = |span: Nanos| span.as_seconds() * 1e3;
        Self::new(Quantity::Milliseconds, ms(age), Some(ms(limit)))
    }

    /// The same value, of one motor.
    #[must_use]
    pub const fn of_motor(self, motor: u8) -> Self {
        Self { motor: Some(motor), ..self }
    }
}

impl fmt::Display for Measurement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.motor {
            Some(motor) if self.quantity == Quantity::None => return write!(f, "motor {motor}"),
            Some(motor) => write!(f, "motor {motor}: ")?,
            None => {}
        }
        let text = Value(self.quantity, self.measured);
        match self.limit {
            Some(limit) => write!(f, "{text}, limit {}", Value(self.quantity, limit)),
            None => write!(f, "{text}"),
        }
    }
}

/// A number with its unit.
struct Value(Quantity, f64);

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(quantity, value) = *self;
        match quantity {
            Quantity::None => write!(f, "{value}"),
            Quantity::Degrees | Quantity::Millimetres => write!(f, "{value:.2} {quantity}"),
            Quantity::Milliseconds => write!(f, "{value:.1} {quantity}"),
            Quantity::Counts | Quantity::Milliamperes | Quantity::LateTicks | Quantity::Values => {
                write!(f, "{value:.0} {quantity}")
            }
            Quantity::ErrorCode | Quantity::Statusword => {
                write!(f, "{quantity} 0x{:04X}", value as u16)
            }
            Quantity::Sequence => write!(f, "{quantity} {value:.0}"),
        }
    }
}
