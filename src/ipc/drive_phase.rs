//! The phases of a drive as numbers in payloads.

use crate::drive::AxisPhase;

/// The number of a drive phase in [`crate::ipc::payload::ActuatorState::phase`].
#[must_use]
pub const fn phase_number(phase: AxisPhase) -> u8 {
    match phase {
        AxisPhase::Starting => 0,
        AxisPhase::Disabled => 1,
        AxisPhase::Enabling => 2,
        AxisPhase::Enabled => 3,
        AxisPhase::Homing => 4,
        AxisPhase::QuickStopped => 5,
        AxisPhase::Disabling => 6,
        AxisPhase::Faulted => 7,
        AxisPhase::Lost => 8,
    }
}

/// The text for a number of [`crate::ipc::payload::ActuatorState::phase`].
#[must_use]
pub const fn phase_text(number: u8) -> &'static str {
    match number {
        0 => "starting",
        1 => "disabled",
        2 => "enabling",
        3 => "enabled",
        4 => "homing",
        5 => "quick-stopped",
        6 => "disabling",
        7 => "at fault",
        8 => "lost",
        _ => "unknown",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_phase_has_a_text() {
        assert_eq!(phase_text(phase_number(AxisPhase::Enabled)), "enabled");
        assert_eq!(phase_text(phase_number(AxisPhase::Lost)), "lost");
        assert_eq!(phase_text(phase_number(AxisPhase::Lost) + 1), "unknown");
    }
}
