//! `i2ris status --web` as a process, a minimal browser, and Chromium without a window over two
//! pipes (Chrome DevTools Protocol, `--remote-debugging-pipe`: JSON messages, each ended by a 0, in
//! on descriptor 3 and out on descriptor 4).

use std::fs::File;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::os::fd::{AsRawFd, OwnedFd};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::{Duration, Instant};

use i2ris::ipc::Domain;
use i2ris_testing::{Program, wait_until};
use serde_json::{Value, json};
use tempfile::TempDir;

pub struct Served {
    pub program: Program,
    pub address: SocketAddr,
}

impl Served {
    /// Serves at a free port of this machine.
    pub fn start(domain: &Domain) -> Self {
        Self::with(domain, &["status", "--web", "127.0.0.1:0"])
    }

    pub fn with(domain: &Domain, arguments: &[&str]) -> Self {
        let mut program = Program::start(domain, arguments);
        let mut line = String::new();
        BufReader::new(program.child().stdout.take().unwrap()).read_line(&mut line).unwrap();
        let address = line.split("http://").nth(1).and_then(|rest| rest.split('/').next());
        let address = address.and_then(|address| address.parse().ok());
        let address = address.unwrap_or_else(|| panic!("no address in {line:?}"));
        Self { program, address }
    }

    pub fn open(&self, page: &str, size: [u32; 2]) -> Browser {
        Browser::open(&find().unwrap(), &format!("http://{}/{page}", self.address), size)
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

    pub fn wait_for_a_place(&self) {
        wait_until("a place becomes free", || self.ask("GET", "/").0 == 200);
    }

    /// Sends a request with a method; returns status and body.
    pub fn ask(&self, method: &str, target: &str) -> (u16, String) {
        let host = self.address;
        let head = format!("{method} {target} HTTP/1.1\r\nHost: {host}\r\nConnection: close");
        let answer = self.exchange(format!("{head}\r\n\r\n").as_bytes());
        let (head, body) =
            answer.split_once("\r\n\r\n").unwrap_or_else(|| panic!("no answer: {answer:?}"));
        (head.split(' ').nth(1).unwrap().parse().unwrap(), body.to_owned())
    }

    pub fn live(&self, query: &str) -> Value {
        let (status, body) = self.ask("GET", &format!("/live?{query}"));
        assert_eq!(status, 200, "{body}");
        serde_json::from_str(&body).unwrap()
    }

    pub fn wait(&self, what: &str, wanted: impl Fn(&Value) -> bool) -> Value {
        wait_until(what, || Some(self.live("")).filter(&wanted))
    }
}

const TIMEOUT: Duration = Duration::from_secs(60);

/// A browser with one page, ended when dropped.
pub struct Browser {
    child: Child,
    pipe: File,
    messages: Receiver<Value>,
    session: Value,
    next: u64,
    pub events: Vec<Value>,
    _profile: TempDir,
}

fn find() -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    let names = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];
    let places = || std::env::split_paths(&path);
    names.iter().find_map(|name| places().map(|place| place.join(name)).find(|file| file.is_file()))
}

impl Browser {
    fn open(program: &Path, url: &str, [width, height]: [u32; 2]) -> Self {
        let profile = tempfile::tempdir().unwrap();
        let pipe = || nix::unistd::pipe2(nix::fcntl::OFlag::O_CLOEXEC).unwrap();
        let ((their_in, our_out), (our_in, their_out)) = (pipe(), pipe());
        let mut command = Command::new(program);
        command
            .args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"])
            .args(["--remote-debugging-pipe", "--no-first-run", "--disable-extensions"])
            .args(["--disable-background-networking", "--mute-audio"])
            .arg(format!("--user-data-dir={}", profile.path().display()));
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        let child = with_pipes(command, &their_in, &their_out);
        drop((their_in, their_out));
        let (sender, messages) = channel();
        thread::spawn(move || {
            let mut reader = BufReader::new(File::from(our_in));
            let mut bytes = Vec::new();
            while let Ok(1..) = reader.read_until(0, &mut bytes) {
                bytes.pop();
                if serde_json::from_slice(&bytes).is_ok_and(|message| sender.send(message).is_err())
                {
                    return;
                }
                bytes.clear();
            }
        });
        let (pipe, session) = (File::from(our_out), Value::Null);
        let mut browser =
            Self { child, pipe, messages, session, next: 0, events: Vec::new(), _profile: profile };
        let created = browser.call("Target.createTarget", json!({ "url": "about:blank" }));
        let target = json!({ "targetId": created["targetId"], "flatten": true });
        let attached = browser.call("Target.attachToTarget", target);
        browser.session = attached["sessionId"].clone();
        for domain in ["Page", "Runtime", "Network", "Log"] {
            browser.call(&format!("{domain}.enable"), json!({}));
        }
        browser.resize([width, height]);
        browser.call("Page.navigate", json!({ "url": url }));
        browser
    }

    pub fn resize(&mut self, [width, height]: [u32; 2]) {
        let size =
            json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": false });
        self.call("Emulation.setDeviceMetricsOverride", size);
    }

    pub fn call(&mut self, method: &str, parameters: Value) -> Value {
        self.next += 1;
        let mut message = json!({ "id": self.next, "method": method, "params": parameters });
        if self.session.is_string() {
            message["sessionId"] = self.session.clone();
        }
        let mut bytes = message.to_string().into_bytes();
        bytes.push(0);
        self.pipe.write_all(&bytes).unwrap();
        let end = Instant::now() + TIMEOUT;
        loop {
            let left = end.saturating_duration_since(Instant::now());
            let message = self.messages.recv_timeout(left);
            let message = message.unwrap_or_else(|error| panic!("{method}: {error}"));
            if message["id"].as_u64() == Some(self.next) {
                assert!(message["error"].is_null(), "{method}: {message}");
                return message["result"].clone();
            }
            if message["id"].is_null() {
                self.events.push(message);
            }
        }
    }

    pub fn evaluate(&mut self, script: &str) -> Value {
        let request = json!({ "expression": script, "returnByValue": true, "awaitPromise": true });
        let result = self.call("Runtime.evaluate", request);
        assert!(result["exceptionDetails"].is_null(), "{script}: {result}");
        result["result"]["value"].clone()
    }

    pub fn wait(&mut self, what: &str, script: &str) {
        let end = Instant::now() + TIMEOUT;
        while self.evaluate(script) != json!(true) {
            if Instant::now() > end {
                panic!("waited in vain: {what}\n{}", self.evaluate("document.body.innerText"));
            }
            thread::sleep(Duration::from_millis(50));
        }
    }

    pub fn press(&mut self, key: &str) {
        for kind in ["keyDown", "keyUp"] {
            let (text, code) = if key == "Tab" { ("", 9) } else { (key, 0) };
            let mut pressed = json!({ "type": kind, "key": key, "text": text });
            pressed["windowsVirtualKeyCode"] = json!(code);
            self.call("Input.dispatchKeyEvent", pressed);
        }
    }

    /// The addresses of everything that the page requested.
    pub fn requested(&self) -> Vec<String> {
        let is_request = |event: &&Value| event["method"] == "Network.requestWillBeSent";
        let url = |event: &Value| event["params"]["request"]["url"].as_str().unwrap().to_owned();
        self.events.iter().filter(is_request).map(url).collect()
    }

    /// Errors and warnings on the console, and uncaught exceptions.
    pub fn complaints(&self) -> Vec<String> {
        let bad = |event: &&Value| {
            let level = match event["method"].as_str() {
                Some("Runtime.exceptionThrown") => return true,
                Some("Runtime.consoleAPICalled") => &event["params"]["type"],
                Some("Log.entryAdded") => &event["params"]["entry"]["level"],
                _ => return false,
            };
            ["error", "warning", "assert"].iter().any(|bad| level == bad)
        };
        self.events.iter().filter(bad).map(ToString::to_string).collect()
    }
}

/// Starts it with the two pipes in the places where it looks for them.
fn with_pipes(mut command: Command, input: &OwnedFd, output: &OwnedFd) -> Child {
    let (input, output) = (input.as_raw_fd(), output.as_raw_fd());
    // SAFETY: fcntl and dup2 are async-signal-safe and touch no memory of the parent. Both are
    // moved out of the way first, because 3 and 4 may be each other's.
    unsafe {
        command.pre_exec(move || {
            let result = nix::errno::Errno::result;
            let high = [input, output]
                .map(|descriptor| nix::libc::fcntl(descriptor, nix::libc::F_DUPFD, 10));
            for (place, descriptor) in [3, 4].into_iter().zip(high) {
                result(descriptor)?;
                result(nix::libc::dup2(descriptor, place))?;
            }
            Ok(())
        });
    }
    command.process_group(0).spawn().unwrap()
}

impl Drop for Browser {
    fn drop(&mut self) {
        // All of its processes are in their own group.
        let group = nix::unistd::Pid::from_raw(-i32::try_from(self.child.id()).unwrap_or(i32::MAX));
        let _ = nix::sys::signal::kill(group, nix::sys::signal::Signal::SIGKILL);
        let _ = self.child.wait();
    }
}
