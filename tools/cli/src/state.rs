//! `i2ris home`, `enable`, `disable`, and `i2ris command state`: changes of the state.

use i2ris::ipc::{Domain, OperatingState, StateCommand};
use i2ris_report::{DomainOption, Failure, Interrupt, Screen, until_closed};

use crate::command::prepare::carry_out;
use crate::command::stream_monitor::StopReason;
use crate::exit::name_holder;

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  i2ris home && i2ris enable
  i2ris disable

`i2ris command state` has the other changes: pause, resume, condition, acknowledge, ...")]
pub struct Arguments {
    /// End when the controller has accepted the command, and not when it is carried out
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
    let state = if arguments.no_wait {
        client.state_command(command)?
    } else {
        let state = carry_out(&mut client, command, &interrupt)?.state;
        OperatingState::from_number(state).ok_or(StopReason::Unknown(state))?
    };
    let report = if arguments.json {
        serde_json::json!({
            "accepted": command.text(), "done": !arguments.no_wait, "state": state.text()
        })
        .to_string()
    } else {
        let how = if arguments.no_wait { "accepted" } else { "done" };
        let stays = match (command, state) {
            (StateCommand::Disable, OperatingState::Fault) => {
                " until `i2ris command state acknowledge`; its drives are switched off"
            }
            _ => "",
        };
        format!("{how}: {command}; the controller is {state}{stays}")
    };
    until_closed(Screen::stdout().say(&report))?;
    Ok(())
}
