//! Driving the robot through a protocol while listening to motors and camera.

use std::io::Write;

use i2ris::clock;
use i2ris::ipc::client::{Client, ClientError, Commander, Subscription};
use i2ris::ipc::payload::{ActuatorState, ExternalPosition, OperatingStateMsg};
use i2ris::ipc::{Refusal, StateCommand};
use i2ris::rt::Ticker;
use i2ris::units::{MotorVec, Nanos};
use indicatif::ProgressBar;

use super::motion::{Motion, Playback};
use super::take::Take;
use crate::command::watch::{Watch, enabled};
use i2ris_terminal::Failure;
use i2ris_terminal::Interrupt;

/// Commands per second: well below the deadline of a controller, and four times as fast as feedback
/// needs.
const PERIOD: Nanos = Nanos::from_millis(5);

/// How long to wait for the first picture.
const CAMERA_WAIT: Nanos = Nanos::from_millis(3000);

/// A camera that says nothing for so long has gone.
const CAMERA_SILENCE: Nanos = Nanos::from_millis(2000);

/// A picture whose stamp is further from now is not on this machine's monotonic clock.
const STRANGE_CLOCK: Nanos = Nanos::from_millis(10_000);

/// Rows are written this much later: pictures take their time.
const HOLD_BACK: Nanos = Nanos::from_millis(1000);

/// How long to listen on after the motion, for the pictures that are on their way.
const AFTERGLOW: Nanos = Nanos::from_millis(1000);

/// How long a conditioning stroke may take: with the slowest that a configuration is likely to ask
/// for.
const CONDITIONING: Nanos = Nanos::from_millis(300_000);

/// How long the controller may take to read the last command: many ticks.
const LAST_COMMAND: Nanos = Nanos::from_millis(50);

/// How a session ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    Complete,
    Interrupted,
}

/// What arrives.
pub struct Ears {
    actuators: Subscription<ActuatorState>,
    external: Subscription<ExternalPosition>,
    /// When the last picture came.
    heard: Nanos,
    setpoint: Option<MotorVec>,
}

impl Ears {
    /// Waits for motors and camera. The answer says, too, how many outputs the camera measures.
    pub fn open(
        client: &Client,
        domain: &str,
        interrupt: &Interrupt,
    ) -> Result<(Self, usize), Failure> {
        let watcher = client.watcher();
        let (actuators, external) = (watcher.actuators(), watcher.external());
        let start = clock::now();
        let mut ears = Self {
            actuators,
            external,
            heard: start,
            setpoint: None,
        };
        let mut blind = false;
        loop {
            let now = clock::now();
            // The last picture of a camera that has ended is still there for whoever joins.
            while let Some(seen) = ears.external.read()? {
                let valid = seen.flags & ExternalPosition::VALID != 0;
                blind |= !valid;
                if valid && Nanos(seen.stamp_ns) + CAMERA_SILENCE > start {
                    check_clock(&seen, now)?;
                    ears.heard = now;
                    return Ok((ears, seen.count as usize));
                }
            }
            if interrupt.came() {
                return Err("interrupted before anything moved".into());
            }
            if now.since(start) > CAMERA_WAIT {
                return Err(no_camera(domain, blind).into());
            }
            clock::sleep(PERIOD);
        }
    }

    fn listen<W: Write>(&mut self, take: &mut Take<W>) -> Result<(), Failure> {
        let setpoint = &mut self.setpoint;
        self.actuators.drain(|state| {
            *setpoint = Some(state.setpoint_counts.map(f64::from));
            take.positions(&state);
        })?;
        let (now, mut heard) = (clock::now(), false);
        self.external.drain(|seen| {
            heard = true;
            take.picture(&seen);
        })?;
        if heard {
            self.heard = now;
        }
        if now.since(self.heard) > CAMERA_SILENCE {
            return Err(format!(
                "the camera has been silent for {} s",
                CAMERA_SILENCE.as_seconds()
            )
            .into());
        }
        take.write(now - HOLD_BACK, false)
            .map_err(|error| format!("cannot write the recording: {error}").into())
    }

    /// Messages that were not read in time.
    pub fn missed(&self) -> u64 {
        self.actuators.missed() + self.external.missed()
    }
}

fn check_clock(seen: &ExternalPosition, now: Nanos) -> Result<(), Failure> {
    let apart = Nanos(seen.stamp_ns.abs_diff(now.0));
    if apart <= STRANGE_CLOCK {
        return Ok(());
    }
    let seconds = apart.as_seconds();
    Err(format!(
        "the camera's stamps are {seconds:.0} s away from this machine's monotonic clock; stamp pictures with \
         CLOCK_MONOTONIC of this machine (Python: time.monotonic_ns())"
    )
    .into())
}

fn no_camera(domain: &str, blind: bool) -> String {
    if blind {
        return "the camera sees nothing: every picture on external/measured_jp is marked as not valid; look at the \
                snake in its picture"
            .to_owned();
    }
    format!(
        "no angles arrive on external/measured_jp of domain `{domain}`; start the camera process on this domain (the \
         emulator is one: `i2ris emulate --domain {domain}`, without --no-camera)"
    )
}

/// A robot that is ENABLED, and everything that is needed to move and record it.
pub struct Session<'a> {
    pub client: &'a mut Client,
    pub interrupt: &'a Interrupt,
    pub ears: &'a mut Ears,
    /// Shows time; its length is set here.
    pub bar: &'a ProgressBar,
}

impl Session<'_> {
    /// Conditions the robot, if asked, and moves it. What arrives goes to `take` all the while. An
    /// interrupt stops the motion softly; whatever happens, the robot holds in the end and the
    /// lease is free.
    pub fn perform<W: Write>(
        &mut self,
        take: &mut Take<W>,
        condition: bool,
        motion: impl FnOnce(MotorVec) -> Motion,
    ) -> Result<Ending, Failure> {
        if condition && self.condition(take)? == Ending::Interrupted {
            return Ok(Ending::Interrupted);
        }
        let outcome = self
            .place(take)
            .and_then(|from| self.play(take, motion(from)));
        // A command that is still on its way would take the lease again.
        clock::sleep(LAST_COMMAND);
        let released = self.client.state_command(StateCommand::Release);
        let ending = outcome?;
        released?;
        self.listen_on(take)?;
        Ok(ending)
    }

    /// Where the set-points are.
    fn place<W: Write>(&mut self, take: &mut Take<W>) -> Result<MotorVec, Failure> {
        let start = clock::now();
        loop {
            self.ears.listen(take)?;
            match self.ears.setpoint {
                Some(setpoint) => return Ok(setpoint),
                None if clock::now().since(start) > CAMERA_WAIT => {
                    return Err(
                        "the controller does not tell where the motors are; look at its log".into(),
                    );
                }
                None => clock::sleep(PERIOD),
            }
        }
    }

    /// Lets the controller run its stroke.
    fn condition<W: Write>(&mut self, take: &mut Take<W>) -> Result<Ending, Failure> {
        self.client.state_command(StateCommand::Condition).map_err(|error| -> Failure {
            match error {
                ClientError::Refused { refusal: Refusal::Unsupported, .. } => {
                    "this controller knows no conditioning stroke; add --no-condition to go without it".into()
                }
                other => other.into(),
            }
        })?;
        let asked = clock::now();
        loop {
            clock::sleep(PERIOD);
            self.ears.listen(take)?;
            let now = clock::now();
            let state = self
                .client
                .operating_state()?
                .filter(|state| state.stamp_ns > asked.0);
            if let Some(state) = state {
                enabled(&state)?;
                if state.flags & OperatingStateMsg::BUSY == 0 {
                    return Ok(Ending::Complete);
                }
            }
            if self.interrupt.came() {
                self.hold()?;
                return Ok(Ending::Interrupted);
            }
            if now.since(asked) > CONDITIONING {
                self.hold()?;
                return Err(
                    "the conditioning stroke does not end; look at the controller's log".into(),
                );
            }
        }
    }

    /// Ends a stroke: paused, the robot holds; resumed, it goes on holding.
    fn hold(&mut self) -> Result<(), Failure> {
        self.client.state_command(StateCommand::Pause)?;
        self.client.state_command(StateCommand::Resume)?;
        Ok(())
    }

    fn play<W: Write>(&mut self, take: &mut Take<W>, motion: Motion) -> Result<Ending, Failure> {
        let state = self.client.wait_for(CAMERA_WAIT, |_| true)?;
        let mut watch = Watch::new(self.client.id(), &state, clock::now());
        let mut commander: Commander = self.client.commander();
        let motors = take.motors();
        let mut playback = Playback::new(motion);
        self.bar.set_length(tenths(playback.left_s()));
        self.bar.reset();
        let mut last = clock::now();
        let mut ticker = Ticker::new(last + PERIOD, PERIOD, Nanos::ZERO);
        loop {
            let now = ticker.wait().started;
            let stop = self.interrupt.came();
            if playback.finished(stop) {
                return Ok(if playback.left_s() <= 0.0 {
                    Ending::Complete
                } else {
                    Ending::Interrupted
                });
            }
            let place = playback.advance((now - last).as_seconds(), stop);
            last = now;
            let counts = place.map(|counts| counts.round() as i32);
            commander.servo_actuators(counts.get(..motors).unwrap_or(&counts))?;
            self.ears.listen(take)?;
            if let Some(state) = self.client.operating_state()? {
                watch.judge(&state, clock::now())?;
            }
            self.bar.set_position(tenths(playback.at_s()));
        }
    }

    /// Until the last pictures have come.
    fn listen_on<W: Write>(&mut self, take: &mut Take<W>) -> Result<(), Failure> {
        let end = clock::now() + AFTERGLOW;
        while clock::now() < end {
            self.ears.listen(take)?;
            clock::sleep(PERIOD);
        }
        Ok(())
    }
}

fn tenths(seconds: f64) -> u64 {
    (seconds * 10.0) as u64
}
