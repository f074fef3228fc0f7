//! `i2ris command`: moves the robot and changes its state.

mod fixture;
pub mod prepare;
pub mod progress;
pub mod stream;
pub mod stream_monitor;
pub mod task;
pub mod tracking;
pub mod trajectory;
mod trajectory_player;

use std::path::PathBuf;

use i2ris::ipc::client::Client;
use i2ris::ipc::{Domain, OperatingState, StateCommand};

use i2ris_report::{DomainOption, Failure, Interrupt, Screen, until_closed};

use crate::exit::name_holder;
use crate::numbers::{finite, pair, positive, rate};
use crate::teleop::{self, HandOptions};
use prepare::{PrepareOptions, carry_out};
use stream::{OnLate, Plan};
use stream_monitor::StopReason;
use task::{HoldStillOptions, PursuitOptions, ReachOptions, TaskOptions};
use trajectory::{Trajectory, Waypoints};

#[derive(Debug, clap::Args)]
#[command(
    arg_required_else_help = true,
    after_help = "Examples:
  i2ris command state home && i2ris command state enable
  i2ris command pose 5 -3 --duration-s 2
  i2ris command circle --radius-deg 5 --period-s 6 --duration-s 30 --enable
  i2ris command state condition --no-wait
  i2ris command file desired.csv
  i2ris command fixture circle 10 5 3            a circle of 3 deg around 10, 5 is forbidden
  i2ris command reach --targets 5                bring the snake to targets and hold it there
  i2ris command pursuit --device /dev/input/event7    follow a target that moves

Ctrl-C comes to rest softly, gives the lease back and ends; the snake holds."
)]
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
    /// Commands per second; slower than the deadline of the controller allows, the robot stops in
    /// between
    #[arg(long, default_value_t = 200.0, value_name = "HZ", value_parser = rate, global = true)]
    rate_hz: f64,
    /// Speed limit of the approach to the start of the trajectory, and of motion by hand
    #[arg(
        long,
        default_value_t = 10.0,
        value_name = "DEG_PER_S",
        value_parser = positive,
        global = true
    )]
    speed_deg_s: f64,
    /// What to do when the controller has stopped the snake because commands came late
    #[arg(long, value_enum, default_value_t = OnLate::Continue, global = true)]
    on_late: OnLate,
    #[command(flatten)]
    prepare: PrepareOptions,
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
        #[arg(long, num_args = 2, required = true, value_names = ["PITCH_DEG", "YAW_DEG"],
              value_parser = finite, allow_negative_numbers = true)]
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
    /// Follow the angles of a CSV file with the columns t_s, pitch_deg and yaw_deg, joined by
    /// straight lines
    File {
        /// The file
        csv: PathBuf,
    },
    /// A task: bring the snake to targets, one after the other, and hold it there. With the keys of
    /// this terminal or --device. The monitor shows the targets, `i2ris report` scores a recording
    Reach {
        #[command(flatten)]
        task: ReachOptions,
        #[command(flatten)]
        hand: HandOptions,
    },
    /// A task: follow a target along a curve that cannot be foreseen, by hand as in `reach`
    Pursuit {
        #[command(flatten)]
        task: PursuitOptions,
        #[command(flatten)]
        hand: HandOptions,
    },
    /// A task: keep the snake at a place, by hand as in `reach`
    HoldStill {
        #[command(flatten)]
        task: HoldStillOptions,
        #[command(flatten)]
        hand: HandOptions,
    },
    /// Regions that the snake may not enter
    #[command(subcommand)]
    Fixture(fixture::FixtureCommand),
    /// Change the state
    State {
        /// What to do
        #[arg(value_enum)]
        command: StateWord,
        /// End when the controller has accepted the command, and not when it is carried out
        #[arg(long)]
        no_wait: bool,
        /// Print JSON
        #[arg(long)]
        json: bool,
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
    /// End after this time on the trajectory instead of with Ctrl-C
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
    /// Stop and hold until the next command
    Hold,
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
            Self::Hold => StateCommand::Hold,
            Self::Release => StateCommand::Release,
        }
    }
}

pub fn run(arguments: Arguments) -> Result<(), Failure> {
    let domain = arguments.domain.domain()?;
    carry_out_all(arguments, &domain).map_err(|failure| name_holder(failure, &domain))
}

fn carry_out_all(arguments: Arguments, domain: &Domain) -> Result<(), Failure> {
    let Arguments { domain: _, stream, what } = arguments;
    // A wrong file is refused before the robot moves.
    let waypoints = if let What::File { csv } = &what { Some(Waypoints::load(csv)?) } else { None };
    let mut client = crate::connection::connect(domain)?;
    let interrupt = Interrupt::catch()?;
    let by_hand = |client: &mut Client, task, hand: HandOptions| {
        let pace = teleop::Pace { rate_hz: stream.rate_hz, speed_deg_s: stream.speed_deg_s };
        let plan = hand.plan(pace, stream.prepare, Some(task));
        teleop::run_plan((client, domain), &plan, &interrupt)
    };
    let (name, path, duration_s) = match what {
        What::State { command, no_wait, json } => {
            let command = command.command();
            return if no_wait {
                let state = client.state_command(command)?;
                print_state(false, command, state, json)
            } else {
                let state = carry_out(&mut client, command, &interrupt)?.state;
                let state = OperatingState::from_number(state).ok_or(StopReason::Unknown(state))?;
                print_state(true, command, state, json)
            };
        }
        What::Reach { task, hand } => return by_hand(&mut client, TaskOptions::Reach(task), hand),
        What::Pursuit { task, hand } => {
            return by_hand(&mut client, TaskOptions::Pursuit(task), hand);
        }
        What::HoldStill { task, hand } => {
            return by_hand(&mut client, TaskOptions::HoldStill(task), hand);
        }
        What::Fixture(command) => return fixture::run(&mut client, &command),
        What::Hold { duration_s } => ("hold", None, duration_s),
        What::Pose { pitch_deg, yaw_deg, duration_s } => {
            ("pose", Some(Trajectory::Point([pitch_deg, yaw_deg])), duration_s)
        }
        What::Sine { amplitude_deg, periodic } => {
            let (center, amplitude) = (pair(&periodic.center), pair(&amplitude_deg));
            (
                "sine",
                Some(Trajectory::Sine { center, amplitude, period_s: periodic.period_s }),
                periodic.duration_s,
            )
        }
        What::Circle { radius_deg, periodic } => {
            let center = pair(&periodic.center);
            let path =
                Trajectory::Circle { center, radius: radius_deg, period_s: periodic.period_s };
            ("circle", Some(path), periodic.duration_s)
        }
        What::File { .. } => ("file", waypoints.map(Trajectory::Waypoints), None),
    };
    let StreamOptions { rate_hz, speed_deg_s, on_late, prepare } = stream;
    stream::run(
        &mut client,
        Plan { name, trajectory: path, duration_s, rate_hz, speed_deg_s, on_late, prepare },
        &interrupt,
    )
}

fn print_state(
    is_done: bool,
    command: StateCommand,
    state: OperatingState,
    json: bool,
) -> Result<(), Failure> {
    let report = if json {
        serde_json::json!({
            "accepted": command.text(), "done": is_done, "state": state.text()
        })
        .to_string()
    } else {
        let how = if is_done { "done" } else { "accepted" };
        let stays = match (command, state) {
            (StateCommand::Disable, OperatingState::Fault) => {
                " until `i2ris command state acknowledge`; its drives are switched off"
            }
            _ => "",
        };
        format!("{how}: {command}; the controller is {state}{stays}")
    };
    until_closed(Screen::stdout().say(&report))?;
    Ok(())
}
