//! Joining the network of ROS 2, or only this computer.
//!
//! RustDDS listens on all interfaces, reads during its construction, and restricts only its
//! announcements. So [`bind`] restricts every socket before it has a port. All sockets drop
//! messages from devices other than `lo`, and multicasts leave by `lo` only. Other messages go to
//! announced addresses, and only those of this computer are received.
//!
//! All addresses of this computer are announced, and the sending socket is bound to no device:
//! Cyclone DDS 11, which is part of Lyrical, ignores participants without an announced address in
//! its network, and messages over a different device, also on the same computer.

use std::ffi::OsString;
use std::io;
use std::net::{IpAddr, Ipv4Addr, SocketAddrV4, UdpSocket};
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, RawFd};
use std::sync::atomic::{AtomicBool, Ordering};

use nix::libc::{self, c_int, sock_filter, sock_fprog, sockaddr, sockaddr_in, socklen_t};
use nix::sys::socket::setsockopt;
use nix::sys::socket::sockopt::BindToDevice;
use ros2_client::{Context, Node, NodeName, NodeOptions};
use rustdds::DomainParticipantBuilder;

use crate::RosError;

/// Maximum domain of ROS: larger ones have no ports.
pub const MAX_DOMAIN: u16 = 232;
pub const NODE: &str = "i2ris_ros";

/// Domain and networks of ROS.
#[derive(Debug, Clone, clap::Args)]
pub struct RosNetwork {
    /// ROS domain id
    #[arg(long, env = "ROS_DOMAIN_ID", default_value_t = 0, value_name = "NUMBER",
          value_parser = clap::value_parser!(u16).range(0..=i64::from(MAX_DOMAIN)))]
    pub ros_domain: u16,
    /// Address of this computer in a network to join; may be repeated. Without one, ROS is
    /// restricted to this computer
    #[arg(long, value_name = "ADDRESS")]
    pub network: Vec<IpAddr>,
}

/// Whether sockets that are opened now are for this computer only.
static ONLY_HERE: AtomicBool = AtomicBool::new(false);

/// Joins a domain of ROS with a node of this name. Without networks it reaches only this computer,
/// with any interfaces; with networks, also the interfaces that have these addresses. Fails if it
/// cannot be restricted to this computer.
pub fn join(domain: u16, networks: &[IpAddr], name: &str) -> Result<(Context, Node), RosError> {
    let failed = |error: &dyn ToString| RosError::Join { domain, reason: error.to_string() };
    let mut builder = DomainParticipantBuilder::new(domain).same_host_loopback(true);
    ONLY_HERE.store(networks.is_empty(), Ordering::Relaxed);
    if networks.is_empty() {
        // If that is not possible, the reason is known.
        UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).map_err(RosError::Loopback)?;
    } else {
        let here = IpAddr::V4(Ipv4Addr::LOCALHOST);
        builder = builder.with_only_networks(networks.iter().copied().chain([here]));
    }
    let participant = builder.build().map_err(|error| failed(&error))?;
    let context = Context::from_domain_participant(participant).map_err(|error| failed(&error))?;
    let name = NodeName::new("/", name).map_err(|error| failed(&error))?;
    let options = NodeOptions::new().start_parameter_services(false);
    let node = context.new_node(name, options).map_err(|error| failed(&error))?;
    Ok((context, node))
}

/// Replaces libc's function: restricts a UDP socket to this computer, then does the same.
///
/// # Safety
///
/// As libc's.
#[unsafe(no_mangle)]
unsafe extern "C" fn bind(fd: c_int, address: *const sockaddr, length: socklen_t) -> c_int {
    if ONLY_HERE.load(Ordering::Relaxed) {
        // SAFETY: the caller promises an address of this length.
        let address = unsafe { ipv4_of(address, length) };
        // SAFETY: the caller's socket, open during this call.
        let socket = unsafe { BorrowedFd::borrow_raw(fd) };
        if let Some(address) = address
            && let Err(error) = keep_here(&socket, address)
        {
            nix::errno::Errno::from_raw(error.raw_os_error().unwrap_or(libc::EPERM)).set();
            return -1;
        }
    }
    // SAFETY: what the caller promises.
    unsafe { libc::syscall(libc::SYS_bind, fd, address, length) as c_int }
}

/// An IPv4 address; RustDDS uses no others.
///
/// # Safety
///
/// `address` has this length.
unsafe fn ipv4_of(address: *const sockaddr, length: socklen_t) -> Option<SocketAddrV4> {
    if address.is_null() || (length as usize) < size_of::<sockaddr_in>() {
        return None;
    }
    // SAFETY: long enough for an address of IPv4.
    let address = unsafe { address.cast::<sockaddr_in>().read_unaligned() };
    let is_ipv4 = c_int::from(address.sin_family) == libc::AF_INET;
    let ip = Ipv4Addr::from_bits(u32::from_be(address.sin_addr.s_addr));
    is_ipv4.then(|| SocketAddrV4::new(ip, u16::from_be(address.sin_port)))
}

fn keep_here(socket: &impl AsFd, address: SocketAddrV4) -> io::Result<()> {
    // RustDDS sends to groups by a socket with the address of each network.
    if address.port() == 0 && !address.ip().is_unspecified() {
        setsockopt(socket, BindToDevice, &OsString::from("lo"))?;
    }
    // SAFETY: a name that ends with 0.
    let loopback = unsafe { libc::if_nametoindex(c"lo".as_ptr()) };
    restrict_to_device(socket.as_fd().as_raw_fd(), loopback)
}

/// Drops messages over a different device. Messages of this computer to itself use `lo` for any
/// address (`ip_local_out` of Linux).
fn restrict_to_device(socket: RawFd, device: u32) -> io::Result<()> {
    let step =
        |code: u32, jump_if_not, k| sock_filter { code: code as u16, jt: 0, jf: jump_if_not, k };
    let interface = (libc::SKF_AD_OFF + libc::SKF_AD_IFINDEX) as u32;
    let mut filter = [
        step(libc::BPF_LD | libc::BPF_W | libc::BPF_ABS, 0, interface),
        step(libc::BPF_JMP | libc::BPF_JEQ | libc::BPF_K, 1, device),
        step(libc::BPF_RET | libc::BPF_K, 0, u32::MAX),
        step(libc::BPF_RET | libc::BPF_K, 0, 0),
    ];
    let program = sock_fprog { len: filter.len() as u16, filter: filter.as_mut_ptr() };
    // SAFETY: the kernel copies the program, which lives until it has.
    let done = unsafe {
        libc::setsockopt(
            socket,
            libc::SOL_SOCKET,
            libc::SO_ATTACH_FILTER,
            (&raw const program).cast(),
            size_of::<sock_fprog>() as socklen_t,
        )
    };
    if done == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use nix::sys::socket::getsockopt;

    use super::*;

    /// An address of this computer in a network, if it is in one: nothing is sent.
    fn own_address() -> Option<IpAddr> {
        let socket = UdpSocket::bind("0.0.0.0:0").unwrap();
        socket.connect("192.0.2.1:9").ok()?;
        Some(socket.local_addr().ok()?.ip())
    }

    #[test]
    fn socket_is_restricted_before_it_has_a_port() {
        let (own, other) = (own_address(), UdpSocket::bind("0.0.0.0:0").unwrap());
        let free = UdpSocket::bind("0.0.0.0:0").unwrap().local_addr().unwrap();
        ONLY_HERE.store(true, Ordering::Relaxed);
        let [to_groups, sends, hears] =
            [UdpSocket::bind("127.0.0.1:0"), UdpSocket::bind("0.0.0.0:0"), UdpSocket::bind(free)];
        ONLY_HERE.store(false, Ordering::Relaxed);
        let [to_groups, sends, hears] = [to_groups, sends, hears].map(Result::unwrap);
        assert_eq!(getsockopt(&to_groups, BindToDevice).unwrap(), "lo");
        hears.set_read_timeout(Some(Duration::from_secs(5))).unwrap();
        let mut buffer = [0; 8];
        for address in [Some(IpAddr::V4(Ipv4Addr::LOCALHOST)), own].into_iter().flatten() {
            for from in [&sends, &other] {
                from.send_to(b"here", (address, free.port())).unwrap();
                assert_eq!(hears.recv(&mut buffer).unwrap(), 4, "{address}");
            }
        }
        // Messages over a different device are dropped before they are read.
        restrict_to_device(hears.as_raw_fd(), u32::MAX).unwrap();
        other.send_to(b"there", (Ipv4Addr::LOCALHOST, free.port())).unwrap();
        hears.set_read_timeout(Some(Duration::from_millis(300))).unwrap();
        assert!(hears.recv(&mut buffer).is_err());
    }
}
