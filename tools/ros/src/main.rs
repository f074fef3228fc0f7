//! `i2ris start ros`: the robot in ROS 2.

use std::process::ExitCode;

use clap::{Parser, ValueEnum};
use i2ris::units::Nanos;
use i2ris_report::program::yield_to_controller;
use i2ris_report::snake::Snake;
use i2ris_report::{DomainOption, Failure, Interrupt, Screen, until_closed};
use i2ris_ros::{MasterOptions, Options, RosNetwork, ServiceMapping, robot_name};

/// Connect the robot to ROS 2 (CRTK)
#[derive(Debug, Parser)]
#[command(name = "i2ris-ros", bin_name = "i2ris start ros", version, propagate_version = true)]
#[command(args_conflicts_with_subcommands = true)]
#[command(after_help = "Examples:
  i2ris start ros                               topics under /i2ris, this computer only
  i2ris start ros --name eye --command          topics under /eye, every user of this computer can
                                                command
  i2ris start ros --network 192.168.1.10        other computers of that network can also watch
  i2ris start ros --name eye --urdf > eye.urdf  the snake for RViz and Foxglove
  i2ris start ros master MTML --to arm          another arm: `i2ris teleop --device arm` follows it

No installation of ROS is needed. Topics, types and quality of service are those of CRTK: \
measured_js, setpoint_js, goal_js, measured_cp, setpoint_cp, measured_cv, jacobian, \
period_statistics, operating_state, error, warning, status; servo_jp, servo_jr, move_jp, move_jr, \
state_command, hold, free.

ROS 2 has no access control: with --command every user of this computer can command. Other \
computers can only watch: --command and --network exclude each other.")]
struct Arguments {
    #[command(subcommand)]
    other: Option<Other>,
    #[command(flatten)]
    run: RunArguments,
}

#[derive(Debug, clap::Subcommand)]
enum Other {
    /// Use another arm as input device: its measured_cp or measured_js, and its pedal, go into a
    /// pipe for `i2ris teleop --device PIPE`
    Master(MasterOptions),
}

#[derive(Debug, clap::Args)]
struct RunArguments {
    /// The name of the robot, and prefix of its topics
    #[arg(long, default_value = "i2ris", value_name = "NAME", value_parser = robot_name)]
    name: String,
    #[command(flatten)]
    ros: RosNetwork,
    /// Accept commands from every user of this computer
    #[arg(long, conflicts_with = "network")]
    command: bool,
    /// Also accept the command `home`, which makes the present pose the zero: straighten the snake
    /// first
    #[arg(long, requires = "command")]
    home: bool,
    /// Messages of measured_js and setpoint_js per second
    #[arg(long, default_value_t = 100, value_name = "HZ",
          value_parser = clap::value_parser!(u64).range(1..=1000))]
    rate_hz: u64,
    /// Mapping of services to DDS: that of Fast DDS, or of Cyclone DDS
    #[arg(long, value_enum, env = "RMW_IMPLEMENTATION", default_value_t = Rmw::FastDds)]
    rmw: Rmw,
    /// Print a URDF of the snake and exit; the names of its links begin with --name
    #[arg(long)]
    urdf: bool,
    #[command(flatten)]
    domain: DomainOption,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Rmw {
    #[value(name = "rmw_fastrtps_cpp", alias = "rmw_fastrtps_dynamic_cpp")]
    FastDds,
    #[value(name = "rmw_cyclonedds_cpp")]
    CycloneDds,
}

fn main() -> ExitCode {
    let only_prints = |arguments: &Arguments| arguments.run.urdf;
    i2ris_report::program::run(only_prints, run)
}

fn run(arguments: Arguments) -> Result<(), Failure> {
    if let Some(Other::Master(options)) = arguments.other {
        yield_to_controller();
        let (interrupt, mut screen) = (Interrupt::catch()?, Screen::never_blocking()?);
        i2ris_ros::follow(&options, || interrupt.came(), |line| drop(screen.say(line)))?;
        return Ok(());
    }
    let RunArguments { name, ros, command, home, rate_hz, rmw, urdf, domain } = arguments.run;
    if urdf {
        until_closed(Screen::stdout().say(Snake::new(&name).urdf().trim_end()))?;
        return Ok(());
    }
    yield_to_controller();
    let options = Options {
        domain: domain.domain()?,
        robot: name,
        ros,
        read_only: !command,
        may_home: home,
        period: Nanos(1_000_000_000 / rate_hz),
        services: match rmw {
            Rmw::FastDds => ServiceMapping::Enhanced,
            Rmw::CycloneDds => ServiceMapping::Cyclone,
        },
    };
    let (interrupt, mut screen) = (Interrupt::catch()?, Screen::never_blocking()?);
    // A lost reader of the lines must not end the program: the robot may depend on it.
    i2ris_ros::run(&options, || interrupt.came(), |line| drop(screen.say(line)))?;
    Ok(())
}
