//! `i2ris command motor`: moves one motor a few counts and back, without camera or model.

use i2ris::ipc::client::{Client, Latest};
use i2ris::ipc::{StateCommand, payload::ActuatorState};
use i2ris::{clock, realtime::Ticker, units::Nanos};
use i2ris_report::{DomainOption, Failure, Interrupt, bail};

use super::prepare::{FIRST_MESSAGE_TIMEOUT, HOMING, PrepareOptions, prepare};
use super::stream_monitor::{StopReason, StreamMonitor};
use crate::procedure::{Person, Terminal, say};

/// Largest distance, counts: enough to see a motor turn, too little to bend a snake far.
const MAX_COUNTS: i32 = 100;
/// Slow enough to watch, and to stop by hand.
const SPEED_COUNTS_S: f64 = 50.0;
/// Command period: well below the deadline of a controller.
const PERIOD: Nanos = Nanos::from_millis(5);
/// Commands at each target before reading the position: half a second.
const RESTS: usize = 100;
/// Time for the controller to read the last command: many ticks.
const LAST_COMMAND: Nanos = Nanos::from_millis(50);
/// Position error above which a motor has not followed, counts. An encoder may toggle.
const MAX_POSITION_ERROR: i32 = 3;

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  i2ris command motor 0 20                       half way, full, half way, back
  i2ris command motor 1 -20 --home               in a script: permit homing, enabling and motion

Needs no camera and no model. A robot with unknown zero is homed: the present pose becomes the zero.
The motor returns to where it started, and the robot stays enabled. On Ctrl-C it stops and holds.")]
pub struct Arguments {
    /// Motor, counted from 0
    motor: usize,
    /// Distance, 1 to 100; negative: the other direction
    #[arg(allow_negative_numbers = true, value_parser = few)]
    counts: i32,
    #[command(flatten)]
    prepare: PrepareOptions,
    #[command(flatten)]
    pub domain: DomainOption,
}

fn few(text: &str) -> Result<i32, String> {
    let counts: i32 = text.parse().map_err(|error| format!("{error}"))?;
    if (1..=MAX_COUNTS.unsigned_abs()).contains(&counts.unsigned_abs()) {
        return Ok(counts);
    }
    Err(format!("1 to {MAX_COUNTS} counts, either way; `i2ris calibrate collect` moves further"))
}

pub fn run(arguments: &Arguments, client: &mut Client) -> Result<(), Failure> {
    let interrupt = Interrupt::catch()?;
    let motors = client.version()?.shape[0];
    if arguments.motor >= usize::from(motors) {
        bail!("motor {}: there are {motors}, from 0", arguments.motor);
    }
    prepare(client, permission(arguments, &interrupt)?, &interrupt)?;
    let outcome = there_and_back(arguments, client, &interrupt);
    // A command in transit would acquire the lease again.
    clock::sleep(LAST_COMMAND);
    let stopped = interrupt.came();
    client.state_command(if stopped { StateCommand::Hold } else { StateCommand::Release })?;
    outcome
}

/// Asks the operator. A script gives permission by `--enable` or `--home`.
fn permission(arguments: &Arguments, interrupt: &Interrupt) -> Result<PrepareOptions, Failure> {
    let Arguments { motor, counts, prepare, .. } = arguments;
    if prepare.is_given() {
        return Ok(*prepare);
    }
    let why = "the motor moves, and there is no operator to ask here: add --enable, or --home if \
               its zero is unknown";
    let mut person = Terminal::open(interrupt).ok_or(why)?;
    let typed = person.answer(&format!(
        "motor {motor} will move {counts} counts and back. Its drive will be powered; if its zero \
         is unknown, {HOMING}. Is the snake out of the eye, are the wires slack, and is one hand \
         on the switch of the motor supply? Type yes."
    ));
    match typed.as_deref() {
        Ok("yes") => Ok(PrepareOptions::ALL),
        _ => Err("not confirmed: nothing has moved".into()),
    }
}

fn newest(motors: &mut Latest<ActuatorState>, after: Nanos) -> Result<ActuatorState, Failure> {
    while clock::now().duration_since(after) < FIRST_MESSAGE_TIMEOUT {
        match motors.refresh()? {
            Some(state) if Nanos(state.stamp_ns) > after => return Ok(*state),
            _ => clock::sleep(PERIOD),
        }
    }
    Err(StopReason::Silent.into())
}

/// Half way, full, half way, back: glides to each target, rests there, and prints a row.
fn there_and_back(
    arguments: &Arguments,
    client: &mut Client,
    interrupt: &Interrupt,
) -> Result<(), Failure> {
    let Arguments { motor, counts, .. } = *arguments;
    let mut motors = Latest::new(client.watcher().actuators());
    let from = newest(&mut motors, clock::now())?;
    let state = client.wait_for(FIRST_MESSAGE_TIMEOUT, |_| true)?;
    let mut monitor = StreamMonitor::new(client.id(), &state, clock::now());
    let mut commander = client.commander();
    let mut ticker = Ticker::new(clock::now() + PERIOD, PERIOD, Nanos::ZERO);
    let step = SPEED_COUNTS_S * PERIOD.as_seconds();
    let (mut at, mut missed) = (0.0, Ok(()));
    say("target  measured  largest current")?;
    for target in [counts / 2, counts, counts / 2, 0] {
        let (mut rests, mut current_ma) = (0, 0i32);
        let (mut place, mut measured) = (from.setpoint_counts, 0);
        while rests < RESTS {
            ticker.wait();
            if interrupt.came() {
                bail!("interrupted; the motor stopped on its way and holds");
            }
            let left = f64::from(target) - at;
            at += left.clamp(-step, step);
            rests += usize::from(left == 0.0);
            place[motor] = from.setpoint_counts[motor] + at.round() as i32;
            commander.servo_actuators(place.get(..from.count as usize).unwrap_or(&place))?;
            if let Some(state) = client.operating_state()? {
                monitor.check(&state, clock::now())?;
            }
            if let Some(load) = monitor.load.take() {
                say(&load)?;
            }
            if let Some(state) = motors.refresh()? {
                current_ma = current_ma.max(state.current_ma[motor].abs());
                measured = state.measured_counts[motor] - from.setpoint_counts[motor];
            }
        }
        say(&format!("{target:6}  {measured:8}  {current_ma:12} mA"))?;
        if (measured - target).abs() > MAX_POSITION_ERROR && missed.is_ok() {
            missed = Err(format!(
                "motor {motor} was at {measured} counts instead of {target}: it is blocked, its \
                 wiring or encoder is wrong, or its current is too low"
            ));
        }
    }
    Ok(missed?)
}
