//! Fault detection: which fault the drives and monitors show, and the demands to the drives then.

use crate::core::drive_status::{DriveStatus, DriveSummary, ExpectedPower};
use crate::drive::{AxisPhase, Demand};
use crate::robot::Fault;
use crate::units::{MAX_AXES, Nanos};

/// The gravest present fault. Faults of drives come first.
pub(crate) fn detect_fault(summary: &DriveSummary, expected: ExpectedPower) -> Option<Fault> {
    let is_on = expected == ExpectedPower::On;
    let drive_fault = summary
        .drives()
        .filter_map(|drive| detect_drive_fault(drive, expected, summary.lost_after))
        .min_by_key(|fault| fault.number());
    let others = [
        (!summary.is_model_finite, Fault::Model),
        (is_on && summary.is_overrun, Fault::Late),
        (is_on && summary.is_implausible, Fault::Implausible),
    ];
    let other = others.into_iter().find(|(is_present, _)| *is_present);
    drive_fault.or(other.map(|(_, fault)| fault))
}

/// Fault of one drive.
fn detect_drive_fault(
    drive: &DriveStatus,
    expected: ExpectedPower,
    lost_after: Nanos,
) -> Option<Fault> {
    match drive.phase {
        AxisPhase::Faulted => Some(Fault::Drive),
        AxisPhase::Lost => Some(Fault::Link),
        // A drive that starts again had been lost. Before its first start it has no position, so
        // its age means nothing.
        AxisPhase::Starting => (expected != ExpectedPower::Off).then_some(Fault::Link),
        _ if drive.age >= lost_after => Some(Fault::Link),
        phase if expected == ExpectedPower::On && phase != AxisPhase::Enabled => {
            Some(Fault::DriveState)
        }
        _ if drive.has_following_error => Some(Fault::FollowingError),
        _ => drive.has_over_current.then_some(Fault::Current),
    }
}

/// Demands to the drives in a fault: drives that work hold by quick stop, all others are switched
/// off. The reasons are in the documentation of [`crate::core::faults`].
pub(crate) fn fault_demands(summary: &DriveSummary, expected: ExpectedPower) -> [Demand; MAX_AXES] {
    let mut demands = [Demand::Disabled; MAX_AXES];
    for (demand, drive) in demands.iter_mut().zip(&summary.axes) {
        let Some(drive) = drive else { continue };
        let is_cause = match detect_drive_fault(drive, expected, summary.lost_after) {
            Some(Fault::Drive | Fault::DriveState | Fault::FollowingError | Fault::Current) => true,
            Some(_) | None => false,
        };
        if expected == ExpectedPower::On && !is_cause {
            *demand = Demand::QuickStop;
        }
    }
    demands
}
