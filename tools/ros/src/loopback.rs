//! Keeps sockets of this process on the loopback interface.
//!
//! The filter of RustDDS concerns what it announces; its sockets still listen on all interfaces, so
//! a computer that knows the ports could take part. A socket that is bound to the device `lo` hears
//! only this computer.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs;
use std::io;
use std::os::fd::{BorrowedFd, RawFd};

use nix::sys::socket::sockopt::{BindToDevice, SockType as SockTypeOption};
use nix::sys::socket::{AddressFamily, SockType, SockaddrLike, SockaddrStorage};
use nix::sys::socket::{getsockname, getsockopt, setsockopt};

/// The UDP sockets of this process.
#[derive(Debug)]
pub(crate) struct Sockets(BTreeSet<RawFd>);

impl Sockets {
    /// The present ones.
    pub fn of_this_process() -> io::Result<Self> {
        let mut sockets = BTreeSet::new();
        for entry in fs::read_dir("/proc/self/fd")? {
            let name = entry?.file_name();
            let Some(fd) = name.to_str().and_then(|name| name.parse().ok()) else {
                continue;
            };
            if is_udp(fd) {
                sockets.insert(fd);
            }
        }
        Ok(Self(sockets))
    }
}

/// Binds every UDP socket that was opened since `before` to the loopback interface.
pub(crate) fn confine(before: &Sockets) -> io::Result<()> {
    let Sockets(now) = Sockets::of_this_process()?;
    for fd in now.difference(&before.0) {
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
        let before = Sockets::of_this_process().unwrap();
        let later = UdpSocket::bind("0.0.0.0:0").unwrap();
        confine(&before).unwrap();
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
