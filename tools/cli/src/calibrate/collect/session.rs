//! Moves the robot through a protocol and records motors and camera.

use std::{fs::File, io::LineWriter};

use i2ris::ipc::client::{Client, ClientError, Commander, Subscription};
use i2ris::ipc::payload::{ActuatorState, ExternalPosition};
use i2ris::ipc::{Refusal, StateCommand};
use i2ris::units::{MotorVec, Nanos};
use i2ris::{clock, realtime::Ticker};
use i2ris_report::{Failure, Interrupt, bail};
use i2ris_simulation::motion::paced_motion::{Motion, Playback};
use indicatif::ProgressBar;

use super::recorder::Recorder;
use crate::command::stream::{LOST_SETPOINT, restart_stream};
use crate::command::stream_monitor::StreamMonitor;
use crate::progress_bar::tenths;

/// Well below the deadline of a controller, and four times as fast as feedback needs.
const PERIOD: Nanos = Nanos::from_millis(5);
const CAMERA_WAIT: Nanos = Nanos::from_millis(3000);
const CAMERA_SILENCE: Nanos = Nanos::from_millis(2000);
/// A frame whose stamp is further from now is not on this machine's monotonic clock.
const CLOCK_TOLERANCE: Nanos = Nanos::from_millis(10_000);
/// Rows are written this much later, because frames arrive late.
const WRITE_DELAY: Nanos = Nanos::from_millis(1000);
const LAST_FRAMES: Nanos = Nanos::from_millis(1000);
/// How long the controller may take to read the last command: many ticks.
const LAST_COMMAND: Nanos = Nanos::from_millis(50);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    Complete,
    Interrupted,
}

pub struct Subscriptions {
    actuators: Subscription<ActuatorState>,
    external: Subscription<ExternalPosition>,
    last_frame: Nanos,
    setpoint: Option<MotorVec>,
}

impl Subscriptions {
    /// Waits for motors and camera; also returns how many outputs the camera measures.
    pub fn open(
        client: &Client,
        domain: &str,
        interrupt: &Interrupt,
    ) -> Result<(Self, usize), Failure> {
        let watcher = client.watcher();
        let (actuators, external) = (watcher.actuators(), watcher.external());
        let start = clock::now();
        let mut subscriptions = Self { actuators, external, last_frame: start, setpoint: None };
        let mut blind = false;
        loop {
            let now = clock::now();
            // New subscribers still receive the last frame of a camera that has ended.
            while let Some(seen) = subscriptions.external.read()? {
                let valid = seen.flags & ExternalPosition::VALID != 0;
                blind |= !valid;
                if valid && Nanos(seen.stamp_ns) + CAMERA_SILENCE > start {
                    check_clock(&seen, now)?;
                    subscriptions.last_frame = now;
                    return Ok((subscriptions, seen.count as usize));
                }
            }
            if interrupt.came() {
                bail!("interrupted before anything moved");
            }
            if now.duration_since(start) > CAMERA_WAIT {
                return Err(no_camera(domain, blind).into());
            }
            clock::sleep(PERIOD);
        }
    }

    fn receive(&mut self, recorder: &mut Recorder<LineWriter<File>>) -> Result<(), Failure> {
        let setpoint = &mut self.setpoint;
        self.actuators.drain(|state| {
            *setpoint = Some(state.setpoint_counts.map(f64::from));
            recorder.positions(&state);
        })?;
        let (now, last_frame) = (clock::now(), &mut self.last_frame);
        self.external.drain(|seen| {
            *last_frame = now;
            recorder.frame(&seen);
        })?;
        if now.duration_since(self.last_frame) > CAMERA_SILENCE {
            bail!("the camera has been silent for {} s", CAMERA_SILENCE.as_seconds());
        }
        recorder
            .write(now - WRITE_DELAY, false)
            .map_err(|error| format!("cannot write the recording: {error}").into())
    }

    pub fn missed(&self) -> u64 {
        self.actuators.missed() + self.external.missed()
    }
}

fn check_clock(seen: &ExternalPosition, now: Nanos) -> Result<(), Failure> {
    let apart = Nanos(seen.stamp_ns.abs_diff(now.0));
    if apart <= CLOCK_TOLERANCE {
        return Ok(());
    }
    let seconds = apart.as_seconds();
    bail!(
        "the camera's stamps are {seconds:.0} s away from this machine's monotonic clock; stamp \
         frames with CLOCK_MONOTONIC of this machine (Python: time.monotonic_ns())"
    )
}

fn no_camera(domain: &str, blind: bool) -> String {
    if blind {
        return "the camera sees nothing: every frame on external/measured_jp is marked invalid; \
         check that the snake is in the image"
            .to_owned();
    }
    format!(
        "no angles arrive on external/measured_jp of domain `{domain}`; start the camera process \
         on this domain (the emulator is one: `i2ris emulate --domain {domain}`, without \
         --no-camera)"
    )
}

pub struct Session<'a> {
    pub client: &'a mut Client,
    pub interrupt: &'a Interrupt,
    pub subscriptions: &'a mut Subscriptions,
    pub recorder: &'a mut Recorder<LineWriter<File>>,
    /// Progress bar over time; this session sets its length.
    pub bar: &'a ProgressBar,
}

impl Session<'_> {
    /// Conditions the robot, if requested, and moves it, while messages are recorded. An interrupt
    /// stops the motion softly. In every case the robot holds in the end and the lease is free.
    pub fn perform(
        &mut self,
        condition: bool,
        speed_counts_s: f64,
        motion: impl FnOnce(MotorVec) -> Motion,
    ) -> Result<Ending, Failure> {
        if condition && self.condition()? == Ending::Interrupted {
            return Ok(Ending::Interrupted);
        }
        let outcome =
            self.current_setpoints().and_then(|from| self.play(motion(from), speed_counts_s));
        // A command in transit would acquire the lease again.
        clock::sleep(LAST_COMMAND);
        let released = self.client.state_command(StateCommand::Release);
        let ending = outcome?;
        released?;
        self.receive_last_frames()?;
        Ok(ending)
    }

    pub fn watch(&mut self) -> Result<Ending, Failure> {
        while !self.interrupt.came() {
            self.subscriptions.receive(self.recorder)?;
            clock::sleep(PERIOD);
        }
        self.receive_last_frames()?;
        Ok(Ending::Complete)
    }

    fn current_setpoints(&mut self) -> Result<MotorVec, Failure> {
        let start = clock::now();
        loop {
            self.subscriptions.receive(self.recorder)?;
            match self.subscriptions.setpoint {
                Some(setpoint) => return Ok(setpoint),
                None if clock::now().duration_since(start) > CAMERA_WAIT => {
                    bail!("the controller does not report the motor positions; look at its log");
                }
                None => clock::sleep(PERIOD),
            }
        }
    }

    fn condition(&mut self) -> Result<Ending, Failure> {
        let (subscriptions, recorder) = (&mut *self.subscriptions, &mut *self.recorder);
        let interrupt = self.interrupt;
        let mut recorded = Ok(());
        let outcome = self.client.carry_out(StateCommand::Condition, || {
            recorded = subscriptions.receive(recorder);
            recorded.is_err() || interrupt.came()
        });
        match outcome {
            Ok(_) => recorded.map(|()| Ending::Complete),
            Err(ClientError::WaitCancelled(_)) => {
                self.client.state_command(StateCommand::Hold)?;
                recorded.map(|()| Ending::Interrupted)
            }
            Err(ClientError::Refused { refusal: Refusal::Unsupported, .. }) => bail!(
                "this controller has no conditioning cycle; add --no-condition to record without it"
            ),
            Err(error) => Err(error.into()),
        }
    }

    fn play(&mut self, motion: Motion, speed_counts_s: f64) -> Result<Ending, Failure> {
        let state = self.client.wait_for(CAMERA_WAIT, |_| true)?;
        let mut watch = StreamMonitor::new(self.client.id(), &state, clock::now());
        let mut commander: Commander = self.client.commander();
        let motors = self.recorder.motors;
        let mut playback = Playback::new(motion);
        self.bar.set_length(tenths(playback.left_s()));
        self.bar.reset();
        let mut last = clock::now();
        let mut ticker = Ticker::new(last + PERIOD, PERIOD, Nanos::ZERO);
        loop {
            let now = ticker.wait().started;
            let stop = self.interrupt.came();
            if playback.is_finished(stop) {
                let is_complete = playback.left_s() <= 0.0;
                return Ok(if is_complete { Ending::Complete } else { Ending::Interrupted });
            }
            let step_s = if watch.may_continue() { (now - last).as_seconds() } else { 0.0 };
            let place = playback.advance(step_s, stop);
            last = now;
            let counts = place.map(|counts| counts.round() as i32);
            commander.servo_actuators(counts.get(..motors).unwrap_or(&counts))?;
            self.subscriptions.receive(self.recorder)?;
            if let Some(state) = self.client.operating_state()? {
                watch.check(&state, clock::now())?;
            }
            if let Some(load) = watch.load.take() {
                self.bar.suspend(|| eprintln!("note: {load}"));
            }
            if watch.has_lost_setpoint() {
                let state = restart_stream(self.client)?;
                playback.rejoin(self.current_setpoints()?, speed_counts_s);
                last = clock::now();
                watch.restart(&state, last);
                self.bar.suspend(|| eprintln!("note: {LOST_SETPOINT}"));
            }
            self.bar.set_position(tenths(playback.elapsed_s()));
        }
    }

    fn receive_last_frames(&mut self) -> Result<(), Failure> {
        let end = clock::now() + LAST_FRAMES;
        while clock::now() < end {
            self.subscriptions.receive(self.recorder)?;
            clock::sleep(PERIOD);
        }
        Ok(())
    }
}
