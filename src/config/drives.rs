//! The part of the configuration that names the drives: serial ports, and the axes behind them.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::{Config, WrongValue, require};
use crate::units::{Counts, MAX_MOTORS};

/// A serial port and the axes behind it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct PortConfig {
    /// The device file.
    pub device: PathBuf,
    /// Bits per second.
    #[serde(default = "default_baud")]
    pub baud: u32,
    /// The family of the drive that the port belongs to: its language is spoken on the line.
    #[serde(default)]
    pub family: Family,
    /// How bytes are put into frames.
    #[serde(default)]
    pub framing: Framing,
    /// How long to wait for a reply, in milliseconds, 3 to 1000. Behind a gateway, longer than its
    /// own time-out for a node.
    #[serde(default = "default_reply_timeout_ms")]
    pub reply_timeout_ms: u64,
    /// Silence of the control loop after which the port stops its enabled axes, in milliseconds; 0:
    /// never. The loop writes a request every tick, so this is a loop that hangs.
    #[serde(default = "default_deadman_ms")]
    pub deadman_ms: u64,
    /// How often what is not pressing is read while a target is followed.
    #[serde(default)]
    pub pattern: Pattern,
    /// A file that takes where the axes stand when the controller ends, relative to the folder of
    /// this file. With it, an axis that stands elsewhere at the next start, or of which no one
    /// noted the place, is not homed. Absent: what the drive says of its zero is believed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub positions_file: Option<PathBuf>,
    /// The axes, one drive each. More than one: the first drive passes requests on over CAN, by
    /// node id.
    pub axes: Vec<AxisConfig>,
}

impl PortConfig {
    /// A port with every default.
    #[must_use]
    pub fn new(device: PathBuf, axes: Vec<AxisConfig>) -> Self {
        Self {
            device,
            baud: default_baud(),
            family: Family::default(),
            framing: Framing::default(),
            reply_timeout_ms: default_reply_timeout_ms(),
            deadman_ms: default_deadman_ms(),
            pattern: Pattern::default(),
            positions_file: None,
            axes,
        }
    }
}

/// How often what is not pressing is read. A round is a set-point and a position, and takes two
/// exchanges of the line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct Pattern {
    /// Rounds between two looks at the statusword, 1 to 1000.
    pub status_every: u32,
    /// Rounds between two reads of the error code, and of the current, 20 to 10000.
    pub rare_every: u32,
}

impl Default for Pattern {
    fn default() -> Self {
        Self {
            status_every: 4,
            rare_every: 32,
        }
    }
}

/// Families of drives. They differ in their requests and in the numbers of their objects.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Family {
    /// maxon EPOS4.
    #[default]
    Epos4,
    /// maxon EPOS2.
    Epos2,
}

/// How bytes are put into frames on a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Framing {
    /// With sync bytes and stuffing: EPOS4 on RS232 and USB, EPOS2 on USB.
    #[default]
    V2,
    /// With a hand-shake for every part of a frame: EPOS2 on RS232.
    V1,
}

/// How set-points reach the motor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Streaming {
    /// Every set-point acts at once: cyclic synchronous position (EPOS4), position mode (EPOS2).
    /// One write each.
    #[default]
    Cyclic,
    /// The drive ramps to every set-point: profile position mode, EPOS4 only. Three writes each, so
    /// a third of the rate; the drive's own limits on speed and acceleration hold.
    Profile,
}

/// How an axis finds its zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum HomingMethod {
    /// Where it stands when it is homed. Nothing moves.
    #[default]
    Here,
    /// At the hard stop in the positive direction, told by the motor current.
    StopPositive,
    /// At the hard stop in the negative direction, told by the motor current.
    StopNegative,
}

fn default_baud() -> u32 {
    115_200
}

fn default_reply_timeout_ms() -> u64 {
    20
}

fn default_deadman_ms() -> u64 {
    1000
}

/// One drive and its motor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct AxisConfig {
    /// Which motor of the model this drive turns, 0 or 1.
    pub motor: usize,
    /// The family of the drive. Absent: that of its port.
    #[serde(default)]
    pub family: Option<Family>,
    /// How set-points reach the motor.
    #[serde(default)]
    pub streaming: Streaming,
    /// CAN node id of the drive, 0 to 127; 0 is the drive that the port belongs to.
    pub node_id: u8,
    /// Serial number of the drive (object 0x1018:04), so that swapped cables are refused.
    pub serial_number: u32,
    /// Lowest position that the drive and the loop may be asked for, counts.
    pub position_min_counts: Counts,
    /// Highest position that the drive and the loop may be asked for, counts.
    pub position_max_counts: Counts,
    /// Output current limit of the drive (object 0x3001:02; EPOS2 0x6410:02), mA.
    #[serde(default = "default_current_limit_ma")]
    pub current_limit_ma: u32,
    /// Following error window of the drive (object 0x6065), counts.
    #[serde(default = "default_following_error_counts")]
    pub following_error_counts: u32,
    /// Speed limit of the motor in the drive (objects 0x607F and 0x6080; EPOS2 0x6410:04), rpm.
    #[serde(default = "default_motor_speed_rpm")]
    pub motor_speed_rpm: u32,
    /// Quick-stop deceleration in the drive (object 0x6085), rpm per second.
    #[serde(default = "default_quick_stop_rpm_s")]
    pub quick_stop_rpm_s: u32,
    /// How it finds its zero.
    #[serde(default)]
    pub homing: HomingMethod,
    /// Motor current that tells the hard stop, mA, and the most that the drive puts out while it
    /// looks for it. Far below what the wires bear, and below `current_limit_ma`.
    #[serde(default = "default_homing_current_ma")]
    pub homing_current_ma: u32,
    /// Motor speed towards the hard stop, rpm.
    #[serde(default = "default_homing_speed_rpm")]
    pub homing_speed_rpm: u32,
    /// Position that the hard stop has, counts: the zero lies as far from it. Only for homing
    /// against a stop.
    #[serde(default)]
    pub homing_stop_counts: Counts,
}

impl AxisConfig {
    /// An axis with every default.
    #[must_use]
    pub fn new(motor: usize, serial_number: u32, limits: [Counts; 2]) -> Self {
        let [position_min_counts, position_max_counts] = limits;
        Self {
            motor,
            family: None,
            streaming: Streaming::default(),
            node_id: 0,
            serial_number,
            position_min_counts,
            position_max_counts,
            current_limit_ma: default_current_limit_ma(),
            following_error_counts: default_following_error_counts(),
            motor_speed_rpm: default_motor_speed_rpm(),
            quick_stop_rpm_s: default_quick_stop_rpm_s(),
            homing: HomingMethod::default(),
            homing_current_ma: default_homing_current_ma(),
            homing_speed_rpm: default_homing_speed_rpm(),
            homing_stop_counts: Counts(0),
        }
    }
}

fn default_current_limit_ma() -> u32 {
    300
}

fn default_following_error_counts() -> u32 {
    400
}

fn default_motor_speed_rpm() -> u32 {
    3000
}

fn default_quick_stop_rpm_s() -> u32 {
    10_000
}

fn default_homing_current_ma() -> u32 {
    30
}

fn default_homing_speed_rpm() -> u32 {
    20
}

impl Config {
    pub(super) fn check_ports(&self) -> Result<(), WrongValue> {
        let motors = self.motors();
        require(
            (1..=MAX_MOTORS).contains(&motors),
            "ports.axes",
            motors,
            "there must be 1 or 2 axes in all",
        )?;
        for (number, port) in self.ports.iter().enumerate() {
            let twice = self.ports[..number]
                .iter()
                .any(|other| other.device == port.device);
            port.check(number, twice)?;
        }
        self.axes().try_for_each(|axis| self.check_axis(axis))
    }

    fn check_axis(&self, axis: &AxisConfig) -> Result<(), WrongValue> {
        let (motors, twice) = (
            self.motors(),
            self.axes()
                .filter(|other| other.motor == axis.motor)
                .count()
                > 1,
        );
        require(
            axis.motor < motors,
            &axis.key("motor"),
            axis.motor,
            "motors are numbered from 0 without gaps",
        )?;
        require(
            !twice,
            &axis.key("motor"),
            axis.motor,
            "is turned by another axis already",
        )?;
        axis.check()
    }
}

impl PortConfig {
    fn check(&self, number: usize, twice: bool) -> Result<(), WrongValue> {
        let key = |name: &str| format!("ports[{number}].{name}");
        let timeout = self.reply_timeout_ms;
        require(
            (3..=1000).contains(&timeout),
            &key("reply_timeout_ms"),
            timeout,
            "must be 3 to 1000",
        )?;
        require(
            (9600..=4_000_000).contains(&self.baud),
            &key("baud"),
            self.baud,
            "must be 9600 to 4000000",
        )?;
        require(
            !twice,
            &key("device"),
            self.device.display(),
            "is named by another port already",
        )?;
        let Pattern {
            status_every,
            rare_every,
        } = self.pattern;
        require(
            (1..=1000).contains(&status_every),
            &key("pattern.status_every"),
            status_every,
            "must be 1 to 1000",
        )?;
        require(
            (20..=10_000).contains(&rare_every),
            &key("pattern.rare_every"),
            rare_every,
            "must be 20 to 10000",
        )?;
        let speaks = (self.family, self.framing) != (Family::Epos4, Framing::V1);
        require(
            speaks,
            &key("framing"),
            "v1",
            "is spoken by `family = \"epos2\"` on RS232 only",
        )?;
        for (place, axis) in self.axes.iter().enumerate() {
            let family = axis.family.unwrap_or(self.family);
            let can = (family, axis.streaming) != (Family::Epos2, Streaming::Profile);
            require(
                can,
                &axis.key("streaming"),
                "profile",
                "is for EPOS4 only; leave it out for an EPOS2",
            )?;
            let fits = family != Family::Epos2 || axis.current_limit_ma <= u32::from(u16::MAX);
            require(
                fits,
                &axis.key("current_limit_ma"),
                axis.current_limit_ma,
                "must be below 65536 for an EPOS2",
            )?;
            let twice = self.axes[..place]
                .iter()
                .any(|other| other.node_id == axis.node_id);
            require(
                !twice,
                &axis.key("node_id"),
                axis.node_id,
                "is named by another axis of the same port already",
            )?;
        }
        Ok(())
    }
}

impl AxisConfig {
    fn key(&self, name: &str) -> String {
        format!("ports.axes[motor {}].{name}", self.motor)
    }

    fn check(&self) -> Result<(), WrongValue> {
        require(
            self.node_id <= 127,
            &self.key("node_id"),
            self.node_id,
            "must be 0 to 127",
        )?;
        require(
            self.position_min_counts < self.position_max_counts,
            &self.key("position_min_counts"),
            self.position_min_counts,
            "must be below position_max_counts",
        )?;
        for (name, value) in [
            ("current_limit_ma", self.current_limit_ma),
            ("motor_speed_rpm", self.motor_speed_rpm),
            ("quick_stop_rpm_s", self.quick_stop_rpm_s),
            ("homing_current_ma", self.homing_current_ma),
            ("homing_speed_rpm", self.homing_speed_rpm),
        ] {
            require(value > 0, &self.key(name), value, "must be above 0")?;
        }
        if self.homing == HomingMethod::Here {
            return Ok(());
        }
        let (current, stop) = (self.homing_current_ma, self.homing_stop_counts);
        require(
            current < self.current_limit_ma && current <= u32::from(u16::MAX),
            &self.key("homing_current_ma"),
            current,
            "must be below current_limit_ma: it decides how hard the wires are pulled against the stop",
        )?;
        let inside = (self.position_min_counts..=self.position_max_counts).contains(&stop);
        require(
            inside,
            &self.key("homing_stop_counts"),
            stop,
            "must lie within the position limits",
        )
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn parse(port: &str, axis: &str) -> Result<Config, String> {
        let text = format!(
            "robot_id = \"test\"\n[[ports]]\ndevice = \"/dev/null\"\n{port}\n[[ports.axes]]\nmotor = 0\nnode_id = 0\n\
             serial_number = 1\nposition_min_counts = -100\nposition_max_counts = 100\n{axis}"
        );
        Config::parse(&text, Path::new("robot.toml")).map_err(|error| error.to_string())
    }

    #[test]
    fn a_port_without_a_family_is_an_epos4_with_stuffed_frames() {
        let config = parse("", "").unwrap();
        assert_eq!(
            (config.ports[0].family, config.ports[0].framing),
            (Family::Epos4, Framing::V2)
        );
        assert_eq!(config.axis(0).unwrap().homing, HomingMethod::Here);
        assert_eq!(
            PortConfig::new("/dev/null".into(), config.ports[0].axes.clone()),
            config.ports[0]
        );
        assert_eq!(
            AxisConfig::new(0, 1, [Counts(-100), Counts(100)]),
            config.ports[0].axes[0]
        );
    }

    #[test]
    fn what_a_family_does_not_have_is_refused() {
        assert!(parse("family = \"epos2\"\nframing = \"v1\"", "").is_ok());
        assert!(
            parse("framing = \"v1\"", "")
                .unwrap_err()
                .contains("ports[0].framing = v1: is spoken by")
        );
        assert!(
            parse("family = \"epos2\"", "streaming = \"profile\"")
                .unwrap_err()
                .contains("for EPOS4 only")
        );
        assert!(
            parse("", "family = \"epos2\"\nstreaming = \"profile\"")
                .unwrap_err()
                .contains("for EPOS4 only")
        );
        assert!(
            parse("", "family = \"epos2\"\ncurrent_limit_ma = 70000")
                .unwrap_err()
                .contains("below 65536")
        );
        assert!(
            parse("family = \"epos3\"", "")
                .unwrap_err()
                .contains("epos2")
        );
    }

    proptest::proptest! {
        /// A damaged file is refused or understood, and never ends the process.
        #[test]
        fn damaged_files_never_panic(cut in 0..400usize, byte: u8, place in 0..400usize) {
            let whole = "robot_id = \"r\"\n[[ports]]\ndevice = \"/dev/null\"\nbaud = 115200\nfamily = \"epos2\"\n\
                         [[ports.axes]]\nmotor = 0\nnode_id = 0\nserial_number = 1\nposition_min_counts = -100\n\
                         position_max_counts = 100\nhoming = \"stop-positive\"\n";
            let mut damaged = whole.as_bytes().to_vec();
            let length = damaged.len();
            damaged[place % length] = byte;
            damaged.truncate(cut % length + length / 2);
            let _ = Config::parse(&String::from_utf8_lossy(&damaged), Path::new("robot.toml"));
        }
    }

    #[test]
    fn two_axes_with_one_node_id_are_refused() {
        let second = "[[ports.axes]]\nmotor = 1\nnode_id = 0\nserial_number = 2\nposition_min_counts = 0\n\
                      position_max_counts = 1";
        assert!(
            parse("", second)
                .unwrap_err()
                .contains("node_id = 0: is named by another axis of the same port")
        );
    }

    #[test]
    fn a_hard_stop_needs_a_current_below_the_limit() {
        assert!(parse("", "homing = \"stop-negative\"\nhoming_stop_counts = -90").is_ok());
        assert!(
            parse("", "homing = \"stop-positive\"\nhoming_current_ma = 300")
                .unwrap_err()
                .contains("how hard")
        );
        assert!(
            parse("", "homing = \"stop-positive\"\nhoming_stop_counts = 101")
                .unwrap_err()
                .contains("within the pos")
        );
    }
}
