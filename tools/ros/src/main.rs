//! `i2ris ros`: the robot in ROS 2.

use std::net::IpAddr;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, ValueEnum};
use i2ris::units::Nanos;
use i2ris_report::program::yield_to_controller;
use i2ris_report::snake::Snake;
use i2ris_report::{DomainOption, Failure, Interrupt, Screen, until_closed};
use i2ris_ros::{LARGEST_DOMAIN, MasterOptions, Options, ServiceMapping};

/// Show and command the robot in ROS 2, as CRTK names it
#[derive(Debug, Parser)]
#[command(
    name = "i2ris-ros",
    bin_name = "i2ris ros",
    version,
    propagate_version = true,
    args_conflicts_with_subcommands = true
)]
#[command(after_help = "Examples:
  i2ris ros                                     topics under /i2ris, this computer only
  i2ris ros --name eye --command                topics under /eye, every user of this computer can
                                                command
  i2ris ros --network 192.168.1.10              other computers of that network watch, too
  i2ris ros urdf eye > eye.urdf                 the snake for RViz and Foxglove
  i2ris ros master MTML --to master.pipe        steer by another arm: i2ris teleop --played

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
    /// Print a URDF of the snake
    Urdf {
        /// The name of the robot, with which the names of all links begin
        #[arg(default_value = "i2ris", value_parser = name)]
        name: String,
    },
    /// Hold another arm as an input device: its measured_cp or measured_js, and its pedal, into a
    /// pipe for `i2ris teleop --played`
    Master(MasterArguments),
}

#[derive(Debug, clap::Args)]
struct MasterArguments {
    /// The arm, as MTML
    #[arg(value_parser = name)]
    arm: String,
    /// Topic of the pedal that is the dead-man (sensor_msgs/Joy, first button)
    #[arg(long, default_value = "/footpedals/coag", value_name = "TOPIC")]
    pedal: String,
    /// What goes to the right in the picture: x, y, z of measured_cp, or a joint of measured_js;
    /// with a - it goes to the left
    #[arg(long, default_value = "x", value_name = "AXIS", allow_hyphen_values = true)]
    right: String,
    /// What goes up in the picture
    #[arg(long, default_value = "y", value_name = "AXIS", allow_hyphen_values = true)]
    up: String,
    /// Way of full deflection, m or rad; `i2ris teleop --reach-deg` says what it does
    #[arg(long, default_value_t = 0.05, value_name = "WAY", value_parser = way)]
    full: f64,
    /// The pipe; made if it is not there
    #[arg(long, value_name = "PIPE")]
    to: PathBuf,
    #[command(flatten)]
    ros: RosArguments,
}

/// Where in ROS.
#[derive(Debug, clap::Args)]
struct RosArguments {
    /// Domain of ROS
    #[arg(
        long,
        env = "ROS_DOMAIN_ID",
        default_value_t = 0,
        value_name = "NUMBER",
        value_parser = clap::value_parser!(u16).range(0..=i64::from(LARGEST_DOMAIN))
    )]
    ros_domain: u16,
    /// Address of this computer in a network to take part in; may be repeated. Without one, only
    /// this computer is reached
    #[arg(long, value_name = "ADDRESS")]
    network: Vec<IpAddr>,
}

#[derive(Debug, clap::Args)]
struct RunArguments {
    /// The name of the robot, under which its topics are
    #[arg(long, default_value = "i2ris", value_name = "NAME", value_parser = name)]
    name: String,
    #[command(flatten)]
    ros: RosArguments,
    /// Take commands of every user of this computer
    #[arg(long, conflicts_with = "network")]
    command: bool,
    /// Take the command `home`, too, which makes the present pose the zero: straighten the snake
    /// before
    #[arg(long, requires = "command")]
    home: bool,
    /// Time between two messages of measured_js and setpoint_js
    #[arg(
        long,
        default_value_t = 10,
        value_name = "MS",
        value_parser = clap::value_parser!(u64).range(1..=1000)
    )]
    period_ms: u64,
    /// How services are put on DDS: as Fast DDS does, or as Cyclone DDS does
    #[arg(long, value_enum, env = "RMW_IMPLEMENTATION", default_value_t = Rmw::FastDds)]
    rmw: Rmw,
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
    let only_prints = |arguments: &Arguments| matches!(arguments.other, Some(Other::Urdf { .. }));
    i2ris_report::program::run(only_prints, run)
}

fn run(arguments: Arguments) -> Result<(), Failure> {
    match arguments.other {
        Some(Other::Urdf { name }) => {
            until_closed(Screen::stdout().say(Snake::new(&name).urdf().trim_end()))?;
            return Ok(());
        }
        Some(Other::Master(arguments)) => return master(arguments),
        None => {}
    }
    let RunArguments { name, ros, command, home, period_ms, rmw, domain } = arguments.run;
    let RosArguments { ros_domain, network } = ros;
    yield_to_controller();
    let options = Options {
        domain: domain.domain()?,
        robot: name,
        ros_domain,
        networks: network,
        read_only: !command,
        may_home: home,
        period: Nanos::from_millis(period_ms),
        services: rmw.mapping(),
    };
    let interrupt = Interrupt::catch()?;
    let mut screen = Screen::never_blocking()?;
    // A reader of the lines that went away ends nothing: the robot may depend on it.
    i2ris_ros::run(&options, || interrupt.came(), |line| drop(screen.say(line)))?;
    Ok(())
}

fn master(arguments: MasterArguments) -> Result<(), Failure> {
    let MasterArguments { arm, pedal, right, up, full, to, ros } = arguments;
    let RosArguments { ros_domain, network: networks } = ros;
    yield_to_controller();
    let axes = [right, up];
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

/// A name that ROS takes as a part of topics, and URDF as a part of links.
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
    fn names_are_those_that_ros_takes() {
        for good in ["i2ris", "PSM1", "left_eye"] {
            assert_eq!(name(good).as_deref(), Ok(good));
        }
        for bad in ["", "1eye", "_eye", "eye_", "left__eye", "left/eye", "eye ", "äuge"] {
            assert!(name(bad).is_err(), "{bad}");
        }
    }
}
