//! Exit codes of commands that end while the robot moves.

use i2ris::ipc::ready::Ready;
use i2ris::ipc::{Domain, MaskedClientId, find_client_process};
use i2ris_report::Failure;
use i2ris_report::exit::{Coded, OUT_OF_REACH};

use crate::command::stream_monitor::StopReason;
use crate::command::tracking::OutOfReach;

/// Adds the name of the program that holds the lease, if known.
pub fn name_holder(failure: Failure, domain: &Domain) -> Failure {
    let stop = failure.downcast_ref::<StopReason>();
    let holder = stop.and_then(|stop| match stop {
        StopReason::Lease(client) | StopReason::LostLease(client) => Some(*client),
        _ => None,
    });
    let named = holder.and_then(|client| {
        let process = find_client_process(domain, Ready::read(domain)?.boot_id, client)?;
        Some((MaskedClientId(client).to_string(), process.to_string()))
    });
    match named {
        Some((id, process)) => {
            let sentence = failure.to_string().replace(&id, &process);
            Coded { code: 4, sentence }.into()
        }
        None => failure,
    }
}

/// Gives a failure that is a [`StopReason`] or [`OutOfReach`] its exit code.
pub fn with_code(failure: Failure) -> Failure {
    if failure.is::<OutOfReach>() {
        let sentence = failure.to_string();
        return Coded { code: OUT_OF_REACH, sentence }.into();
    }
    let Some(stop) = failure.downcast_ref::<StopReason>() else {
        return failure;
    };
    let code = match stop {
        StopReason::Silent
        | StopReason::Ignored
        | StopReason::Restarted
        | StopReason::Unknown(_) => 3,
        StopReason::NotEnabled(_)
        | StopReason::LeftEnabled(_)
        | StopReason::NotHomed
        | StopReason::Lease(_)
        | StopReason::LostLease(_)
        | StopReason::Refused(_)
        | StopReason::Stopped(_) => 4,
        StopReason::Fault(_) => 5,
    };
    let sentence = stop.to_string();
    Coded { code, sentence }.into()
}
