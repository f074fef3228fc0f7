//! Parameters of a drive.

use super::family::Family;
use super::motor::MotorConfig;

#[derive(Debug, Clone, PartialEq)]
pub struct DriveConfig {
    pub family: Family,
    /// CAN node id (object 0x2000). The drive also answers to 0.
    pub node_id: u8,
    /// Serial number (objects 0x1018:04 and 0x2100:01; EPOS2 0x2004).
    pub serial_number: u32,
    pub motor: MotorConfig,
    /// Time without any reply after a reset or power-up, milliseconds.
    pub boot_ms: u64,
    /// A fault that is present after every boot, such as 0x8120 when no CAN bus is connected.
    pub boot_fault: Option<u16>,
    /// Data words of an error reply to a read, 2 or 4. maxon does not document which it is.
    pub error_reply_words: u8,
    /// Fill the unused upper bytes of short values with garbage, as first-generation drives do.
    pub fill_unused_bytes: bool,
    /// Maximum bytes in one segment of a segmented read, 1 to 255.
    pub segment_bytes: u8,
    /// Timeout of a request to another node, milliseconds.
    pub gateway_timeout_ms: u64,
    /// Whether interpolation (0x60C2:01 above 0) expects setpoints in time over a serial line too:
    /// fault 0x8250.
    pub interpolation_timeout: bool,
}

impl Default for DriveConfig {
    fn default() -> Self {
        Self {
            family: Family::default(),
            node_id: 1,
            serial_number: 62_000_001,
            motor: MotorConfig::default(),
            boot_ms: 300,
            boot_fault: None,
            error_reply_words: 2,
            fill_unused_bytes: true,
            segment_bytes: 255,
            gateway_timeout_ms: 100,
            interpolation_timeout: true,
        }
    }
}
