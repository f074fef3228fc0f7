//! Tracking of an unseen motion: goal against camera, and its output.

use i2ris::ipc::client::{Client, Subscription};
use i2ris::ipc::payload::{ExternalPosition, JointState};
use i2ris_report::Failure;
use i2ris_report::statistics::{TimeSeries, quantile_of_unsorted};

use i2ris_simulation::motion::unseen_motion::Motion;

/// Longest gap between two samples, ns. The controller publishes the goal every millisecond.
const GAP_NS: u64 = 60_000_000;
/// Distance at which the goal has reached the start of the motion, degrees.
const NEAR_DEG: f64 = 0.2;

#[derive(Debug, Default)]
pub struct MotionRun {
    /// Difference between goal and camera for every frame: pitch and yaw, degrees.
    pub errors_deg: Vec<[f64; 2]>,
}

/// RMS of pitch, yaw and their length; NaN without frames.
pub fn rms_deg(errors_deg: &[[f64; 2]]) -> [f64; 3] {
    let mean = |square: fn(&[f64; 2]) -> f64| {
        (errors_deg.iter().map(square).sum::<f64>() / errors_deg.len() as f64).sqrt()
    };
    [mean(|e| e[0] * e[0]), mean(|e| e[1] * e[1]), mean(|e| e[0] * e[0] + e[1] * e[1])]
}

fn length_percentile_deg(errors_deg: &[[f64; 2]], share: f64) -> f64 {
    let mut lengths: Vec<f64> = errors_deg.iter().map(|e| e[0].hypot(e[1])).collect();
    quantile_of_unsorted(&mut lengths, share).unwrap_or(f64::NAN)
}

/// Records goal and camera while another process commands.
pub struct TrackingRecorder {
    goal: Subscription<JointState>,
    camera: Subscription<ExternalPosition>,
    goals: TimeSeries<2>,
    frames: TimeSeries<2>,
    run: MotionRun,
}

impl TrackingRecorder {
    pub fn new(client: &Client) -> Self {
        let watcher = client.watcher();
        Self {
            goal: watcher.goal_js(),
            camera: watcher.external(),
            goals: TimeSeries::default(),
            frames: TimeSeries::default(),
            run: MotionRun::default(),
        }
    }

    pub fn read(&mut self) -> Result<(), Failure> {
        let degrees = |position: [f64; 3]| [position[0].to_degrees(), position[1].to_degrees()];
        self.goal.drain(|goal| self.goals.push(goal.stamp_ns, degrees(goal.position)))?;
        self.camera.drain(|seen| {
            if seen.flags != 0 {
                self.frames.push(seen.stamp_ns, degrees(seen.position));
            }
        })?;
        Ok(())
    }

    pub fn finish(mut self) -> MotionRun {
        // Every motion begins at the straight pose.
        let near = |goal: &[f64; 2]| goal[0].hypot(goal[1]) < NEAR_DEG;
        let started =
            self.goals.iter().find(|(_, goal)| near(goal)).map_or(u64::MAX, |(stamp, _)| *stamp);
        self.run.errors_deg = self.errors_since(started);
        self.run
    }

    /// The difference for every frame after a time, ns.
    pub fn errors_since(&self, started: u64) -> Vec<[f64; 2]> {
        let error = |&(stamp, seen): &(u64, [f64; 2])| {
            let goal = self.goals.value_at(stamp, GAP_NS)?;
            Some([seen[0] - goal[0], seen[1] - goal[1]])
        };
        self.frames.iter().filter(|(stamp, _)| *stamp >= started).filter_map(error).collect()
    }
}

pub struct Followed {
    pub family: String,
    pub motion: Motion,
    pub run: MotionRun,
}

/// Prints everything.
pub fn print(followed: &[Followed]) {
    tracking(followed);
    println!("  The camera adds its noise of about 0.05 degrees per axis.");
}

fn tracking(followed: &[Followed]) {
    println!("\nTracking error on unseen motions: goal against camera, degrees");
    println!(
        "  motion         model              frames pitch RMS   yaw RMS \
         length RMS length p99 length max  below linear"
    );
    for Followed { family, motion, run } in followed {
        let errors = &run.errors_deg;
        let [pitch, yaw, length] = rms_deg(errors);
        let (p99, max) = (length_percentile_deg(errors, 0.99), length_percentile_deg(errors, 1.0));
        let linear =
            followed.iter().find(|other| other.family == "linear" && other.motion == *motion);
        let below = match linear {
            Some(linear) if family != "linear" => {
                format!("{:.1} %", 100.0 * (1.0 - length / rms_deg(&linear.run.errors_deg)[2]))
            }
            _ => "-".to_owned(),
        };
        println!(
            "  {motion:14} {family:16} {:>8} {pitch:>9.3} {yaw:>9.3} {length:>10.3} {p99:>10.3} \
             {max:>10.3} {below:>13}",
            errors.len()
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn root_mean_square_per_axis_and_of_the_length() {
        let [pitch, yaw, length] = rms_deg(&[[3.0, 0.0], [0.0, 4.0]]);
        assert!((pitch - 4.5_f64.sqrt()).abs() < 1e-12);
        assert!((yaw - 8.0_f64.sqrt()).abs() < 1e-12);
        assert!((length - 12.5_f64.sqrt()).abs() < 1e-12);
        assert_eq!(length_percentile_deg(&[[3.0, 0.0], [0.0, 4.0]], 0.99), 4.0);
    }
}
