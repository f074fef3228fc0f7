//! What happened, as lines for a person.

use std::fmt;

use crate::core::{CycleEvent, CycleEventKind};
use crate::robot::Fault;

impl fmt::Display for CycleEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "[{:12.6}] {}", self.stamp.as_seconds(), self.kind)
    }
}

impl fmt::Display for CycleEventKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::State {
                from,
                to,
                command,
                fault,
            } => {
                write!(f, "{from} -> {to}")?;
                if let Some(command) = command {
                    write!(f, " by command {command}")?;
                }
                if *fault != Fault::None {
                    write!(f, ": {fault}")?;
                }
                Ok(())
            }
            Self::StaleStop { client_id, age } => {
                write!(
                    f,
                    "stopped: client {client_id:016x} has been silent for {:.1} ms",
                    age.as_seconds() * 1e3
                )
            }
            Self::Lease { client_id: 0 } => write!(f, "lease is free"),
            Self::Lease { client_id } => write!(f, "lease taken by client {client_id:016x}"),
            Self::Refused { client_id, refusal } => {
                write!(f, "refused client {client_id:016x}: {refusal}")
            }
            Self::Model {
                from: Some(from),
                to,
            } => write!(f, "model {to} took over from {from}"),
            Self::Model { from: None, to } => write!(f, "model {to} took over"),
            Self::Axis {
                motor,
                from,
                to,
                error_code: 0,
            } => write!(f, "motor {motor}: {from:?} -> {to:?}"),
            Self::Axis {
                motor,
                from,
                to,
                error_code,
            } => {
                write!(
                    f,
                    "motor {motor}: {from:?} -> {to:?}, error 0x{error_code:04X}"
                )
            }
        }
    }
}
