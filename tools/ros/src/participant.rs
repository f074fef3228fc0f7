//! Joining the network of ROS 2.

use std::net::{IpAddr, Ipv4Addr};

use ros2_client::{Context, Node, NodeName, NodeOptions};
use rustdds::DomainParticipantBuilder;

use crate::RosError;
use crate::loopback::{self, Sockets};

/// The largest domain of ROS: the ports of larger ones do not exist.
pub const LARGEST_DOMAIN: u16 = 232;

/// The name of the node.
pub const NODE: &str = "i2ris_ros";

/// Joins a domain of ROS with a node of this name. Without networks only this computer is reached,
/// whatever its interfaces are; with networks the interfaces that have these addresses, and this
/// computer.
///
/// # Errors
///
/// The participant cannot be created, or cannot be kept from the network.
pub fn join(domain: u16, networks: &[IpAddr], name: &str) -> Result<(Context, Node), RosError> {
    let here = IpAddr::V4(Ipv4Addr::LOCALHOST);
    let mut addresses = networks.to_vec();
    if !addresses.contains(&here) {
        addresses.push(here);
    }
    let before = Sockets::of_this_process().map_err(RosError::Loopback)?;
    let participant = DomainParticipantBuilder::new(domain)
        .with_only_networks(addresses)
        .same_host_loopback(true)
        .build();
    let participant =
        participant.map_err(|error| RosError::Join { domain, reason: error.to_string() })?;
    if networks.is_empty() {
        loopback::confine(&before).map_err(RosError::Loopback)?;
    }
    let failed = |reason: String| RosError::Join { domain, reason };
    let context = Context::from_domain_participant(participant);
    let context = context.map_err(|error| failed(error.to_string()))?;
    let name = NodeName::new("/", name).map_err(|error| failed(error.to_string()))?;
    let options = NodeOptions::new().start_parameter_services(false);
    let node = context.new_node(name, options);
    let node = node.map_err(|error| failed(error.to_string()))?;
    Ok((context, node))
}
