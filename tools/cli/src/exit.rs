//! Exit codes of commands that end while the robot moves.

use i2ris_terminal::Failure;
use i2ris_terminal::exit::Coded;

use crate::command::watch::Stop;

/// Gives a failure that is a [`Stop`] its exit code.
pub fn with_code(failure: Failure) -> Failure {
    let Some(stop) = failure.downcast_ref::<Stop>() else {
        return failure;
    };
    let code = match stop {
        Stop::Silent | Stop::Ignored | Stop::Restarted | Stop::Unknown(_) => 3,
        Stop::NotEnabled(_) | Stop::Lease(_) | Stop::LostLease(_) | Stop::Refused(_) => 4,
        Stop::Fault(_) => 5,
    };
    let sentence = stop.to_string();
    Coded { code, sentence }.into()
}

#[cfg(test)]
mod tests {
    use i2ris::ipc::Fault;
    use i2ris_terminal::exit::code;

    use super::*;

    #[test]
    fn a_stop_has_the_code_of_its_cause() {
        for (stop, expected) in [
            (Stop::Silent, 3),
            (Stop::Lease(7), 4),
            (Stop::Fault(Fault::Drive), 5),
        ] {
            assert_eq!(code(&with_code(stop.into())), expected);
        }
    }
}
