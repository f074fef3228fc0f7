//! `i2ris start ros`: the robot in ROS 2.

use std::net::IpAddr;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, ValueEnum};
use i2ris::units::Nanos;
use i2ris_report::program::yield_to_controller;
use i2ris_report::snake::Snake;
use i2ris_report::{DomainOption, Failure, Interrupt, Screen, until_closed};
use i2ris_ros::{MAX_DOMAIN, MasterOptions, Options, ServiceMapping};

/// Connect the robot to ROS 2 (CRTK)
#[derive(Debug, Parser)]
#[command(
    name = "i2ris-ros",
    bin_name = "i2ris start ros",
    version,
    propagate_version = true,
    args_conflicts_with_subcommands = true
)]
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
    Master(MasterArguments),
}

#[derive(Debug, clap::Args)]
struct MasterArguments {
    /// Name of the arm, e.g. MTML
    #[arg(value_parser = name)]
    arm: String,
    /// Topic of the pedal that is the dead-man (sensor_msgs/Joy, first button)
    #[arg(long, default_value = "/footpedals/coag", value_name = "TOPIC")]
    pedal: String,
    /// Axes to the right and up in the picture: x, y, z of measured_cp, or joints of measured_js; a
    /// leading - reverses the direction
    #[arg(long, default_value = "x,y", value_name = "RIGHT,UP", allow_hyphen_values = true,
          value_parser = axes)]
    axes: [String; 2],
    /// Travel of full deflection, m or rad; `i2ris teleop` sets the resulting motion
    #[arg(long, default_value_t = 0.05, value_name = "WAY", value_parser = way)]
    full: f64,
    /// The pipe; created if it does not exist
    #[arg(long, value_name = "PIPE")]
    to: PathBuf,
    #[command(flatten)]
    ros: RosArguments,
}

/// Domain and networks of ROS.
#[derive(Debug, clap::Args)]
struct RosArguments {
    /// Domain of ROS
    #[arg(
        long,
        env = "ROS_DOMAIN_ID",
        default_value_t = 0,
        value_name = "NUMBER",
        value_parser = clap::value_parser!(u16).range(0..=i64::from(MAX_DOMAIN))
    )]
    ros_domain: u16,
    /// Address of this computer in a network to join; may be repeated. Without one, ROS is
    /// restricted to this computer
    #[arg(long, value_name = "ADDRESS")]
    network: Vec<IpAddr>,
}

#[derive(Debug, clap::Args)]
struct RunArguments {
    /// The name of the robot, and prefix of its topics
    #[arg(long, default_value = "i2ris", value_name = "NAME", value_parser = name)]
    name: String,
    #[command(flatten)]
    ros: RosArguments,
    /// Accept commands from every user of this computer
    #[arg(long, conflicts_with = "network")]
    command: bool,
    /// Also accept the command `home`, which makes the present pose the zero: straighten the snake
    /// first
    #[arg(long, requires = "command")]
    home: bool,
    /// Messages of measured_js and setpoint_js per second
    #[arg(
        long,
        default_value_t = 100,
        value_name = "HZ",
        value_parser = clap::value_parser!(u64).range(1..=1000)
    )]
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

impl Rmw {
    const fn mapping(self) -> ServiceMapping {
        match self {
            Self::FastDds => ServiceMapping::Enhanced,
            Self::CycloneDds => ServiceMapping::Cyclone,
        }
    }
}

fn main() -> ExitCode {
    let only_prints = |arguments: &Arguments| arguments.run.urdf;
    i2ris_report::program::run(only_prints, run)
}

fn run(arguments: Arguments) -> Result<(), Failure> {
    if let Some(Other::Master(arguments)) = arguments.other {
        return master(arguments);
    }
    let RunArguments { name, ros, command, home, rate_hz, rmw, urdf, domain } = arguments.run;
    if urdf {
        until_closed(Screen::stdout().say(Snake::new(&name).urdf().trim_end()))?;
        return Ok(());
    }
    let RosArguments { ros_domain, network } = ros;
    yield_to_controller();
    let options = Options {
        domain: domain.domain()?,
        robot: name,
        ros_domain,
        networks: network,
        read_only: !command,
        may_home: home,
        period: Nanos(1_000_000_000 / rate_hz),
        services: rmw.mapping(),
    };
    let interrupt = Interrupt::catch()?;
    let mut screen = Screen::never_blocking()?;
    // A lost reader of the lines must not end the program: the robot may depend on it.
    i2ris_ros::run(&options, || interrupt.came(), |line| drop(screen.say(line)))?;
    Ok(())
}

fn master(arguments: MasterArguments) -> Result<(), Failure> {
    let MasterArguments { arm, pedal, axes, full, to, ros } = arguments;
    let RosArguments { ros_domain, network: networks } = ros;
    yield_to_controller();
    let options = MasterOptions { ros_domain, networks, arm, pedal, axes, full, pipe: to };
    let interrupt = Interrupt::catch()?;
    let mut screen = Screen::never_blocking()?;
    i2ris_ros::follow(&options, || interrupt.came(), |line| drop(screen.say(line)))?;
    Ok(())
}

fn way(text: &str) -> Result<f64, String> {
    let way = text.parse().ok().filter(|way: &f64| (0.001..=10.0).contains(way));
    way.ok_or_else(|| "must be 0.001 to 10".to_owned())
}

fn axes(text: &str) -> Result<[String; 2], String> {
    let (right, up) = text.split_once(',').ok_or("must be two, with a comma between them")?;
    Ok([right.to_owned(), up.to_owned()])
}

/// A name that is valid in topics of ROS and in links of URDF.
fn name(text: &str) -> Result<String, String> {
    let letters = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let begins = text.starts_with(|c: char| c.is_ascii_alphabetic());
    if begins && text.chars().all(letters) && !text.contains("__") && !text.ends_with('_') {
        Ok(text.to_owned())
    } else {
        Err("must be letters, digits and single _, beginning with a letter".to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_names_valid_in_ros_are_accepted() {
        for good in ["i2ris", "PSM1", "left_eye"] {
            assert_eq!(name(good).as_deref(), Ok(good));
        }
        for bad in ["", "1eye", "_eye", "eye_", "left__eye", "left/eye", "eye ", "äuge"] {
            assert!(name(bad).is_err(), "{bad}");
        }
    }
}
