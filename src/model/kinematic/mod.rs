//! Where the tip of a bent snake is.
//!
//! The snake has twelve rolling joints, six per axis, which share the bend equally.
//!
//! | file | contents |
//! |---|---|
//! | `bend` | which bend brings the tip to a place |
//! | `tip` | from the angles of the joints to the position of the tip |

mod bend;
mod tip;

pub(crate) use bend::bend_rates;
pub use bend::bend_to;
pub use tip::JOINT_PITCH_MM;

use crate::model::estimate::OutputUnit;

/// Number of pitch joints, and of yaw joints (the robot's drawing).
pub const JOINTS_PER_AXIS: usize = 6;

/// Radius of the rolling surfaces, mm (the robot's drawing).
pub const ROLLING_RADIUS_MM: f64 = 0.75;

/// Stop angle of a joint, rad (8.75 deg by the robot's drawing).
pub const STOP_RAD: f64 = 8.75 * std::f64::consts::PI / 180.0;

/// Tip position of a bent snake.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TipPosition {
    /// x, y and z at the base, m: z along the straight snake, yaw bends towards x, pitch towards y.
    pub position_m: [f64; 3],
    /// The derivative of the position with respect to pitch, and to yaw, m per rad.
    pub slope_m_per_rad: [[f64; 3]; 2],
}

/// The tip of a snake that bends by a pitch and a yaw in total, rad, shared equally by its joints.
#[must_use]
pub fn tip_position(pitch: f64, yaw: f64) -> TipPosition {
    let joints = JOINTS_PER_AXIS as f64;
    let tip = tip::tip(pitch / joints, yaw / joints);
    let metres = OutputUnit::Mm.si();
    let column = |axis: usize| (tip.slope.column(axis) * (metres / joints)).into();
    TipPosition {
        position_m: (tip.position_mm * metres).into(),
        slope_m_per_rad: [column(0), column(1)],
    }
}

/// Base, twelve joints and tip of a snake that bends by `pitch` and `yaw` in all, rad: thirteen
/// positions, mm. z is along the straight snake, yaw bends it towards x, pitch towards y.
#[must_use]
pub fn shape_mm(pitch: f64, yaw: f64) -> [[f64; 3]; 2 * JOINTS_PER_AXIS + 1] {
    tip::shape(pitch, yaw)
}
