//! Tracking of an unseen motion: goal against camera, latency, and what the demo prints of them.

use i2ris::ipc::client::{Client, Subscription};
use i2ris::ipc::payload::{
    ActuatorState, ExternalPosition, JointState, PeriodStatistics, SpanSummary,
};
use i2ris::units::Nanos;
use i2ris_report::Failure;
use i2ris_report::statistics::{TimeSeries, quantile, quantile_of_unsorted};

use i2ris_simulation::motion::unseen_motion::Motion;

/// Longest gap between two samples, ns. The controller publishes the goal every millisecond.
const GAP_NS: u64 = 60_000_000;
/// The goal has come to the start of the motion when it is this near, degrees.
const NEAR_DEG: f64 = 0.2;

#[derive(Debug, Default)]
pub struct MotionRun {
    /// Difference between goal and camera for every frame: pitch and yaw, degrees.
    pub errors_deg: Vec<[f64; 2]>,
    /// From the stamp of a command until its setpoint had been handed to the serial line,
    /// microseconds, sorted.
    pub command_to_wire_us: Vec<f64>,
    /// One entry a second.
    pub statistics: Vec<PeriodStatistics>,
}

fn rms_deg(errors_deg: &[[f64; 2]]) -> [f64; 3] {
    let mean = |square: fn(&[f64; 2]) -> f64| {
        (errors_deg.iter().map(square).sum::<f64>() / errors_deg.len() as f64).sqrt()
    };
    [mean(|e| e[0] * e[0]), mean(|e| e[1] * e[1]), mean(|e| e[0] * e[0] + e[1] * e[1])]
}

fn length_percentile_deg(errors_deg: &[[f64; 2]], share: f64) -> f64 {
    let mut lengths: Vec<f64> = errors_deg.iter().map(|e| e[0].hypot(e[1])).collect();
    quantile_of_unsorted(&mut lengths, share).unwrap_or(f64::NAN)
}

/// Records goal, camera, latencies and statistics while another process commands.
pub struct TrackingRecorder {
    goal: Subscription<JointState>,
    actuators: Subscription<ActuatorState>,
    camera: Subscription<ExternalPosition>,
    statistics: Subscription<PeriodStatistics>,
    goals: TimeSeries<2>,
    frames: TimeSeries<2>,
    /// Sequence of the command that each motor carried out last.
    carried_out: [u64; 2],
    run: MotionRun,
}

impl TrackingRecorder {
    pub fn new(client: &Client) -> Self {
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

    pub fn read(&mut self) -> Result<(), Failure> {
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

    pub fn finish(mut self) -> MotionRun {
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

pub struct Followed {
    pub family: String,
    pub motion: Motion,
    pub run: MotionRun,
}

/// Prints everything.
pub fn print(followed: &[Followed]) {
    tracking(followed);
    println!("  The camera adds its noise of about 0.05 degrees per axis.");
    if let Some(last) = followed.last() {
        statistics(&last.run.statistics);
        latency(&last.run.command_to_wire_us);
    }
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

fn statistics(windows: &[PeriodStatistics]) {
    let (Some(first), Some(last)) = (windows.first(), windows.last()) else {
        println!("\nThe loop reported no statistics.");
        return;
    };
    let of = |pick: fn(&PeriodStatistics) -> &SpanSummary| {
        let us = |value: fn(&SpanSummary) -> u64| -> Vec<f64> {
            windows.iter().map(|window| value(pick(window)) as f64 / 1e3).collect()
        };
        let typical = |mut values: Vec<f64>| quantile_of_unsorted(&mut values, 0.5);
        let max = us(|times| times.max_ns).into_iter().reduce(f64::max);
        [typical(us(|times| times.p50_ns)), typical(us(|times| times.p99_ns)), max]
            .map(Option::unwrap_or_default)
    };
    let ticks: u64 = windows.iter().map(|window| window.ticks).sum();
    let missed: u64 = windows.iter().map(|window| window.missed).sum();
    println!(
        "\nControl loop, {:.0} Hz: {ticks} ticks, {missed} skipped; {}",
        1e9 / first.period_ns as f64,
        granted(last)
    );
    println!("  microseconds  p50 (typical)  p99 (typical)        max");
    for (name, [p50, p99, max]) in
        [("lateness", of(|window| &window.lateness)), ("compute", of(|window| &window.compute))]
    {
        println!("  {name:12} {p50:>14.1} {p99:>14.1} {max:>10.1}");
    }
    println!("  typical: median over the windows of one second");
}

fn granted(statistics: &PeriodStatistics) -> String {
    let scheduling = match statistics.priority {
        0 => "normal scheduling".to_owned(),
        priority => format!("SCHED_FIFO {priority}"),
    };
    let memory = if statistics.memory_locked == 1 { "memory locked" } else { "memory not locked" };
    let cpu = if statistics.cpu == u32::MAX {
        "not pinned".to_owned()
    } else {
        format!("pinned to processor {}", statistics.cpu)
    };
    format!("{scheduling}, {memory}, {cpu}")
}

fn latency(sorted_us: &[f64]) {
    let ms = |share| quantile(sorted_us, share).unwrap_or(f64::NAN) / 1e3;
    println!(
        "\nCommand published by another process -> its setpoint handed to the serial line, {} \
         commands",
        sorted_us.len()
    );
    println!(
        "  p50 {:.2} ms, p90 {:.2} ms, p99 {:.2} ms, max {:.2} ms",
        ms(0.5),
        ms(0.9),
        ms(0.99),
        ms(1.0)
    );
    println!("  On the wire a setpoint takes another 1.2 ms (14 bytes at 115200 baud).");
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
