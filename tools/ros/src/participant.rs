//! Joining the network of ROS 2, or only this computer.
//!
//! The filter of RustDDS concerns what it announces; its sockets still listen on all interfaces, so
//! a computer that knows the ports could take part. A socket that is bound to the device `lo` hears
//! only this computer.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs;
use std::io;
use std::net::{IpAddr, Ipv4Addr};
use std::os::fd::{BorrowedFd, RawFd};

use nix::sys::socket::sockopt::{BindToDevice, SockType as SockTypeOption};
use nix::sys::socket::{AddressFamily, SockType, SockaddrLike, SockaddrStorage};
use nix::sys::socket::{getsockname, getsockopt, setsockopt};
use ros2_client::{Context, Node, NodeName, NodeOptions};
use rustdds::DomainParticipantBuilder;

use crate::RosError;

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
    let failed = |reason: String| RosError::Join { domain, reason };
    let before = udp_sockets().map_err(RosError::Loopback)?;
    let participant = DomainParticipantBuilder::new(domain)
        .with_only_networks(addresses)
        .same_host_loopback(true)
        .build()
        .map_err(|error| failed(error.to_string()))?;
    if networks.is_empty() {
        keep_on_loopback(&before).map_err(RosError::Loopback)?;
    }
    let context = Context::from_domain_participant(participant);
    let context = context.map_err(|error| failed(error.to_string()))?;
    let name = NodeName::new("/", name).map_err(|error| failed(error.to_string()))?;
    let options = NodeOptions::new().start_parameter_services(false);
    let node = context.new_node(name, options);
    let node = node.map_err(|error| failed(error.to_string()))?;
    Ok((context, node))
}

/// The UDP sockets of this process.
fn udp_sockets() -> io::Result<BTreeSet<RawFd>> {
    let names = fs::read_dir("/proc/self/fd")?.map(|entry| entry.map(|entry| entry.file_name()));
    let names = names.collect::<io::Result<Vec<_>>>()?;
    let sockets = names.iter().filter_map(|name| name.to_str()?.parse().ok());
    Ok(sockets.filter(|socket| is_udp(*socket)).collect())
}

/// Binds every UDP socket that was opened since `before` to the loopback interface.
fn keep_on_loopback(before: &BTreeSet<RawFd>) -> io::Result<()> {
    for fd in udp_sockets()?.difference(before) {
        // SAFETY: the descriptor was open a moment ago and belongs to the participant, which lives
        // longer than this call.
        let socket = unsafe { BorrowedFd::borrow_raw(*fd) };
        setsockopt(&socket, BindToDevice, &OsString::from("lo"))?;
    }
    Ok(())
}

fn is_udp(fd: RawFd) -> bool {
    // SAFETY: the descriptor was open a moment ago; if it was closed the calls fail.
    let socket = unsafe { BorrowedFd::borrow_raw(fd) };
    let datagrams = getsockopt(&socket, SockTypeOption) == Ok(SockType::Datagram);
    let family = getsockname::<SockaddrStorage>(fd).ok();
    let family = family.and_then(|address| address.family());
    datagrams && matches!(family, Some(AddressFamily::Inet | AddressFamily::Inet6))
}

#[cfg(test)]
mod tests {
    use std::net::UdpSocket;
    use std::os::fd::AsFd;

    use super::*;

    #[test]
    fn sockets_opened_since_are_bound_to_loopback_and_others_are_not() {
        let earlier = UdpSocket::bind("0.0.0.0:0").unwrap();
        let before = udp_sockets().unwrap();
        let later = UdpSocket::bind("0.0.0.0:0").unwrap();
        keep_on_loopback(&before).unwrap();
        let device = |socket: &UdpSocket| getsockopt(&socket.as_fd(), BindToDevice).unwrap();
        assert_eq!(device(&later), "lo");
        assert_eq!(device(&earlier), "");
        // Messages of this computer still come, to whichever address of it.
        let port = later.local_addr().unwrap().port();
        earlier.send_to(b"here", ("127.0.0.1", port)).unwrap();
        let mut buffer = [0; 8];
        assert_eq!(later.recv(&mut buffer).unwrap(), 4);
    }
}
