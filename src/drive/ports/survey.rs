//! Search for drives: the rate, and the nodes of a port. Reads identities, writes nothing.

use crate::config::PortConfig;
use crate::drive::bring_up::{DriveNode, explain, learn_constants};
use crate::drive::epos2::Epos2;
use crate::drive::epos4::Epos4;
use crate::drive::error::{AxisError, DriveError};
use crate::drive::family::DriveFamily;
use crate::drive::family_selection::family_of_port;
use crate::drive::link::{DriveLink, GATEWAY_TIMEOUT, LOCAL_NODE};
use crate::drive::object;
use crate::drive::serial_transport::SerialTransport;
use crate::drive::transport::Transport;
use crate::units::Nanos;

/// The rates that drives are used at, the most frequent first.
const RATES: [u32; 6] = [115_200, 1_000_000, 38_400, 57_600, 19_200, 9600];

/// Silence after which a drive discards bytes of another rate: its frame timeout as delivered.
const FORGETS: Nanos = Nanos::from_millis(500);

/// Last node that is tried, starting at 1.
const LAST_NODE: u8 = 8;

/// Time that a reply may take where no loop waits for it: a loaded computer delays replies.
const UNHURRIED: Nanos = Nanos::from_millis(200);

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FoundNode {
    pub node_id: u8,
    pub family: &'static str,
    /// Firmware version, in hexadecimal as maxon writes it.
    pub firmware: u16,
    pub serial_number: u32,
}

/// The port for a question that no loop waits for.
pub(in crate::drive) fn unhurried(config: &PortConfig) -> PortConfig {
    patient(config, UNHURRIED)
}

fn patient(config: &PortConfig, timeout: Nanos) -> PortConfig {
    let reply_timeout_ms = config.reply_timeout_ms.max(timeout.0 / 1_000_000);
    PortConfig { reply_timeout_ms, ..config.clone() }
}

/// Another rate at which a drive of any family answers on a port. Takes some seconds.
pub fn answering_rate(config: &PortConfig) -> Option<u32> {
    RATES.into_iter().filter(|rate| *rate != config.baud).find(|&baud| {
        let config = PortConfig { baud, ..unhurried(config) };
        let Ok(mut line) = SerialTransport::open(&config) else { return false };
        line.sleep_until(line.now() + FORGETS);
        DriveLink::new(line, family_of_port(&config), &config)
            .is_understood(LOCAL_NODE, object::VENDOR.address())
    })
}

/// The drives of a port by node id: the drive at the port and those behind its gateway. Fails when
/// the port cannot be opened, or its drive does not answer.
pub fn nodes(config: &PortConfig) -> Result<Vec<FoundNode>, DriveError> {
    let patient = patient(config, GATEWAY_TIMEOUT);
    let Some(first) = config.axes.first() else { return Ok(Vec::new()) };
    let line = SerialTransport::open(&patient)?;
    let mut link = DriveLink::new(line, family_of_port(&patient), &patient);
    learn_constants(&mut link).map_err(|error| explain(config, first, error))?;
    Ok(nodes_on(&mut link))
}

/// Searches nodes on a line whose drive is known, see [`nodes`].
pub fn nodes_on(link: &mut DriveLink<impl Transport>) -> Vec<FoundNode> {
    link.wait_for_gateway(true);
    let mut found = Vec::new();
    for node in 1..=LAST_NODE {
        if link.is_answered(node, object::SERIAL_NUMBER.address()) {
            found.extend(identify(link, node).ok());
        } else if !link.is_in_sync() {
            // Nothing answers any more: further nodes would each cost as much.
            break;
        }
    }
    link.wait_for_gateway(false);
    found
}

/// Only an EPOS2 has its firmware version in an object of its own.
fn identify(link: &mut DriveLink<impl Transport>, node: u8) -> Result<FoundNode, AxisError> {
    let mut drive = DriveNode::new(link, node);
    let serial_number = drive.read(object::SERIAL_NUMBER)?;
    let mut firmware = |family: &dyn DriveFamily| {
        drive.read_firmware(family.object_map().firmware_version).map(|it| (family.name(), it))
    };
    let (family, firmware) = firmware(&Epos2).or_else(|_| firmware(&Epos4::Cyclic))?;
    Ok(FoundNode { node_id: node, family, firmware, serial_number })
}
