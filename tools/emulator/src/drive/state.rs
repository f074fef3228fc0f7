//! The CiA 402 state machine of the EPOS4: controlword commands and where they lead (reference
//! section 3.2).

/// States of the drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// Booting.
    NotReadyToSwitchOn,
    /// Booted or disabled; parameters can be set.
    SwitchOnDisabled,
    /// Shut down: next is switching on.
    ReadyToSwitchOn,
    /// Switched on, power stage still off.
    SwitchedOn,
    /// Power stage on, following the mode of operation.
    OperationEnabled,
    /// Stopped by quick stop; power stage on, holding.
    QuickStopActive,
    /// A fault is being reacted to.
    FaultReactionActive,
    /// A fault is latched; power stage off.
    Fault,
}

impl State {
    /// The bits of the statusword that tell the state, under the mask 0x006F.
    #[must_use]
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
    #[must_use]
    pub const fn is_powered(self) -> bool {
        matches!(
            self,
            Self::OperationEnabled | Self::QuickStopActive | Self::FaultReactionActive
        )
    }

    /// What logs say.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::NotReadyToSwitchOn => "not-ready",
            Self::SwitchOnDisabled => "switch-on-disabled",
            Self::ReadyToSwitchOn => "ready",
            Self::SwitchedOn => "switched-on",
            Self::OperationEnabled => "operation-enabled",
            Self::QuickStopActive => "quick-stop-active",
            Self::FaultReactionActive => "fault-reaction",
            Self::Fault => "fault",
        }
    }
}

/// What the low byte of a controlword commands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Command {
    /// 0xxx x110.
    Shutdown,
    /// 0xxx 0111: switch on, or disable operation.
    SwitchOn,
    /// 0xxx 1111: enable operation, passing switched on if need be.
    EnableOperation,
    /// 0xxx xx0x.
    DisableVoltage,
    /// 0xxx x01x.
    QuickStop,
}

impl Command {
    /// The command in a controlword. While bit 7 is set there is none: only its rising edge means
    /// something.
    #[must_use]
    pub const fn of(controlword: u16) -> Option<Self> {
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

    /// Where the command leads from `state`, or `None` if it means nothing there.
    #[must_use]
    pub const fn leads(self, state: State) -> Option<State> {
        use State::{
            OperationEnabled, QuickStopActive, ReadyToSwitchOn, SwitchOnDisabled, SwitchedOn,
        };
        match (self, state) {
            (Self::Shutdown, SwitchOnDisabled | SwitchedOn | OperationEnabled) => {
                Some(ReadyToSwitchOn)
            }
            (Self::SwitchOn, ReadyToSwitchOn | OperationEnabled) => Some(SwitchedOn),
            (Self::EnableOperation, ReadyToSwitchOn | SwitchedOn | QuickStopActive) => {
                Some(OperationEnabled)
            }
            (
                Self::DisableVoltage,
                ReadyToSwitchOn | SwitchedOn | OperationEnabled | QuickStopActive,
            ) => Some(SwitchOnDisabled),
            (Self::QuickStop, ReadyToSwitchOn | SwitchedOn) => Some(SwitchOnDisabled),
            (Self::QuickStop, OperationEnabled) => Some(QuickStopActive),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::State::*;
    use super::*;

    const ALL: [State; 8] = [
        NotReadyToSwitchOn,
        SwitchOnDisabled,
        ReadyToSwitchOn,
        SwitchedOn,
        OperationEnabled,
        QuickStopActive,
        FaultReactionActive,
        Fault,
    ];

    #[test]
    fn patterns_of_the_controlword() {
        for (controlword, command) in [
            (0x0000, Some(Command::DisableVoltage)),
            (0x000D, Some(Command::DisableVoltage)),
            (0x0002, Some(Command::QuickStop)),
            (0x000B, Some(Command::QuickStop)),
            (0x0006, Some(Command::Shutdown)),
            (0x000E, Some(Command::Shutdown)),
            (0x0007, Some(Command::SwitchOn)),
            (0x000F, Some(Command::EnableOperation)),
            (0x003F, Some(Command::EnableOperation)),
            (0x010F, Some(Command::EnableOperation)),
            (0x0080, None),
            (0x008F, None),
        ] {
            assert_eq!(Command::of(controlword), command, "{controlword:04X}");
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
            for from in ALL {
                let expected = table
                    .iter()
                    .find(|row| row.0 == controlword && row.1 == from)
                    .map(|row| row.2);
                let command = Command::of(controlword).unwrap();
                assert_eq!(
                    command.leads(from),
                    expected,
                    "{controlword:02X} in {}",
                    from.name()
                );
            }
        }
    }

    #[test]
    fn the_masked_bits_are_the_states() {
        let mut seen: Vec<u16> = ALL.iter().map(|state| state.bits()).collect();
        assert!(seen.iter().all(|bits| bits & !0x6F == 0));
        seen.sort_unstable();
        seen.dedup();
        assert_eq!(seen.len(), ALL.len());
    }
}
