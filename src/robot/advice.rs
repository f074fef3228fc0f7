//! Recommended action for a fault, a refusal, a stop or a clip: one sentence each.

use super::{Clip, Fault, OperatingState, Refusal, Stop};

pub(super) fn fault_advice(fault: Fault) -> &'static str {
    match fault {
        Fault::None => "read the controller's log, then `i2ris command state acknowledge`",
        Fault::Drive => {
            "look up the error code in the drive's manual; then `i2ris command state acknowledge`"
        }
        Fault::Link => {
            "check cable and supply (`i2ris doctor`); then `i2ris command state acknowledge`"
        }
        Fault::FollowingError => {
            "free the mechanism, raise `current_limit_ma`, or command slower motion; then `i2ris \
             command state acknowledge`"
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
        Fault::Model => "save the black box (`i2ris record dump`) and report it",
        Fault::Late => {
            "reduce the load on the computer, or grant real-time permission; then `i2ris command \
             state acknowledge`"
        }
        Fault::Implausible => {
            "check camera, wires, zero and model; then `i2ris command state acknowledge`"
        }
        Fault::Current => {
            "free the mechanism and inspect the snake; then `i2ris command state acknowledge`"
        }
    }
}

pub(super) fn refusal_advice(refusal: Refusal) -> &'static str {
    match refusal {
        Refusal::None => "nothing",
        Refusal::NotFinite => "fix the client: it sends NaN or an infinite value",
        Refusal::Malformed => "fix the client: number of values, flags and client id",
        Refusal::Sequence => "fix the client: increase the sequence number by one per command",
        Refusal::Stale => "send faster; stamp with the monotonic clock of this computer",
        Refusal::Stamp => {
            "stamp with the monotonic clock of this computer, in sending order; use a deadline of \
             at most 1 s"
        }
        Refusal::StepTooLarge => {
            "start at `setpoint_js` and interpolate: at most `command.max_step_deg` per command \
             (motors: `max_step_counts`)"
        }
        Refusal::Lease => "end the other client, or wait until it stops sending (`i2ris status`)",
        Refusal::NotEnabled => "`i2ris enable`",
        Refusal::Paused => "`i2ris command state resume`",
        Refusal::InFault => {
            "remove the cause of the fault (`i2ris status`), then `i2ris command state acknowledge`"
        }
        Refusal::NotDisabled => "`i2ris disable`",
        Refusal::NoFault => "continue; no action is needed",
        Refusal::WatchdogNotReady => {
            "give the watchdog access to every port (see its log), or end it (see `i2ris \
             doctor`): the robot then runs without a watchdog"
        }
        Refusal::NotHomed => "straighten the snake, then `i2ris home`",
        Refusal::NoModel => "`i2ris model use FILE`, or name it in the configuration",
        Refusal::Range => {
            "stay within the position limits, or correct them (`position_min_counts`, \
             `position_max_counts`, `joint_limits`)"
        }
        Refusal::WrongState => {
            "`i2ris command state hold`; if the controller is shutting down, start it again"
        }
        Refusal::Busy | Refusal::Conditioning => {
            "wait until it is done, or send `i2ris command state hold` and wait 1 s"
        }
        Refusal::CausePersists => "remove the cause of the fault first",
        Refusal::Unsupported => "use a model whose outputs are angles, or another command",
        Refusal::DrivesNotReady => {
            "wait for the drives to start; if they do not, run `i2ris doctor`"
        }
        Refusal::NothingStaged => "`i2ris model use FILE`; `i2ris model show` lists what is loaded",
        Refusal::NoPreviousModel => "`i2ris model use FILE` instead",
        Refusal::MemoryUnknown => "`i2ris command state condition`, or `--force`",
        Refusal::Fixture => {
            "go around the region (`i2ris command fixture list`), or switch the fixtures off"
        }
        Refusal::OutOfReach => "command a smaller angle, or calibrate a wider range",
        Refusal::StreamInterrupted => {
            "(1) read `i2ris status`, (2) fix the stream; stay silent for 1 s, send `hold` as \
             this client, then restart from `setpoint_js`"
        }
        Refusal::BadModel => "read the reason in the controller's reply to `i2ris model use`",
    }
}

pub(super) fn stop_advice(stop: Stop) -> &'static str {
    match stop {
        Stop::Stale => "send faster, or use a longer deadline; check the load on the computer",
        Stop::Feedback => {
            "missed ticks (`i2ris status`): reduce the load; else check cable and supply (`i2ris \
             doctor`); zero lost: home again"
        }
        Stop::Watchdog => "start `i2ris-watchdog --config FILE` again and read its log",
        Stop::Command => "find the sender (`i2ris status`), then repeat the command",
        Stop::Fixture => {
            "switch the fixtures off (`i2ris command fixture off`), then repeat the command"
        }
        Stop::Limit => "start further inside the limits, or correct them",
        Stop::Hull => "start further inside the calibrated range, or calibrate a wider one",
        Stop::Setpoint => "`i2ris disable`, then find in the log which object the drive refuses",
        Stop::Speed => {
            "raise the rates in `joint_limits`, or, if the model jumps there, calibrate \
             again"
        }
        Stop::Fault => "remove the cause (`i2ris status`), then repeat the command",
    }
}

pub(super) fn clip_advice(clip: Clip) -> &'static str {
    match clip {
        Clip::Reach => "command a smaller angle, or calibrate a wider range",
        Clip::Motor => {
            "command a smaller angle, or check `position_min_counts`, `position_max_counts`"
        }
        Clip::Joint => "command a smaller angle, or check the positions in `joint_limits`",
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
