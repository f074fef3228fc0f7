//! The peers: sockets, which programs without shared memory use.

use std::io::{self, ErrorKind};
use std::net::UdpSocket;
use std::os::unix::net::UnixDatagram;
use std::time::Duration;

use i2ris::units::Nanos;

use super::pair::{BYTES, Turn, measure};
use crate::durations::Durations;
use crate::error::BenchError;

/// The longest wait of a receiver.
const WAIT_TIMEOUT: Duration = Duration::from_millis(20);

/// Measures a pair of connected sockets, either polled or waiting.
macro_rules! measure_pair {
    ($turn:expr, $polls:expr, $pair:expr) => {{
        let (from, to) = $pair.map_err(opening)?;
        if $polls {
            to.set_nonblocking(true).map_err(opening)?;
        } else {
            to.set_read_timeout(Some(WAIT_TIMEOUT)).map_err(opening)?;
        }
        measure_socket($turn, move |bytes| from.send(bytes), move |bytes| to.recv(bytes))
    }};
}

pub fn unix_polled(turn: Turn) -> Result<Durations, BenchError> {
    measure_pair!(turn, true, UnixDatagram::pair())
}

pub fn unix_waiting(turn: Turn) -> Result<Durations, BenchError> {
    measure_pair!(turn, false, UnixDatagram::pair())
}

pub fn udp_polled(turn: Turn) -> Result<Durations, BenchError> {
    measure_pair!(turn, true, udp_pair())
}

pub fn udp_waiting(turn: Turn) -> Result<Durations, BenchError> {
    measure_pair!(turn, false, udp_pair())
}

fn opening(source: io::Error) -> BenchError {
    BenchError::system("open a socket")(source)
}

fn udp_pair() -> io::Result<(UdpSocket, UdpSocket)> {
    let to = UdpSocket::bind(("127.0.0.1", 0))?;
    let from = UdpSocket::bind(("127.0.0.1", 0))?;
    from.connect(to.local_addr()?)?;
    Ok((from, to))
}

fn measure_socket(
    turn: Turn,
    send: impl Fn(&[u8]) -> io::Result<usize> + Send,
    receive: impl Fn(&mut [u8]) -> io::Result<usize> + Send,
) -> Result<Durations, BenchError> {
    let sender = move || {
        Ok(move |now: Nanos| {
            let mut bytes = [0; BYTES];
            bytes[..8].copy_from_slice(&now.0.to_le_bytes());
            send(&bytes).map(drop).map_err(BenchError::system("send to a socket"))
        })
    };
    let receiver = move || {
        let mut bytes = [0; BYTES];
        Ok(move || match receive(&mut bytes) {
            Ok(_) => Ok(bytes.first_chunk().map(|stamp| Nanos(u64::from_le_bytes(*stamp)))),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                Ok(None)
            }
            Err(error) => Err(BenchError::system("receive from a socket")(error)),
        })
    };
    measure(turn, sender, receiver)
}
