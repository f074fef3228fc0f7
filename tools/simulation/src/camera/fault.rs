//! Faults of a camera: wrong measurements, and their times.

use i2ris::ipc::payload::ExternalPosition;
use i2ris::units::Nanos;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "fault", rename_all = "kebab-case", deny_unknown_fields)]
pub enum CameraFault {
    /// A share of the frames has errors, evenly distributed up to a size in pitch and in yaw.
    Outliers {
        /// 0 to 1.
        share: f64,
        /// Degrees.
        size_deg: f64,
    },
    Bias {
        /// Degrees.
        deg: [f64; 2],
    },
    /// The angles of the first frame are repeated, with new stamps.
    Frozen {},
    Swapped {},
    /// Pitch, yaw or both have the wrong sign.
    Mirrored {
        /// Pitch and yaw.
        axes: [bool; 2],
    },
    /// The stamps are later than the exposures by this time; earlier if negative.
    LateStamps {
        /// Milliseconds.
        ms: f64,
    },
    Silent {},
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TimedCameraFault {
    /// When it begins, seconds after the start, or after the command.
    #[serde(default)]
    pub start_s: f64,
    /// How long it lasts, seconds. Absent: to the end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub for_s: Option<f64>,
    #[serde(flatten)]
    pub fault: CameraFault,
}

impl TimedCameraFault {
    /// Checks all values; the error is a sentence.
    pub fn check(&self) -> Result<(), String> {
        let within = |key: &str, value: f64, low: f64, high: f64| {
            let wrong = || format!("camera.{key} = {value}: must be {low} to {high}");
            (low..=high).contains(&value).then_some(()).ok_or_else(wrong)
        };
        within("start_s", self.start_s, 0.0, 1e9)?;
        within("for_s", self.for_s.unwrap_or(0.0), 0.0, 1e9)?;
        match self.fault {
            CameraFault::Outliers { share, size_deg } => {
                within("share", share, 0.0, 1.0)?;
                within("size_deg", size_deg, 0.0, 180.0)
            }
            CameraFault::Bias { deg: [pitch, yaw] } => {
                within("deg", pitch, -180.0, 180.0)?;
                within("deg", yaw, -180.0, 180.0)
            }
            CameraFault::LateStamps { ms } => within("ms", ms, -10_000.0, 10_000.0),
            CameraFault::Frozen {}
            | CameraFault::Swapped {}
            | CameraFault::Mirrored { .. }
            | CameraFault::Silent {} => Ok(()),
        }
    }
}

#[derive(Debug)]
struct Running {
    from: Nanos,
    until: Option<Nanos>,
    fault: CameraFault,
    /// The angles of its first frame, rad.
    first: Option<[f64; 3]>,
}

#[derive(Debug)]
pub(super) struct CameraFaults {
    running: Vec<Running>,
    random: Pcg64Mcg,
}

impl CameraFaults {
    pub(super) fn new(seed: u64) -> Self {
        Self { running: Vec::new(), random: Pcg64Mcg::seed_from_u64(seed) }
    }

    pub(super) fn begin(&mut self, timed: &TimedCameraFault, now: Nanos) {
        let span = |seconds: f64| Nanos((seconds * 1e9) as u64);
        let from = now + span(timed.start_s);
        self.running.push(Running {
            from,
            until: timed.for_s.map(|seconds| from + span(seconds)),
            fault: timed.fault,
            first: None,
        });
    }

    pub(super) fn clear(&mut self) {
        self.running.clear();
    }

    /// The frame delivered instead of a good one, if any.
    pub(super) fn apply(&mut self, mut frame: ExternalPosition) -> Option<ExternalPosition> {
        let exposed = Nanos(frame.stamp_ns);
        let Self { running, random } = self;
        let is_on =
            |it: &&mut Running| it.from <= exposed && it.until.is_none_or(|until| exposed < until);
        for running in running.iter_mut().filter(is_on) {
            let [pitch, yaw, _] = &mut frame.position;
            match running.fault {
                CameraFault::Outliers { share, size_deg } => {
                    if random.random::<f64>() < share {
                        let size = size_deg.to_radians();
                        *pitch += size * (2.0 * random.random::<f64>() - 1.0);
                        *yaw += size * (2.0 * random.random::<f64>() - 1.0);
                    }
                }
                CameraFault::Bias { deg } => {
                    *pitch += deg[0].to_radians();
                    *yaw += deg[1].to_radians();
                }
                CameraFault::Frozen {} => {
                    frame.position = *running.first.get_or_insert(frame.position);
                }
                CameraFault::Swapped {} => std::mem::swap(pitch, yaw),
                CameraFault::Mirrored { axes } => {
                    let sign = axes.map(|mirrored| if mirrored { -1.0 } else { 1.0 });
                    *pitch *= sign[0];
                    *yaw *= sign[1];
                }
                CameraFault::LateStamps { ms } => {
                    let stamp = frame.stamp_ns.saturating_add_signed((ms * 1e6) as i64);
                    frame.stamp_ns = stamp;
                }
                CameraFault::Silent {} => return None,
            }
        }
        Some(frame)
    }
}
