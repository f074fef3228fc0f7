//! Output of a command stream, and how it resumes after the controller stopped the snake.

use i2ris::clock;
use i2ris::ipc::StateCommand;
use i2ris::ipc::client::{Client, ClientError};
use i2ris::ipc::payload::OperatingStateMsg;
use i2ris::units::Nanos;
use i2ris_report::{Failure, Screen, until_closed};

use super::stream_monitor::StreamMonitor;

const TERMINAL_PERIOD: Nanos = Nanos::from_millis(100);
const FILE_PERIOD: Nanos = Nanos::from_millis(1000);
const REST_TIMEOUT: Nanos = Nanos::from_millis(2000);

#[derive(Debug)]
pub struct Progress {
    monitor: StreamMonitor,
    screen: Screen,
    next_line: Nanos,
}

impl Progress {
    pub fn new(monitor: StreamMonitor) -> Self {
        Self { monitor, screen: Screen::stdout(), next_line: Nanos::ZERO }
    }

    /// Prints a line that stays. Returns whether standard output still has a reader.
    pub fn say(&mut self, line: &str) -> Result<bool, Failure> {
        Ok(until_closed(self.screen.say(line))?)
    }

    /// Monitor of the controller's response to the stream.
    pub fn monitor(&mut self) -> &mut StreamMonitor {
        &mut self.monitor
    }

    /// Checks the response of the controller, and prints a new refusal, or `line` when it is due.
    /// Returns whether standard output still has a reader.
    pub fn check(
        &mut self,
        client: &mut Client,
        line: impl FnOnce() -> String,
    ) -> Result<bool, Failure> {
        let now = clock::now();
        let refusal = match client.operating_state()? {
            Some(state) => self.monitor.check(&state, now)?,
            None => None,
        };
        if let Some(load) = self.monitor.take_load()
            && !self.say(&load)?
        {
            return Ok(false);
        }
        if let Some(refusal) = refusal {
            return self.say(&format!("refused: {refusal}"));
        }
        if now < self.next_line {
            return Ok(true);
        }
        let period = if self.screen.is_terminal() { TERMINAL_PERIOD } else { FILE_PERIOD };
        self.next_line = now + period;
        Ok(until_closed(self.screen.draw(&[line()]))?)
    }
}

/// Printed when a stream resumes from the setpoint.
pub const LOST_SETPOINT: &str = "the controller has stopped the snake, because commands came late \
     or were not read; the motion resumes from the present pose";

/// Waits until no setpoint moves, then releases the lease, so that the next command starts a new
/// stream. `release` is safe in every state: it never enables or resumes. If another client takes
/// the lease in the meantime, nothing is sent, and the caller sees it by the lease.
pub fn restart_stream(client: &mut Client) -> Result<OperatingStateMsg, ClientError> {
    let id = client.id();
    let is_ours = |state: &OperatingStateMsg| [0, id].contains(&state.lease_client_id);
    let state = client.wait_for(REST_TIMEOUT, |state| {
        state.flags & OperatingStateMsg::AT_REST != 0 || !is_ours(state)
    })?;
    if is_ours(&state) {
        client.state_command(StateCommand::Release)?;
    }
    Ok(state)
}
