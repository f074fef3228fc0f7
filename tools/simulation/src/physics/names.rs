//! Names of the physics.

use strum::{Display, EnumString, VariantArray, VariantNames};

/// A theory of hysteresis.
#[derive(
    Debug,
    Clone,
    Copy,
    PartialEq,
    Eq,
    Hash,
    PartialOrd,
    Ord,
    Display,
    EnumString,
    VariantArray,
    VariantNames,
)]
#[strum(serialize_all = "kebab-case")]
pub enum Physics {
    /// Gear, loose wires, bristles and segments: the physics of the files in `config/snakes`.
    Springs,
    /// Generalised, asymmetric Prandtl-Ishlinskii.
    PrandtlIshlinskii,
    /// Relays with a density.
    Preisach,
    /// A differential equation of the lost travel, in two axes.
    BoucWen,
    /// Friction that grows with the travel since a reversal.
    Dahl,
    /// Bristles with the Stribeck effect: depends on speed.
    #[strum(serialize = "lugre")]
    LuGre,
    /// A wire in pieces with capstan friction.
    Wire,
    /// A gear with lost motion and compliance.
    Gear,
    /// The same gear with a transmission error, which repeats with the turn of the motor.
    TransmissionError,
    /// A snake that creeps under its load: depends on time.
    Creep,
    /// Friction that acts on both wires as one vector.
    VectorFriction,
}

impl Physics {
    pub const ALL: &[Self] = <Self as VariantArray>::VARIANTS;

    pub const NAMES: &[&str] = <Self as VariantNames>::VARIANTS;

    /// Whether the angles depend on the path of the motors alone, at whatever speed.
    pub fn is_rate_independent(self) -> bool {
        !matches!(self, Self::Springs | Self::LuGre | Self::Creep)
    }

    /// Short description.
    pub fn summary(self) -> &'static str {
        match self {
            Self::Springs => "gear, loose wires, friction by bristles, segments",
            Self::PrandtlIshlinskii => "plays with different rising and falling branches",
            Self::Preisach => "relays with a density",
            Self::BoucWen => "a differential equation of the lost travel",
            Self::Dahl => "friction that grows with the travel since a reversal",
            Self::LuGre => "bristles with the Stribeck effect; depends on speed",
            Self::Wire => "a wire in pieces with capstan friction",
            Self::Gear => "a gear with lost motion and compliance",
            Self::TransmissionError => {
                "the same gear, and an error that repeats with the motor's turn"
            }
            Self::Creep => "a snake that creeps under its load; depends on time",
            Self::VectorFriction => "friction that acts on both wires as one vector",
        }
    }
}
