//! The controller and its shared memory with real processes, each test in a domain of its own.

mod campaign;
mod examples;
mod hostile_clients;
mod ipc_domain;
mod ipc_processes;
mod ipc_services;
mod start_refusals;
mod whole_path;

use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::{fs, thread};

use i2ris::clock;
use i2ris::ipc::client::*;
use i2ris::ipc::payload::*;
use i2ris::ipc::ready::{INTERFACE_VERSION, Ready};
use i2ris::ipc::watchdog_presence::WatchdogStatus;
use i2ris::ipc::{
    Domain, DomainError, DomainLock, OperatingState, Refusal, Request, StateCommand, StreamMessage,
    random_id,
};
use i2ris::units::Nanos;
use i2ris_simulation::drive::State;
use i2ris_testing::*;
use nix::sys::signal::Signal;
