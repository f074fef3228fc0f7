//! `i2ris teleop`: what a hand holds moves the snake. Dead-man, clutch, motion scaling, view.
//!
//! The hand moves a virtual master. While the dead-man is released the clutch is open: the snake
//! holds, and the master stays at the pose of the snake. While it is held, the hand moves the
//! master, and the snake follows. A device that is lost opens the clutch at once; when it is back,
//! everything has to be at rest before the dead-man counts.

mod hands;
mod input;
mod keyboard;
mod measure;
mod options;
mod pulse;
mod source;
mod task;

use i2ris::clock;
use i2ris::ipc::client::{Announcer, Client, Commander, Latest};
use i2ris::ipc::payload::{JointState, OperatingStateMsg, TeleopMsg, padded_text};
use i2ris::ipc::{Domain, StateCommand};
use i2ris::units::Nanos;
use i2ris_report::stop::stop;
use i2ris_report::{Failure, Interrupt};
use i2ris_teleop::clutch::Open;
use i2ris_teleop::master::{Master, MasterCommand, Mode, Motion};
use i2ris_teleop::view::View;

use crate::command::prepare::prepare;
use crate::command::progress::Progress;
use crate::command::stream::{present_pose, two_angles};
use crate::command::stream_monitor::StreamMonitor;
use crate::command::tracking::ClipMonitor;
use crate::exit::name_holder;
use options::{HandOptions, Lie};
use pulse::Pulses;
use source::{HandRequest, Source};
use task::{HandTask, HoldStillOptions, PursuitOptions, ReachOptions, TaskOptions};

use hands::profiles;

/// Longest delay of a command to the control loop: some ticks.
const COMMAND_DELAY: Nanos = Nanos::from_millis(20);
/// A device that tells more often than this is not sent more often.
const MIN_PERIOD: Nanos = Nanos::from_millis(1);
/// How often monitors are told what the hand does.
const TELL: Nanos = Nanos::from_millis(50);
/// Where the controller takes turned angles for pitch and yaw.
const TOLD_TURNED: &str = "warning: the camera tells the axes of its picture, and the controller compares them with \
     pitch and yaw: it will stop; set limits.plausibility_deg to 0, or let `i2ris vision \
     calibrate` find pitch and yaw";

/// Arguments of `i2ris teleop`.
#[derive(Debug, clap::Args)]
#[command(
    args_conflicts_with_subcommands = true,
    after_help = "Examples:
  i2ris teleop --enable                           the known device that is plugged in, and its pedal
  i2ris teleop --keyboard --scale 0.5             space bar: dead-man; arrows steer
  i2ris teleop --view 90,mirror                   how the picture of the camera lies
  i2ris teleop --view measure                     the snake moves by 1 deg while a camera watches
  i2ris teleop task reach --targets 5             bring the snake to targets and hold it there
  i2ris teleop input show                         which devices there are

Ctrl-C ends; the snake holds."
)]
pub struct Arguments {
    #[command(subcommand)]
    other: Option<Other>,
    #[command(flatten)]
    hand: HandOptions,
}

#[derive(Debug, clap::Subcommand)]
enum Other {
    /// A task by hand. The monitor shows the target, `i2ris record report` scores a recording
    #[command(subcommand)]
    Task(Task),
    /// Look at input devices, record them and play what was recorded
    #[command(subcommand)]
    Input(input::Command),
}

#[derive(Debug, clap::Subcommand)]
#[command(after_help = "Examples:
  i2ris teleop task reach --targets 5
  i2ris teleop task pursuit --device /dev/input/event7
  i2ris teleop task hold-still --duration-s 20")]
enum Task {
    /// Bring the snake to targets, one after the other, and hold it there. With the keys of this
    /// terminal or --device
    Reach {
        #[command(flatten)]
        task: ReachOptions,
        #[command(flatten)]
        hand: HandOptions,
    },
    /// Follow a target along a curve that cannot be foreseen
    Pursuit {
        #[command(flatten)]
        task: PursuitOptions,
        #[command(flatten)]
        hand: HandOptions,
    },
    /// Keep the snake at a place
    HoldStill {
        #[command(flatten)]
        task: HoldStillOptions,
        #[command(flatten)]
        hand: HandOptions,
    },
}

pub fn run(arguments: Arguments) -> Result<(), Failure> {
    let (hand, task) = match arguments.other {
        None => (arguments.hand, None),
        Some(Other::Input(command)) => return input::run(&command),
        Some(Other::Task(Task::Reach { task, hand })) => (hand, Some(TaskOptions::Reach(task))),
        Some(Other::Task(Task::Pursuit { task, hand })) => (hand, Some(TaskOptions::Pursuit(task))),
        Some(Other::Task(Task::HoldStill { task, hand })) => {
            (hand, Some(TaskOptions::HoldStill(task)))
        }
    };
    let domain = hand.domain.domain()?;
    steer(&domain, &hand, task.as_ref()).map_err(|failure| name_holder(failure, &domain))
}

/// Commands the snake until the operator or the system ends it, or the controller cannot follow any
/// more. Then the snake holds and the lease is free.
fn steer(domain: &Domain, hand: &HandOptions, task: Option<&TaskOptions>) -> Result<(), Failure> {
    let (client, interrupt) =
        (&mut crate::command::prepare::connect(domain)?, &Interrupt::catch()?);
    let settings = hand.settings(task.is_some());
    let mut source = hand.source(task.is_some())?;
    let state = prepare(client, hand.prepare, interrupt)?;
    let monitor = StreamMonitor::new(client.id(), &state, clock::now());
    let mut progress = Progress::new(monitor);
    let is_measured = hand.view == Lie::Measured;
    let view = if let Lie::Typed { rotation_deg, is_mirrored } = hand.view {
        View::typed(rotation_deg, is_mirrored)
    } else {
        progress.say("measuring the view: the snake moves by a degree in pitch and in yaw")?;
        let view = measure::measure(client, interrupt)?;
        if view.is_turned() && state.flags & OperatingStateMsg::COMPARED != 0 {
            progress.say(TOLD_TURNED)?;
        }
        view
    };
    let mut teleoperation = Teleoperation {
        master: Master::new(present_pose(client)?, settings),
        mode: settings.mode,
        view,
        scales: hand.scale.clone(),
        scale: 0,
        progress,
        is_measured,
        announcer: client.announcer(),
        told: (Nanos::ZERO, None),
        event: (Nanos::ZERO, 0),
        pulses: hand.pulse.then(|| Pulses::new(client, domain)),
        marked: Nanos::ZERO,
        commander: client.commander(),
        setpoint: Latest::new(client.watcher().setpoint_js()),
        goal: Latest::new(client.watcher().goal_js()),
        clips: ClipMonitor::new(clock::now()),
        is_stopped: false,
        task: task.map(|options| HandTask::new(options, client)),
    };
    teleoperation.progress.say(&source.help())?;
    teleoperation.progress.say(&format!("the view: {view}"))?;
    let period = Nanos((1e9 / hand.rate_hz) as u64);
    let outcome = teleoperation.run(client, source.as_mut(), period, interrupt);
    // The clutch first: the lease is valid until it is released.
    let held = teleoperation.hold();
    if teleoperation.is_stopped {
        teleoperation.progress.say(&stop(client, domain)?.text)?;
    }
    // A command that arrives later would take the lease again.
    clock::sleep(COMMAND_DELAY);
    let released = client.state_command(StateCommand::Release);
    outcome?;
    held?;
    released?;
    if let Some(task) = &teleoperation.task {
        teleoperation.progress.say(&task.summary())?;
    }
    Ok(())
}

struct Teleoperation {
    master: Master,
    mode: Mode,
    view: View,
    scales: Vec<f64>,
    /// Which of them.
    scale: usize,
    progress: Progress,
    is_measured: bool,
    announcer: Announcer<TeleopMsg>,
    /// When monitors were told last, and why the clutch was open then.
    told: (Nanos, Option<Open>),
    /// When the newest event came to the computer, and the command that it led to.
    event: (Nanos, u64),
    /// Whether limits are felt.
    pulses: Option<Pulses>,
    /// When the newest mark was asked for.
    marked: Nanos,
    commander: Commander,
    setpoint: Latest<JointState>,
    goal: Latest<JointState>,
    clips: ClipMonitor,
    /// The key that stops every client was pressed.
    is_stopped: bool,
    task: Option<HandTask>,
}

impl Teleoperation {
    fn run(
        &mut self,
        client: &mut Client,
        source: &mut dyn Source,
        period: Nanos,
        interrupt: &Interrupt,
    ) -> Result<(), Failure> {
        let mut last = clock::now();
        while !interrupt.came() {
            source.wait(last + period);
            clock::sleep_until(last + MIN_PERIOD);
            let now = clock::now();
            let asked = source.read(now)?;
            if asked.quit {
                self.is_stopped = asked.stop;
                break;
            }
            let command = self.command(&asked, (now - last).as_seconds())?;
            last = now;
            let sequence = self.send(&command)?;
            if let Some(came) = asked.newest {
                self.event = (came, sequence);
            }
            self.publish(&asked, now)?;
            while let Some(news) = source.news() {
                self.progress.say(&news)?;
            }
            self.goal.refresh()?;
            if let Some(pulses) = &mut self.pulses
                && asked.open.is_none()
                && pulses.due(now)?
            {
                source.pulse();
            }
            if let Some(goal) = self.goal.value()
                && let Some(clipped) = self.clips.check(command.pose, goal, now)
            {
                self.progress.say(&clipped)?;
            }
            if let Some(task) = &mut self.task {
                if let Some(outcome) = task.update(now, asked.open.is_none())? {
                    self.progress.say(&outcome)?;
                }
                if task.is_finished() {
                    break;
                }
            }
            let (task, scale) = (self.task.as_ref(), self.scales[self.scale]);
            if !self.progress.check(client, || line(&command, &asked, scale, task, now))? {
                break;
            }
        }
        Ok(())
    }

    fn command(&mut self, asked: &HandRequest, step_s: f64) -> Result<MasterCommand, Failure> {
        self.scale = (self.scale + asked.scale_steps as usize) % self.scales.len();
        let snake = self.setpoint.refresh()?.map(two_angles).transpose()?;
        let motion = Motion {
            engaged: asked.open.is_none(),
            push: self.view.joints(asked.push),
            steps: self.view.joints(asked.steps),
            scale: self.scales[self.scale],
        };
        Ok(self.master.update(&motion, snake, step_s))
    }

    /// Returns the number of the command. Its stamp is now, and not that of the event: by it the
    /// controller judges its age, and a stick that is held has no new event for long.
    fn send(&mut self, command: &MasterCommand) -> Result<u64, Failure> {
        self.commander.set_clutch(command.clutch_open);
        Ok(self.commander.servo_jp(&command.pose.map(f64::to_radians))?)
    }

    /// Tells monitors and recorders what the hand does.
    fn publish(&mut self, asked: &HandRequest, now: Nanos) -> Result<(), Failure> {
        if asked.marks > 0 {
            self.marked = asked.newest.unwrap_or(now);
        } else if now.duration_since(self.told.0) < TELL && self.told.1 == asked.open {
            return Ok(());
        }
        self.told = (now, asked.open);
        let measured = if self.is_measured { TeleopMsg::VIEW_MEASURED } else { 0 };
        let open = asked.open.map_or(0, |_| TeleopMsg::OPEN);
        let why_open = asked.open.map(|why| why.to_string()).unwrap_or_default();
        self.announcer.publish(TeleopMsg {
            view: self.view.seen(),
            push: asked.push,
            scale: self.scales[self.scale],
            event_ns: self.event.0.0,
            command_sequence: self.event.1,
            mark_ns: self.marked.0,
            mode: self.mode as u32,
            flags: open | measured,
            why_open: padded_text(&why_open),
            ..TeleopMsg::default()
        })?;
        Ok(())
    }

    /// Opens the clutch: the snake stops now and not at the deadline.
    fn hold(&mut self) -> Result<(), Failure> {
        let command = self.master.hold();
        self.send(&command).map(drop)
    }
}

fn line(
    command: &MasterCommand,
    asked: &HandRequest,
    scale: f64,
    task: Option<&HandTask>,
    now: Nanos,
) -> String {
    // Within 80 columns: a line that wraps cannot be drawn over.
    if let Some(task) = task {
        let clutch = if command.clutch_open { "HOLDS" } else { "FOLLOWS" };
        return format!("{clutch}; {}", task.line(now));
    }
    let [pitch, yaw] = command.pose;
    match asked.open {
        Some(why) => format!("HOLDS: {why}"),
        None => format!(
            "FOLLOWS at {:.0} %; pitch, yaw commanded {pitch:+.2} {yaw:+.2} deg",
            100.0 * scale
        ),
    }
}
