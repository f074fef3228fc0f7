//! `i2ris command`: moves the robot and changes its state.

mod path;
mod player;
pub mod prepare;
mod stream;
pub mod watch;

use std::path::PathBuf;

use i2ris::ipc::StateCommand;
use i2ris::ipc::client::Client;
use i2ris::units::Nanos;

use crate::Failure;
use crate::console::{DomainOption, Interrupt, Screen, until_closed};
use path::{Angles, Path, Table};
use stream::Plan;

/// How long to wait for a controller that is just starting.
const CONNECT: Nanos = Nanos::from_millis(2000);

/// Arguments of `i2ris command`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    domain: DomainOption,
    #[command(flatten)]
    stream: StreamOptions,
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, clap::Args)]
struct StreamOptions {
    /// Commands per second; slower than the deadline of the controller allows, the robot stops in between
    #[arg(long, default_value_t = 200.0, value_name = "HZ", value_parser = rate, global = true)]
    rate_hz: f64,
    /// Speed limit on the way to the start of the path
    #[arg(long, default_value_t = 10.0, value_name = "DEG_PER_S", value_parser = positive, global = true)]
    speed_deg_s: f64,
    /// Home and enable the robot first, where necessary
    #[arg(long, global = true)]
    enable: bool,
}

#[derive(Debug, clap::Subcommand)]
enum What {
    /// Hold the present pose
    Hold {
        /// End after this time instead of with Ctrl-C
        #[arg(long, value_name = "S", value_parser = positive)]
        duration_s: Option<f64>,
    },
    /// Move to a pose and hold it
    Pose {
        /// Pitch
        #[arg(value_parser = finite, allow_negative_numbers = true)]
        pitch_deg: f64,
        /// Yaw
        #[arg(value_parser = finite, allow_negative_numbers = true)]
        yaw_deg: f64,
        /// End so long after arriving instead of with Ctrl-C
        #[arg(long, value_name = "S", value_parser = positive)]
        duration_s: Option<f64>,
    },
    /// Swing to both sides
    Sine {
        /// Largest distance from the middle
        #[arg(long, num_args = 2, required = true, value_names = ["PITCH_DEG", "YAW_DEG"], value_parser = finite,
              allow_negative_numbers = true)]
        amplitude_deg: Vec<f64>,
        #[command(flatten)]
        periodic: Periodic,
    },
    /// Go round in a circle
    Circle {
        /// Distance from the middle
        #[arg(long, value_name = "DEG", value_parser = positive)]
        radius_deg: f64,
        #[command(flatten)]
        periodic: Periodic,
    },
    /// Follow the angles of a CSV file with the columns t_s, pitch_deg and yaw_deg, joined by straight lines
    File {
        /// The file
        csv: PathBuf,
    },
    /// Change the state
    State {
        /// What to do
        #[arg(value_enum)]
        command: StateWord,
    },
}

#[derive(Debug, clap::Args)]
struct Periodic {
    /// The middle
    #[arg(long, num_args = 2, value_names = ["PITCH_DEG", "YAW_DEG"], default_values_t = [0.0, 0.0],
          value_parser = finite, allow_negative_numbers = true)]
    center: Vec<f64>,
    /// Time for one round
    #[arg(long, value_name = "S", value_parser = positive)]
    period_s: f64,
    /// End after this time on the path instead of with Ctrl-C
    #[arg(long, value_name = "S", value_parser = positive)]
    duration_s: Option<f64>,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum StateWord {
    /// Drives on; the robot holds
    Enable,
    /// Decelerate, then drives off
    Disable,
    /// Decelerate and hold; servo commands are refused
    Pause,
    /// Take servo commands again
    Resume,
    /// Here is zero
    Home,
    /// Forget the zero
    Unhome,
    /// A decaying stroke of all motors, after which the hysteresis of the wires is known
    Condition,
    /// The operator has seen the fault
    Acknowledge,
    /// Give the lease back; of use only for the client that holds it
    Release,
}

impl StateWord {
    fn command(self) -> StateCommand {
        match self {
            Self::Enable => StateCommand::Enable,
            Self::Disable => StateCommand::Disable,
            Self::Pause => StateCommand::Pause,
            Self::Resume => StateCommand::Resume,
            Self::Home => StateCommand::Home,
            Self::Unhome => StateCommand::Unhome,
            Self::Condition => StateCommand::Condition,
            Self::Acknowledge => StateCommand::Acknowledge,
            Self::Release => StateCommand::Release,
        }
    }
}

/// Runs it.
pub fn run(arguments: Arguments) -> Result<(), Failure> {
    let Arguments { domain, stream, what } = arguments;
    // A file with a mistake is refused before the robot moves.
    let table = if let What::File { csv } = &what { Some(Table::load(csv)?) } else { None };
    let mut client = Client::connect(&domain.domain()?, CONNECT)?;
    let interrupt = Interrupt::catch()?;
    let (name, path, duration_s) = match what {
        What::State { command } => return change_state(&mut client, command),
        What::Hold { duration_s } => ("hold", None, duration_s),
        What::Pose { pitch_deg, yaw_deg, duration_s } => ("pose", Some(Path::Point([pitch_deg, yaw_deg])), duration_s),
        What::Sine { amplitude_deg, periodic } => {
            let (center, amplitude) = (pair(&periodic.center), pair(&amplitude_deg));
            ("sine", Some(Path::Sine { center, amplitude, period_s: periodic.period_s }), periodic.duration_s)
        }
        What::Circle { radius_deg, periodic } => {
            let center = pair(&periodic.center);
            let path = Path::Circle { center, radius: radius_deg, period_s: periodic.period_s };
            ("circle", Some(path), periodic.duration_s)
        }
        What::File { .. } => ("file", table.map(Path::Table), None),
    };
    let StreamOptions { rate_hz, speed_deg_s, enable } = stream;
    stream::run(&mut client, Plan { name, path, duration_s, rate_hz, speed_deg_s, enable }, &interrupt)
}

fn change_state(client: &mut Client, command: StateWord) -> Result<(), Failure> {
    let state = client.state_command(command.command())?;
    until_closed(Screen::stdout().say(&format!("accepted: {}; the controller is {state}", command.command())))?;
    Ok(())
}

/// The command line takes exactly two values.
fn pair(values: &[f64]) -> Angles {
    [values.first().copied().unwrap_or(0.0), values.get(1).copied().unwrap_or(0.0)]
}

fn finite(text: &str) -> Result<f64, String> {
    let number: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if number.is_finite() { Ok(number) } else { Err("must be finite".to_owned()) }
}

fn positive(text: &str) -> Result<f64, String> {
    finite(text).and_then(|number| if number > 0.0 { Ok(number) } else { Err("must be above 0".to_owned()) })
}

fn rate(text: &str) -> Result<f64, String> {
    let in_range = |number: &f64| (10.0..=1000.0).contains(number);
    finite(text).ok().filter(in_range).ok_or_else(|| "must be 10 to 1000".to_owned())
}
