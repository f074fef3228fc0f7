//! Ports that are opened again.

use i2ris::drive::epos4::Epos4;
use i2ris::drive::object;
use i2ris::drive::transport::Transport;
use i2ris_testing::drive::NODE;

use super::*;

/// The port is healthy, so the operating system has not closed it.
#[test]
fn port_is_reopened_after_error_other_than_hang_up() {
    let rig = Rig::on(Line::Rs232);
    let mut port = SerialTransport::open(&rig.config.ports[0]).unwrap();
    for _ in 0..2 {
        port.reopen().unwrap();
    }
    let mut link = DriveLink::new(port, &Epos4::Cyclic, &rig.config.ports[0]);
    assert_eq!(link.read(NODE, object::VENDOR), Ok(object::MAXON));
}
