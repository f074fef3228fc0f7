//! The robot in ROS 2, with the topics, types and quality of service of CRTK: a client of the
//! controller like any other. It needs no installation of ROS.
//!
//! | file | contains |
//! |---|---|
//! | `participant` | joining the network of ROS, limited to this computer |
//! | `message` | the messages, and the topics with their quality of service |
//! | `inbound` | path from ROS to the controller |
//! | `admission` | admission of commands to the controller, with reasons for refusals |
//! | `clock` | the age of a message, without trust in the clock of its sender |
//! | `outbound` | path from the controller to ROS |
//! | `master` | a CRTK arm as an input device of `i2ris teleop` |
//! | `event` | events between the threads; refusals as lines |
//!
//! ```text
//! ROS 2 (DDS)        servo_jp, state_command, ...      measured_js, operating_state, ...
//!                          |                                  ^
//! one thread each      inbound -- admission               outbound
//!                          |   \______ requests ___ events ____^
//!                          v                                  |
//! shared memory        commands of every client           streams of the controller
//! ```
//!
//! Every client of ROS is a separate client of the controller, which follows one at a time. Stored
//! messages, which the controller cannot detect, are refused here.

mod admission;
mod clock;
mod event;
mod inbound;
mod master;
pub mod message;
mod outbound;
mod participant;

use std::io;
use std::net::IpAddr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use i2ris::ipc::Domain;
use i2ris::units::Nanos;
pub use ros2_client::ServiceMapping;

pub use master::{MasterOptions, follow};
pub use participant::{NODE, RosNetwork, join};

use event::ClientNames;
use inbound::{Inbound, Shared};
use message::{Inputs, Outputs, Services};
use outbound::{Outbound, SharedState};

/// Options of the robot in ROS.
#[derive(Debug, Clone)]
pub struct Options {
    pub domain: Domain,
    pub robot: String,
    pub ros: RosNetwork,
    pub read_only: bool,
    /// Whether clients may make the present pose the zero.
    pub may_home: bool,
    pub period: Nanos,
    /// Mapping of services to DDS, which differs between implementations of ROS.
    pub services: ServiceMapping,
}

/// Runs the robot in ROS until `stop`. `say` receives a line for every event.
pub fn run(
    options: &Options,
    stop: impl Fn() -> bool,
    mut say: impl FnMut(&str),
) -> Result<(), RosError> {
    let RosNetwork { ros_domain, network } = &options.ros;
    let (context, mut node) = join(*ros_domain, network, NODE)?;
    let robot = options.robot.as_str();
    let outputs = Outputs::new(&mut node, robot)?;
    let services = Services::new(&mut node, robot, options.services)?;
    let inputs = (!options.read_only).then(|| Inputs::new(&mut node, robot)).transpose()?;
    let (events, receiver) = event::channel();
    let (names, state) = (ClientNames::default(), SharedState::default());
    let shared = Shared {
        domain: options.domain.clone(),
        robot: robot.to_owned(),
        may_home: options.may_home,
        events,
        names: names.clone(),
        state: state.clone(),
        state_writer: outputs.operating_state.guid(),
    };
    let inbound = Inbound::new(&context, &mut node, inputs, services, shared)?;
    let outbound = Outbound::new((outputs, node), options, (receiver, names), state);
    let all = "every user of this computer can command";
    let users = if options.read_only { "read-only" } else { all };
    let networks: Vec<String> = network.iter().map(IpAddr::to_string).collect();
    let reach = match networks.is_empty() {
        true => "on this computer only".to_owned(),
        false => format!("in the network {}", networks.join(", ")),
    };
    say(&format!("/{robot} is in ROS domain {ros_domain}, {reach}, {users}; Ctrl-C to stop"));
    let ended = AtomicBool::new(false);
    thread::scope(|scope| {
        let receive = || inbound.run(|| ended.load(Ordering::Relaxed));
        let inbound =
            thread::Builder::new().name("inbound".to_owned()).spawn_scoped(scope, receive);
        let inbound = inbound.map_err(RosError::thread)?;
        outbound.run(|| stop() || inbound.is_finished(), say);
        ended.store(true, Ordering::Relaxed);
        Ok(())
    })
}

/// A name that is valid in topics of ROS and in links of URDF. An error has the rules for a name.
pub fn robot_name(text: &str) -> Result<String, String> {
    let letters = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let begins = text.starts_with(|c: char| c.is_ascii_alphabetic());
    if begins && text.chars().all(letters) && !text.contains("__") && !text.ends_with('_') {
        Ok(text.to_owned())
    } else {
        Err("must be letters, digits and single _, beginning with a letter".to_owned())
    }
}

#[derive(Debug, thiserror::Error)]
pub enum RosError {
    #[error("cannot join ROS domain {domain}: {reason}")]
    Join { domain: u16, reason: String },
    #[error(
        "cannot restrict ROS to this computer ({0}), which needs Linux 5.7 or newer; with \
         --network, other computers can watch"
    )]
    Loopback(#[source] io::Error),
    #[error("cannot create {name}: {reason}")]
    Topic { name: String, reason: String },
    #[error("cannot {action}: {source}")]
    System { action: &'static str, source: io::Error },
}

impl RosError {
    pub(crate) fn thread(source: io::Error) -> Self {
        Self::System { action: "start a thread", source }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_names_valid_in_ros_are_accepted() {
        for good in ["i2ris", "PSM1", "left_eye"] {
            assert_eq!(robot_name(good).as_deref(), Ok(good));
        }
        for bad in ["", "1eye", "_eye", "eye_", "left__eye", "left/eye", "eye ", "äuge"] {
            assert!(robot_name(bad).is_err(), "{bad}");
        }
    }
}
