//! `i2ris teleop`: moves the snake by an input device. Dead-man, clutch, motion scaling, view.
//!
//! The hand moves a virtual master. While the dead-man is released the clutch is open: the snake
//! holds, and the master stays at the pose of the snake. While it is held, the hand moves the
//! master, and the snake follows. A lost device opens the clutch at once; when it returns, all
//! controls must be at rest before the dead-man is accepted.

mod input;
mod input_devices;
mod keyboard;
mod measure;
mod options;
mod task;

use i2ris::ipc::client::{Announcer, Client, Commander, Latest};
use i2ris::ipc::payload::{JointState, OperatingStateMsg, TeleopMsg, padded_text};
use i2ris::ipc::{Domain, StateCommand};
use i2ris::{clock, units::Nanos};
use i2ris_report::{Failure, Interrupt, stop::stop};
use i2ris_teleop::clutch::{Hand, Open};
use i2ris_teleop::master::{Master, MasterCommand, Mode, Motion};
use i2ris_teleop::view::View;
use nix::errno::Errno;

use crate::command::name_holder;
use crate::command::prepare::prepare;
use crate::command::stream::{Progress, present_pose, two_angles};
use crate::command::stream_monitor::StreamMonitor;
use crate::command::tracking::ClipMonitor;
use crate::stop::confirmed;
use input_devices::{Pulses, profiles};
use options::{CameraOrientation, HandOptions};
use task::{HandTask, TaskOptions};

/// Longest delay of a command to the control loop: a few ticks.
const COMMAND_DELAY: Nanos = Nanos::from_millis(20);
const MIN_PERIOD: Nanos = Nanos::from_millis(1);
const PUBLISH_PERIOD: Nanos = Nanos::from_millis(50);
/// Warning if the controller would mistake rotated image axes for pitch and yaw.
const ROTATED_CAMERA: &str = "warning: the camera reports angles in image axes, but the controller \
         compares them with pitch and yaw and will stop; set limits.plausibility_deg to 0, or \
         state axis, reversed and turn_deg of every view in the setup of `i2ris vision`";

#[derive(Debug, clap::Args)]
#[command(
    args_conflicts_with_subcommands = true,
    after_help = "Examples:
  i2ris teleop --enable                           the known device that is plugged in, and its pedal
  i2ris teleop --keyboard --scale 0.5             space bar: dead-man; arrows steer
  i2ris teleop --view 90,mirror                   orientation of the camera image
  i2ris teleop --view measure                     the snake moves by 1 deg while a camera watches
  i2ris teleop task reach --targets 5             move the snake to targets and hold it there
  i2ris teleop input show                         list the input devices

Ctrl-C exits; the snake holds."
)]
pub struct Arguments {
    #[command(subcommand)]
    other: Option<Other>,
    #[command(flatten)]
    hand: HandOptions,
}

#[derive(Debug, clap::Subcommand)]
enum Other {
    /// Manual tasks: the monitor shows the target, `i2ris record report` scores a recording
    Task(Box<Steered>),
    /// Inspect, record and play back input devices
    #[command(subcommand)]
    Input(input::Command),
}

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  i2ris teleop task reach --targets 5
  i2ris teleop task pursuit --device /dev/input/event7
  i2ris teleop task hold-still --duration-s 20")]
struct Steered {
    #[command(flatten)]
    task: TaskOptions,
    #[command(flatten)]
    hand: HandOptions,
}

pub fn run(arguments: Arguments) -> Result<(), Failure> {
    let (hand, task) = match arguments.other {
        None => (arguments.hand, None),
        Some(Other::Input(command)) => return input::run(&command),
        Some(Other::Task(steered)) => (steered.hand, Some(steered.task)),
    };
    task.iter().try_for_each(TaskOptions::check)?;
    let domain = hand.domain.domain()?;
    steer(&domain, &hand, task.as_ref()).map_err(|failure| name_holder(failure, &domain))
}

/// Commands the snake to the end. Then the snake holds and the lease is free.
fn steer(domain: &Domain, hand: &HandOptions, task: Option<&TaskOptions>) -> Result<(), Failure> {
    let (client, interrupt) =
        (&mut crate::command::prepare::connect(domain)?, &Interrupt::catch()?);
    let settings = hand.settings(task.is_some());
    let mut source = hand.source(task.is_some())?;
    let state = prepare(client, hand.prepare, interrupt)?;
    let mut progress = Progress::new(StreamMonitor::new(client.id(), &state, clock::now()));
    let is_measured = hand.view == CameraOrientation::Measured;
    let view = if let CameraOrientation::Typed { rotation_deg, is_mirrored } = hand.view {
        View::typed(rotation_deg, is_mirrored)
    } else {
        progress.say("measuring the view: the snake moves by a degree in pitch and in yaw")?;
        let view = measure::measure(client, interrupt)?;
        if view.is_turned() && state.flags & OperatingStateMsg::COMPARED != 0 {
            progress.say(ROTATED_CAMERA)?;
        }
        view
    };
    let mut teleoperation = Teleoperation {
        period: Nanos((1e9 / hand.rate_hz) as u64),
        interrupt,
        master: Master::new(present_pose(client)?, settings),
        mode: settings.mode,
        view,
        scales: hand.scale.clone(),
        scale: 0,
        progress,
        is_measured,
        announcer: client.announcer(),
        published: (Nanos::ZERO, None),
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
    let outcome = teleoperation.run(client, source.as_mut());
    // Open the clutch first, while the lease is valid: the snake stops now, not at the deadline.
    let command = teleoperation.master.hold();
    let held = teleoperation.send(&command);
    let stopped = teleoperation.is_stopped.then(|| stop(client, domain));
    // A command that arrives later would acquire the lease again.
    clock::sleep(COMMAND_DELAY);
    let released = client.state_command(StateCommand::Release);
    if let Some(stopped) = stopped {
        teleoperation.progress.say(&confirmed(stopped?)?)?;
    }
    outcome?;
    held?;
    released?;
    if let Some(task) = &teleoperation.task {
        teleoperation.progress.say(&task.course.summary())?;
    }
    Ok(())
}

struct Teleoperation<'a> {
    period: Nanos,
    interrupt: &'a Interrupt,
    master: Master,
    mode: Mode,
    view: View,
    scales: Vec<f64>,
    scale: usize,
    progress: Progress,
    is_measured: bool,
    announcer: Announcer<TeleopMsg>,
    /// Time of the last published state, and why the clutch was open then.
    published: (Nanos, Option<Open>),
    /// Arrival of the newest event, and the command that it led to.
    event: (Nanos, u64),
    pulses: Option<Pulses>,
    marked: Nanos,
    commander: Commander,
    setpoint: Latest<JointState>,
    goal: Latest<JointState>,
    clips: ClipMonitor,
    is_stopped: bool,
    task: Option<HandTask>,
}

impl Teleoperation<'_> {
    fn run(&mut self, client: &mut Client, source: &mut dyn Source) -> Result<(), Failure> {
        let mut last = clock::now();
        while !self.interrupt.came() {
            source.wait(last + self.period);
            clock::sleep_until(last + MIN_PERIOD);
            let now = clock::now();
            let request = source.read(now)?;
            if request.quit {
                self.is_stopped = request.stop;
                break;
            }
            let command = self.command(&request, (now - last).as_seconds())?;
            last = now;
            let sequence = self.send(&command)?;
            if let Some(came) = request.hand.newest {
                self.event = (came, sequence);
            }
            self.publish(&request, now)?;
            while let Some(news) = source.news() {
                self.progress.say(&news)?;
            }
            self.goal.refresh()?;
            if let Some(pulses) = &mut self.pulses
                && request.hand.open.is_none()
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
                if let Some(outcome) = task.update(now, request.hand.open.is_none())? {
                    self.progress.say(&outcome)?;
                }
                if task.course.is_finished() {
                    break;
                }
            }
            let (task, scale) = (self.task.as_ref(), self.scales[self.scale]);
            if !self.progress.check(client, || line(&command, &request, scale, task, now))? {
                break;
            }
        }
        Ok(())
    }

    fn command(&mut self, request: &HandRequest, step_s: f64) -> Result<MasterCommand, Failure> {
        self.scale = (self.scale + request.hand.scale_steps as usize) % self.scales.len();
        let snake = self.setpoint.refresh()?.map(two_angles).transpose()?;
        if self.progress.monitor.has_lost_setpoint() {
            // Begins again at the setpoint.
            self.master.hold();
        }
        let (engaged, scale) = (request.hand.open.is_none(), self.scales[self.scale]);
        let [push, steps] = [request.hand.push, request.steps].map(|it| self.view.joints(it));
        Ok(self.master.update(&Motion { engaged, push, steps, scale }, snake, step_s))
    }

    /// Returns the number of the command. Its stamp is the present time, not that of the event: the
    /// controller judges its age by it, and a held stick may have no new event for long.
    fn send(&mut self, command: &MasterCommand) -> Result<u64, Failure> {
        self.commander.set_clutch(command.clutch_open);
        Ok(self.commander.servo_jp(&command.pose.map(f64::to_radians))?)
    }

    fn publish(&mut self, request: &HandRequest, now: Nanos) -> Result<(), Failure> {
        if request.hand.marks > 0 {
            self.marked = request.hand.newest.unwrap_or(now);
        } else if now.duration_since(self.published.0) < PUBLISH_PERIOD
            && self.published.1 == request.hand.open
        {
            return Ok(());
        }
        self.published = (now, request.hand.open);
        let measured = if self.is_measured { TeleopMsg::VIEW_MEASURED } else { 0 };
        let open = request.hand.open.map_or(0, |_| TeleopMsg::OPEN);
        let why_open = request.hand.open.map(|why| why.to_string()).unwrap_or_default();
        self.announcer.publish(TeleopMsg {
            view: self.view.seen(),
            push: request.hand.push,
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
}

fn line(
    command: &MasterCommand,
    request: &HandRequest,
    scale: f64,
    task: Option<&HandTask>,
    now: Nanos,
) -> String {
    // Within 80 columns: a wrapped line cannot be overwritten.
    if let Some(task) = task {
        let clutch = if command.clutch_open { "HOLDS" } else { "FOLLOWS" };
        return format!("{clutch}; {}", task.course.line(now));
    }
    let [pitch, yaw] = command.pose;
    match request.hand.open {
        Some(why) => format!("HOLDS: {why}"),
        None => format!(
            "FOLLOWS at {:.0} %; pitch, yaw commanded {pitch:+.2} {yaw:+.2} deg",
            100.0 * scale
        ),
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct HandRequest {
    pub hand: Hand,
    /// Key presses since the last call, right and up in the image.
    pub steps: [f64; 2],
    pub quit: bool,
    /// Stop the robot, whichever client commands it, and quit.
    pub stop: bool,
}

pub(super) trait Source {
    /// The present request. Never waits.
    fn read(&mut self, now: Nanos) -> Result<HandRequest, SourceLost>;
    /// Waits until there is a new event, or until `until`.
    fn wait(&mut self, until: Nanos) {
        clock::sleep_until(until);
    }
    fn pulse(&mut self) {}
    fn news(&mut self) -> Option<String> {
        None
    }
    /// Usage, in one line.
    fn help(&self) -> String;
}

#[derive(Debug, thiserror::Error)]
#[error("the terminal is gone ({0}); the snake holds")]
pub struct SourceLost(pub Errno);
