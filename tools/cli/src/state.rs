//! `i2ris home`, `enable`, `disable`, and `i2ris command state`: changes of the state.

use i2ris::ipc::{Domain, OperatingState, StateCommand};
use i2ris_report::{DomainOption, Failure, Interrupt};

use crate::command::prepare::{FIRST_MESSAGE_TIMEOUT, carry_out};
use crate::command::stream_monitor::StopReason;
use crate::exit::name_holder;
use crate::procedure::person::say;

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  i2ris home && i2ris enable
  i2ris disable

`i2ris command state` has the other changes: pause, resume, condition, acknowledge, ...")]
pub struct Arguments {
    /// Return when the controller has accepted the command, without waiting for its completion
    #[arg(long)]
    no_wait: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    domain: DomainOption,
}

pub fn run(arguments: &Arguments, command: StateCommand) -> Result<(), Failure> {
    let domain = arguments.domain.domain()?;
    change(&domain, arguments, command).map_err(|failure| name_holder(failure, &domain))
}

fn change(domain: &Domain, arguments: &Arguments, command: StateCommand) -> Result<(), Failure> {
    let (mut client, interrupt) = (crate::command::prepare::connect(domain)?, Interrupt::catch()?);
    let (state, message) = if arguments.no_wait {
        let state = client.state_command(command)?;
        // Without a message the power state is unknown.
        let newest = client.wait_for(FIRST_MESSAGE_TIMEOUT, |_| true);
        (state, newest.unwrap_or_default())
    } else {
        let message = carry_out(&mut client, command, &interrupt)?;
        let state = OperatingState::from_number(message.state);
        (state.ok_or(StopReason::Unknown(message.state))?, message)
    };
    let report = if arguments.json {
        serde_json::json!({
            "accepted": command.text(), "done": !arguments.no_wait, "state": state.text()
        })
        .to_string()
    } else {
        let how = if arguments.no_wait { "accepted" } else { "done" };
        let stays = match state {
            OperatingState::Fault => " until `i2ris command state acknowledge`",
            _ => "",
        };
        let power = match command {
            StateCommand::Disable => format!("{stays}; {}", message.power().text()),
            _ => String::new(),
        };
        format!("{how}: {command}; the controller is {state}{power}")
    };
    say(&report)
}
