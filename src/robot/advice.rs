//! What to do about a fault, a refusal, a stop or a clip: one sentence each.

use super::{Clip, Fault, OperatingState, Refusal, Stop};

pub(super) fn fault_advice(fault: Fault) -> &'static str {
    match fault {
        Fault::None => "read the controller's log, then `i2ris command state acknowledge`",
        Fault::Drive => {
            "look the error code up in the drive's manual; then `i2ris command state acknowledge`"
        }
        Fault::Link => {
            "check cable and supply (`i2ris doctor`); then `i2ris command state acknowledge`"
        }
        Fault::FollowingError => {
            "free the mechanism, or raise `current_limit_ma`, or go slower; then `i2ris command \
             state acknowledge`"
        }
        Fault::DriveState => {
            "check STO and supply, and close EPOS Studio; then `i2ris command state acknowledge`"
        }
        Fault::DriveTimeout => {
            "check the drives with `i2ris doctor`; then `i2ris command state acknowledge`"
        }
        Fault::Homing => {
            "check the keys `homing_*` of the axis; then `i2ris command state acknowledge`"
        }
        Fault::Model => "keep the black box (`i2ris record dump`) and report it",
        Fault::Late => {
            "take load off the computer, or give it real-time permission; then `i2ris command \
             state acknowledge`"
        }
        Fault::Implausible => {
            "look at wires, zero, model and camera; then `i2ris command state acknowledge`"
        }
        Fault::Current => {
            "free the mechanism and look at the snake; then `i2ris command state acknowledge`"
        }
    }
}

pub(super) fn refusal_advice(refusal: Refusal) -> &'static str {
    match refusal {
        Refusal::None => "nothing",
        Refusal::NotFinite => "correct the client: it sends NaN or an infinite value",
        Refusal::Malformed => "correct the client: number of values, flags and client id",
        Refusal::Sequence => "correct the client: count the sequence number up by one per command",
        Refusal::Stale => "send faster; stamp with the monotonic clock of this computer",
        Refusal::Stamp => {
            "stamp with the monotonic clock of this computer, in the order of sending; ask for a \
             deadline of 1 s at most"
        }
        Refusal::Step => "start at `setpoint_js` and interpolate (`command.max_step_deg`)",
        Refusal::Lease => "end the other client, or wait until it is silent (`i2ris status`)",
        Refusal::NotEnabled => "`i2ris enable`",
        Refusal::Paused => "`i2ris command state resume`",
        Refusal::InFault => {
            "remove the cause of the fault (`i2ris status`), then `i2ris command state acknowledge`"
        }
        Refusal::NotDisabled => "`i2ris disable`",
        Refusal::NoFault => "go on: nothing is to be done",
        Refusal::Unwatched => {
            "read the log of `i2ris-watchdog`; let it hold every port, or end the process \
             that `i2ris doctor` names"
        }
        Refusal::NotHomed => "straighten the snake, then `i2ris home`",
        Refusal::NoModel => {
            "`i2ris model use FILE`, or name it in the \
             configuration"
        }
        Refusal::Range => {
            "command less, or correct the position limits of the axes or `joint_limits`"
        }
        Refusal::State => {
            "`i2ris command state hold`; a controller that ends has to be started again"
        }
        Refusal::Busy | Refusal::Conditioning => {
            "wait until it is done, or `i2ris command state hold` and a second"
        }
        Refusal::CausePersists => "remove the cause of the fault first",
        Refusal::Unsupported => "use a model of angles, or another command",
        Refusal::DrivesNotReady => "wait for the drives to start; else `i2ris doctor`",
        Refusal::NothingStaged => "`i2ris model use FILE`; `i2ris model show` lists what is loaded",
        Refusal::NoFormer => "`i2ris model use FILE` instead",
        Refusal::MemoryUnknown => "`i2ris command state condition`, or `--force`",
        Refusal::Fixture => {
            "go around the region (`i2ris command fixture list`), or switch the fixtures off"
        }
        Refusal::Reach => "command less, or calibrate a wider range",
        Refusal::BrokenOff => {
            "stop sending for a second, `hold` as this client, then begin where the snake is"
        }
        Refusal::BadModel => "read the reason in the controller's answer to `i2ris model use`",
    }
}

pub(super) fn stop_advice(stop: Stop) -> &'static str {
    match stop {
        Stop::Stale => "send faster, or with a longer deadline; look at the load of the computer",
        Stop::Feedback => {
            "take load off the computer if ticks are missed (`i2ris status`), else check cable and \
             supply (`i2ris doctor`)"
        }
        Stop::Watchdog => "start `i2ris-watchdog --config FILE` again, and read its log",
        Stop::Command => "ask who gave it (`i2ris status`), then give the command again",
        Stop::Fixture => "switch the fixtures off (`i2ris command fixture off`), then again",
        Stop::Limit => "begin further inside the limits, or correct them",
        Stop::Hull => "begin further inside the calibrated range, or calibrate a wider one",
        Stop::Setpoint => "read which object the drive refuses in the log, then `i2ris disable`",
        Stop::Speed => "raise `joint_limits`, or calibrate again: the model jumps there",
        Stop::Fault => "remove the cause (`i2ris status`), then give the command again",
    }
}

pub(super) fn clip_advice(clip: Clip) -> &'static str {
    match clip {
        Clip::Reach => "command less, or calibrate a wider range",
        Clip::Motor => "command less, or check `position_min_counts`, `position_max_counts`",
        Clip::Joint => "command less, or check the positions in `joint_limits`",
        Clip::Fixture => "go around the region (`i2ris command fixture list`)",
    }
}

pub(super) fn state_advice(state: OperatingState) -> &'static str {
    match state {
        OperatingState::Disabled => "`i2ris enable`",
        OperatingState::Enabled => "send commands",
        OperatingState::Paused => "`i2ris command state resume`",
        OperatingState::Fault => "remove the cause, then `i2ris command state acknowledge`",
    }
}

pub(super) fn state_sentence(state: OperatingState) -> &'static str {
    match state {
        OperatingState::Disabled => "the drives are off",
        OperatingState::Enabled => "the robot waits for commands",
        OperatingState::Paused => "the robot holds, and servo commands are refused",
        OperatingState::Fault => "a fault is latched",
    }
}
