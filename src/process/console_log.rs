//! Operator log on a terminal or pipe that may block, written by its own thread.
//!
//! Lines that do not fit into the queue are dropped and counted. At the end, the thread gets a
//! short time for the rest and is then abandoned: a pipe without a reader must not keep the process
//! alive.

use std::io::{self, Write};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread;
use std::time::Duration;

const LINES: usize = 1024;
/// Time for the last lines.
const LAST_LINES: Duration = Duration::from_millis(500);

/// A writer that never blocks and never fails. Text is passed on line by line.
#[derive(Debug)]
pub struct ConsoleLog {
    lines: Option<SyncSender<Vec<u8>>>,
    ended: Receiver<()>,
    line: Vec<u8>,
    lost: u64,
    has_panic_hook: bool,
}

impl ConsoleLog {
    /// Starts the thread that writes to `output`. Fails when the system refuses a thread.
    pub fn start(output: impl Write + Send + 'static) -> io::Result<Self> {
        let (lines, queue) = sync_channel(LINES);
        let (ending, ended) = sync_channel(1);
        thread::Builder::new().name("log".to_owned()).spawn(move || {
            write_all(output, &queue);
            let _ = ending.send(());
        })?;
        Ok(Self { lines: Some(lines), ended, line: Vec::new(), lost: 0, has_panic_hook: false })
    }

    /// Also writes panic messages: the standard hook could block and hide the thread's end.
    pub(crate) fn take_panic_messages(&mut self) {
        self.has_panic_hook = true;
        if let Some(lines) = self.lines.clone() {
            std::panic::set_hook(Box::new(move |panic| {
                let _ = lines.try_send(format!("{panic}\n").into_bytes());
            }));
        }
    }

    fn send(&mut self, line: Vec<u8>) {
        let Some(lines) = &self.lines else { return };
        if self.lost > 0 {
            let note = format!("{} log lines were lost here\n", self.lost);
            match lines.try_send(note.into_bytes()) {
                Ok(()) => self.lost = 0,
                Err(_) => return self.lost += 1,
            }
        }
        if let Err(TrySendError::Full(_)) = lines.try_send(line) {
            self.lost += 1;
        }
    }
}

fn write_all(mut output: impl Write, queue: &Receiver<Vec<u8>>) {
    for line in queue {
        // A closed pipe: the robot continues without a log.
        let _ = output.write_all(&line).and_then(|()| output.flush());
    }
}

impl Write for ConsoleLog {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        for byte in bytes {
            self.line.push(*byte);
            if *byte == b'\n' {
                let line = std::mem::take(&mut self.line);
                self.send(line);
            }
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        if !self.line.is_empty() {
            let line = std::mem::take(&mut self.line);
            self.send(line);
        }
        Ok(())
    }
}

impl Drop for ConsoleLog {
    fn drop(&mut self) {
        // The hook holds the queue open. It cannot be removed by a thread that panics.
        if self.has_panic_hook && !thread::panicking() {
            let _ = std::panic::take_hook();
        }
        // The thread ends after the last line.
        self.lines = None;
        let _ = self.ended.recv_timeout(LAST_LINES);
    }
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use super::*;

    #[test]
    fn lines_arrive_in_order_also_the_last_ones() {
        let (mut reader, writer) = io::pipe().unwrap();
        let mut log = ConsoleLog::start(writer).unwrap();
        for number in 0..100 {
            write!(log, "line ").unwrap();
            writeln!(log, "{number}").unwrap();
        }
        drop(log);
        let mut text = String::new();
        reader.read_to_string(&mut text).unwrap();
        let expected: String = (0..100).map(|number| format!("line {number}\n")).collect();
        assert_eq!(text, expected);
    }

    #[test]
    fn unread_pipe_blocks_neither_writer_nor_exit() {
        let (mut reader, writer) = io::pipe().unwrap();
        let mut log = ConsoleLog::start(writer).unwrap();
        let line = "x".repeat(1000);
        for _ in 0..10 * LINES {
            writeln!(log, "{line}").unwrap();
        }
        assert!(log.lost > 0);
        let reading = thread::spawn(move || {
            let mut text = String::new();
            reader.read_to_string(&mut text).unwrap();
            text
        });
        while log.lost > 0 {
            writeln!(log, "still here").unwrap();
            thread::sleep(Duration::from_millis(1));
        }
        drop(log);
        assert!(reading.join().unwrap().contains("log lines were lost here"));
        let (_unread, writer) = io::pipe().unwrap();
        let mut log = ConsoleLog::start(writer).unwrap();
        for _ in 0..LINES {
            writeln!(log, "{line}").unwrap();
        }
        drop(log);
    }
}
