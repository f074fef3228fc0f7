//! `i2ris status --web` as a process, and a minimal browser.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::Duration;

use i2ris::ipc::Domain;
use serde_json::Value;

use i2ris_testing::{Program, wait_until};

use crate::chromium::{self, Browser};

/// A page that is served, until dropped.
pub struct Served {
    pub program: Program,
    pub address: SocketAddr,
}

impl Served {
    /// Serves at a free port of this machine.
    pub fn start(domain: &Domain) -> Self {
        Self::with(domain, &["status", "--web", "127.0.0.1:0"])
    }

    /// Serves as the arguments say.
    pub fn with(domain: &Domain, arguments: &[&str]) -> Self {
        let mut program = Program::start(domain, arguments);
        let mut line = String::new();
        BufReader::new(program.child().stdout.take().unwrap()).read_line(&mut line).unwrap();
        let address = line
            .split("http://")
            .nth(1)
            .and_then(|rest| rest.split('/').next())
            .unwrap_or_default();
        let address = address.parse().unwrap_or_else(|_| panic!("no address in {line:?}"));
        Self { program, address }
    }

    /// Opens one of its pages in a browser, if one is installed.
    pub fn open(&self, page: &str, size: [u32; 2]) -> Browser {
        chromium::open(&format!("http://{}/{page}", self.address), size)
    }

    pub fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(("127.0.0.1", self.address.port())).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        stream
    }

    /// Sends these bytes and reads until the other side closes, cleanly or not.
    pub fn exchange(&self, bytes: &[u8]) -> String {
        let mut stream = self.connect();
        let mut answer = Vec::new();
        let _ = stream.write_all(bytes);
        let _ = stream.read_to_end(&mut answer);
        String::from_utf8(answer).unwrap()
    }

    /// Waits until there is a place among the browsers.
    pub fn wait_for_a_place(&self) {
        wait_until("a place becomes free", || self.ask("GET", "/").0 == 200);
    }

    /// Sends a request with a method; returns status and body.
    pub fn ask(&self, method: &str, target: &str) -> (u16, String) {
        let host = self.address;
        let answer = self.exchange(
            format!("{method} {target} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n")
                .as_bytes(),
        );
        let (head, body) =
            answer.split_once("\r\n\r\n").unwrap_or_else(|| panic!("no answer: {answer:?}"));
        (head.split(' ').nth(1).unwrap().parse().unwrap(), body.to_owned())
    }

    /// Data that a page receives.
    pub fn live(&self, query: &str) -> Value {
        let (status, body) = self.ask("GET", &format!("/live?{query}"));
        assert_eq!(status, 200, "{body}");
        serde_json::from_str(&body).unwrap()
    }

    /// Waits until a page receives something.
    pub fn wait(&self, what: &str, wanted: impl Fn(&Value) -> bool) -> Value {
        wait_until(what, || Some(self.live("")).filter(&wanted))
    }
}
