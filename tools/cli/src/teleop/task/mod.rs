//! Manual tasks with any input device: reach (targets, one after the other), pursuit (a moving
//! target), and holding still.
//!
//! The target is published, so that the monitor shows it and a recording has it; `i2ris record
//! report` scores it, by the camera's angles if there is a camera, otherwise by the model's
//! estimate.

mod follow;
mod reach;

use i2ris::ipc::Message;
use i2ris::ipc::client::{Announcer, Client, Latest};
use i2ris::ipc::payload::{ExternalPosition, JointState, ReachTarget};
use i2ris::units::Nanos;
use i2ris_report::Failure;

use crate::command::trajectory::Angles;
use crate::numbers::{finite, pair, positive};
use follow::{Curve, Follow};
use reach::{Disc, Reach, Settings, seeded_targets};

/// Age at which camera angles are ignored.
const CAMERA_STALE: Nanos = Nanos::from_millis(500);
const PUBLISH_PERIOD: Nanos = Nanos::from_millis(50);
/// Publishing period of a moving target: between two messages, its path is taken as straight.
const MOVING_PERIOD: Nanos = Nanos::from_millis(10);

/// New angles of the snake, deg, with their stamp.
type Seen = Option<(Nanos, Angles)>;

/// The course of a task. Pure: time and angles are arguments.
trait Course {
    fn is_finished(&self) -> bool;

    /// Adds new angles, and returns the last message of a target that ends now. A task begins when
    /// the clutch first closes, so that waiting costs no time.
    fn update(&mut self, now: Nanos, is_engaged: bool, seen: Seen) -> Option<ReachTarget>;

    /// Message of the present target; `None`: no target is shown.
    fn message(&self, now: Nanos) -> Option<ReachTarget>;

    /// Instruction for the operator, within 70 columns.
    fn line(&self, now: Nanos) -> String;

    fn outcome(&self, ended: &ReachTarget, now: Nanos) -> String;

    fn summary(&self) -> String;
}

#[derive(Debug, Clone)]
pub enum TaskOptions {
    Reach(ReachOptions),
    Pursuit(PursuitOptions),
    HoldStill(HoldStillOptions),
}

#[derive(Debug, Clone, clap::Args)]
pub struct ReachOptions {
    /// Number of targets
    #[arg(long, default_value_t = 10, value_name = "N",
          value_parser = clap::value_parser!(u32).range(1..=1000))]
    targets: u32,
    /// Random seed: the same number gives the same targets
    #[arg(long, default_value_t = 1, value_name = "NUMBER")]
    seed: u64,
    #[command(flatten)]
    area: AreaOptions,
    /// Time for which a target must be held
    #[arg(long, default_value_t = 1.0, value_name = "S", value_parser = positive)]
    hold_s: f64,
    /// Distance within which a target is reached
    #[arg(long, default_value_t = 0.15, value_name = "DEG", value_parser = positive)]
    tolerance_deg: f64,
    /// Time limit: a target not held by then is missed, and the next one is shown
    #[arg(long, default_value_t = 30.0, value_name = "S", value_parser = positive)]
    limit_s: f64,
}

#[derive(Debug, Clone, clap::Args)]
pub struct PursuitOptions {
    /// Duration of the target motion
    #[arg(long, default_value_t = 30.0, value_name = "S", value_parser = positive)]
    duration_s: f64,
    /// Random seed: the same number gives the same curve
    #[arg(long, default_value_t = 1, value_name = "NUMBER")]
    seed: u64,
    #[command(flatten)]
    area: AreaOptions,
}

/// Area of the targets.
#[derive(Debug, Clone, clap::Args)]
struct AreaOptions {
    /// Centre of the area
    #[arg(long, num_args = 2, value_names = ["PITCH_DEG", "YAW_DEG"], default_values_t = [0.0, 0.0],
          value_parser = finite, allow_negative_numbers = true)]
    centre_deg: Vec<f64>,
    /// Largest distance of a target from the centre
    #[arg(long, default_value_t = 8.0, value_name = "DEG", value_parser = positive)]
    range_deg: f64,
}

#[derive(Debug, Clone, clap::Args)]
pub struct HoldStillOptions {
    /// Duration
    #[arg(long, default_value_t = 20.0, value_name = "S", value_parser = positive)]
    duration_s: f64,
    /// Pose to hold
    #[arg(long, num_args = 2, value_names = ["PITCH_DEG", "YAW_DEG"], default_values_t = [0.0, 0.0],
          value_parser = finite, allow_negative_numbers = true)]
    centre_deg: Vec<f64>,
}

pub struct HandTask {
    course: Box<dyn Course>,
    period: Nanos,
    publisher: Announcer<ReachTarget>,
    camera: Latest<ExternalPosition>,
    measured: Latest<JointState>,
    by_camera: bool,
    next_message: Nanos,
}

impl HandTask {
    /// Creates a task, which begins when the clutch first closes.
    pub fn new(options: &TaskOptions, client: &Client) -> Self {
        let (course, period): (Box<dyn Course>, _) = match options {
            TaskOptions::Reach(options) => {
                let area = &options.area;
                let disc = Disc { centre: pair(&area.centre_deg), range_deg: area.range_deg };
                let settings = Settings {
                    tolerance_deg: options.tolerance_deg,
                    hold: seconds(options.hold_s),
                    limit: seconds(options.limit_s),
                };
                let targets = seeded_targets(options.targets as usize, options.seed, disc);
                (Box::new(Reach::new(targets, settings)), PUBLISH_PERIOD)
            }
            TaskOptions::Pursuit(options) => {
                let area = &options.area;
                let curve = Curve::seeded(pair(&area.centre_deg), area.range_deg, options.seed);
                (Box::new(Follow::new(curve, seconds(options.duration_s))), MOVING_PERIOD)
            }
            TaskOptions::HoldStill(options) => {
                let curve = Curve::at_rest(pair(&options.centre_deg));
                (Box::new(Follow::new(curve, seconds(options.duration_s))), MOVING_PERIOD)
            }
        };
        Self {
            course,
            period,
            publisher: client.announcer(),
            camera: Latest::new(client.watcher().external()),
            measured: Latest::new(client.watcher().measured_js()),
            by_camera: false,
            next_message: Nanos::ZERO,
        }
    }

    pub fn is_finished(&self) -> bool {
        self.course.is_finished()
    }

    /// Updates the pose of the snake, and publishes the target when a message is due. Returns a
    /// line when a target has ended.
    pub fn update(&mut self, now: Nanos, is_engaged: bool) -> Result<Option<String>, Failure> {
        let seen = self.observe(now)?;
        if let Some(ended) = self.course.update(now, is_engaged, seen) {
            self.publish(ended)?;
            return Ok(Some(self.course.outcome(&ended, now)));
        }
        if now >= self.next_message
            && let Some(target) = self.course.message(now)
        {
            self.next_message = now + self.period;
            self.publish(target)?;
        }
        Ok(None)
    }

    fn publish(&mut self, mut target: ReachTarget) -> Result<(), Failure> {
        if self.by_camera {
            target.flags |= ReachTarget::BY_CAMERA;
        }
        Ok(self.publisher.publish(target)?)
    }

    pub fn line(&self, now: Nanos) -> String {
        self.course.line(now)
    }

    pub fn summary(&self) -> String {
        self.course.summary()
    }

    /// The angles of the camera, or of the estimate.
    fn observe(&mut self, now: Nanos) -> Result<Seen, Failure> {
        let seen = self.camera.refresh()?.copied().filter(|camera| {
            camera.flags & ExternalPosition::VALID != 0
                && camera.count == 2
                && camera.age(now) <= CAMERA_STALE
        });
        let estimate = self.measured.refresh()?.copied().filter(|joint| {
            joint.flags & JointState::VALID != 0
                && joint.count == 2
                && joint.age(now) <= CAMERA_STALE
        });
        // A silent camera shows nothing; the estimate does not replace it.
        self.by_camera |= seen.is_some();
        let degrees = |position: [f64; 3]| [position[0].to_degrees(), position[1].to_degrees()];
        Ok(match (seen, estimate) {
            (Some(camera), _) => Some((camera.stamp(), degrees(camera.position))),
            (None, Some(joint)) if !self.by_camera => {
                Some((joint.stamp(), degrees(joint.position)))
            }
            (None, _) => None,
        })
    }
}

fn seconds(seconds: f64) -> Nanos {
    Nanos((seconds * 1e9) as u64)
}
