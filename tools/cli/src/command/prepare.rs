//! Connects to a controller, enables the robot, and waits for the effect of state commands.

use i2ris::ipc::client::{Client, ClientError};
use i2ris::ipc::{Domain, OperatingState, Refusal, StateCommand};
use i2ris::{ipc::payload::OperatingStateMsg, units::Nanos};
use i2ris_report::{Failure, Interrupt, bail, while_working};

use super::stream_monitor::{StopReason, enabled};

pub const CONNECT: Nanos = Nanos::from_millis(2000);
pub const FIRST_MESSAGE_TIMEOUT: Nanos = Nanos::from_millis(2000);
/// Time limit for a motion begun by another client.
const MOTION_TIMEOUT: Nanos = Nanos::from_millis(300_000);
pub const HOMING: &str = "the present pose becomes the zero (where no hard stop is configured)";

#[derive(Debug, Clone, Copy, clap::Args)]
pub struct PrepareOptions {
    /// Enable the robot first, where necessary
    #[arg(long)]
    enable: bool,
    /// Home the robot first if its zero is unknown, and enable it: the present pose becomes the
    /// zero, so straighten the snake first
    #[arg(long)]
    home: bool,
}

impl PrepareOptions {
    /// Options allowed by an operator who typed yes.
    pub const ALL: Self = Self { enable: true, home: true };

    pub const ENABLE: Self = Self { enable: true, home: false };

    pub fn is_given(self) -> bool {
        self.enable || self.home
    }
}

pub fn connect(domain: &Domain) -> Result<Client, ClientError> {
    Client::connect(domain, CONNECT)
}

/// Brings the controller to ENABLED, as far as the options permit it, and returns the state.
pub fn prepare(
    client: &mut Client,
    options: PrepareOptions,
    interrupt: &Interrupt,
) -> Result<OperatingStateMsg, Failure> {
    let enable = options.enable || options.home;
    let mut state = client.wait_for(FIRST_MESSAGE_TIMEOUT, |_| true).map_err(silent)?;
    if enable && enabled(&state) == Err(StopReason::NotEnabled(OperatingState::Paused)) {
        state = carry_out(client, StateCommand::Resume, interrupt)?;
    }
    if enable && enabled(&state) == Err(StopReason::NotEnabled(OperatingState::Disabled)) {
        // The command waits for starting drives, and is refused if they have not kept their zero.
        state = match carry_out(client, StateCommand::Enable, interrupt) {
            Err(failure) if is_not_homed(&failure) && options.home => {
                carry_out(client, StateCommand::Home, interrupt)?;
                carry_out(client, StateCommand::Enable, interrupt)?
            }
            Err(failure) if is_not_homed(&failure) => return Err(StopReason::NotHomed.into()),
            outcome => outcome?,
        };
    }
    enabled(&state)?;
    if is_busy(&state) {
        state = while_working("the robot is busy", || wait_until_idle(client, interrupt))?;
        enabled(&state)?;
    }
    Ok(state)
}

/// Sends a state command and waits for its effect. On an interrupt, a remaining motion is held.
pub fn carry_out(
    client: &mut Client,
    command: StateCommand,
    interrupt: &Interrupt,
) -> Result<OperatingStateMsg, Failure> {
    if command == StateCommand::Home {
        eprintln!("homing: {HOMING}");
    }
    while_working(command.text(), || {
        let outcome = client.carry_out(command, || interrupt.came());
        if matches!(outcome, Err(ClientError::WaitCancelled(StateCommand::Condition))) {
            client.state_command(StateCommand::Hold)?;
        }
        Ok(outcome?)
    })
}

fn is_not_homed(failure: &Failure) -> bool {
    matches!(failure.downcast_ref(), Some(ClientError::Refused { refusal: Refusal::NotHomed, .. }))
}

fn is_busy(state: &OperatingStateMsg) -> bool {
    state.flags & OperatingStateMsg::BUSY != 0
}

fn silent(error: ClientError) -> Failure {
    if matches!(error, ClientError::Timeout(_)) { StopReason::Silent.into() } else { error.into() }
}

/// Waits for the end of another client's motion. A fault or an interrupt ends the wait.
fn wait_until_idle(
    client: &mut Client,
    interrupt: &Interrupt,
) -> Result<OperatingStateMsg, Failure> {
    let is_ended = |state: &OperatingStateMsg| !is_busy(state) || interrupt.came();
    let state = match client.wait_for(MOTION_TIMEOUT, is_ended) {
        Err(ClientError::Timeout(waited)) => {
            let seconds = waited.as_seconds();
            bail!("the robot was busy for {seconds} s; see `i2ris status`");
        }
        other => other?,
    };
    if is_busy(&state) { Err("interrupted while the robot is busy".into()) } else { Ok(state) }
}
