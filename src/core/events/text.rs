//! Log texts of events.

use std::fmt;

use super::{AdaptationEvent, CycleEvent, CycleEventKind, PlausibilityCheck};
use crate::robot::{Fault, MaskedClientId};

impl fmt::Display for CycleEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.reason() {
            Some(reason) => write!(f, "{}{}", self.kind, reason.text()),
            None => self.kind.fmt(f),
        }
    }
}

/// Text of an event without its cause.
impl fmt::Display for CycleEventKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::State { from, to, command, fault } => {
                write!(f, "{from} -> {to}")?;
                if let Some(command) = command {
                    write!(f, " by command {command}")?;
                }
                if *fault == Fault::None { Ok(()) } else { write!(f, ", ") }
            }
            Self::Clipped { client_id: 0, .. } => write!(f, "move_jp: "),
            Self::StaleStop { client_id, .. }
            | Self::LimitStop { client_id, .. }
            | Self::Clipped { client_id, .. } => write!(f, "{}: ", MaskedClientId(*client_id)),
            Self::FeedbackStop(_) => Ok(()),
            Self::Lease { client_id: 0 } => write!(f, "lease is free"),
            Self::Lease { client_id } => write!(f, "lease taken by {}", MaskedClientId(*client_id)),
            Self::Refused { client_id, .. } => {
                write!(f, "refused {}: ", MaskedClientId(*client_id))
            }
            Self::RequestRefused { client_id, command, .. } => {
                write!(f, "refused `{command}` of {}: ", MaskedClientId(*client_id))
            }
            Self::Model { from, to } => {
                write!(f, "model {to} took over")?;
                from.map_or(Ok(()), |from| write!(f, " from {from}"))
            }
            Self::Fixtures { client_id, active } => {
                write!(f, "virtual fixtures changed by {}: ", MaskedClientId(*client_id))?;
                write_fixtures(f, *active)
            }
            Self::FixtureLimit { region } => {
                write!(f, "warning: virtual fixture {} limits the goal", region + 1)
            }
            Self::Plausibility(check) => f.write_str(match check {
                PlausibilityCheck::Inactive => "camera plausibility check off",
                PlausibilityCheck::Working => "camera plausibility check on",
                PlausibilityCheck::Silent => {
                    "warning: the camera is silent; the pose is NOT checked against it"
                }
                PlausibilityCheck::TooOld => {
                    "warning: camera frames are older than 0.5 s or stamped by a different clock; \
                     the pose is NOT checked against them"
                }
            }),
            Self::OtherCamera { frames } => write!(
                f,
                "warning: a second camera is publishing; {frames} of its frames were ignored"
            ),
            Self::Adaptation(event) => f.write_str(match event {
                AdaptationEvent::BudgetUsed => {
                    "warning: adaptation: the budget is used up; adaptation has stopped; \
                     recalibrate"
                }
                AdaptationEvent::Reverted => {
                    "warning: adaptation: the adapted model was worse than the calibrated model \
                     for 30 s; the correction was reverted"
                }
                AdaptationEvent::Slip => "adaptation: the zero has shifted; estimating it again",
                AdaptationEvent::SlipAgain => {
                    "warning: adaptation: the zero has shifted again; adaptation is paused until \
                     the robot has been disabled: check the camera and the wires"
                }
                AdaptationEvent::CameraRejected => {
                    "warning: adaptation: most camera frames are far from the expected pose; \
                     adaptation ignores them"
                }
                AdaptationEvent::CameraAccepted => {
                    "adaptation: the camera frames agree with the expected pose again"
                }
            }),
            Self::Axis { motor, from, to, error_code } => {
                write!(f, "motor {motor}: {from:?} -> {to:?}")?;
                if *error_code == 0 { Ok(()) } else { write!(f, ", error 0x{error_code:04X}") }
            }
        }
    }
}

fn write_fixtures(f: &mut fmt::Formatter<'_>, active: u32) -> fmt::Result {
    if active == 0 {
        return f.write_str("none active");
    }
    let numbers = (0..u32::BITS).filter(|index| active & (1 << index) != 0);
    for (position, index) in numbers.enumerate() {
        let separator = if position == 0 { "" } else { ", " };
        write!(f, "{separator}{}", index + 1)?;
    }
    f.write_str(" active")
}
