//! H05: ports or axes swapped. Every drive is known by its serial number.

use crate::rig::{Rig, wait_for_end};

#[test]
fn h05_swapped_cables_are_refused_before_a_drive_is_touched() {
    let mut rig = Rig::new();
    let [first, second] = [0, 1].map(|port| rig.config.ports[port].device.clone());
    (rig.config.ports[0].device, rig.config.ports[1].device) = (second, first);
    let mut child = rig.spawn_controller("controller");
    assert_eq!(
        wait_for_end(&mut child).expect("it gives up").code(),
        Some(1)
    );
    let text = rig.said("controller");
    let complaint = text.lines().last().unwrap();
    let numbers = [0, 1].map(|port| rig.config.ports[port].axes[0].serial_number.to_string());
    assert!(
        complaint.starts_with("error: ") && numbers.iter().all(|number| complaint.contains(number)),
        "{text}"
    );
    for axis in 0..2 {
        assert!(rig.setpoints(axis).is_empty());
    }
}
