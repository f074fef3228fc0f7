//! Streaming a path to the controller.

use i2ris::clock;
use i2ris::ipc::StateCommand;
use i2ris::ipc::client::{Client, Commander, Latest};
use i2ris::ipc::payload::JointState;
use i2ris::rt::Ticker;
use i2ris::units::Nanos;

use super::path::{Angles, Path};
use super::player::Player;
use super::prepare::prepare;
use super::watch::{Stop, Tracking, Watch};
use i2ris_terminal::Failure;
use i2ris_terminal::{Interrupt, Screen, until_closed};

/// How long the controller may take to tell something for the first time.
pub(super) const FIRST_NEWS: Nanos = Nanos::from_millis(2000);
/// How often progress is shown to a person, and to a file.
const SHOW_PERIOD: Nanos = Nanos::from_millis(100);
const LOG_PERIOD: Nanos = Nanos::from_millis(1000);

/// What to stream, and how.
#[derive(Debug)]
pub struct Plan {
    /// What people read while it runs.
    pub name: &'static str,
    /// Where to go; `None`: stay where the robot is.
    pub path: Option<Path>,
    /// Seconds to stay on the path; `None`: as long as it is, or until interrupted.
    pub duration_s: Option<f64>,
    /// Commands per second.
    pub rate_hz: f64,
    /// Speed limit of the approach, deg/s.
    pub speed_deg_s: f64,
    /// Home and enable first, where necessary.
    pub enable: bool,
}

/// Waits for the present pose, as the set-points have it.
pub(super) fn present_pose(client: &Client) -> Result<Angles, Failure> {
    let mut setpoint = Latest::new(client.watcher().setpoint_js());
    let start = clock::now();
    loop {
        match setpoint.refresh()? {
            Some(joint) if joint.flags & JointState::VALID != 0 => return two_angles(joint),
            Some(_) if clock::now().since(start) > FIRST_NEWS => {
                return Err(
                    "the controller has no model loaded, so it cannot be commanded by angles; \
                            name a model file in its configuration"
                        .into(),
                );
            }
            None if clock::now().since(start) > FIRST_NEWS => return Err(Stop::Silent.into()),
            _ => clock::sleep(Nanos::from_millis(5)),
        }
    }
}

pub(super) fn two_angles(joint: &JointState) -> Result<Angles, Failure> {
    match joint.count {
        2 => Ok([
            joint.position[0].to_degrees(),
            joint.position[1].to_degrees(),
        ]),
        count => Err(format!(
            "the controller's model has {count} outputs; this program moves pitch and yaw only"
        )
        .into()),
    }
}

/// Streams the plan until it ends, is interrupted, or makes no sense any more, and gives the lease
/// back.
pub fn run(client: &mut Client, plan: Plan, interrupt: &Interrupt) -> Result<(), Failure> {
    let mut screen = Screen::stdout();
    let state = prepare(client, plan.enable, interrupt)?;
    let watch = Watch::new(client.id(), &state, clock::now());
    let pose = present_pose(client)?;
    let player = Player::new(
        pose,
        plan.path.unwrap_or(Path::Point(pose)),
        plan.speed_deg_s,
        plan.duration_s,
    );
    let mut stream = Stream {
        name: plan.name,
        player,
        watch,
        commander: client.commander(),
        goal: Latest::new(client.watcher().goal_js()),
        measured: Latest::new(client.watcher().measured_js()),
        tracking: Tracking::default(),
        next_show: Nanos::ZERO,
    };
    let outcome = stream.play(
        client,
        Nanos((1e9 / plan.rate_hz) as u64),
        interrupt,
        &mut screen,
    );
    let released = client.state_command(StateCommand::Release);
    outcome?;
    released?;
    if let Some(summary) = stream.tracking.summary() {
        until_closed(screen.say(&summary))?;
    }
    Ok(())
}

struct Stream {
    name: &'static str,
    player: Player,
    watch: Watch,
    commander: Commander,
    goal: Latest<JointState>,
    measured: Latest<JointState>,
    tracking: Tracking,
    next_show: Nanos,
}

impl Stream {
    fn play(
        &mut self,
        client: &mut Client,
        period: Nanos,
        interrupt: &Interrupt,
        screen: &mut Screen,
    ) -> Result<(), Failure> {
        let (mut last, mut closed) = (clock::now(), false);
        let mut ticker = Ticker::new(last + period, period, Nanos::ZERO);
        loop {
            let now = ticker.wait().started;
            let stop = interrupt.came() || closed;
            if self.player.finished(stop) {
                return Ok(());
            }
            let angles = self.player.advance((now - last).as_seconds(), stop);
            last = now;
            self.commander.servo_jp(&angles.map(f64::to_radians))?;
            closed |= !self.follow(client, angles, screen)?;
        }
    }

    /// Looks at what the controller makes of it. The answer is whether anyone still reads what is
    /// shown.
    fn follow(
        &mut self,
        client: &mut Client,
        angles: Angles,
        screen: &mut Screen,
    ) -> Result<bool, Failure> {
        let state = client.operating_state()?;
        let now = clock::now();
        let refusal = state
            .map(|state| self.watch.judge(&state, now))
            .transpose()?
            .flatten();
        if let (Some(goal), Some(measured)) = (self.goal.refresh()?, self.measured.refresh()?) {
            self.tracking.record(goal, measured);
        }
        if let Some(refusal) = refusal {
            return Ok(until_closed(screen.say(&format!("refused: {refusal}")))?);
        }
        if now < self.next_show {
            return Ok(true);
        }
        self.next_show = now
            + if screen.is_terminal() {
                SHOW_PERIOD
            } else {
                LOG_PERIOD
            };
        Ok(until_closed(screen.draw(&[self.line(angles)]))?)
    }

    fn line(&self, [pitch, yaw]: Angles) -> String {
        let left = match self.player.left_s() {
            _ if self.player.approaching() => "approaching".to_owned(),
            Some(left_s) => format!("{left_s:.1} s left"),
            None => "until Ctrl-C".to_owned(),
        };
        let measured = self
            .measured
            .value()
            .filter(|joint| joint.flags & JointState::VALID != 0)
            .map_or_else(
                || "unknown".to_owned(),
                |joint| {
                    format!(
                        "{:+.2} {:+.2}",
                        joint.position[0].to_degrees(),
                        joint.position[1].to_degrees()
                    )
                },
            );
        format!(
            "{}: {left}; pitch, yaw commanded {pitch:+.2} {yaw:+.2}, measured {measured} deg",
            self.name
        )
    }
}
