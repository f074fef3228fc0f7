//! Teleoperation with keyboard or gamepad: dead-man switch, clutch and motion scaling.
//!
//! Both devices move a virtual master. While the dead-man switch is released the clutch is open:
//! the snake holds, and the master stays at the pose of the snake. While it is held, the device
//! moves the master, and the snake follows. A device that is unplugged opens the clutch at once and
//! ends the program.

mod gamepad;
mod input_device;
mod keyboard;
mod virtual_master;

use std::path::PathBuf;

use i2ris::clock;
use i2ris::ipc::StateCommand;
use i2ris::ipc::client::{Client, Commander, Latest};
use i2ris::ipc::payload::JointState;
use i2ris::realtime::Ticker;
use i2ris::units::Nanos;

use super::prepare::{PrepareOptions, prepare};
use super::progress::Progress;
use super::reach::{ReachOptions, ReachTask};
use super::stream::{present_pose, two_angles};
use super::stream_monitor::StreamMonitor;
use super::tracking::ClipMonitor;
use gamepad::Gamepad;
use i2ris_report::Failure;
use i2ris_report::Interrupt;
use input_device::InputDevice;
use keyboard::Keyboard;
use virtual_master::{MasterCommand, VirtualMaster};

/// Longest delay of a command to the control loop: some ticks.
const COMMAND_DELAY: Nanos = Nanos::from_millis(20);

#[derive(Debug, Clone)]
pub enum DeviceOption {
    Keyboard,
    /// A device of the joystick interface of the kernel.
    Gamepad {
        /// `/dev/input/js0`, say.
        path: PathBuf,
        /// The number of the button that must be held.
        dead_man: u8,
    },
}

#[derive(Debug, Clone)]
pub struct Plan {
    pub device: DeviceOption,
    /// Speed at full deflection, and of steps by keys, deg/s.
    pub speed_deg_s: f64,
    /// Step of one key press, deg.
    pub step_deg: f64,
    /// Motion scaling, above 0, at most 1.
    pub scale: f64,
    pub rate_hz: f64,
    pub prepare: PrepareOptions,
    pub task: Option<ReachOptions>,
}

/// Commands the snake until the operator or the system ends it, or the controller cannot follow any
/// more. Then the snake holds and the lease is free.
pub fn run(client: &mut Client, plan: &Plan, interrupt: &Interrupt) -> Result<(), Failure> {
    let mut source: Box<dyn InputDevice> = match &plan.device {
        DeviceOption::Keyboard => Box::new(Keyboard::open()?),
        DeviceOption::Gamepad { path, dead_man } => Box::new(Gamepad::open(path, *dead_man)?),
    };
    let state = prepare(client, plan.prepare, interrupt)?;
    let monitor = StreamMonitor::new(client.id(), &state, clock::now());
    let pose = present_pose(client)?;
    let mut teleoperation = Teleoperation {
        master: VirtualMaster::new(pose, plan.speed_deg_s * plan.scale, plan.step_deg * plan.scale),
        progress: Progress::new(monitor),
        commander: client.commander(),
        setpoint: Latest::new(client.watcher().setpoint_js()),
        goal: Latest::new(client.watcher().goal_js()),
        clips: ClipMonitor::new(clock::now()),
        task: { plan.task.as_ref() }.map(|options| ReachTask::new(options, client)),
    };
    teleoperation.progress.say(source.help())?;
    let period = Nanos((1e9 / plan.rate_hz) as u64);
    let outcome = teleoperation.run(client, source.as_mut(), period, interrupt);
    // The clutch first: the lease is valid until it is released.
    let held = teleoperation.hold();
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
    master: VirtualMaster,
    progress: Progress,
    commander: Commander,
    setpoint: Latest<JointState>,
    goal: Latest<JointState>,
    clips: ClipMonitor,
    task: Option<ReachTask>,
}

impl Teleoperation {
    fn run(
        &mut self,
        client: &mut Client,
        source: &mut dyn InputDevice,
        period: Nanos,
        interrupt: &Interrupt,
    ) -> Result<(), Failure> {
        let mut last = clock::now();
        let mut ticker = Ticker::new(last + period, period, Nanos::ZERO);
        while !interrupt.came() {
            let now = ticker.wait().started;
            let input = source.read(now)?;
            if input.quit {
                break;
            }
            let snake = self.setpoint.refresh()?.map(two_angles).transpose()?;
            let command = self.master.update(&input, snake, (now - last).as_seconds());
            last = now;
            self.send(&command)?;
            if let Some(goal) = self.goal.refresh()?
                && let Some(clipped) = self.clips.check(command.pose, goal, now)
            {
                self.progress.say(&clipped)?;
            }
            if let Some(task) = &mut self.task {
                if let Some(outcome) = task.update(now, input.engaged)? {
                    self.progress.say(&outcome)?;
                }
                if task.is_finished() {
                    break;
                }
            }
            let task = self.task.as_ref();
            if !self.progress.check(client, || line(&command, task, now))? {
                break;
            }
        }
        Ok(())
    }

    fn send(&mut self, command: &MasterCommand) -> Result<(), Failure> {
        self.commander.set_clutch(command.clutch_open);
        self.commander.servo_jp(&command.pose.map(f64::to_radians))?;
        Ok(())
    }

    /// Opens the clutch: the snake stops now and not at the deadline.
    fn hold(&mut self) -> Result<(), Failure> {
        let command = self.master.hold();
        self.send(&command)
    }
}

fn line(command: &MasterCommand, task: Option<&ReachTask>, now: Nanos) -> String {
    if let Some(task) = task {
        let clutch = if command.clutch_open { "HOLDS" } else { "FOLLOWS" };
        return format!("{clutch}; {}", task.line(now));
    }
    let clutch = if command.clutch_open { "HOLDS (dead-man switch released)" } else { "FOLLOWS" };
    let [pitch, yaw] = command.pose;
    format!("the snake {clutch}; pitch, yaw commanded {pitch:+.2} {yaw:+.2} deg")
}
