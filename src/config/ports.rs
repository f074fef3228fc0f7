//! Configuration of the drives: serial ports and their axes.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::units::Counts;

/// A serial port and its axes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct PortConfig {
    /// The device file.
    pub device: PathBuf,
    /// Bits per second.
    #[serde(default = "default_baud")]
    pub baud: u32,
    /// The family of the drive that the port belongs to: it decides the command set on the line.
    #[serde(default)]
    pub family: Family,
    /// Timeout for a reply, in milliseconds.
    #[serde(default = "default_reply_timeout_ms")]
    pub reply_timeout_ms: u64,
    /// The file that saves the positions of the axes when the controller ends, relative to the
    /// folder of this file. With it, an axis without a saved position, or at another position at
    /// the next start, is not homed. Absent: the homing flag of the drive is trusted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub positions_file: Option<PathBuf>,
    /// The axes, one drive each. With more than one, the first drive is a gateway to the others
    /// over CAN, by node id.
    pub axes: Vec<AxisConfig>,
}

impl PortConfig {
    /// A port with every default.
    pub fn new(device: PathBuf, axes: Vec<AxisConfig>) -> Self {
        Self {
            device,
            baud: default_baud(),
            family: Family::default(),
            reply_timeout_ms: default_reply_timeout_ms(),
            positions_file: None,
            axes,
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

/// How setpoints act in the drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Streaming {
    /// Every setpoint acts at once: cyclic synchronous position (EPOS4), position mode (EPOS2).
    /// One write each.
    #[default]
    Cyclic,
    /// The drive ramps to every setpoint: profile position mode, EPOS4 only. Three writes each, so
    /// a third of the rate; the drive's own limits on speed and acceleration hold.
    Profile,
}

/// The homing methods.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum HomingMethod {
    /// The present position becomes zero (homing method 37). Nothing moves.
    #[default]
    Here,
    /// The hard stop in the positive direction, detected by the motor current.
    StopPositive,
    /// The hard stop in the negative direction, detected by the motor current.
    StopNegative,
}

fn default_baud() -> u32 {
    115_200
}

fn default_reply_timeout_ms() -> u64 {
    20
}

/// One drive and its motor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct AxisConfig {
    /// Motor of the model that this drive turns, 0 or 1; 2 for the auxiliary axis.
    pub motor: usize,
    /// Makes this the auxiliary axis (a gripper, or a roll): counts per degree of `jaw/servo_jp`,
    /// below zero if the motor turns the other way. It has no model and no hysteresis memory;
    /// limits, homing and faults are those of every axis, and its fault stops all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub auxiliary_counts_per_deg: Option<f64>,
    /// The family of the drive. Absent: that of its port.
    #[serde(default)]
    pub family: Option<Family>,
    /// How setpoints act in the drive.
    #[serde(default)]
    pub streaming: Streaming,
    /// CAN node id of the drive; 0 is the drive that the port belongs to.
    pub node_id: u8,
    /// Serial number of the drive (object 0x1018:04), so that swapped cables are refused: decimal,
    /// hexadecimal (0x...), or the number of 64 bits on the label, of which the lower half counts.
    #[serde(deserialize_with = "serial_number")]
    #[cfg_attr(test, schemars(with = "SerialNumber"))]
    pub serial_number: u64,
    /// Lowest position that may be commanded, in drive and loop, counts.
    pub position_min_counts: Counts,
    /// Highest position that may be commanded, in drive and loop, counts.
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
    /// The homing method.
    #[serde(default)]
    pub homing: HomingMethod,
    /// Motor current that detects the hard stop, mA, and the limit of the drive while it homes. Far
    /// below the strength of the wires, and below `current_limit_ma`.
    #[serde(default = "default_homing_current_ma")]
    pub homing_current_ma: u32,
    /// Position of the hard stop, counts. Only for homing against a stop.
    #[serde(default)]
    pub homing_stop_counts: Counts,
}

/// A serial number as people copy it.
#[derive(Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(untagged)]
enum SerialNumber {
    Number(u64),
    /// Decimal digits, or hexadecimal ones after `0x`. Numbers above 2^63 need quotes in TOML.
    Text(String),
}

/// The number as it was typed: an error has to show it.
fn serial_number<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<u64, D::Error> {
    let number = match SerialNumber::deserialize(deserializer) {
        Ok(SerialNumber::Number(number)) => Some(number),
        Ok(SerialNumber::Text(text)) => {
            let text = text.trim();
            match text.strip_prefix("0x").or_else(|| text.strip_prefix("0X")) {
                Some(digits) => u64::from_str_radix(digits, 16).ok(),
                None => text.parse().ok(),
            }
        }
        Err(_) => None,
    };
    // TOML holds no larger one, and the lower half is all that counts.
    let fits =
        |number| if number > i64::MAX as u64 { number & u64::from(u32::MAX) } else { number };
    number.map(fits).ok_or_else(|| {
        serde::de::Error::custom(
            "must be a serial number: decimal, hexadecimal (0x...), or that of 64 bits on the \
                 label of the drive",
        )
    })
}

impl AxisConfig {
    /// An axis with every default.
    pub fn new(motor: usize, serial_number: u32, limits: [Counts; 2]) -> Self {
        let [position_min_counts, position_max_counts] = limits;
        Self {
            motor,
            auxiliary_counts_per_deg: None,
            family: None,
            streaming: Streaming::default(),
            node_id: 0,
            serial_number: serial_number.into(),
            position_min_counts,
            position_max_counts,
            current_limit_ma: default_current_limit_ma(),
            following_error_counts: default_following_error_counts(),
            motor_speed_rpm: default_motor_speed_rpm(),
            homing: HomingMethod::default(),
            homing_current_ma: default_homing_current_ma(),
            homing_stop_counts: Counts(0),
        }
    }

    /// Lower half of the serial number, as reported by the drive (object 0x1018:04).
    pub const fn short_serial_number(&self) -> u32 {
        self.serial_number as u32
    }
}

fn default_current_limit_ma() -> u32 {
    100
}

fn default_following_error_counts() -> u32 {
    150
}

fn default_motor_speed_rpm() -> u32 {
    200
}

fn default_homing_current_ma() -> u32 {
    30
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::config::Config;

    use super::*;

    fn parse(port: &str, axis: &str) -> Result<Config, String> {
        let text = format!(
            "robot_id = \"test\"\n[[ports]]\ndevice = \"/dev/null\"\n{port}\n[[ports.axes]]\n\
             motor = 0\nnode_id = 0\n\
             serial_number = 1\nposition_min_counts = -100\nposition_max_counts = 100\n{axis}"
        );
        Config::parse(&text, Path::new("robot.toml")).map_err(|error| error.to_string())
    }

    #[test]
    fn port_without_family_is_an_epos4_with_stuffed_frames() {
        let config = parse("", "").unwrap();
        assert_eq!(config.ports[0].family, Family::Epos4);
        assert_eq!(config.axis(0).unwrap().homing, HomingMethod::Here);
        let port = PortConfig::new("/dev/null".into(), config.ports[0].axes.clone());
        assert_eq!(port, config.ports[0]);
        assert_eq!(AxisConfig::new(0, 1, [Counts(-100), Counts(100)]), config.ports[0].axes[0]);
    }

    #[test]
    fn impossible_axes_are_refused_with_the_reason() {
        let stop = "homing = \"stop-negative\"\nhoming_stop_counts = -90";
        for (port, axis) in [("family = \"epos2\"", ""), ("", stop)] {
            assert!(parse(port, axis).is_ok(), "{port} {axis}");
        }
        let second = "[[ports.axes]]\nmotor = 1\nnode_id = 0\nserial_number = 2\n\
                      position_min_counts = 0\nposition_max_counts = 1";
        let positions = "positions_file = \"p\"";
        let other_port = format!("[[ports]]\ndevice = \"/dev/zero\"\n{positions}\n{second}");
        for (port, axis, reason) in [
            ("family = \"epos2\"", "streaming = \"profile\"", "for EPOS4 only"),
            ("", "family = \"epos2\"\nstreaming = \"profile\"", "for EPOS4 only"),
            ("", "family = \"epos2\"\ncurrent_limit_ma = 70000", "at most 2000"),
            ("family = \"epos3\"", "", "epos2"),
            ("", second, "node_id = 0: is already named by another axis of the same port"),
            (positions, &other_port, "[1].positions_file = p: is already named by another port"),
            ("", "homing = \"stop-positive\"\nhoming_current_ma = 300", "how hard"),
            ("", "homing = \"stop-positive\"\nhoming_stop_counts = 101", "within the pos"),
        ] {
            let error = parse(port, axis).unwrap_err();
            assert!(error.contains(reason), "{port} {axis}: {error}");
        }
    }

    proptest::proptest! {
        /// A damaged file is refused or understood, and never ends the process.
        #[test]
        fn damaged_files_never_panic(cut in 0..400usize, byte: u8, place in 0..400usize) {
            let whole = "robot_id = \"r\"\n[[ports]]\ndevice = \"/dev/null\"\nbaud = 115200\n\
                         family = \"epos2\"\n\
                         [[ports.axes]]\nmotor = 0\nnode_id = 0\nserial_number = 1\n\
                         position_min_counts = -100\n\
                         position_max_counts = 100\nhoming = \"stop-positive\"\n";
            let mut damaged = whole.as_bytes().to_vec();
            let length = damaged.len();
            damaged[place % length] = byte;
            damaged.truncate(cut % length + length / 2);
            let _ = Config::parse(&String::from_utf8_lossy(&damaged), Path::new("robot.toml"));
        }
    }

    #[test]
    fn serial_numbers_are_read_as_people_copy_them() {
        let read = |number: &str| {
            toml::from_str::<AxisConfig>(&format!(
                "motor = 0\nnode_id = 0\nposition_min_counts = -1\nposition_max_counts = 1\n\
                 serial_number = {number}"
            ))
        };
        for number in ["70124480", "0x42E_03C0", "\"70124480\"", "\"0x042E03C0\"", "0x1_042E_03C0"]
        {
            let serial_number = read(number).unwrap().short_serial_number();
            assert_eq!(serial_number, 0x042E_03C0, "{number}");
        }
        assert_eq!(read("602060003005").unwrap().serial_number, 602_060_003_005, "as typed");
        let long = "\"0xF000_0000_0000_0007\"".replace('_', "");
        assert_eq!(read(&long).unwrap().serial_number, 7);
        for wrong in ["-1", "\"SN 12\"", "1.5"] {
            let error = read(wrong).unwrap_err().to_string();
            assert!(error.contains("must be a serial number"), "{error}");
        }
    }
}
