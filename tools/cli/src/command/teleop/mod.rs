//! Leading the snake by hand: keyboard or gamepad, with a dead-man and motion scaling.
//!
//! Both devices lead a virtual master. While the dead-man is not held the clutch is open: the snake
//! holds, and the master stays where the snake is. When it is held, the master moves by what the
//! device asks, and the snake goes along. A device that is unplugged opens the clutch at once and
//! ends the program.

mod gamepad;
mod keyboard;
mod master;

use std::path::PathBuf;

use i2ris::clock;
use i2ris::ipc::StateCommand;
use i2ris::ipc::client::{Client, Commander, Latest};
use i2ris::ipc::payload::JointState;
use i2ris::rt::Ticker;
use i2ris::units::Nanos;

use super::prepare::prepare;
use super::stream::{present_pose, two_angles};
use super::watch::Watch;
use gamepad::Gamepad;
use i2ris_terminal::Failure;
use i2ris_terminal::{Interrupt, Screen, until_closed};
use keyboard::Keyboard;
use master::{Input, Master, Order};

/// How often the screen shows something new, and a file.
const SHOW_PERIOD: Nanos = Nanos::from_millis(100);
const LOG_PERIOD: Nanos = Nanos::from_millis(1000);

/// How long a command may be on its way to the control loop: some ticks.
const ON_ITS_WAY: Nanos = Nanos::from_millis(20);

/// What leads.
#[derive(Debug, Clone)]
pub enum Device {
    /// The keys of this terminal.
    Keyboard,
    /// A device of the joystick interface of the kernel.
    Gamepad {
        /// `/dev/input/js0`, say.
        path: PathBuf,
        /// The number of the button that has to be held.
        dead_man: u8,
    },
}

/// How to lead.
#[derive(Debug, Clone)]
pub struct Plan {
    /// What leads.
    pub device: Device,
    /// Speed at full deflection, and of the way to where keys point, deg/s.
    pub speed_deg_s: f64,
    /// How far one key press goes, deg.
    pub step_deg: f64,
    /// What of all that reaches the snake, above 0, at most 1.
    pub scale: f64,
    /// Commands per second.
    pub rate_hz: f64,
    /// Home and enable first, where necessary.
    pub enable: bool,
}

/// A device that leads.
trait Source {
    /// What it asks now. Never waits.
    fn read(&mut self, now: Nanos) -> Result<Input, Gone>;
    /// What people have to know of it.
    fn help(&self) -> &'static str;
}

/// The device is gone.
#[derive(Debug, thiserror::Error)]
#[error("{what}; the snake holds")]
pub struct Gone {
    what: String,
}

/// Leads until the person, or the system, ends it, or it makes no sense any more; then the snake
/// holds and the lease is free.
pub fn run(client: &mut Client, plan: &Plan, interrupt: &Interrupt) -> Result<(), Failure> {
    let mut source: Box<dyn Source> = match &plan.device {
        Device::Keyboard => Box::new(Keyboard::open()?),
        Device::Gamepad { path, dead_man } => Box::new(Gamepad::open(path, *dead_man)?),
    };
    let state = prepare(client, plan.enable, interrupt)?;
    let watch = Watch::new(client.id(), &state, clock::now());
    let pose = present_pose(client)?;
    let mut lead = Lead {
        master: Master::new(
            pose,
            plan.speed_deg_s * plan.scale,
            plan.step_deg * plan.scale,
        ),
        watch,
        commander: client.commander(),
        setpoint: Latest::new(client.watcher().setpoint_js()),
        next_show: Nanos::ZERO,
    };
    let mut screen = Screen::stdout();
    until_closed(screen.say(source.help()))?;
    let period = Nanos((1e9 / plan.rate_hz) as u64);
    let outcome = lead.go(client, source.as_mut(), period, interrupt, &mut screen);
    // The clutch first: the lease runs on until it is given back.
    let held = lead.hold();
    // A command that is still on its way would take the lease again.
    clock::sleep(ON_ITS_WAY);
    let released = client.state_command(StateCommand::Release);
    outcome?;
    held?;
    released?;
    Ok(())
}

struct Lead {
    master: Master,
    watch: Watch,
    commander: Commander,
    setpoint: Latest<JointState>,
    next_show: Nanos,
}

impl Lead {
    fn go(
        &mut self,
        client: &mut Client,
        source: &mut dyn Source,
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
            let order = self.master.lead(&input, snake, (now - last).as_seconds());
            last = now;
            self.send(&order)?;
            if !self.follow(client, &order, now, screen)? {
                break;
            }
        }
        Ok(())
    }

    fn send(&mut self, order: &Order) -> Result<(), Failure> {
        self.commander.set_clutch(order.clutch_open);
        self.commander.servo_jp(&order.pose.map(f64::to_radians))?;
        Ok(())
    }

    /// Opens the clutch: the snake stops now, not at the deadline.
    fn hold(&mut self) -> Result<(), Failure> {
        let order = self.master.hold();
        self.send(&order)
    }

    /// Looks at what the controller makes of it. The answer is whether anyone still reads what is
    /// shown.
    fn follow(
        &mut self,
        client: &mut Client,
        order: &Order,
        now: Nanos,
        screen: &mut Screen,
    ) -> Result<bool, Failure> {
        let state = client.operating_state()?;
        let refusal = state
            .map(|state| self.watch.judge(&state, clock::now()))
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
        let clutch = if order.clutch_open {
            "HOLDS (dead-man not held)"
        } else {
            "FOLLOWS"
        };
        let [pitch, yaw] = order.pose;
        Ok(until_closed(screen.draw(&[format!(
            "the snake {clutch}; pitch, yaw asked {pitch:+.2} {yaw:+.2} deg"
        )]))?)
    }
}
