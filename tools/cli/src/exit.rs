//! What the program says to the shell: a number per kind of failure, so that scripts can tell them
//! apart.

use std::process::ExitCode;

use i2ris::config::ConfigError;
use i2ris::ipc::client::ClientError;

use crate::Failure;
use crate::command::watch::Stop;

/// What stands below the help.
pub const HELP: &str = "Exit codes:
  0    done
  1    failed; the last line on standard error says why
  2    the command line is wrong
  3    no controller serves the domain, it does not answer, or it is of another version
  4    the controller refuses: not homed, not enabled, another client commands, a bad model, ...
  5    the robot is in FAULT
  6    a configuration is not valid
  130  interrupted twice";

/// The number for a failure.
pub fn code(failure: &Failure) -> ExitCode {
    ExitCode::from(number(failure))
}

fn number(failure: &Failure) -> u8 {
    if let Some(error) = failure.downcast_ref::<ClientError>() {
        return match error {
            ClientError::NoController { .. }
            | ClientError::Interface { .. }
            | ClientError::NoReply { .. }
            | ClientError::Timeout { .. } => 3,
            ClientError::Refused { .. } | ClientError::ModelRefused { .. } => 4,
            _ => 1,
        };
    }
    if let Some(stop) = failure.downcast_ref::<Stop>() {
        return match stop {
            Stop::Silent | Stop::Ignored | Stop::Restarted | Stop::Unknown(_) => 3,
            Stop::NotEnabled(_) | Stop::Lease(_) | Stop::LostLease(_) | Stop::Refused(_) => 4,
            Stop::Fault(_) => 5,
        };
    }
    if failure.is::<ConfigError>() { 6 } else { 1 }
}

#[cfg(test)]
mod tests {
    use i2ris::ipc::{Fault, Refusal, StateCommand};

    use super::*;

    #[test]
    fn every_kind_of_failure_has_the_number_that_the_help_tells() {
        let refused = ClientError::Refused {
            command: StateCommand::Enable,
            refusal: Refusal::NotHomed,
            state: None,
        };
        let cases: [(Failure, u8); 6] = [
            ("something".into(), 1),
            (
                ClientError::NoController {
                    domain: "x".to_owned(),
                }
                .into(),
                3,
            ),
            (refused.into(), 4),
            (Stop::Lease(7).into(), 4),
            (Stop::Fault(Fault::Drive).into(), 5),
            (
                i2ris::config::Config::load(std::path::Path::new("/nowhere"))
                    .unwrap_err()
                    .into(),
                6,
            ),
        ];
        for (failure, expected) in cases {
            assert_eq!(number(&failure), expected, "{failure}");
            assert!(HELP.contains(&format!("\n  {expected} ")), "{expected}");
        }
    }
}
