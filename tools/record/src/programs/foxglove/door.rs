//! Who may look, before Foxglove's server is reached: it asks neither for Origin nor for Host, so
//! every page in a browser of this computer could read the robot, also one that gave its own name
//! the address of this computer (DNS rebinding).

use std::io::{self, Read, Write};
use std::net::{IpAddr, Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::Duration;

/// Where Foxglove itself is.
const FOXGLOVE: &str = "foxglove.dev";
/// Longest head of a request, bytes.
const HEAD: usize = 16 * 1024;
/// Time for it.
const PATIENCE: Duration = Duration::from_secs(5);
/// Connections at the same time.
const CONNECTIONS: usize = 32;

/// Lets viewers through to the server at `inner`, for as long as the program lives.
pub fn open(listener: TcpListener, inner: SocketAddr, origins: Vec<String>) -> io::Result<()> {
    let (origins, open) = (Arc::new(origins), Arc::new(AtomicUsize::new(0)));
    let accept = move || {
        for viewer in listener.incoming().flatten() {
            if open.load(Ordering::Relaxed) >= CONNECTIONS {
                continue;
            }
            let (origins, count) = (Arc::clone(&origins), Arc::clone(&open));
            count.fetch_add(1, Ordering::Relaxed);
            let serve = move || {
                // A viewer that goes ends its connection only.
                let _ = let_through(viewer, inner, &origins);
                count.fetch_sub(1, Ordering::Relaxed);
            };
            if thread::Builder::new().name("viewer".to_owned()).spawn(serve).is_err() {
                open.fetch_sub(1, Ordering::Relaxed);
            }
        }
    };
    thread::Builder::new().name("door".to_owned()).spawn(accept).map(drop)
}

fn let_through(mut viewer: TcpStream, inner: SocketAddr, origins: &[String]) -> io::Result<()> {
    viewer.set_read_timeout(Some(PATIENCE))?;
    let head = read_head(&mut viewer)?;
    if let Err(reason) = check(&String::from_utf8_lossy(&head), origins) {
        let length = reason.len();
        return write!(
            viewer,
            "HTTP/1.1 403 Forbidden\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n{reason}"
        );
    }
    viewer.set_read_timeout(None)?;
    viewer.set_nodelay(true)?;
    let mut server = TcpStream::connect(inner)?;
    server.set_nodelay(true)?;
    server.write_all(&head)?;
    let (mut from, mut to) = (viewer.try_clone()?, server.try_clone()?);
    let back = thread::spawn(move || {
        let _ = io::copy(&mut from, &mut to);
        let _ = to.shutdown(Shutdown::Both);
    });
    let _ = io::copy(&mut server, &mut viewer);
    let _ = viewer.shutdown(Shutdown::Both);
    let _ = back.join();
    Ok(())
}

fn read_head(viewer: &mut TcpStream) -> io::Result<Vec<u8>> {
    let mut head = Vec::new();
    while !head.windows(4).any(|end| end == b"\r\n\r\n") {
        let mut more = [0; 1024];
        let count = viewer.read(&mut more)?;
        if count == 0 || head.len() > HEAD {
            return Err(io::ErrorKind::InvalidData.into());
        }
        head.extend_from_slice(&more[..count]);
    }
    Ok(head)
}

/// Whether a request comes from a viewer and not from any page.
fn check(head: &str, origins: &[String]) -> Result<(), String> {
    let header = |name: &str| {
        let mut values =
            head.lines().skip(1).take_while(|line| !line.is_empty()).filter_map(|line| {
                let (key, value) = line.split_once(':')?;
                key.trim().eq_ignore_ascii_case(name).then(|| value.trim().to_owned())
            });
        values.next()
    };
    let host = header("host").unwrap_or_default();
    let host = name_of(&host);
    if !is_address(host) && host != "localhost" && !is_own_name(host) {
        return Err(format!("{host} is no name of this computer; call it by its address"));
    }
    let Some(origin) = header("origin") else {
        // No browser.
        return Ok(());
    };
    let Some((scheme, rest)) = origin.split_once("://") else {
        return Err(format!("pages of {origin} may not look"));
    };
    let from = name_of(rest);
    let is_foxglove = scheme == "https"
        && from.strip_suffix(FOXGLOVE).is_some_and(|sub| sub.is_empty() || sub.ends_with('.'));
    let is_here =
        from == "localhost" || from == host || from.parse() == Ok(IpAddr::from([127, 0, 0, 1]));
    if is_foxglove || is_here || scheme == "file" || origins.contains(&origin) {
        return Ok(());
    }
    Err(format!("pages of {origin} may not look; allow them with --origin {origin}"))
}

/// The name or address without the port.
fn name_of(host: &str) -> &str {
    match host.strip_prefix('[') {
        Some(ipv6) => ipv6.split(']').next().unwrap_or_default(),
        None => host.split(':').next().unwrap_or_default(),
    }
}

fn is_address(host: &str) -> bool {
    host.parse::<IpAddr>().is_ok()
}

fn is_own_name(host: &str) -> bool {
    let own = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    let own = own.trim();
    !own.is_empty() && host.strip_suffix(".local").unwrap_or(host).eq_ignore_ascii_case(own)
}
