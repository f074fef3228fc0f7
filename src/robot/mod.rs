//! The vocabulary of the robot: states, commands, refusals, faults, and the reasons shown to
//! people. Core, process, shared memory and clients use this module. It depends on none of them.

/// Declares an enum with fixed numbers for payloads, the conversion from a number, and a display
/// text, with which the documentation of a value begins. After `=>`: the recommended action.
macro_rules! numbered_enum {
    ($(#[$meta:meta])* $name:ident {
        $($(#[$vmeta:meta])* $variant:ident = $number:literal, $text:literal => $advice:literal;)*
    }) => {
        numbered_enum! { $(#[$meta])* $name { $($(#[$vmeta])* $variant = $number, $text;)* } }

        impl $name {
            pub(super) const fn advice(self) -> &'static str {
                match self {
                    $(Self::$variant => $advice,)*
                }
            }
        }
    };
    ($(#[$meta:meta])* $name:ident {
        $($(#[$vmeta:meta])* $variant:ident = $number:literal, $text:literal;)*
    }) => {
        $(#[$meta])*
        #[derive(
            Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize,
        )]
        #[repr(u32)]
        pub enum $name {
            $(#[doc = concat!($text, ".\n")] $(#[$vmeta])* $variant = $number,)*
        }

        impl $name {
            /// All values, in the order of their numbers.
            pub const ALL: &'static [Self] = &[$(Self::$variant,)*];

            /// The value with this number.
            #[must_use]
            pub fn from_number(number: u32) -> Option<Self> {
                Self::ALL.iter().copied().find(|value| *value as u32 == number)
            }

            /// The number of this value in payloads.
            #[must_use]
            pub const fn number(self) -> u32 {
                self as u32
            }

            /// The display text.
            #[must_use]
            pub const fn text(self) -> &'static str {
                match self {
                    $(Self::$variant => $text,)*
                }
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(self.text())
            }
        }
    };
}

mod drive;
mod measurement;
mod operating_state;
mod reason;
mod refusal;
mod requests;

pub use drive::{AxisPhase, DriveFingerprint, DrivePower, KnownPower};
pub use measurement::{Measurement, Quantity};
pub use operating_state::{Clip, Fault, OperatingState, Stop};
pub use reason::{Cause, Reason};
pub use refusal::{REFUSED_CLIENTS, Refusal};
pub use requests::{
    FixtureAction, FixtureKind, MaskedClientId, ModelAction, ModelId, StateCommand,
};
