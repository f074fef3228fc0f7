//! H05: ports or axes swapped. Every drive is identified by its serial number.

use i2ris_testing::{Rig, wait_for_end};

#[test]
fn h05_swapped_cables_are_refused_before_a_drive_is_changed() {
    let mut rig = Rig::start();
    let [first, second] = [0, 1].map(|port| rig.config.ports[port].device.clone());
    (rig.config.ports[0].device, rig.config.ports[1].device) = (second, first);
    let mut child = rig.spawn_controller("controller");
    assert_eq!(wait_for_end(&mut child).code(), Some(1));
    let text = rig.log_text("controller");
    let error = text.lines().last().unwrap();
    assert!(error.starts_with("error: "), "{text}");
    for port in 0..2 {
        let number = rig.config.ports[port].axes[0].serial_number.to_string();
        assert!(error.contains(&number), "{text}");
        assert!(rig.setpoints(port).is_empty());
    }
}
