//! `i2ris command`: moves the robot and changes its state.

mod fixture;
mod held_up;
mod motor;
pub mod prepare;
pub mod stream;
pub mod stream_monitor;
pub mod tracking;
pub mod trajectory;

use std::io::{self, IsTerminal as _};
use std::path::PathBuf;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use i2ris::ipc::ready::Ready;
use i2ris::ipc::{Domain, MaskedClientId, OperatingState, StateCommand, find_client_process};
use i2ris_report::exit::{Coded, OUT_OF_REACH};
use i2ris_report::{DomainOption, Failure, Interrupt};
use serde_json::json;

use crate::numbers::{finite, pair, positive, rate};
use crate::procedure::say;
use prepare::{FIRST_MESSAGE_TIMEOUT, PrepareOptions, carry_out};
use stream::{OnLate, Plan};
use stream_monitor::StopReason;
use tracking::OutOfReach;
use trajectory::Trajectory;

#[derive(Debug, clap::Args)]
#[command(
    arg_required_else_help = true,
    after_help = "Examples:
  i2ris command pose 5 -3 --enable               a script ends there, or with --hold by Ctrl-C
  i2ris command pose                             hold the present pose
  i2ris command circle --radius-deg 5 --period-s 6 --duration-s 30 --enable
  i2ris command motor 0 20                       first motion of a motor
  i2ris command state condition --no-wait
  i2ris command file desired.csv
  i2ris command fixture circle 10 5 3            forbid a circle of 3 deg around 10, 5

Ctrl-C decelerates smoothly, releases the lease and exits; the snake holds."
)]
pub struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, clap::Args)]
struct StreamOptions {
    /// Commands per second; below the rate set by the controller's deadline, the robot stops in
    /// between
    #[arg(long, default_value_t = 200.0, value_name = "HZ", value_parser = rate)]
    rate_hz: f64,
    /// Speed limit of the approach to the start of the trajectory
    #[arg(long, default_value_t = 10.0, value_name = "DEG_PER_S", value_parser = positive)]
    speed_deg_s: f64,
    /// Reaction when the controller has stopped the snake because commands came late
    #[arg(long, value_enum, default_value_t = OnLate::Continue)]
    on_late: OnLate,
    #[command(flatten)]
    prepare: PrepareOptions,
    #[command(flatten)]
    domain: DomainOption,
}

#[derive(Debug, clap::Subcommand)]
enum What {
    /// Move to a pose and hold it; without angles, hold the present pose
    Pose {
        /// Pitch
        #[arg(value_parser = finite, allow_negative_numbers = true, requires = "yaw_deg")]
        pitch_deg: Option<f64>,
        /// Yaw
        #[arg(value_parser = finite, allow_negative_numbers = true)]
        yaw_deg: Option<f64>,
        /// Stop this many seconds after arriving
        #[arg(long, value_name = "S", value_parser = positive)]
        duration_s: Option<f64>,
        /// Hold the pose until Ctrl-C, also in a script, which otherwise ends on arrival
        #[arg(long, conflicts_with = "duration_s")]
        hold: bool,
        #[command(flatten)]
        stream: StreamOptions,
    },
    /// Follow a sine
    Sine {
        /// Largest distance from the centre
        #[arg(long, num_args = 2, required = true, value_names = ["PITCH_DEG", "YAW_DEG"],
              value_parser = finite, allow_negative_numbers = true)]
        amplitude_deg: Vec<f64>,
        #[command(flatten)]
        periodic: Periodic,
    },
    /// Follow a circle
    Circle {
        /// Distance from the centre
        #[arg(long, value_name = "DEG", value_parser = positive)]
        radius_deg: f64,
        #[command(flatten)]
        periodic: Periodic,
    },
    /// Follow a CSV trajectory (t_s, pitch_deg, yaw_deg), interpolated linearly
    File {
        /// The file
        csv: PathBuf,
        #[command(flatten)]
        stream: StreamOptions,
    },
    /// Move one motor a few counts and back, without camera or model
    Motor(motor::Arguments),
    /// Manage virtual fixtures
    Fixture(fixture::Arguments),
    /// Send a state command (top level: stop, home, enable, disable)
    State {
        /// State command
        #[arg(value_parser = state_words())]
        command: StateCommand,
        #[command(flatten)]
        options: StateArguments,
    },
}

#[derive(Debug, clap::Args)]
struct Periodic {
    /// The centre
    #[arg(long, num_args = 2, value_names = ["PITCH_DEG", "YAW_DEG"], default_values_t = [0.0, 0.0],
          value_parser = finite, allow_negative_numbers = true)]
    centre_deg: Vec<f64>,
    /// Period of one round
    #[arg(long, value_name = "S", value_parser = positive)]
    period_s: f64,
    /// Stop after this trajectory time instead of on Ctrl-C
    #[arg(long, value_name = "S", value_parser = positive)]
    duration_s: Option<f64>,
    #[command(flatten)]
    stream: StreamOptions,
}

const STATE_WORDS: [(StateCommand, &str); 6] = [
    (StateCommand::Pause, "Decelerate and hold; servo commands are refused"),
    (StateCommand::Resume, "Accept servo commands again"),
    (StateCommand::Unhome, "Invalidate the zero"),
    (StateCommand::Condition, "Set the hysteresis memory by a decaying oscillation"),
    (StateCommand::Acknowledge, "Acknowledge a fault"),
    (StateCommand::Hold, "Stop and hold until the next command"),
];

fn state_words() -> impl TypedValueParser<Value = StateCommand> {
    let words = STATE_WORDS.map(|(it, help)| PossibleValue::new(it.text()).help(help));
    let command = |word: String| STATE_WORDS.into_iter().find(|(it, _)| it.text() == word);
    PossibleValuesParser::new(words)
        .try_map(move |word| command(word).map(|(it, _)| it).ok_or("not a state command"))
}

pub fn run(arguments: Arguments) -> Result<(), Failure> {
    let (name, trajectory, duration_s, stream) = match arguments.what {
        What::State { command, options } => return change_state(&options, command),
        What::Fixture(arguments) => return fixture::run(&arguments),
        What::Motor(arguments) => {
            let domain = arguments.domain.domain()?;
            return motor::run(&arguments, &mut prepare::connect(&domain)?)
                .map_err(|failure| name_holder(failure, &domain));
        }
        What::Pose { pitch_deg, yaw_deg, duration_s, hold, stream } => {
            let pose = pitch_deg.zip(yaw_deg);
            let ends = pose.is_some() && !hold && !io::stdout().is_terminal();
            let duration_s = duration_s.or(ends.then_some(0.0));
            let pose = pose.map(|(pitch, yaw)| Trajectory::Point([pitch, yaw]));
            (if pose.is_some() { "pose" } else { "hold" }, pose, duration_s, stream)
        }
        What::Sine { amplitude_deg, periodic } => {
            let Periodic { centre_deg, period_s, duration_s, stream } = periodic;
            let (centre, amplitude) = (pair(&centre_deg), pair(&amplitude_deg));
            ("sine", Some(Trajectory::Sine { centre, amplitude, period_s }), duration_s, stream)
        }
        What::Circle { radius_deg: radius, periodic } => {
            let Periodic { centre_deg, period_s, duration_s, stream } = periodic;
            let centre = pair(&centre_deg);
            ("circle", Some(Trajectory::Circle { centre, radius, period_s }), duration_s, stream)
        }
        // An invalid file is refused before the robot moves.
        What::File { csv, stream } => ("file", Some(Trajectory::load(&csv)?), None, stream),
    };
    let StreamOptions { rate_hz, speed_deg_s, on_late, prepare, domain } = stream;
    let plan = Plan { name, trajectory, duration_s, rate_hz, speed_deg_s, on_late, prepare };
    let domain = domain.domain()?;
    let follow = || stream::run(&mut prepare::connect(&domain)?, plan, &Interrupt::catch()?);
    follow().map_err(|failure| name_holder(failure, &domain))
}

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  i2ris home && i2ris enable
  i2ris disable

`i2ris command state` has the other changes: pause, resume, condition, acknowledge, ...")]
pub struct StateArguments {
    /// Return when the controller has accepted the command, without waiting for its completion
    #[arg(long)]
    no_wait: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    domain: DomainOption,
}

/// `i2ris home`, `enable`, `disable`, and `i2ris command state`.
pub fn change_state(arguments: &StateArguments, command: StateCommand) -> Result<(), Failure> {
    let domain = arguments.domain.domain()?;
    let change = || -> Result<(), Failure> {
        let (mut client, interrupt) = (prepare::connect(&domain)?, Interrupt::catch()?);
        let (state, message) = if arguments.no_wait {
            let state = client.state_command(command)?;
            // Without a message the power state is unknown.
            (state, client.wait_for(FIRST_MESSAGE_TIMEOUT, |_| true).unwrap_or_default())
        } else {
            let message = carry_out(&mut client, command, &interrupt)?;
            let state = OperatingState::from_number(message.state);
            (state.ok_or(StopReason::Unknown(message.state))?, message)
        };
        let (accepted, done) = (command.text(), !arguments.no_wait);
        let report = if arguments.json {
            json!({ "accepted": accepted, "done": done, "state": state.text() }).to_string()
        } else {
            let how = if done { "done" } else { "accepted" };
            let is_fault = state == OperatingState::Fault;
            let stays = if is_fault { " until `i2ris command state acknowledge`" } else { "" };
            let power = match command {
                StateCommand::Disable => format!("{stays}; {}", message.power().text()),
                _ => String::new(),
            };
            format!("{how}: {command}; the controller is {state}{power}")
        };
        say(&report)
    };
    change().map_err(|failure| name_holder(failure, &domain))
}

pub fn name_holder(failure: Failure, domain: &Domain) -> Failure {
    let stop = failure.downcast_ref::<StopReason>();
    let holder = stop.and_then(|stop| match stop {
        StopReason::Lease(client) | StopReason::LostLease(client) => Some(*client),
        _ => None,
    });
    let named = holder.and_then(|client| {
        let process = find_client_process(domain, Ready::read(domain)?.boot_id, client)?;
        Some((MaskedClientId(client).to_string(), process.to_string()))
    });
    match named {
        Some((id, process)) => {
            let sentence = failure.to_string().replace(&id, &process);
            Coded { code: 4, sentence }.into()
        }
        None => failure,
    }
}

pub fn with_code(failure: Failure) -> Failure {
    if failure.is::<OutOfReach>() {
        let sentence = failure.to_string();
        return Coded { code: OUT_OF_REACH, sentence }.into();
    }
    let Some(stop) = failure.downcast_ref::<StopReason>() else { return failure };
    use StopReason::*;
    let code = match stop {
        Silent | Ignored | Restarted | Unknown(_) => 3,
        NotEnabled(_) | LeftEnabled(_) | NotHomed | Lease(_) | LostLease(_) => 4,
        Refused(_) | Stopped(_) => 4,
        Fault(_) => 5,
    };
    let sentence = stop.to_string();
    Coded { code, sentence }.into()
}
