//! Properties of a recording that need no model of a family.
//!
//! | file | contents |
//! |---|---|
//! | `overview` | all of it together |
//! | `noise` | noise of the measurement |
//! | `spike` | single wrong readings |
//! | `identifiability` | whether the motion can show hysteresis |
//! | `circulation` | motion of two motors around a closed curve |
//! | `cycle` | the cycles of a repeating motion |

pub mod circulation;
pub mod cycle;
pub mod identifiability;
pub mod noise;
pub mod overview;
pub mod spike;
