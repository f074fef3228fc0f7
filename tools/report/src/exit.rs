//! Exit codes: one number per kind of failure, so that scripts can tell them apart.

use i2ris::config::ConfigError;
use i2ris::ipc::DomainError;
use i2ris::ipc::client::ClientError;
use i2ris::robot::Cause;

use crate::Failure;

/// The exit codes, as the help of `i2ris` prints them.
pub const HELP: &str = "Exit codes:
  0    done
  1    failed; the last line on standard error says why
  2    the command line is wrong
  3    no controller serves the domain, it does not answer, or it is of another version
  4    the controller refused: not homed, not enabled, another client commands, a bad model, ...
  5    the robot is in FAULT
  6    a configuration is not valid
  7    a pose was out of reach: the robot went as near as permitted
  8    not confirmed: that the robot is at rest, that a drive is off, or that the memory is known
  9    a configuration is valid but not ready for a robot: it has unchecked lines, or limits that
       its serial lines cannot keep
  10   a file is damaged or truncated: the intact part was read, the rest is reported
  130  interrupted twice, or the terminal was closed";

pub const OUT_OF_REACH: u8 = 7;
/// The effect could not be confirmed.
pub const NOT_CONFIRMED: u8 = 8;
/// A configuration is valid but not ready for a robot.
pub const NOT_READY: u8 = 9;
/// Only a part of a file could be read.
pub const INCOMPLETE: u8 = 10;
pub const INTERRUPTED: u8 = 130;

/// A failure that names its exit code.
#[derive(Debug, thiserror::Error)]
#[error("{sentence}")]
pub struct Coded {
    pub code: u8,
    pub sentence: String,
}

pub fn code(failure: &Failure) -> u8 {
    if let Some(coded) = failure.downcast_ref::<Coded>() {
        return coded.code;
    }
    match failure.downcast_ref::<ClientError>() {
        Some(
            ClientError::NoController(_)
            | ClientError::Interface { .. }
            | ClientError::NoReply { .. }
            | ClientError::Restarted
            | ClientError::Timeout(_),
        ) => 3,
        Some(ClientError::Interrupted { cause: Cause::Fault(_), .. }) => 5,
        Some(
            ClientError::Refused { .. }
            | ClientError::ModelRefused { .. }
            | ClientError::Interrupted { .. },
        ) => 4,
        Some(ClientError::NotConfirmed(_)) => NOT_CONFIRMED,
        Some(ClientError::Domain(DomainError::Name(_))) => 2,
        Some(_) => 1,
        None if failure.is::<ConfigError>() => 6,
        // Domains come from the command line or from I2RIS_DOMAIN.
        None if matches!(failure.downcast_ref(), Some(DomainError::Name(_))) => 2,
        None => 1,
    }
}

#[cfg(test)]
mod tests {
    use i2ris::config::Config;
    use i2ris::ipc::{Fault, Refusal, StateCommand};
    use i2ris::robot::Stop;

    use super::*;

    #[test]
    fn every_failure_has_the_exit_code_of_the_help() {
        let refused = ClientError::Refused {
            command: StateCommand::Enable,
            refusal: Refusal::NotHomed,
            measurement: None,
            state: None,
        };
        let sentence = "the robot is in FAULT".to_owned();
        let no_config = Config::load(std::path::Path::new("/nowhere")).unwrap_err();
        let no_domain = i2ris::ipc::Domain::new("a/b").unwrap_err();
        let command = StateCommand::Condition;
        let cases: [(Failure, u8); 9] = [
            (no_domain.into(), 2),
            ("something".into(), 1),
            (ClientError::NoController("x".to_owned()).into(), 3),
            (refused.into(), 4),
            (Coded { code: 5, sentence }.into(), 5),
            (ClientError::Interrupted { command, cause: Cause::Fault(Fault::Link) }.into(), 5),
            (ClientError::Interrupted { command, cause: Cause::Stop(Stop::Feedback) }.into(), 4),
            (ClientError::NotConfirmed(command).into(), 8),
            (no_config.into(), 6),
        ];
        for (failure, expected) in cases {
            assert_eq!(code(&failure), expected, "{failure}");
            assert!(HELP.contains(&format!("\n  {expected} ")), "{expected}");
        }
    }
}
