//! A port in a child process, which cuts the power of its drives when the commissioning ends, is
//! killed or is suspended: a suspended process cannot end a current pulse.
//!
//! Every call on the line is a packet to the child and one back. Only the child has the port open,
//! so late calls from a resumed commissioning cannot bypass it.

use std::io::{self, Read, Write};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::{fs, os::unix::net::UnixStream, time::Duration};

use i2ris::drive::{DriveError, family_selection::family_of_port, link::DriveLink};
use i2ris::drive::{serial_transport::SerialTransport, transport::Transport};
use i2ris::{clock, config::PortConfig, units::Nanos};
use nix::sys::socket::{AddressFamily, SockFlag, SockType, socketpair};
use nix::unistd::{ForkResult, Pid, fork, getpid, getppid, setsid};
use nix::{libc, sys::wait::waitpid};

use super::node::Node;

/// Period of checking that the commissioning is running: one of its pulses lasts 3 ms.
const LOOK: Nanos = Nanos::from_millis(5);
/// Maximum size of a packet, bytes; a frame is far smaller.
const PACKET: usize = 8192;
/// The calls, as first byte of a packet. A reply begins with 0 if the call failed.
const WRITE: u8 = 1;
/// Payload: deadline, ns, and maximum number of bytes.
const READ: u8 = 2;
const REOPEN: u8 = 3;
/// Clean end: the power stays as the commissioning left it.
const END: u8 = 4;

pub struct HeldPort {
    child: Pid,
    socket: UnixStream,
}

impl HeldPort {
    pub fn open(config: &PortConfig) -> Result<Self, DriveError> {
        let line = SerialTransport::open(config)?;
        let fail = |error: nix::Error| DriveError::NotSerial {
            device: config.device.clone(),
            source: io::Error::from(error).into(),
        };
        let (kind, flags) = (SockType::SeqPacket, SockFlag::SOCK_CLOEXEC);
        let (ours, theirs) = socketpair(AddressFamily::Unix, kind, None, flags).map_err(fail)?;
        let parent = getpid();
        // SAFETY: the other thread waits for a signal and holds no lock that the child could need.
        match unsafe { fork() }.map_err(fail)? {
            ForkResult::Parent { child } => Ok(Self { child, socket: ours.into() }),
            ForkResult::Child => {
                drop(ours);
                // Ctrl-C and Ctrl-Z are for the commissioning.
                let _ = setsid();
                // A panic must not return into the parent's code.
                let held = || hold(line, theirs.into(), parent, config);
                let _ = catch_unwind(AssertUnwindSafe(held));
                // SAFETY: ends this process without flushing or removing anything of the parent.
                unsafe { libc::_exit(0) }
            }
        }
    }

    fn call(&self, kind: u8, payload: &[u8], into: &mut [u8]) -> io::Result<usize> {
        let mut socket = &self.socket;
        socket.write_all(&[&[kind], payload].concat())?;
        let mut packet = [0; PACKET];
        let count = loop {
            match socket.read(&mut packet) {
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                count => break count?,
            }
        };
        match packet.get(..count) {
            Some([1, bytes @ ..]) => {
                into.iter_mut().zip(bytes).for_each(|(to, from)| *to = *from);
                Ok(bytes.len())
            }
            // The child has ended, or its port is broken.
            _ => Err(io::ErrorKind::BrokenPipe.into()),
        }
    }
}

impl Transport for HeldPort {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.call(WRITE, bytes, &mut []).map(drop)
    }

    fn read(&mut self, into: &mut [u8], deadline: Nanos) -> io::Result<usize> {
        let most = into.len().min(PACKET - 1) as u64;
        self.call(READ, &[deadline.0, most].map(u64::to_ne_bytes).concat(), into)
    }

    fn reopen(&mut self) -> io::Result<()> {
        self.call(REOPEN, &[], &mut []).map(drop)
    }

    fn now(&self) -> Nanos {
        clock::now()
    }

    fn sleep_until(&mut self, until: Nanos) {
        clock::sleep_until(until);
    }
}

impl Drop for HeldPort {
    /// The port is free afterwards.
    fn drop(&mut self) {
        let _ = (&self.socket).write_all(&[END]);
        let _ = waitpid(self.child, None);
    }
}

fn is_away(parent: Pid) -> bool {
    let state = fs::read_to_string(format!("/proc/{parent}/stat")).unwrap_or_default();
    // The process name, in parentheses, may contain anything.
    let is_stopped = state.rsplit(") ").next().is_none_or(|state| state.starts_with('T'));
    getppid() != parent || is_stopped
}

/// Serves the calls of the commissioning, and cuts the power when it has ended or is suspended.
fn hold(mut line: SerialTransport, mut socket: UnixStream, parent: Pid, config: &PortConfig) {
    let _ = socket.set_read_timeout(Some(Duration::from_nanos(LOOK.0)));
    let (mut packet, mut answer) = ([0; PACKET], [0; PACKET]);
    while !is_away(parent) {
        let count = match socket.read(&mut packet) {
            Ok(0) => break,
            Ok(count) => count,
            Err(_) => continue,
        };
        // Calls sent before the suspension are discarded.
        if is_away(parent) {
            break;
        }
        let done = match packet.get(..count).and_then(<[u8]>::split_first) {
            Some((&WRITE, bytes)) => line.write(bytes).map(|()| 0),
            Some((&READ, payload)) => read(&mut line, payload, &mut answer[1..], parent),
            Some((&REOPEN, _)) => line.reopen().map(|()| 0),
            _ => return,
        };
        answer[0] = u8::from(done.is_ok());
        let _ = answer.get(..=done.unwrap_or(0)).map(|answer| socket.write_all(answer));
    }
    let mut link = DriveLink::new(line, family_of_port(config), config);
    for axis in &config.axes {
        let _ = Node::new(&mut link, config, axis, &|| false).cut();
    }
}

fn read(
    line: &mut SerialTransport,
    payload: &[u8],
    into: &mut [u8],
    parent: Pid,
) -> io::Result<usize> {
    let number = |at: usize| {
        let bytes = payload.get(at..at + 8).and_then(|bytes| bytes.try_into().ok());
        u64::from_ne_bytes(bytes.unwrap_or_default())
    };
    let (until, most) = (Nanos(number(0)), number(8) as usize);
    let into = into.get_mut(..most).unwrap_or_default();
    loop {
        let now = clock::now();
        let read = line.read(into, until.min(now + LOOK));
        if !matches!(read, Ok(0)) || now >= until || is_away(parent) {
            return read;
        }
    }
}
