//! The CiA 402 state machine: controlword commands and transitions (reference, section 3.2).

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, strum::IntoStaticStr)]
#[cfg_attr(test, derive(strum::VariantArray))]
#[strum(serialize_all = "kebab-case")]
pub enum State {
    #[default]
    #[strum(serialize = "not-ready")]
    NotReadyToSwitchOn,
    /// Booted, power stage off; parameters can be set.
    SwitchOnDisabled,
    #[strum(serialize = "ready")]
    ReadyToSwitchOn,
    /// Switched on, power stage still off.
    SwitchedOn,
    /// Power stage on, following the mode of operation.
    OperationEnabled,
    /// Stopped by quick stop; power stage on, holding.
    QuickStopActive,
    #[strum(serialize = "fault-reaction")]
    FaultReactionActive,
    /// A fault is latched; power stage off.
    Fault,
}

impl State {
    /// The bits of the statusword for the state, under the mask 0x006F.
    pub const fn bits(self) -> u16 {
        match self {
            Self::NotReadyToSwitchOn => 0x00,
            Self::SwitchOnDisabled => 0x40,
            Self::ReadyToSwitchOn => 0x21,
            Self::SwitchedOn => 0x23,
            Self::OperationEnabled => 0x27,
            Self::QuickStopActive => 0x07,
            Self::FaultReactionActive => 0x0F,
            Self::Fault => 0x08,
        }
    }

    /// Whether the power stage is on.
    pub const fn is_powered(self) -> bool {
        matches!(self, Self::OperationEnabled | Self::QuickStopActive | Self::FaultReactionActive)
    }

    /// Its name in the log.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

/// Device control commands, the low byte of a controlword.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DeviceCommand {
    /// 0xxx x110.
    Shutdown,
    /// 0xxx 0111: switch on, or disable operation.
    SwitchOn,
    /// 0xxx 1111: enable operation, through switched on if necessary.
    EnableOperation,
    /// 0xxx xx0x.
    DisableVoltage,
    /// 0xxx x01x.
    QuickStop,
}

impl DeviceCommand {
    /// The command in a controlword; none while bit 7 is set: only its rising edge has an effect.
    pub const fn from_controlword(controlword: u16) -> Option<Self> {
        if controlword & 0x80 != 0 {
            return None;
        }
        Some(match controlword & 0x0F {
            0x2 | 0x3 | 0xA | 0xB => Self::QuickStop,
            0x6 | 0xE => Self::Shutdown,
            0x7 => Self::SwitchOn,
            0xF => Self::EnableOperation,
            _ => Self::DisableVoltage,
        })
    }

    /// The state after the command in `state`, or `None` if it has no effect there.
    pub const fn next_state(self, state: State) -> Option<State> {
        use State::*;
        Some(match (self, state) {
            (Self::Shutdown, SwitchOnDisabled | SwitchedOn | OperationEnabled) => ReadyToSwitchOn,
            (Self::SwitchOn, ReadyToSwitchOn | OperationEnabled) => SwitchedOn,
            (Self::EnableOperation, ReadyToSwitchOn | SwitchedOn | QuickStopActive) => {
                OperationEnabled
            }
            (Self::DisableVoltage | Self::QuickStop, ReadyToSwitchOn | SwitchedOn)
            | (Self::DisableVoltage, OperationEnabled | QuickStopActive) => SwitchOnDisabled,
            (Self::QuickStop, OperationEnabled) => QuickStopActive,
            _ => return None,
        })
    }
}

/// The present task of the drive. Positions are counts of the motor.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) enum Task {
    #[default]
    Off,
    Hold,
    /// The demand is object 0x607A.
    Cyclic,
    /// A trapezoidal profile to a target.
    Profile {
        target: f64,
    },
    /// The speed of object 0x60FF, reached by ramps.
    Velocity,
    /// The speed of object 0x60FF at once.
    CyclicVelocity,
    /// The torque of object 0x6071.
    Torque,
    /// Moves towards a hard stop, counts per second, until the current has been high for a while.
    SearchStop {
        speed: f64,
        pressed_s: f64,
    },
    /// A ramp to standstill, counts per second squared; then holds, or enters a powerless state.
    Brake {
        deceleration: f64,
        then: Option<State>,
    },
}

impl Task {
    /// Whether the drive is about to leave its present state.
    pub(super) const fn is_leaving(self) -> bool {
        matches!(self, Self::Brake { then: Some(_), .. })
    }
}

#[cfg(test)]
mod tests {
    use strum::VariantArray;

    use super::State::*;
    use super::*;

    #[test]
    fn controlword_patterns_are_commands() {
        for (command, controlwords) in [
            (Some(DeviceCommand::DisableVoltage), &[0x0000, 0x000D][..]),
            (Some(DeviceCommand::QuickStop), &[0x0002, 0x000B]),
            (Some(DeviceCommand::Shutdown), &[0x0006, 0x000E]),
            (Some(DeviceCommand::SwitchOn), &[0x0007]),
            (Some(DeviceCommand::EnableOperation), &[0x000F, 0x003F, 0x010F]),
            (None, &[0x0080, 0x008F]),
        ] {
            for controlword in controlwords {
                let found = DeviceCommand::from_controlword(*controlword);
                assert_eq!(found, command, "{controlword:04X}");
            }
        }
    }

    #[test]
    fn every_transition_of_the_table_and_no_other() {
        let table = [
            (0x06, SwitchOnDisabled, ReadyToSwitchOn),
            (0x06, SwitchedOn, ReadyToSwitchOn),
            (0x06, OperationEnabled, ReadyToSwitchOn),
            (0x07, ReadyToSwitchOn, SwitchedOn),
            (0x07, OperationEnabled, SwitchedOn),
            (0x0F, ReadyToSwitchOn, OperationEnabled),
            (0x0F, SwitchedOn, OperationEnabled),
            (0x0F, QuickStopActive, OperationEnabled),
            (0x00, ReadyToSwitchOn, SwitchOnDisabled),
            (0x00, SwitchedOn, SwitchOnDisabled),
            (0x00, OperationEnabled, SwitchOnDisabled),
            (0x00, QuickStopActive, SwitchOnDisabled),
            (0x02, ReadyToSwitchOn, SwitchOnDisabled),
            (0x02, SwitchedOn, SwitchOnDisabled),
            (0x02, OperationEnabled, QuickStopActive),
        ];
        for controlword in [0x00u16, 0x02, 0x06, 0x07, 0x0F] {
            for from in State::VARIANTS {
                let row = table.iter().find(|row| row.0 == controlword && row.1 == *from);
                let command = DeviceCommand::from_controlword(controlword).unwrap();
                let expected = row.map(|row| row.2);
                assert_eq!(command.next_state(*from), expected, "{controlword:02X} in {from:?}");
            }
        }
    }

    #[test]
    fn status_bits_identify_the_states() {
        let mut bits: Vec<u16> = State::VARIANTS.iter().map(|state| state.bits()).collect();
        assert!(bits.iter().all(|bits| bits & !0x6F == 0));
        bits.sort_unstable();
        bits.dedup();
        assert_eq!(bits.len(), 8);
    }
}
