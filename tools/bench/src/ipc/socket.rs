//! The peers: what programs use that know nothing of shared memory.

use std::io::{self, ErrorKind};
use std::net::UdpSocket;
use std::os::unix::net::UnixDatagram;
use std::time::Duration;

use i2ris::units::Nanos;

use super::BYTES;
use super::pair::{Run, measure};
use crate::error::BenchError;
use crate::spans::Spans;

/// How long a receiver sleeps at most.
const NAP: Duration = Duration::from_millis(20);

pub fn unix_polled(run: Run) -> Result<Spans, BenchError> {
    let (from, to) = UnixDatagram::pair().map_err(opening)?;
    to.set_nonblocking(true).map_err(opening)?;
    both(
        run,
        move |bytes| from.send(bytes),
        move |bytes| to.recv(bytes),
    )
}

pub fn unix_waiting(run: Run) -> Result<Spans, BenchError> {
    let (from, to) = UnixDatagram::pair().map_err(opening)?;
    to.set_read_timeout(Some(NAP)).map_err(opening)?;
    both(
        run,
        move |bytes| from.send(bytes),
        move |bytes| to.recv(bytes),
    )
}

pub fn udp_polled(run: Run) -> Result<Spans, BenchError> {
    let (from, to) = udp().map_err(opening)?;
    to.set_nonblocking(true).map_err(opening)?;
    both(
        run,
        move |bytes| from.send(bytes),
        move |bytes| to.recv(bytes),
    )
}

pub fn udp_waiting(run: Run) -> Result<Spans, BenchError> {
    let (from, to) = udp().map_err(opening)?;
    to.set_read_timeout(Some(NAP)).map_err(opening)?;
    both(
        run,
        move |bytes| from.send(bytes),
        move |bytes| to.recv(bytes),
    )
}

fn opening(source: io::Error) -> BenchError {
    BenchError::system("open a socket")(source)
}

fn udp() -> io::Result<(UdpSocket, UdpSocket)> {
    let to = UdpSocket::bind(("127.0.0.1", 0))?;
    let from = UdpSocket::bind(("127.0.0.1", 0))?;
    from.connect(to.local_addr()?)?;
    Ok((from, to))
}

fn both(
    run: Run,
    send: impl Fn(&[u8]) -> io::Result<usize> + Send,
    receive: impl Fn(&mut [u8]) -> io::Result<usize> + Send,
) -> Result<Spans, BenchError> {
    let sender = move || {
        Ok(move |now: Nanos| {
            let mut bytes = [0; BYTES];
            bytes[..8].copy_from_slice(&now.0.to_le_bytes());
            send(&bytes)
                .map(drop)
                .map_err(BenchError::system("send to a socket"))
        })
    };
    let receiver = move || {
        let mut bytes = [0; BYTES];
        Ok(move || match receive(&mut bytes) {
            Ok(_) => Ok(bytes
                .first_chunk::<8>()
                .map(|stamp| Nanos(u64::from_le_bytes(*stamp)))),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                Ok(None)
            }
            Err(error) => Err(BenchError::system("receive from a socket")(error)),
        })
    };
    measure(run, sender, receiver)
}
