//! The streams `error` and `warning`: why the robot does not move, or not as commanded.

use iceoryx2::prelude::ZeroCopySend;

use super::definition::{padded_text, payload, unpadded_text};
use super::state_streams::OperatingStateMsg;
use crate::robot::{Cause, Fault, Measurement, OperatingState, Quantity, Reason, Refusal};
use crate::units::Nanos;

payload! {
    /// `error` (faults) and `warning` (refusals, stops, clips), out. Code, sentence and advice are
    /// the same in the log and in every program.
    ReasonMsg "I2risReasonV1": outgoing {
        /// The client whose command it concerns; 0: none.
        pub client_id: u64,
        /// The measured value, in the unit of `quantity`.
        pub measured: f64,
        /// The limit that it broke.
        pub limit: f64,
        /// 1 fault, 2 refusal, 3 stop, 4 clip.
        pub kind: u32,
        /// [`crate::robot::Fault`], [`crate::robot::Refusal`], [`crate::robot::Stop`] or
        /// [`crate::robot::Clip`].
        pub number: u32,
        /// [`crate::robot::Quantity`] of `measured` and `limit`.
        pub quantity: u32,
        /// Index of the motor.
        pub motor: u32,
        /// Sum of [`ReasonMsg::MEASURED`], [`ReasonMsg::LIMIT`], [`ReasonMsg::MOTOR`].
        pub flags: u32,
        /// 0.
        pub reserved: u32,
        /// Code, sentence, measured value and limit; UTF-8, padded with 0.
        pub text: [u8; 192],
        /// Recommended action; UTF-8, padded with 0.
        pub advice: [u8; 128],
    }
}

impl ReasonMsg {
    /// Flag: `measured` and `quantity` are valid.
    pub const MEASURED: u32 = 1;
    /// Flag: `limit` is valid.
    pub const LIMIT: u32 = 2;
    /// Flag: `motor` is valid.
    pub const MOTOR: u32 = 4;

    /// The message of a reason.
    #[must_use]
    pub fn new(reason: &Reason, client_id: u64, stamp: Nanos) -> Self {
        let ([measured, limit], [quantity, motor, flags]) = fields(reason.measurement);
        Self {
            stamp_ns: stamp.0,
            client_id,
            measured,
            limit,
            kind: reason.cause.kind(),
            number: reason.cause.number(),
            quantity,
            motor,
            flags,
            text: padded_text(&reason.text()),
            advice: padded_text(reason.cause.advice()),
            ..Self::default()
        }
    }

    /// The reason; `None` for one of another release.
    #[must_use]
    pub fn reason(&self) -> Option<Reason> {
        let cause = Cause::from_numbers(self.kind, self.number)?;
        let numbers = [self.quantity, self.motor, self.flags];
        Some(Reason { cause, measurement: measurement([self.measured, self.limit], numbers) })
    }

    /// Code, sentence, measured value and limit.
    #[must_use]
    pub fn text(&self) -> String {
        unpadded_text(&self.text)
    }

    /// Recommended action.
    #[must_use]
    pub fn advice(&self) -> String {
        unpadded_text(&self.advice)
    }
}

impl OperatingStateMsg {
    /// Reasons that keep the robot from moving now, the most important first.
    #[must_use]
    pub fn causes(&self) -> Vec<Cause> {
        let lacks = |flag: u32| self.flags & flag == 0;
        let first = match OperatingState::from_number(self.state) {
            Some(OperatingState::Enabled) | None => None,
            Some(OperatingState::Fault) => {
                let fault = Fault::from_number(self.fault).filter(|fault| *fault != Fault::None);
                Some(fault.map_or(Cause::State(OperatingState::Fault), Cause::Fault))
            }
            Some(state) => Some(Cause::State(state)),
        };
        // The order in which they can be removed: enabling needs the zero.
        let is_off = self.state == OperatingState::Disabled.number();
        let zero_first =
            (is_off && lacks(Self::HOMED)).then_some(Cause::Refusal(Refusal::NotHomed));
        let others = [
            (!is_off && lacks(Self::HOMED), Refusal::NotHomed),
            (lacks(Self::MODEL), Refusal::NoModel),
            (!lacks(Self::BUSY), Refusal::Busy),
        ];
        let others = others.into_iter().filter(|(is_present, _)| *is_present);
        zero_first
            .into_iter()
            .chain(first)
            .chain(others.map(|(_, refusal)| Cause::Refusal(refusal)))
            .collect()
    }
}

/// A [`Measurement`] as fields of a payload: value and limit; quantity, motor and flags.
pub(super) fn fields(measurement: Option<Measurement>) -> ([f64; 2], [u32; 3]) {
    let flag = |is_known: bool, flag: u32| if is_known { flag } else { 0 };
    let limit = measurement.and_then(|it| it.limit);
    let motor = measurement.and_then(|it| it.motor);
    let flags = flag(measurement.is_some(), ReasonMsg::MEASURED)
        | flag(limit.is_some(), ReasonMsg::LIMIT)
        | flag(motor.is_some(), ReasonMsg::MOTOR);
    let quantity = measurement.map_or(0, |it| it.quantity.number());
    let measured = measurement.map_or(0.0, |it| it.measured);
    ([measured, limit.unwrap_or(0.0)], [quantity, motor.map_or(0, u32::from), flags])
}

/// The opposite of [`fields`].
pub(super) fn measurement(
    [measured, limit]: [f64; 2],
    [quantity, motor, flags]: [u32; 3],
) -> Option<Measurement> {
    let has = |flag: u32| flags & flag != 0;
    let quantity = Quantity::from_number(quantity)?;
    has(ReasonMsg::MEASURED).then_some(Measurement {
        motor: u8::try_from(motor).ok().filter(|_| has(ReasonMsg::MOTOR)),
        quantity,
        measured,
        limit: has(ReasonMsg::LIMIT).then_some(limit),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reason_fits_a_message_unchanged() {
        let measurements = [
            None,
            Some(Measurement::new(Quantity::ErrorCode, 34_321.0, None)),
            Some(Measurement::new(Quantity::Degrees, 123_456.78, Some(123_456.78)).of_motor(1)),
        ];
        for cause in Cause::all() {
            for measurement in measurements {
                let reason = Reason { cause, measurement };
                let message = ReasonMsg::new(&reason, 7, Nanos(9));
                assert_eq!(message.reason(), Some(reason));
                assert_eq!(message.text(), reason.text(), "cut");
                assert_eq!(message.advice(), cause.advice(), "cut");
                assert_eq!((message.client_id, message.stamp_ns), (7, 9));
            }
        }
        let foreign =
            ReasonMsg { kind: 9, ..ReasonMsg::new(&Cause::Fault(Fault::Late).into(), 0, Nanos(1)) };
        assert_eq!(foreign.reason(), None);
        assert!(foreign.text().contains("late ticks"));
    }
}
