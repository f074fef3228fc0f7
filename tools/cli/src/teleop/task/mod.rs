//! Manual tasks with any input device: reach (targets, one after the other), pursuit (a moving
//! target), and holding still.
//!
//! The target is published, so that the monitor shows it and a recording has it; `i2ris record
//! report` scores it, by the angles of a camera, or without one by the model's estimate.

mod follow;
mod reach;

use i2ris::ipc::client::{Announcer, Client, Latest};
use i2ris::ipc::payload::{ExternalPosition, JointState, ReachTarget};
use i2ris::{ipc::Message, units::Nanos};
use i2ris_report::{Failure, exit::Coded};

use crate::command::trajectory::Angles;
use crate::numbers::{finite, pair, positive};
use follow::{Curve, Follow};
use reach::{Reach, Settings, seeded_targets};

const CAMERA_STALE: Nanos = Nanos::from_millis(500);
const PUBLISH_PERIOD: Nanos = Nanos::from_millis(50);
/// Publishing period of a moving target: between two messages, its path is taken as straight.
const MOVING_PERIOD: Nanos = Nanos::from_millis(10);

pub type Seen = Option<(Nanos, Angles)>;

/// The course of a task. Pure: time and angles are arguments.
pub trait Course {
    fn is_finished(&self) -> bool;

    /// Adds angles; returns the last message of a target that ends. A task begins with the clutch.
    fn update(&mut self, now: Nanos, is_engaged: bool, seen: Seen) -> Option<ReachTarget>;

    fn message(&self, now: Nanos) -> Option<ReachTarget>;

    /// Instruction for the operator, within 70 columns.
    fn line(&self, now: Nanos) -> String;

    fn outcome(&self, ended: &ReachTarget, now: Nanos) -> String;

    fn summary(&self) -> String;
}

#[derive(Debug, Clone, Copy, PartialEq, clap::ValueEnum)]
enum Task {
    /// Move the snake to targets, one after the other, and hold it there
    Reach,
    /// Track an unpredictable target
    Pursuit,
    /// Hold the snake at a place
    HoldStill,
}

#[derive(Debug, Clone, clap::Args)]
pub struct TaskOptions {
    /// The task, by keyboard or --device
    #[arg(value_enum)]
    task: Task,
    /// Duration; of `reach`: time limit of a target, which is missed if it is not held by then
    /// [default: 30, or 20 for `hold-still`]
    #[arg(long, value_name = "S", value_parser = positive)]
    duration_s: Option<f64>,
    /// Centre of the area, or pose to hold
    #[arg(long, num_args = 2, value_names = ["PITCH_DEG", "YAW_DEG"], default_values_t = [0.0, 0.0],
          value_parser = finite, allow_negative_numbers = true)]
    centre_deg: Vec<f64>,
    /// Largest distance of a target from the centre; not for `hold-still` [default: 8]
    #[arg(long, value_name = "DEG", value_parser = positive)]
    range_deg: Option<f64>,
    /// Random seed: the same number gives the same targets, or the same curve; not for `hold-still`
    /// [default: 1]
    #[arg(long, value_name = "NUMBER")]
    seed: Option<u64>,
    /// Number of targets, only of `reach` [default: 10]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    targets: Option<u32>,
    /// Time for which a target must be held, only of `reach` [default: 1]
    #[arg(long, value_name = "S", value_parser = positive)]
    hold_s: Option<f64>,
    /// Distance within which a target is reached, only of `reach` [default: 0.15]
    #[arg(long, value_name = "DEG", value_parser = positive)]
    tolerance_deg: Option<f64>,
}

impl TaskOptions {
    pub fn check(&self) -> Result<(), Failure> {
        let Self { targets, hold_s, tolerance_deg, .. } = self;
        let of_reach = targets.is_some() || hold_s.is_some() || tolerance_deg.is_some();
        let of_area = self.range_deg.is_some() || self.seed.is_some();
        let sentence = match self.task {
            Task::HoldStill if of_reach || of_area => {
                "`hold-still` has a single target at rest: only --duration-s and --centre-deg apply"
            }
            Task::Pursuit if of_reach => {
                "--targets, --hold-s and --tolerance-deg are for the task `reach`"
            }
            _ => return Ok(()),
        };
        Err(Coded { code: 2, sentence: sentence.to_owned() }.into())
    }

    fn course(&self) -> (Box<dyn Course>, Nanos) {
        let Self { task, range_deg, seed, targets, hold_s, tolerance_deg, .. } = *self;
        let (centre, range_deg) = (pair(&self.centre_deg), range_deg.unwrap_or(8.0));
        let usual_s = if task == Task::HoldStill { 20.0 } else { 30.0 };
        let (duration, seed) = (seconds(self.duration_s.unwrap_or(usual_s)), seed.unwrap_or(1));
        let curve = match task {
            Task::Reach => {
                let (tolerance_deg, hold) =
                    (tolerance_deg.unwrap_or(0.15), seconds(hold_s.unwrap_or(1.0)));
                let settings = Settings { tolerance_deg, hold, limit: duration };
                let number = targets.unwrap_or(10) as usize;
                let targets = seeded_targets(number, seed, centre, range_deg);
                return (Box::new(Reach::new(targets, settings)), PUBLISH_PERIOD);
            }
            Task::Pursuit => Curve::seeded(centre, range_deg, seed),
            Task::HoldStill => Curve::at_rest(centre),
        };
        (Box::new(Follow::new(curve, duration)), MOVING_PERIOD)
    }
}

pub struct HandTask {
    pub course: Box<dyn Course>,
    period: Nanos,
    publisher: Announcer<ReachTarget>,
    camera: Latest<ExternalPosition>,
    measured: Latest<JointState>,
    by_camera: bool,
    next_message: Nanos,
}

impl HandTask {
    pub fn new(options: &TaskOptions, client: &Client) -> Self {
        let (course, period) = options.course();
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

    /// Publishes the target when a message is due. Returns a line when a target has ended.
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

    fn observe(&mut self, now: Nanos) -> Result<Seen, Failure> {
        let seen = self.camera.refresh()?.copied().filter(|camera| {
            let is_valid = camera.flags & ExternalPosition::VALID != 0 && camera.count == 2;
            is_valid && camera.age(now) <= CAMERA_STALE
        });
        let estimate = self.measured.refresh()?.copied().filter(|joint| {
            let is_valid = joint.flags & JointState::VALID != 0 && joint.count == 2;
            is_valid && joint.age(now) <= CAMERA_STALE
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
