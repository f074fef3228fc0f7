//! Events as lines of the log.

use std::fmt;

use crate::core::adaptation::AdaptationEvent;
use crate::core::{CycleEvent, CycleEventKind, PlausibilityCheck};
use crate::ipc::ShownClient;
use crate::robot::Fault;

impl fmt::Display for CycleEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.reason() {
            Some(reason) => write!(f, "{}{}", self.kind, reason.text()),
            None => self.kind.fmt(f),
        }
    }
}

/// What happened; for an event with a cause, all but the cause.
impl fmt::Display for CycleEventKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::State { from, to, command, fault } => {
                write!(f, "{from} -> {to}")?;
                if let Some(command) = command {
                    write!(f, " by command {command}")?;
                }
                match fault {
                    Fault::None => Ok(()),
                    _ => write!(f, ", "),
                }
            }
            Self::StaleStop { client_id, .. } | Self::LimitStop { client_id, .. } => {
                write!(f, "{}: ", ShownClient(*client_id))
            }
            Self::FeedbackStop(_) => Ok(()),
            Self::Clipped { client_id: 0, .. } => write!(f, "move_jp: "),
            Self::Clipped { client_id, .. } => write!(f, "{}: ", ShownClient(*client_id)),
            Self::Lease { client_id: 0 } => write!(f, "lease is free"),
            Self::Lease { client_id } => write!(f, "lease taken by {}", ShownClient(*client_id)),
            Self::Refused { client_id, .. } => write!(f, "refused {}: ", ShownClient(*client_id)),
            Self::RequestRefused { client_id, command, .. } => {
                write!(f, "refused `{command}` of {}: ", ShownClient(*client_id))
            }
            Self::Model { from, to } => {
                write!(f, "model {to} took over")?;
                from.map_or(Ok(()), |from| write!(f, " from {from}"))
            }
            Self::Fixtures { client_id, active } => {
                write!(f, "virtual fixtures changed by {}: ", ShownClient(*client_id))?;
                write_fixtures(f, *active)
            }
            Self::FixtureLimit { region } => {
                write!(f, "warning: virtual fixture {} limits the goal", region + 1)
            }
            Self::Plausibility(check) => f.write_str(match check {
                PlausibilityCheck::Inactive => "the pose is not to be compared with a camera",
                PlausibilityCheck::Working => "the pose is compared with the camera",
                PlausibilityCheck::Silent => {
                    "warning: the camera is silent; the pose is NOT compared with it"
                }
                PlausibilityCheck::TooOld => {
                    "warning: frames of the camera are older than 0.5 s, or stamped by another \
                     clock; the pose is NOT compared with them"
                }
            }),
            Self::OtherCamera { frames } => write!(
                f,
                "warning: another camera publishes, too; {frames} of its frames were not followed"
            ),
            Self::Adaptation(event) => f.write_str(match event {
                AdaptationEvent::BudgetUsed => {
                    "warning: adaptation: the budget is used up, nothing more is learned; calibrate"
                }
                AdaptationEvent::TakenBack => {
                    "warning: adaptation: the adapted model was worse than the calibration for \
                     30 s; the correction is taken back"
                }
                AdaptationEvent::Slip => "adaptation: the zero has slipped; it is found anew",
                AdaptationEvent::SlipAgain => {
                    "warning: adaptation: the zero has slipped again; nothing more is learned until \
                     the robot was off: look at the camera and at the wires"
                }
                AdaptationEvent::CameraDisbelieved => {
                    "warning: adaptation: most frames of the camera are far from what is expected; \
                     nothing is learned from them"
                }
                AdaptationEvent::CameraBelieved => {
                    "adaptation: the frames of the camera are near what is expected again"
                }
            }),
            Self::Axis { motor, from, to, error_code } => {
                write!(f, "motor {motor}: {from:?} -> {to:?}")?;
                match error_code {
                    0 => Ok(()),
                    code => write!(f, ", error 0x{code:04X}"),
                }
            }
        }
    }
}

/// The numbers of the virtual fixtures that count.
fn write_fixtures(f: &mut fmt::Formatter<'_>, active: u32) -> fmt::Result {
    if active == 0 {
        return f.write_str("none counts");
    }
    let numbers = (0..u32::BITS).filter(|index| active & (1 << index) != 0);
    for (position, index) in numbers.enumerate() {
        let separator = if position == 0 { "" } else { ", " };
        write!(f, "{separator}{}", index + 1)?;
    }
    f.write_str(" count")
}
