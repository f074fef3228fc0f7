//! Teleoperation with keyboard or gamepad: dead-man switch, clutch and motion scaling.
//!
//! Both devices move a virtual master. While the dead-man switch is released the clutch is open:
//! the snake holds, and the master stays at the pose of the snake. While it is held, the device
//! moves the master, and the snake follows. A device that is unplugged opens the clutch at once and
//! ends the program.

mod gamepad;
mod keyboard;
mod virtual_master;

use std::path::PathBuf;

use i2ris::clock;
use i2ris::ipc::StateCommand;
use i2ris::ipc::client::{Client, Commander, Latest};
use i2ris::ipc::payload::JointState;
use i2ris::rt::Ticker;
use i2ris::units::Nanos;

use super::prepare::prepare;
use super::stream::{present_pose, two_angles};
use super::stream_monitor::StreamMonitor;
use gamepad::Gamepad;
use i2ris_terminal::Failure;
use i2ris_terminal::{Interrupt, Screen, until_closed};
use keyboard::Keyboard;
use virtual_master::{DeviceInput, MasterCommand, VirtualMaster};

/// Time between two lines on a terminal, and in a file.
const SHOW_PERIOD: Nanos = Nanos::from_millis(100);
const LOG_PERIOD: Nanos = Nanos::from_millis(1000);

/// Longest delay of a command to the control loop: some ticks.
const COMMAND_DELAY: Nanos = Nanos::from_millis(20);

/// The input device.
#[derive(Debug, Clone)]
pub enum DeviceOption {
    /// The keys of this terminal.
    Keyboard,
    /// A device of the joystick interface of the kernel.
    Gamepad {
        /// `/dev/input/js0`, say.
        path: PathBuf,
        /// The number of the button that must be held.
        dead_man: u8,
    },
}

/// The options of teleoperation.
#[derive(Debug, Clone)]
pub struct Plan {
    /// The input device.
    pub device: DeviceOption,
    /// Speed at full deflection, and of steps by keys, deg/s.
    pub speed_deg_s: f64,
    /// Step of one key press, deg.
    pub step_deg: f64,
    /// Motion scaling, above 0, at most 1.
    pub scale: f64,
    /// Commands per second.
    pub rate_hz: f64,
    /// Home and enable first, where necessary.
    pub enable: bool,
}

/// An input device.
trait InputDevice {
    /// Its present state. Never waits.
    fn read(&mut self, now: Nanos) -> Result<DeviceInput, DeviceLost>;
    /// How to use it, in one line.
    fn help(&self) -> &'static str;
}

/// The device is lost.
#[derive(Debug, thiserror::Error)]
#[error("{what}; the snake holds")]
pub struct DeviceLost {
    what: String,
}

/// Commands the snake until the operator or the system ends it, or the controller cannot follow any
/// more. Then the snake holds and the lease is free.
pub fn run(client: &mut Client, plan: &Plan, interrupt: &Interrupt) -> Result<(), Failure> {
    let mut source: Box<dyn InputDevice> = match &plan.device {
        DeviceOption::Keyboard => Box::new(Keyboard::open()?),
        DeviceOption::Gamepad { path, dead_man } => Box::new(Gamepad::open(path, *dead_man)?),
    };
    let state = prepare(client, plan.enable, interrupt)?;
    let monitor = StreamMonitor::new(client.id(), &state, clock::now());
    let pose = present_pose(client)?;
    let mut teleoperation = Teleoperation {
        master: VirtualMaster::new(
            pose,
            plan.speed_deg_s * plan.scale,
            plan.step_deg * plan.scale,
        ),
        monitor,
        commander: client.commander(),
        setpoint: Latest::new(client.watcher().setpoint_js()),
        next_show: Nanos::ZERO,
    };
    let mut screen = Screen::stdout();
    until_closed(screen.say(source.help()))?;
    let period = Nanos((1e9 / plan.rate_hz) as u64);
    let outcome = teleoperation.run(client, source.as_mut(), period, interrupt, &mut screen);
    // The clutch first: the lease is valid until it is released.
    let held = teleoperation.hold();
    // A command that arrives later would take the lease again.
    clock::sleep(COMMAND_DELAY);
    let released = client.state_command(StateCommand::Release);
    outcome?;
    held?;
    released?;
    Ok(())
}

struct Teleoperation {
    master: VirtualMaster,
    monitor: StreamMonitor,
    commander: Commander,
    setpoint: Latest<JointState>,
    next_show: Nanos,
}

impl Teleoperation {
    fn run(
        &mut self,
        client: &mut Client,
        source: &mut dyn InputDevice,
        period: Nanos,
        interrupt: &Interrupt,
        screen: &mut Screen,
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
            if !self.check_response(client, &command, now, screen)? {
                break;
            }
        }
        Ok(())
    }

    fn send(&mut self, command: &MasterCommand) -> Result<(), Failure> {
        self.commander.set_clutch(command.clutch_open);
        self.commander
            .servo_jp(&command.pose.map(f64::to_radians))?;
        Ok(())
    }

    /// Opens the clutch: the snake stops now and not at the deadline.
    fn hold(&mut self) -> Result<(), Failure> {
        let command = self.master.hold();
        self.send(&command)
    }

    /// Checks the response of the controller. Returns whether standard output still has a reader.
    fn check_response(
        &mut self,
        client: &mut Client,
        command: &MasterCommand,
        now: Nanos,
        screen: &mut Screen,
    ) -> Result<bool, Failure> {
        let state = client.operating_state()?;
        let refusal = state
            .map(|state| self.monitor.check(&state, clock::now()))
            .transpose()?
            .flatten();
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
        let clutch = if command.clutch_open {
            "HOLDS (dead-man switch released)"
        } else {
            "FOLLOWS"
        };
        let [pitch, yaw] = command.pose;
        Ok(until_closed(screen.draw(&[format!(
            "the snake {clutch}; pitch, yaw commanded {pitch:+.2} {yaw:+.2} deg"
        )]))?)
    }
}
