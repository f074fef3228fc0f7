//! Tracking of an unseen motion: goal against camera, and latency.

use std::path::Path;

use i2ris::clock;
use i2ris::ipc::client::Client;
use i2ris::ipc::payload::{ActuatorState, JointState, PeriodStatistics};
use i2ris::units::Nanos;
use indicatif::ProgressBar;

use super::process::Process;
use super::progress::check_children;
use super::setup::{DemoSetup, text};
use super::unseen_motion::RATE_HZ;
use i2ris_statistics::{TimeSeries, quantile};
use i2ris_terminal::Failure;

/// Longest gap between two samples, ns. The controller publishes the goal every millisecond.
const GAP_NS: u64 = 60_000_000;
/// How often streams are read.
const READ_PERIOD: Nanos = Nanos::from_millis(5);
/// The goal has come to the start of the motion when it is this near, degrees.
const NEAR_DEG: f64 = 0.2;

/// The result of one run.
#[derive(Debug, Default)]
pub struct MotionRun {
    /// Difference between goal and camera for every frame: pitch and yaw, degrees.
    pub errors_deg: Vec<[f64; 2]>,
    /// From the stamp of a command until its set-point had been handed to the serial line,
    /// microseconds, sorted.
    pub command_to_wire_us: Vec<f64>,
    /// One entry a second.
    pub statistics: Vec<PeriodStatistics>,
}

/// Root mean square, per axis and of the length.
pub fn rms_deg(errors_deg: &[[f64; 2]]) -> [f64; 3] {
    let mean = |square: fn(&[f64; 2]) -> f64| {
        (errors_deg.iter().map(square).sum::<f64>() / errors_deg.len() as f64).sqrt()
    };
    [mean(|e| e[0] * e[0]), mean(|e| e[1] * e[1]), mean(|e| e[0] * e[0] + e[1] * e[1])]
}

/// Quantile of the length of the error over all frames.
pub fn length_percentile_deg(errors_deg: &[[f64; 2]], share: f64) -> f64 {
    let mut lengths: Vec<f64> = errors_deg.iter().map(|e| e[0].hypot(e[1])).collect();
    lengths.sort_by(f64::total_cmp);
    quantile(&lengths, share).unwrap_or(f64::NAN)
}

/// Writes a motion as a CSV of desired angles.
pub fn write_path(file: &Path, path: &[[f64; 2]]) -> Result<(), Failure> {
    let mut writer = csv::Writer::from_path(file)?;
    writer.write_record(["t_s", "pitch_deg", "yaw_deg"])?;
    for (sample, [pitch, yaw]) in path.iter().enumerate() {
        let t_s = sample as f64 / RATE_HZ;
        writer.write_record([t_s.to_string(), pitch.to_string(), yaw.to_string()])?;
    }
    Ok(writer.flush()?)
}

/// Has another process command the motion in `file` and watches until that process is done.
pub fn follow(
    demo: &DemoSetup,
    client: &Client,
    children: &mut [&mut Process],
    file: &Path,
    bar: &ProgressBar,
) -> Result<MotionRun, Failure> {
    let mut recorder = Recorder::new(client);
    let mut commander = demo.tool_in_domain("command", &["command", "file", &text(file)?])?;
    let start = clock::now();
    while !commander.finished()? {
        let now = clock::now();
        check_children(children)?;
        recorder.read()?;
        bar.set_position(((now - start).as_seconds() * 10.0) as u64);
        clock::sleep_until(now + READ_PERIOD);
    }
    recorder.read()?;
    Ok(recorder.finish())
}

struct Recorder {
    goal: i2ris::ipc::client::Subscription<JointState>,
    actuators: i2ris::ipc::client::Subscription<ActuatorState>,
    camera: i2ris::ipc::client::Subscription<i2ris::ipc::payload::ExternalPosition>,
    statistics: i2ris::ipc::client::Subscription<PeriodStatistics>,
    goals: TimeSeries<2>,
    frames: TimeSeries<2>,
    /// Sequence of the command that each motor carried out last.
    carried_out: [u64; 2],
    run: MotionRun,
}

impl Recorder {
    fn new(client: &Client) -> Self {
        let watcher = client.watcher();
        Self {
            goal: watcher.goal_js(),
            actuators: watcher.actuators(),
            camera: watcher.external(),
            statistics: watcher.period_statistics(),
            goals: TimeSeries::default(),
            frames: TimeSeries::default(),
            carried_out: [0; 2],
            run: MotionRun::default(),
        }
    }

    fn read(&mut self) -> Result<(), Failure> {
        let degrees = |position: [f64; 3]| [position[0].to_degrees(), position[1].to_degrees()];
        self.goal.drain(|goal| self.goals.push(goal.stamp_ns, degrees(goal.position)))?;
        self.camera.drain(|seen| {
            if seen.flags != 0 {
                self.frames.push(seen.stamp_ns, degrees(seen.position));
            }
        })?;
        let (carried_out, latencies) = (&mut self.carried_out, &mut self.run.command_to_wire_us);
        self.actuators.drain(|state| {
            for (motor, last) in carried_out.iter_mut().enumerate() {
                if state.command_stamp_ns[motor] != 0 && state.command_sequence[motor] != *last {
                    *last = state.command_sequence[motor];
                    let span =
                        Nanos(state.written_stamp_ns[motor]) - Nanos(state.command_stamp_ns[motor]);
                    latencies.push(span.as_seconds() * 1e6);
                }
            }
        })?;
        self.statistics.drain(|window| self.run.statistics.push(window))?;
        Ok(())
    }

    fn finish(mut self) -> MotionRun {
        // Every motion begins at the straight pose.
        let near = |goal: &[f64; 2]| goal[0].hypot(goal[1]) < NEAR_DEG;
        let started =
            self.goals.iter().find(|(_, goal)| near(goal)).map_or(u64::MAX, |(stamp, _)| *stamp);
        let error = |&(stamp, seen): &(u64, [f64; 2])| {
            let goal = self.goals.value_at(stamp, GAP_NS)?;
            Some([seen[0] - goal[0], seen[1] - goal[1]])
        };
        self.run.errors_deg =
            self.frames.iter().filter(|(stamp, _)| *stamp >= started).filter_map(error).collect();
        self.run.command_to_wire_us.sort_by(f64::total_cmp);
        self.run
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
