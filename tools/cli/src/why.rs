//! `i2ris why`: why the robot does not move, or not where it was sent, and what to do.

use i2ris::clock;
use i2ris::ipc::client::{Client, Latest};
use i2ris::ipc::payload::{ActuatorState, JointState, OperatingStateMsg};
use i2ris::ipc::{Fault, OperatingState, Refusal};
use i2ris::units::{MAX_MOTORS, Nanos};
use i2ris_terminal::{DomainOption, Failure, Screen, until_closed};

/// Time to wait for a controller that is starting.
const CONNECT: Nanos = Nanos::from_millis(2000);
/// Time limit for the first messages.
const FIRST_MESSAGES: Nanos = Nanos::from_millis(1000);
/// Polling period for them.
const POLL_PERIOD: Nanos = Nanos::from_millis(5);

/// Arguments of `i2ris why`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:
  i2ris why

One line per reason: code, sentence, what was measured, and what to do. The last refusal may be \
old: the monitor and the log have times.")]
pub struct Arguments {
    #[command(flatten)]
    domain: DomainOption,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// A reason for not moving as asked.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
struct Reason {
    /// `fault 3`, `refusal 9`, ...
    code: String,
    /// What it means.
    sentence: String,
    /// Measured values; may be empty.
    measured: String,
    /// What to do.
    advice: &'static str,
}

/// Runs it.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let mut client = Client::connect(&arguments.domain.domain()?, CONNECT)?;
    let state = client.wait_for(FIRST_MESSAGES, |_| true)?;
    let watcher = client.watcher();
    let (mut motors, mut goal) = (
        Latest::new(watcher.actuators()),
        Latest::new(watcher.goal_js()),
    );
    let start = clock::now();
    while (motors.refresh()?.is_none() || goal.refresh()?.is_none())
        && clock::now().since(start) < FIRST_MESSAGES
    {
        clock::sleep(POLL_PERIOD);
    }
    let reasons = reasons(&state, motors.value(), goal.value());
    let mut screen = Screen::stdout();
    if arguments.json {
        until_closed(screen.say(&serde_json::to_string(&reasons)?))?;
        return Ok(());
    }
    if reasons.is_empty() {
        until_closed(screen.say("nothing keeps the robot from moving: it waits for commands"))?;
    }
    for reason in &reasons {
        let measured = if reason.measured.is_empty() {
            String::new()
        } else {
            format!(" ({})", reason.measured)
        };
        let Reason {
            code,
            sentence,
            advice,
            ..
        } = reason;
        if !until_closed(screen.say(&format!("{code}: {sentence}{measured}\n  do: {advice}")))? {
            break;
        }
    }
    Ok(())
}

/// All reasons, the one that matters most first.
fn reasons(
    state: &OperatingStateMsg,
    motors: Option<&ActuatorState>,
    goal: Option<&JointState>,
) -> Vec<Reason> {
    let has = |flag: u32| state.flags & flag != 0;
    let mut reasons = Vec::new();
    let mut add = |code: String, sentence: String, measured: String, advice| {
        reasons.push(Reason {
            code,
            sentence,
            measured,
            advice,
        });
    };
    match OperatingState::from_number(state.state) {
        Some(OperatingState::Enabled) => {}
        Some(OperatingState::Fault) => {
            let fault = Fault::from_number(state.fault).unwrap_or(Fault::None);
            let measured = motors.map(measured_motors).unwrap_or_default();
            let code = format!("fault {}", fault.number());
            add(code, fault.to_string(), measured, fault_advice(fault));
        }
        Some(OperatingState::Paused) => add(
            "state PAUSED".to_owned(),
            "the robot holds, and servo commands are refused".to_owned(),
            String::new(),
            "i2ris command state resume",
        ),
        Some(OperatingState::Disabled) => add(
            "state DISABLED".to_owned(),
            "the drives are off".to_owned(),
            String::new(),
            "i2ris command state enable",
        ),
        None => add(
            format!("state {}", state.state),
            "a state of another release".to_owned(),
            String::new(),
            "build controller and tools from one release",
        ),
    }
    if !has(OperatingStateMsg::HOMED) {
        let refusal = Refusal::NotHomed;
        let code = format!("refusal {}", refusal.number());
        add(
            code,
            refusal.to_string(),
            String::new(),
            refusal_advice(refusal),
        );
    }
    if !has(OperatingStateMsg::MODEL) {
        let refusal = Refusal::NoModel;
        let code = format!("refusal {}", refusal.number());
        add(
            code,
            refusal.to_string(),
            String::new(),
            refusal_advice(refusal),
        );
    }
    if has(OperatingStateMsg::BUSY) {
        add(
            "busy".to_owned(),
            "a state command or a motion is being carried out".to_owned(),
            String::new(),
            "wait, or i2ris command state hold",
        );
    }
    if has(OperatingStateMsg::CLIPPED) {
        let measured = goal.map_or_else(String::new, |goal| {
            let [pitch, yaw, _] = goal.position.map(f64::to_degrees);
            format!("clipped to pitch {pitch:+.2}, yaw {yaw:+.2} deg")
        });
        add(
            "clip".to_owned(),
            "the pose is outside the calibrated hull or the position limits".to_owned(),
            measured,
            "command less, or calibrate a wider range",
        );
    }
    if state.stale_stops > 0 {
        add(
            "stop".to_owned(),
            "commands came later than their deadline, and the robot stopped in between".to_owned(),
            format!("{} times since the start", state.stale_stops),
            "send faster, or with a longer deadline; look at the load of the computer",
        );
    }
    if let Some(refusal) = Refusal::from_number(state.last_refusal)
        && refusal != Refusal::None
    {
        add(
            format!("refusal {}", refusal.number()),
            format!("the last refused command: {refusal}"),
            format!("{} servo commands refused since the start", state.refused),
            refusal_advice(refusal),
        );
    }
    reasons
}

fn measured_motors(motors: &ActuatorState) -> String {
    let count = (motors.count as usize).min(MAX_MOTORS);
    let motor = |motor: usize| {
        format!(
            "motor {motor}: {} counts of {} asked, {} mA, error 0x{:04X}",
            motors.measured_counts[motor],
            motors.setpoint_counts[motor],
            motors.current_ma[motor],
            motors.error_code[motor]
        )
    };
    (0..count).map(motor).collect::<Vec<_>>().join("; ")
}

fn fault_advice(fault: Fault) -> &'static str {
    match fault {
        Fault::None => "look at the controller's log, then i2ris command state acknowledge",
        Fault::Drive => "look the error code up in the drive's manual; then acknowledge",
        Fault::Link => "check cable and supply (i2ris doctor); then acknowledge",
        Fault::FollowingError => {
            "free the mechanism, or raise current_limit_ma or lower the velocity; then acknowledge"
        }
        Fault::DriveState => "check STO and supply, and close EPOS Studio; then acknowledge",
        Fault::DriveTimeout => "i2ris doctor; then acknowledge",
        Fault::Homing => "check the keys homing_* of the axis; then acknowledge",
        Fault::Model => "keep the black box (i2ris dump) and report it",
        Fault::Late => "take load off the computer, or give it real-time permission",
        Fault::Implausible => {
            "stop and look at the snake: slack or torn wire, wrong zero, old model, moved camera"
        }
        Fault::Current => "free the mechanism and look at the snake; then acknowledge",
    }
}

fn refusal_advice(refusal: Refusal) -> &'static str {
    match refusal {
        Refusal::None => "nothing",
        Refusal::NotFinite | Refusal::Malformed | Refusal::Sequence => "correct the client",
        Refusal::Stale => "send faster; stamp with the monotonic clock of this computer",
        Refusal::Stamp => "stamp with the monotonic clock of this computer",
        Refusal::Step => "start at setpoint_js and interpolate (command.max_step_deg)",
        Refusal::Lease => "end the other client, or wait until it is silent (i2ris monitor)",
        Refusal::NotEnabled => "i2ris command state enable",
        Refusal::NotHomed => "straighten the snake, then i2ris command state home",
        Refusal::NoModel => "i2ris model stage FILE and activate, or name it in the configuration",
        Refusal::Range => "command less, or correct the position limits of the axes",
        Refusal::State => "bring the robot to the right state (i2ris monitor)",
        Refusal::Busy | Refusal::Conditioning => "wait, or i2ris command state hold",
        Refusal::CausePersists => "remove the cause of the fault first",
        Refusal::Unsupported => "use a model of angles, or another command",
        Refusal::DrivesNotReady => "see the controller's log; i2ris doctor",
        Refusal::NothingStaged | Refusal::NoFormer => "i2ris model list",
        Refusal::MemoryUnknown => "i2ris command state condition, or --force",
        Refusal::Fixture => {
            "i2ris command fixture list: plan around the region, or switch the fixtures off"
        }
        Refusal::BadModel => "the controller's answer to `i2ris model stage` names the reason",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ready() -> OperatingStateMsg {
        OperatingStateMsg {
            state: OperatingState::Enabled.number(),
            flags: OperatingStateMsg::HOMED | OperatingStateMsg::MODEL,
            ..OperatingStateMsg::default()
        }
    }

    #[test]
    fn a_robot_that_is_ready_has_no_reason() {
        assert_eq!(reasons(&ready(), None, None), []);
    }

    #[test]
    fn every_fault_and_every_refusal_has_code_sentence_and_advice() {
        for fault in Fault::ALL.iter().filter(|fault| **fault != Fault::None) {
            let state = OperatingStateMsg {
                state: OperatingState::Fault.number(),
                fault: fault.number(),
                ..ready()
            };
            let motors = ActuatorState {
                count: 2,
                current_ma: [70, 0],
                ..ActuatorState::default()
            };
            let [reason] = &reasons(&state, Some(&motors), None)[..] else {
                panic!("{fault}");
            };
            assert_eq!(reason.code, format!("fault {}", fault.number()));
            assert_eq!(reason.sentence, fault.text());
            assert!(reason.measured.contains("70 mA") && !reason.advice.is_empty());
        }
        for refusal in Refusal::ALL.iter().filter(|it| **it != Refusal::None) {
            let state = OperatingStateMsg {
                last_refusal: refusal.number(),
                ..ready()
            };
            let [reason] = &reasons(&state, None, None)[..] else {
                panic!("{refusal}");
            };
            assert_eq!(reason.code, format!("refusal {}", refusal.number()));
            assert!(reason.sentence.contains(refusal.text()) && !reason.advice.is_empty());
        }
    }

    #[test]
    fn stops_clips_and_states_are_reasons_too() {
        let state = OperatingStateMsg {
            state: OperatingState::Paused.number(),
            flags: OperatingStateMsg::CLIPPED | OperatingStateMsg::BUSY,
            stale_stops: 3,
            ..OperatingStateMsg::default()
        };
        let goal = JointState {
            position: [0.5, 0.0, 0.0],
            ..JointState::default()
        };
        let reasons = reasons(&state, None, Some(&goal));
        let codes: Vec<&str> = reasons.iter().map(|reason| reason.code.as_str()).collect();
        let expected = [
            "state PAUSED",
            "refusal 6",
            "refusal 7",
            "busy",
            "clip",
            "stop",
        ];
        assert_eq!(codes, expected);
        assert!(reasons[4].measured.contains("+28.65"), "{:?}", reasons[4]);
    }
}
