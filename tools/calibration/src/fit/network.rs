//! Networks trained elsewhere: from their file and a recording to a model.
//!
//! The recording provides what the file of a network lacks: the hull, the straight line beyond a
//! step, the deviation on the held-out rows, and the motion after which it forgets the past.

use std::path::Path;

use i2ris::file_permissions::MAX_MODEL_BYTES;
use i2ris::model::file::{FamilyParameters, OutputSpec};
use i2ris::model::network::NetworkParameters;
use i2ris::model::{Memory, Model};
use i2ris::units::MotorVec;
use serde::{Deserialize, Serialize};

use super::all_families::{TrainingData, outputs_change};
use super::model_file::Fitted;
use super::options::FitOptions;
use super::outcome::{FitError, NetworkError};
use super::split::Split;
use crate::quality::Quality;
use crate::recording::{PathPoint, Recording};
use i2ris_report::statistics::largest_difference;

/// Format of the file of a network, and its version.
const NETWORK_FORMAT: &str = "i2ris-network";
const VERSION: u32 = 1;

/// Minimum steps of the recording, and maximum held-out error over that of a straight line.
const MIN_STEPS: usize = 50;
const MAX_ERROR_RATIO: f64 = 1.05;

/// A network as written by its converter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NetworkFile {
    /// `i2ris-network`.
    pub format: String,
    /// 1.
    pub version: u32,
    /// Inputs: `q0_counts`, `q1_counts`.
    pub inputs: Vec<String>,
    /// Outputs.
    pub outputs: Vec<OutputSpec>,
    /// The layers.
    pub network: NetworkParameters,
}

impl NetworkFile {
    /// Reads the file of a network. Fails if it is too long, or not a supported network.
    pub fn read(path: &Path) -> Result<Self, NetworkError> {
        let named = |source| NetworkError::Read { path: path.to_owned(), source };
        let length = std::fs::metadata(path).map_err(named)?.len();
        if length > MAX_MODEL_BYTES {
            let (path, megabytes) = (path.to_owned(), length >> 20);
            return Err(NetworkError::TooLong { path, megabytes });
        }
        let text = std::fs::read_to_string(path).map_err(named)?;
        let parsed = serde_json::from_str(&text);
        parsed.map_err(|source| NetworkError::Json { path: path.to_owned(), source })
    }

    fn check(&self, recording: &Recording) -> Result<(), NetworkError> {
        if self.format != NETWORK_FORMAT || self.version != VERSION {
            return Err(NetworkError::Format(format!("{} {}", self.format, self.version)));
        }
        let names = |inputs: Vec<String>, outputs: &[OutputSpec]| {
            let outputs = outputs.iter().map(|output| format!("{}_{}", output.name, output.unit));
            format!("{} to {}", inputs.join(", "), outputs.collect::<Vec<_>>().join(", "))
        };
        let counts = (0..recording.motors()).map(|motor| format!("q{motor}_counts")).collect();
        let wanted = names(counts, recording.outputs());
        let found = names(self.inputs.clone(), &self.outputs);
        if found != wanted {
            return Err(NetworkError::Columns { found, wanted });
        }
        let step_counts = self.network.step_counts;
        let least = self.network.window_steps().unwrap_or(0).max(MIN_STEPS);
        let steps = (travel(recording) / step_counts) as usize;
        if steps < least {
            return Err(NetworkError::Window { steps, step_counts, least });
        }
        Ok(())
    }
}

/// Travel of the fastest motor, from position to position, counts.
fn travel(recording: &Recording) -> f64 {
    let moved = |pair: &[PathPoint]| largest_difference(&pair[1].counts, &pair[0].counts);
    recording.path().windows(2).map(moved).sum()
}

/// Makes a model of a network, checked and measured. Fails if it is refused, or without a hull.
pub fn import(
    file: &NetworkFile,
    recording: &Recording,
    options: &FitOptions,
) -> Result<Model, FitError> {
    file.check(recording)?;
    let quality = Quality::new(recording, &options.spikes)?;
    let split = Split::new(recording, options.hold_out)?;
    let usable = |row: &usize| options.spikes.keep || !quality.is_flagged(*row);
    let rows: Vec<usize> = split.training().filter(usable).collect();
    outputs_change(recording, &rows)?;
    let data = TrainingData::new(recording, rows)?;
    let (context, straight) = (data.context(&quality, &split, options), &data.straight);
    let parameters = |memory_counts: Vec<f64>| {
        Fitted::plain(FamilyParameters::Network {
            network: file.network.clone(),
            memory_counts,
            gain: straight.gain.clone(),
            covariance: straight.covariance.clone(),
        })
    };
    let refused = |error| FitError::Network(NetworkError::Refused(error));
    let ranges = vec![0.0; recording.motors()];
    let first = context.model(&parameters(ranges)).map_err(refused)?;
    let errors = first.file().metrics.iter().map(|it| it.held_out.unwrap_or(it.training));
    let error = errors.map(|fit| fit.rmsd.powi(2)).sum::<f64>().sqrt();
    let rows = context.held_out_or_training();
    let square = |row: &usize| {
        let row = &recording.rows()[*row];
        let pairs = straight.predict(&row.counts).zip(&row.outputs);
        pairs.map(|(found, measured)| (found - measured).powi(2)).sum::<f64>()
    };
    let straight = (rows.iter().map(square).sum::<f64>() / rows.len() as f64).sqrt();
    if error.is_nan() || error > MAX_ERROR_RATIO * straight {
        return Err(NetworkError::WorseThanLinear { error, straight }.into());
    }
    context.model(&parameters(forgets(&first))).map_err(refused)
}

/// Parts of the hull that are tried, and positions per turn through the hull.
const PARTS: usize = 10;
const PER_TURN: usize = 200;

/// Range of every motor after which two memories with opposite pasts agree within a deviation.
fn forgets(model: &Model) -> Vec<f64> {
    let centre = model.hull().centre();
    let reach = |motor: usize| {
        let corners = model.hull().corners().map(|corner| (corner[motor] - centre[motor]).abs());
        corners.fold(0.0, f64::max)
    };
    let reach: MotorVec = [reach(0), if model.motors() > 1 { reach(1) } else { 0.0 }];
    let at = |size: [f64; 2]| {
        let counts = std::array::from_fn(|motor| centre[motor] + size[motor] * reach[motor]);
        model.hull().project(&counts)
    };
    let from = |side: f64| {
        let mut memory = model.new_memory();
        for position in 0..=PER_TURN {
            let left = side * (1.0 - position as f64 / PER_TURN as f64);
            model.advance(&mut memory, &at([left, left]));
        }
        memory
    };
    let (one, other) = (from(1.0), from(-1.0));
    let agree = |size: f64| {
        let turned = |memory: &Memory| {
            let mut memory = *memory;
            for position in 0..=2 * PER_TURN {
                let angle = std::f64::consts::TAU * position as f64 / PER_TURN as f64;
                model.advance(&mut memory, &at([size * angle.sin(), size * (0.5 * angle).sin()]));
            }
            model.predict(&centre, &memory)
        };
        let (one, other) = (turned(&one), turned(&other));
        let pairs = one.mean.iter().zip(other.mean).zip(one.deviation());
        pairs.take(model.outputs()).all(|((a, b), deviation)| (a - b).abs() <= deviation)
    };
    let parts = (1..PARTS).map(|part| part as f64 / PARTS as f64);
    let part = parts.clone().find(|size| agree(*size)).unwrap_or(1.0);
    reach.iter().take(model.motors()).map(|reach| 2.0 * part * reach).collect()
}

#[cfg(test)]
mod tests {
    use i2ris::model::network::{Activation, Layer};

    use super::*;
    use crate::testing::{assert_contains, bent, degrees};

    /// A network that represents that snake exactly.
    fn exact() -> NetworkFile {
        let weight = vec![vec![20.0 / 12.0, -15.0 / 12.0], vec![15.0 / 12.0, 20.0 / 12.0]];
        let bias = vec![2.0 / 12.0, -5.0 / 12.0];
        NetworkFile {
            format: NETWORK_FORMAT.to_owned(),
            version: 1,
            inputs: vec!["q0_counts".to_owned(), "q1_counts".to_owned()],
            outputs: ["pitch", "yaw"].map(degrees).into(),
            network: NetworkParameters {
                step_counts: 10.0,
                input_centre: vec![0.0; 2],
                input_scale: vec![0.001; 2],
                layers: vec![Layer::Dense { weight, bias, activation: Activation::Tanh }],
                output_gain: vec![vec![12.0, 0.0], vec![0.0, 12.0]],
                output_offset: vec![0.0; 2],
                skip_gain: Vec::new(),
            },
        }
    }

    #[track_caller]
    fn refused(change: impl FnOnce(&mut NetworkFile), rows: usize, parts: &[&str]) {
        let mut file = exact();
        change(&mut file);
        let error = import(&file, &bent(rows), &FitOptions::default()).unwrap_err().to_string();
        assert!(!error.contains('\n'), "{error}");
        assert_contains(&error, parts);
    }

    #[test]
    fn a_network_becomes_a_model_with_hull_deviation_and_range() {
        let recording = bent(1500);
        let model = import(&exact(), &recording, &FitOptions::default()).unwrap();
        let deviation = model.predict(&[0.0; 2], &model.new_memory()).deviation();
        let noise = 0.05_f64.to_radians();
        assert!(deviation.iter().take(2).all(|found| (0.8..1.2).contains(&(found / noise))));
        let file = model.file();
        assert!(
            file.metrics.iter().all(|metrics| metrics.held_out.is_some_and(|it| it.rmsd < 0.07))
        );
        let FamilyParameters::Network { memory_counts, .. } = &file.family else { panic!() };
        // It has no memory: the smallest tested range is enough.
        let widths = [0, 1].map(|motor: usize| {
            let corners = || model.hull().corners().map(|corner| corner[motor]);
            corners().fold(f64::MIN, f64::max) - corners().fold(f64::MAX, f64::min)
        });
        assert!(memory_counts.iter().zip(widths).all(|(range, width)| *range < 0.15 * width));
        assert!(file.training.linear_gain.is_some() && file.training.rows > 1000);
    }

    #[test]
    fn wrong_columns_units_and_directions_are_refused() {
        let reverse = |file: &mut NetworkFile| {
            file.inputs = ["pitch_deg", "yaw_deg"].map(str::to_owned).into();
        };
        refused(reverse, 300, &["from pitch_deg, yaw_deg", "from counts to angles in degrees"]);
        refused(|file| file.outputs.swap(0, 1), 300, &["to yaw_deg, pitch_deg"]);
        let newer = |file: &mut NetworkFile| file.version = 2;
        refused(newer, 300, &["not a network of this version: `i2ris-network 2`"]);
        let radians = |file: &mut NetworkFile| {
            for gain in file.network.output_gain.iter_mut().flatten() {
                *gain = gain.to_radians();
            }
        };
        refused(radians, 1500, &["unusable"]);
    }

    #[test]
    fn too_long_windows_and_foreign_networks_are_refused() {
        let window = |file: &mut NetworkFile| {
            let taps = vec![vec![vec![0.01; 2]; 2]; 2];
            let bias = vec![0.0; 2];
            let conv = Layer::Conv { taps, bias, dilation: 60, activation: Activation::None };
            file.network.layers.insert(0, conv);
            file.network.step_counts = 1000.0;
        };
        refused(window, 300, &["looks at 60", "record more"]);
        let other = |file: &mut NetworkFile| file.network.output_offset = vec![4.0, 0.0];
        refused(other, 1500, &["that of a straight line", "another robot"]);
    }

    #[test]
    fn huge_files_and_unknown_layers_are_refused() {
        let file = tempfile::NamedTempFile::new().unwrap();
        file.as_file().set_len(1 << 30).unwrap();
        let error = NetworkFile::read(file.path()).unwrap_err();
        assert_contains(&error, &["has 1024 MB", "at most 64 MB"]);
        let text = serde_json::to_string(&exact()).unwrap();
        std::fs::write(file.path(), text.replace("\"dense\"", "\"attention\"")).unwrap();
        let error = NetworkFile::read(file.path()).unwrap_err();
        assert_contains(&error, &["unknown variant `attention`", "`conv`"]);
        assert_contains(&NetworkFile::read(Path::new("none.json")).unwrap_err(), &["none.json"]);
    }
}
