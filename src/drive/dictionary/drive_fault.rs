//! Faults of drives: cause, reaction of the drive, and remedy.

use std::fmt;
use std::ops::RangeInclusive;

use crate::config::Family;

/// The error codes of the families; a row starts with its code.
const TABLE: &str = include_str!("error_codes.md");

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DriveFault {
    pub code: u16,
    pub name: &'static str,
    /// Cause of the fault; empty if unknown.
    pub cause: &'static str,
    /// Remedy; empty if unknown.
    pub remedy: &'static str,
    pub reaction: FaultReaction,
    /// Whether resetting it clears the position: the axis must be homed again.
    pub clears_position: bool,
    /// Whether only a reset of the communication clears it.
    pub resets_communication: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FaultReaction {
    /// Power off at once, without a controlled stop.
    Off,
    /// According to the fault-reaction option: quick-stop ramp, then off.
    Ramp,
    /// According to the abort-connection option.
    ConnectionLost,
    Warning,
    Unknown,
}

impl DriveFault {
    /// The meaning of an error code of a family. Allocates nothing.
    pub(crate) fn look_up(family: Family, code: u16) -> Self {
        let rows = TABLE.lines().filter_map(parse_row);
        let mut rows = rows.filter(|(codes, row, _)| is_of(row, family) && codes.contains(&code));
        let fault = rows.next().map(|(.., fault)| Self { code, ..fault });
        fault.unwrap_or_else(|| Self::unknown(code))
    }

    /// Looks up a code without knowing the drive's family. If the families differ, it has no name.
    pub fn look_up_any(code: u16) -> Self {
        let [epos4, epos2] = [Family::Epos4, Family::Epos2].map(|it| Self::look_up(it, code));
        match (epos4.reaction, epos2.reaction) {
            (FaultReaction::Unknown, _) => epos2,
            (_, FaultReaction::Unknown) => epos4,
            _ if epos4 == epos2 => epos4,
            _ => Self { name: "see the log of the controller", ..Self::unknown(code) },
        }
    }

    const fn unknown(code: u16) -> Self {
        Self {
            code,
            name: if code == 0 { "no error" } else { "unknown error" },
            cause: "",
            remedy: "",
            reaction: FaultReaction::Unknown,
            clears_position: false,
            resets_communication: false,
        }
    }
}

/// Name of a family in messages and in the table.
pub(in crate::drive) fn family_name(family: Family) -> &'static str {
    match family {
        Family::Epos4 => "EPOS4",
        Family::Epos2 => "EPOS2",
    }
}

/// Whether a row with this family applies to a drive.
fn is_of(row: &str, family: Family) -> bool {
    [family_name(family), "both"].contains(&row)
}

/// The codes of a row, their family and meaning; `None`: not a row of a code.
fn parse_row(line: &'static str) -> Option<(RangeInclusive<u16>, &'static str, DriveFault)> {
    let mut cells = line.strip_prefix("| 0x")?.strip_suffix(" |")?.split(" | ");
    let codes = cells.next()?;
    let (first, last) = codes.split_once("-0x").unwrap_or((codes, codes));
    let hexadecimal = |digits| u16::from_str_radix(digits, 16).ok();
    let (first, last) = (hexadecimal(first)?, hexadecimal(last)?);
    let family = cells.next()?;
    let reaction = match cells.next()? {
        "off" => FaultReaction::Off,
        "ramp" => FaultReaction::Ramp,
        "option" => FaultReaction::ConnectionLost,
        "warning" => FaultReaction::Warning,
        _ => return None,
    };
    let (clears_position, resets_communication) =
        (cells.next()? == "lost", cells.next()? == "reset");
    let (name, cause, remedy) = (cells.next()?, cells.next()?, cells.next()?);
    let fault = DriveFault {
        code: first,
        name,
        cause,
        remedy,
        reaction,
        clears_position,
        resets_communication,
    };
    Some((first..=last, family, fault))
}

impl fmt::Display for DriveFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { code, name, cause, remedy, .. } = self;
        write!(f, "0x{code:04X} ({name})")?;
        f.write_str(match self.reaction {
            FaultReaction::Off => ", power off at once",
            FaultReaction::Ramp => ", stopped by the ramp",
            FaultReaction::ConnectionLost => ", stopped according to its abort-connection option",
            FaultReaction::Warning => ", a warning only",
            FaultReaction::Unknown => "",
        })?;
        if !remedy.is_empty() {
            write!(f, ": {cause}; {remedy}")?;
        }
        if self.resets_communication {
            f.write_str("; if it persists, switch the supply of the drive off and on")?;
        }
        if self.clears_position {
            f.write_str("; the position is lost: home the axis")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use Family::{Epos2, Epos4};

    use super::*;

    /// The rows of a family, in the order of their codes.
    fn rows(family: Family) -> Vec<(RangeInclusive<u16>, DriveFault)> {
        let rows = TABLE.lines().filter_map(parse_row).filter(|(_, row, _)| is_of(row, family));
        let mut rows: Vec<_> = rows.map(|(codes, _, fault)| (codes, fault)).collect();
        rows.sort_by_key(|(codes, _)| *codes.start());
        rows
    }

    fn codes(family: Family, is_counted: fn(&DriveFault) -> bool) -> Vec<u16> {
        let counted = rows(family).into_iter().filter(|(_, fault)| is_counted(fault));
        counted.map(|(codes, _)| *codes.start()).collect()
    }

    #[test]
    fn every_row_is_read_and_no_code_has_two_meanings() {
        let lines = TABLE.lines().filter(|line| line.starts_with("| 0x"));
        assert_eq!(lines.count(), TABLE.lines().filter_map(parse_row).count());
        for (family, count) in [(Epos4, 73), (Epos2, 36)] {
            let rows = rows(family);
            assert_eq!(rows.len(), count);
            for pair in rows.windows(2) {
                assert!(pair[0].0.end() < pair[1].0.start(), "{pair:?}");
            }
            for (_, fault) in rows {
                assert!(!fault.cause.is_empty() && !fault.remedy.is_empty(), "{fault}");
                assert!(!fault.to_string().contains('|') && fault.to_string().len() < 300);
            }
        }
    }

    #[test]
    fn the_position_is_lost_by_these_faults_and_no_other() {
        let lost = |fault: &DriveFault| fault.clears_position;
        let epos4 = [0x7380, 0x7381, 0x7382, 0x7388, 0x7389, 0x738A, 0x7392, 0xFF02];
        assert_eq!(codes(Epos4, lost), epos4);
        let epos2 = [0xFF01, 0xFF02, 0xFF03, 0xFF04, 0xFF08, 0xFF0A, 0xFF11];
        assert_eq!(codes(Epos2, lost), epos2);
        for family in [Epos4, Epos2] {
            assert_eq!(codes(family, |fault| fault.resets_communication), [0x8120, 0x8130]);
        }
    }

    #[test]
    fn fault_text_states_meaning_and_remedy() {
        let text = DriveFault::look_up(Epos4, 0x8611).to_string();
        let begin = "0x8611 (following error), stopped by the ramp: the motor was further";
        assert!(text.starts_with(begin) && text.contains("then acknowledge"), "{text}");
        let look_up = |family, code| DriveFault::look_up(family, code);
        assert!(look_up(Epos4, 0x7380).to_string().ends_with("home the axis"));
        assert_eq!(look_up(Epos4, 0x6195).name, "internal software error");
        assert_eq!(look_up(Epos4, 0xFF18).name, "auto tuning");
        assert_eq!(look_up(Epos4, 0).to_string(), "0x0000 (no error)");
        assert_eq!(look_up(Epos4, 0x4242).name, "unknown error");
        assert_eq!(DriveFault::look_up_any(0x8611), look_up(Epos2, 0x8611));
        assert_eq!(DriveFault::look_up_any(0x7380), look_up(Epos4, 0x7380));
        assert_eq!(DriveFault::look_up_any(0xFF01).remedy, "");
        // The same number is a different error on an EPOS2.
        assert_eq!(look_up(Epos4, 0xFF01).reaction, FaultReaction::Warning);
        assert_eq!(look_up(Epos2, 0xFF01).name, "Hall sensor");
        assert_eq!(look_up(Epos2, 0x7380).reaction, FaultReaction::Unknown);
    }
}
