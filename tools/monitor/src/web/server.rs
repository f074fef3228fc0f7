//! The server: a thread per connection, bounded in number, in time and in memory.
//!
//! Its own loop on the standard library, because the small servers to be had have no time-outs:
//! there, a browser that stops reading keeps a thread for ever. `tiny_http` has not been released
//! since 2022; `axum` brings an asynchronous runtime and 50 packages for one page.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use super::Source;
use super::http::{Head, MAX_HEAD_BYTES, Response, answer, parse};

/// Connections at the same time. A browser opens up to six.
const CONNECTIONS: usize = 48;
/// Maximum time of an idle connection, of a head once it has begun, and of an answer.
const IDLE: Duration = Duration::from_secs(15);
const HEAD: Duration = Duration::from_secs(5);
const ANSWER: Duration = Duration::from_secs(5);
/// Minimum time between two answers on one connection: no browser requests faster, and a client
/// that did would occupy the processor.
const PACE: Duration = Duration::from_millis(10);
/// Maximum time for the other side to finish sending after it has its answer.
const PARTING: Duration = Duration::from_millis(500);
const BREATH: Duration = Duration::from_millis(50);

/// Starts to serve, in threads that end with the process.
pub fn start(listener: TcpListener, source: Arc<Source>, local: bool) -> io::Result<()> {
    let thread = thread::Builder::new().name("web".to_owned());
    thread.spawn(move || accept(&listener, &source, local)).map(drop)
}

fn accept(listener: &TcpListener, source: &Arc<Source>, local: bool) {
    // Every connection holds one more.
    let open = Arc::new(());
    loop {
        let Ok((stream, _)) = listener.accept() else {
            thread::sleep(BREATH);
            continue;
        };
        if Arc::strong_count(&open) > CONNECTIONS {
            refuse(stream);
            continue;
        }
        let slot = Arc::clone(&open);
        let source = Arc::clone(source);
        // Without a thread the connection is closed.
        let _ = thread::Builder::new().name("web page".to_owned()).spawn(move || {
            let _slot = slot;
            // A browser that went away is not an error.
            drop(serve(stream, &source, local));
        });
    }
}

/// Does not wait: a few hundred bytes always fit into the buffer of a new connection.
fn refuse(mut stream: TcpStream) {
    let refusal = Response::refusal(503, "too many browsers are watching; close one");
    drop(write(&mut stream, &refusal.bytes(false)));
}

fn serve(mut stream: TcpStream, source: &Source, local: bool) -> io::Result<()> {
    stream.set_nodelay(true)?;
    let mut bytes = Vec::new();
    loop {
        let (response, keep_alive) = match read_head(&mut stream, &mut bytes)? {
            Some(Head::Whole(request, length)) => {
                bytes.drain(..length);
                let response = answer(&request, local, |since| source.live(since));
                let keep_alive = request.keep_alive && response.status == 200;
                (response, keep_alive)
            }
            Some(Head::Partial) => {
                (Response::refusal(431, "the head of this request is too long"), false)
            }
            Some(Head::Bad) => (Response::refusal(400, "this is not HTTP/1.1"), false),
            None => return Ok(()),
        };
        write(&mut stream, &response.bytes(keep_alive))?;
        if !keep_alive {
            return part(&mut stream);
        }
        thread::sleep(PACE);
    }
}

/// Ends cleanly: closing with unread bytes would reset it, and the answer could be lost.
fn part(stream: &mut TcpStream) -> io::Result<()> {
    stream.shutdown(Shutdown::Write)?;
    stream.set_read_timeout(Some(PARTING))?;
    let (start, mut rest) = (Instant::now(), [0; 1024]);
    while start.elapsed() < PARTING && stream.read(&mut rest)? > 0 {}
    Ok(())
}

/// Reads a head; `Partial` if it is too long; `None` if no more comes in time.
fn read_head(stream: &mut TcpStream, bytes: &mut Vec<u8>) -> io::Result<Option<Head>> {
    let mut begun = (!bytes.is_empty()).then(Instant::now);
    loop {
        match parse(bytes) {
            Head::Partial if bytes.len() < MAX_HEAD_BYTES => {}
            head => return Ok(Some(head)),
        }
        let left = begun.map_or(Some(IDLE), |begun: Instant| HEAD.checked_sub(begun.elapsed()));
        let Some(left) = left.filter(|left| !left.is_zero()) else { return Ok(None) };
        stream.set_read_timeout(Some(left))?;
        let mut chunk = [0; 1024];
        match stream.read(&mut chunk) {
            Ok(0) => return Ok(None),
            Ok(count) => bytes.extend(chunk.iter().take(count)),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
        begun.get_or_insert_with(Instant::now);
    }
}

/// Writes an answer, as long as the other side takes it in time.
fn write(stream: &mut TcpStream, mut bytes: &[u8]) -> io::Result<()> {
    let start = Instant::now();
    while !bytes.is_empty() {
        let left = ANSWER.checked_sub(start.elapsed()).filter(|left| !left.is_zero());
        stream.set_write_timeout(Some(left.ok_or(ErrorKind::TimedOut)?))?;
        match stream.write(bytes) {
            Ok(0) => return Err(ErrorKind::WriteZero.into()),
            Ok(count) => bytes = bytes.get(count..).unwrap_or_default(),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}
