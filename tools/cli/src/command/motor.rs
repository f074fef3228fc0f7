//! `i2ris command motor`: one motor goes a few counts there and back, before there is a camera or a
//! model.

use std::io::{self, BufRead, IsTerminal};

use i2ris::clock;
use i2ris::ipc::client::{Client, Latest};
use i2ris::ipc::payload::{ActuatorState, Version};
use i2ris::ipc::{Domain, StateCommand};
use i2ris::realtime::Ticker;
use i2ris::units::{MAX_MOTORS, Nanos};
use i2ris_report::{DomainOption, Failure, Interrupt, Screen, until_closed};

use super::prepare::{self, FIRST_MESSAGE_TIMEOUT, HOMING, PrepareOptions, prepare};
use super::stream_monitor::{StopReason, StreamMonitor};

/// Most counts: enough to see a motor turn, too few to bend a snake far.
const MOST: i32 = 100;

/// Slow enough to be followed by eye, and to be stopped by hand.
const SPEED_COUNTS_S: f64 = 50.0;

/// Between two commands: well below the deadline of a controller.
const PERIOD: Nanos = Nanos::from_millis(5);

/// Rest at each place before it is read.
const REST: Nanos = Nanos::from_millis(500);

/// How long the controller may take to read the last command: many ticks.
const LAST_COMMAND: Nanos = Nanos::from_millis(50);

/// A motor that is further off at its place has not followed, counts. An encoder may toggle.
const MOST_OFF: i32 = 3;

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  i2ris command motor 0 20                       half way, there, half way, back
  i2ris command motor 1 -20 --home               in a script: permission to home, enable and move

It needs no camera and no model. A robot whose zero is not known is homed: the present pose becomes
the zero. The motor ends where it began, and the robot stays enabled. Ctrl-C stops, and it holds.")]
pub struct Arguments {
    /// Which motor
    motor: usize,
    /// How far it goes; below 0: the other way
    #[arg(allow_negative_numbers = true, value_parser = few)]
    counts: i32,
    #[command(flatten)]
    prepare: PrepareOptions,
    #[command(flatten)]
    domain: DomainOption,
}

fn few(text: &str) -> Result<i32, String> {
    match text.parse::<i32>() {
        Ok(0) => Err("0 counts are no motion".to_owned()),
        Ok(counts) if counts.abs() <= MOST => Ok(counts),
        Ok(_) => Err(format!(
            "at most {MOST} counts, there to see that a motor turns; `i2ris calibrate collect` goes \
             further"
        )),
        Err(error) => Err(error.to_string()),
    }
}

pub fn run(arguments: &Arguments, domain: &Domain) -> Result<(), Failure> {
    let Arguments { motor, counts, .. } = *arguments;
    let (mut client, interrupt) = (prepare::connect(domain)?, Interrupt::catch()?);
    let mut motors = Latest::new(client.watcher().actuators());
    let version = client.version()?;
    let count = usize::from(version.shape[0]).min(MAX_MOTORS);
    if motor >= count {
        return Err(format!("motor {motor}: this robot has {count}, counted from 0").into());
    }
    let state = prepare(&mut client, permission(arguments)?, &interrupt)?;
    let monitor = StreamMonitor::new(client.id(), &state, clock::now());
    let from = present(&mut motors)?;
    check_range(&version, &from, motor, counts)?;
    let mut bench = Bench { monitor, from, motors, motor, interrupt };
    let outcome = bench.there_and_back(&mut client, counts);
    // A command in transit would take the lease again.
    clock::sleep(LAST_COMMAND);
    let is_stopped = matches!(outcome, Ok(false));
    let end = if is_stopped { StateCommand::Hold } else { StateCommand::Release };
    let ended = client.state_command(end);
    outcome?;
    ended?;
    if is_stopped {
        Err("interrupted; the motor stopped on its way and holds".into())
    } else {
        Ok(())
    }
}

impl Arguments {
    pub fn domain(&self) -> Result<Domain, Failure> {
        Ok(self.domain.domain()?)
    }
}

/// Where the motors are now.
fn present(motors: &mut Latest<ActuatorState>) -> Result<ActuatorState, Failure> {
    let start = clock::now();
    loop {
        if let Some(state) = motors.refresh()?
            && Nanos(state.stamp_ns) > start
        {
            return Ok(*state);
        }
        if clock::now().duration_since(start) > FIRST_MESSAGE_TIMEOUT {
            return Err(StopReason::Silent.into());
        }
        clock::sleep(PERIOD);
    }
}

fn check_range(
    version: &Version,
    from: &ActuatorState,
    motor: usize,
    counts: i32,
) -> Result<(), Failure> {
    let to = from.setpoint_counts[motor].saturating_add(counts);
    let (min, max) = (version.position_min_counts[motor], version.position_max_counts[motor]);
    if to < min || to > max {
        return Err(format!(
            "motor {motor} would go to {to} counts, and its limits are {min} to {max}; ask for less, \
             or for the other way"
        )
        .into());
    }
    Ok(())
}

/// Asks a person. A script has said it with `--enable` or `--home`.
fn permission(arguments: &Arguments) -> Result<PrepareOptions, Failure> {
    if arguments.prepare.is_given() {
        return Ok(arguments.prepare);
    }
    let Arguments { motor, counts, .. } = arguments;
    let terminal = io::stdin();
    if !terminal.is_terminal() {
        return Err("the motor moves: say --enable, or --home if its zero is not known, where \
                    nobody can be asked"
            .into());
    }
    say(&format!(
        "motor {motor} goes {counts} counts and back. Its power is switched on; if its zero is not \
         known, {HOMING}. Snake out of the eye, wires slack, one hand on the switch of the motor \
         supply? Type yes."
    ))?;
    let mut typed = String::new();
    terminal.lock().read_line(&mut typed)?;
    match typed.trim() {
        "yes" => Ok(PrepareOptions::ALL),
        _ => Err("not yes: nothing has moved".into()),
    }
}

fn say(line: &str) -> Result<(), Failure> {
    until_closed(Screen::stdout().say(line))?;
    Ok(())
}

struct Bench {
    monitor: StreamMonitor,
    from: ActuatorState,
    motors: Latest<ActuatorState>,
    motor: usize,
    interrupt: Interrupt,
}

impl Bench {
    /// Half way, there, half way, back, with a row for each. `false`: interrupted.
    fn there_and_back(&mut self, client: &mut Client, counts: i32) -> Result<bool, Failure> {
        let (motor, origin) = (self.motor, self.from.setpoint_counts);
        say("asked  measured  largest current")?;
        let mut at = 0.0;
        let mut missed = None;
        for asked in [counts / 2, counts, counts / 2, 0] {
            let mut current_ma = 0;
            let Some(measured) = self.go(client, &mut at, asked, &mut current_ma)? else {
                return Ok(false);
            };
            let measured = measured - origin[motor];
            say(&format!("{asked:5}  {measured:8}  {current_ma:12} mA"))?;
            if (measured - asked).abs() > MOST_OFF {
                missed = missed.or(Some((asked, measured)));
            }
        }
        match missed {
            None => Ok(true),
            Some((asked, measured)) => Err(format!(
                "motor {motor} was at {measured} counts where {asked} were asked; it is blocked, wired \
                 or counted wrongly, or its current is too low: look at it before anything moves again"
            )
            .into()),
        }
    }

    /// Glides to a place and rests there. Where the motor is then; `None`: interrupted.
    fn go(
        &mut self,
        client: &mut Client,
        at: &mut f64,
        asked: i32,
        current_ma: &mut i32,
    ) -> Result<Option<i32>, Failure> {
        let (motors, asked) = (self.from.count as usize, f64::from(asked));
        let mut commander = client.commander();
        let mut ticker = Ticker::new(clock::now() + PERIOD, PERIOD, Nanos::ZERO);
        let mut rest = Nanos::ZERO;
        let step = SPEED_COUNTS_S * PERIOD.as_seconds();
        loop {
            ticker.wait();
            if self.interrupt.came() {
                return Ok(None);
            }
            *at += (asked - *at).clamp(-step, step);
            let mut goal = self.from.setpoint_counts;
            goal[self.motor] += at.round() as i32;
            commander.servo_actuators(goal.get(..motors).unwrap_or(&goal))?;
            if let Some(state) = client.operating_state()? {
                self.monitor.check(&state, clock::now())?;
            }
            if let Some(state) = self.motors.refresh()? {
                let now_ma = state.current_ma[self.motor];
                if now_ma.abs() > current_ma.abs() {
                    *current_ma = now_ma;
                }
            }
            if *at == asked {
                rest = rest + PERIOD;
            }
            if rest >= REST {
                let state = self.motors.value().ok_or(StopReason::Silent)?;
                return Ok(Some(state.measured_counts[self.motor]));
            }
        }
    }
}
