//! Streams a trajectory: its output, and how it resumes after the controller stopped the snake.

use i2ris::ipc::client::{Client, ClientError, Commander, Latest, Subscription};
use i2ris::ipc::payload::{ExternalPosition, JointState, OperatingStateMsg};
use i2ris::{clock, ipc::StateCommand, realtime::Ticker, units::Nanos};
use i2ris_report::{Failure, Interrupt, Screen, bail, until_closed};

use super::prepare::{FIRST_MESSAGE_TIMEOUT, PrepareOptions, prepare};
use super::stream_monitor::{LateMonitor, StopReason, StreamMonitor};
use super::tracking::{ClipMonitor, TrackingSummary};
use super::trajectory::{Angles, Trajectory, TrajectoryPlayer};

/// Distance that counts as arrived, deg: dead-band, rounding to counts, a settling motor.
const ARRIVED_DEG: f64 = 0.3;
/// Time for the motors to cross their gaps after the end of a trajectory.
const ARRIVAL_TIMEOUT: Nanos = Nanos::from_millis(5000);

/// Reaction when the controller has stopped the snake because commands came late.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum OnLate {
    /// Resume; the rest of the trajectory is delayed
    Continue,
    /// Exit; the snake holds
    End,
}

pub struct Plan {
    pub name: &'static str,
    pub trajectory: Option<Trajectory>,
    /// Time on the trajectory, s; `None`: to its end, or until interrupted.
    pub duration_s: Option<f64>,
    pub rate_hz: f64,
    pub speed_deg_s: f64,
    pub on_late: OnLate,
    pub prepare: PrepareOptions,
}

/// Waits for the present pose, which is the setpoint.
pub fn present_pose(client: &Client) -> Result<Angles, Failure> {
    let mut setpoint = Latest::new(client.watcher().setpoint_js());
    let start = clock::now();
    loop {
        match setpoint.refresh()? {
            Some(joint) if joint.flags & JointState::VALID != 0 => return two_angles(joint),
            Some(_) if clock::now().duration_since(start) > FIRST_MESSAGE_TIMEOUT => {
                bail!(
                    "the controller has no model loaded and accepts no angles; name a model \
                     file in its configuration"
                );
            }
            None if clock::now().duration_since(start) > FIRST_MESSAGE_TIMEOUT => {
                return Err(StopReason::Silent.into());
            }
            _ => clock::sleep(Nanos::from_millis(5)),
        }
    }
}

pub fn two_angles(joint: &JointState) -> Result<Angles, Failure> {
    match joint.count {
        2 => Ok([joint.position[0].to_degrees(), joint.position[1].to_degrees()]),
        count => bail!(
            "the controller's model has {count} outputs; this program moves pitch and yaw only"
        ),
    }
}

/// Streams until the plan ends, an interrupt, or a controller that stops following.
pub fn run(client: &mut Client, plan: Plan, interrupt: &Interrupt) -> Result<(), Failure> {
    let state = prepare(client, plan.prepare, interrupt)?;
    let monitor = StreamMonitor::new(client.id(), &state, clock::now());
    let pose = present_pose(client)?;
    let trajectory = plan.trajectory.unwrap_or(Trajectory::Point(pose));
    let player = TrajectoryPlayer::new(pose, trajectory, plan.speed_deg_s, plan.duration_s);
    let mut stream = Stream {
        name: plan.name,
        period: Nanos((1e9 / plan.rate_hz) as u64),
        interrupt,
        player,
        progress: Progress::new(monitor),
        commander: client.commander(),
        goal: Latest::new(client.watcher().goal_js()),
        measured: Latest::new(client.watcher().measured_js()),
        camera: client.watcher().external(),
        tracking: TrackingSummary::default(),
        clips: ClipMonitor::new(clock::now()),
        late: LateMonitor::new(&state),
        on_late: plan.on_late,
    };
    let outcome = stream.play(client);
    let released = client.state_command(StateCommand::Release);
    outcome?;
    released?;
    if let Some(summary) = stream.tracking.summary() {
        stream.progress.say(&summary)?;
    }
    Ok(stream.clips.outcome()?)
}

struct Stream<'a> {
    name: &'static str,
    period: Nanos,
    interrupt: &'a Interrupt,
    player: TrajectoryPlayer,
    progress: Progress,
    commander: Commander,
    goal: Latest<JointState>,
    measured: Latest<JointState>,
    camera: Subscription<ExternalPosition>,
    tracking: TrackingSummary,
    clips: ClipMonitor,
    late: LateMonitor,
    on_late: OnLate,
}

impl Stream<'_> {
    fn play(&mut self, client: &mut Client) -> Result<(), Failure> {
        let (mut last, mut closed, mut finished) = (clock::now(), false, None);
        let mut ticker = Ticker::new(last + self.period, self.period, Nanos::ZERO);
        loop {
            let now = ticker.wait().started;
            let stop = self.interrupt.came() || closed;
            if self.player.is_finished(stop) && (stop || self.has_arrived(&mut finished, now)?) {
                return Ok(());
            }
            let step_s = (now - last).as_seconds();
            let may_continue = self.progress.monitor.may_continue();
            let angles = self.player.advance(if may_continue { step_s } else { 0.0 }, stop);
            self.late.record_step(step_s);
            last = now;
            self.commander.servo_jp(&angles.map(f64::to_radians))?;
            closed |= !self.check_response(client, angles)?;
            if self.progress.monitor.has_lost_setpoint() {
                last = self.rejoin(client)?;
            }
        }
    }

    /// Whether the snake is at the end of the trajectory, or nearest to it if it is out of reach.
    fn has_arrived(&self, finished: &mut Option<Nanos>, now: Nanos) -> Result<bool, Failure> {
        let since = *finished.get_or_insert(now);
        let away_deg = self.tracking.away_deg();
        if away_deg <= ARRIVED_DEG || self.clips.is_clipped {
            return Ok(true);
        }
        if now.duration_since(since) < ARRIVAL_TIMEOUT {
            return Ok(false);
        }
        bail!(
            "the snake is {away_deg:.2} deg from the end of the trajectory; `i2ris status` shows \
             the cause"
        )
    }

    fn rejoin(&mut self, client: &mut Client) -> Result<Nanos, Failure> {
        let state = restart_stream(client)?;
        self.player.rejoin(present_pose(client)?);
        let now = clock::now();
        self.progress.monitor.restart(&state, now);
        self.progress.say(LOST_SETPOINT)?;
        Ok(now)
    }

    /// Checks the response of the controller. Returns whether standard output still has a reader.
    fn check_response(&mut self, client: &mut Client, angles: Angles) -> Result<bool, Failure> {
        if let Some(state) = client.operating_state()?
            && let Some(late) = self.late.check(&state)
        {
            if self.on_late == OnLate::End {
                return Err(late.into());
            }
            if !self.progress.say(&format!("{late} and resumes"))? {
                return Ok(false);
            }
        }
        // The approach is not part of the trajectory.
        if let Some(measured) = self.measured.refresh()?
            && !self.player.is_approaching()
        {
            self.tracking.record(clock::now(), angles, measured);
        }
        let tracking = &mut self.tracking;
        self.camera.drain(|frame| tracking.record_frame(&frame))?;
        if let Some(goal) = self.goal.refresh()?
            && let Some(clipped) = self.clips.check(angles, goal, clock::now())
            && !self.progress.say(&clipped)?
        {
            return Ok(false);
        }
        let Self { name, player, measured, progress, .. } = self;
        progress.check(client, || line(name, player, measured.value(), angles))
    }
}

fn line(
    name: &str,
    player: &TrajectoryPlayer,
    measured: Option<&JointState>,
    [pitch, yaw]: Angles,
) -> String {
    let left = match player.left_s() {
        _ if player.is_approaching() => "approaching".to_owned(),
        Some(left_s) => format!("{left_s:.1} s left"),
        None => "until Ctrl-C".to_owned(),
    };
    let measured = measured.filter(|joint| joint.flags & JointState::VALID != 0);
    let measured = measured.map(|joint| joint.position.map(f64::to_degrees));
    let measured = measured.map(|[pitch, yaw, _]| format!("{pitch:+.2} {yaw:+.2}"));
    let measured = measured.unwrap_or_else(|| "unknown".to_owned());
    format!("{name}: {left}; pitch, yaw commanded {pitch:+.2} {yaw:+.2}, measured {measured} deg")
}

const TERMINAL_PERIOD: Nanos = Nanos::from_millis(100);
const FILE_PERIOD: Nanos = Nanos::from_millis(1000);
const REST_TIMEOUT: Nanos = Nanos::from_millis(2000);

pub struct Progress {
    pub monitor: StreamMonitor,
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

    /// Prints a new refusal, or `line` when it is due. Returns whether a reader is left.
    pub fn check(
        &mut self,
        client: &mut Client,
        line: impl FnOnce() -> String,
    ) -> Result<bool, Failure> {
        let now = clock::now();
        let state = client.operating_state()?;
        let refusal = state.map_or(Ok(None), |state| self.monitor.check(&state, now))?;
        if let Some(load) = self.monitor.load.take()
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
