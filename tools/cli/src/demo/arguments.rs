//! The arguments of `i2ris demo`.

use std::path::PathBuf;

use crate::emulate::snake_help;
use i2ris_simulation::motion::unseen_motion::Motion;

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  i2ris demo
  i2ris demo --snake brass --duration-s 300 --motions teleoperation,circle,square,points --motion-s 60
  i2ris demo --snake preisach:3 --duration-s 300 --family best")]
pub struct Arguments {
    /// The snake behind the drives, as for `i2ris emulate`: steel (mild), brass (a wide, asymmetric
    /// gap, and slack around the straight pose), multi (several slopes on one stroke), NAME:SEED
    /// of a physics, or a file
    #[arg(
        long,
        value_name = "NAME[:SEED]|FILE",
        default_value = "steel",
        long_help = snake_help()
    )]
    pub snake: String,
    /// How long to calibrate
    #[arg(long, value_name = "S", default_value_t = 90.0)]
    pub duration_s: f64,
    /// Families of models to compare, with commas between them; `best` is the one with the least error on what was held out
    #[arg(
        long,
        value_name = "FAMILY,..",
        value_delimiter = ',',
        default_value = "linear,gmr,best"
    )]
    pub family: Vec<String>,
    /// What to follow
    #[arg(long, value_enum, value_delimiter = ',', default_values_t = [Motion::Teleoperation])]
    pub motions: Vec<Motion>,
    /// How long teleoperation lasts
    #[arg(long, value_name = "S", default_value_t = 20.0)]
    pub motion_s: f64,
    /// Seed of everything random; no calibration has the one of the motions
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Keep recording, models and logs in this folder; what is in it already, recording.csv and
    /// FAMILY.json, is not made again
    #[arg(long, value_name = "DIR")]
    pub folder: Option<PathBuf>,
}
