//! Options that name the columns of a recording.

use i2ris_calibration::recording::{ColumnMap, OutputColumn, TimeColumn};

/// Which columns of a recording are what.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Columns of the recording")]
pub struct ColumnArguments {
    /// Encoder counts of motor 0 and motor 1 [default: `q0_counts,q1_counts` or
    /// `Encoder counts 0,Encoder counts 1`]
    #[arg(long, value_name = "COLUMN,..", value_delimiter = ',')]
    counts: Vec<String>,
    /// Measured angles, deg, and what they are [default: `pitch_deg,yaw_deg` or
    /// `pitches=pitch,yaws=yaw`]
    #[arg(long, value_name = "COLUMN=NAME,..", value_delimiter = ',')]
    angles: Vec<OutputColumn>,
    /// Time stamps, s; none: read the recording without [default: `t_s` or `Enc TS`, if there is
    /// one]
    #[arg(long, value_name = "COLUMN|none")]
    time: Option<String>,
}

impl ColumnArguments {
    /// For reading the recording.
    pub fn map(&self) -> ColumnMap {
        let time = match self.time.as_deref() {
            Some("none") => TimeColumn::Ignored,
            Some(column) => TimeColumn::Named(column.to_owned()),
            None => TimeColumn::Known,
        };
        ColumnMap { time, counts: self.counts.clone(), outputs: self.angles.clone() }
    }
}
