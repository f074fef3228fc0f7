//! Motions of one joint axis at a time, recorded by the emulated camera. They identify the views.

use std::f64::consts::TAU;

use i2ris::clock;
use i2ris::ipc::StateCommand;
use i2ris::ipc::client::Subscription;
use i2ris::ipc::payload::ExternalPosition;
use i2ris::realtime::Ticker;
use i2ris::units::Nanos;
use i2ris_report::Failure;
use i2ris_report::statistics::TimeSeries;

use super::commands::{Demo, finish};
use crate::command::stream_monitor::StreamMonitor;
use crate::csv_table;
use crate::progress_bar::spinner;
use i2ris_simulation::motion::trajectory_time::LONGEST_STEP_S;

/// Rest at the beginning of a motion, s.
pub const REST_S: f64 = 2.0;
const SWINGS: f64 = 3.0;
/// Period of an oscillation, s.
const SWING_S: f64 = 8.0;
/// How far each motor turns, counts: about 28 deg of bend.
const REACH_COUNTS: f64 = 950.0;
/// Commands per second are four times what the deadline asks for.
const PERIOD: Nanos = Nanos::from_millis(5);
const STATE_TIMEOUT: Nanos = Nanos::from_millis(3000);
const CAMERA_DELAY: Nanos = Nanos::from_millis(300);

/// The motors pull at 45 degrees to the joint axes, so both turn for one axis. The signs are what a
/// person finds out by turning a motor and looking at the snake.
#[derive(Debug, Clone, Copy)]
pub enum SingleAxisMotion {
    Pitch,
    Yaw,
}

impl SingleAxisMotion {
    fn name(self) -> &'static str {
        match self {
            Self::Pitch => "pitch",
            Self::Yaw => "yaw",
        }
    }

    fn directions(self) -> [f64; 2] {
        match self {
            Self::Pitch => [1.0, -1.0],
            Self::Yaw => [1.0, 1.0],
        }
    }

    fn counts(self, time_s: f64) -> [i32; 2] {
        let swung = (time_s - REST_S).max(0.0);
        // The last oscillation fades out, so the motion ends at rest.
        let size = ((SWINGS * SWING_S - swung) / (0.5 * SWING_S)).clamp(0.0, 1.0);
        let counts = REACH_COUNTS * size * (TAU * swung / SWING_S).sin();
        self.directions().map(|direction| (direction * counts).round() as i32)
    }
}

impl Demo {
    /// Moves one axis and writes the angles of the camera over time.
    pub fn swing(&mut self, axis: SingleAxisMotion) -> Result<(), Failure> {
        let name = axis.name();
        let bar = spinner(&format!("move {name} alone"));
        let mut client = self.connect()?;
        let mut camera = client.watcher().external();
        let mut commander = client.commander();
        let start = clock::now();
        camera.drain(|_| {})?;
        let state = client.wait_for(STATE_TIMEOUT, |_| true)?;
        let mut monitor = StreamMonitor::new(client.id(), &state, clock::now());
        let mut seen = TimeSeries::default();
        let mut ticker = Ticker::new(start + PERIOD, PERIOD, Nanos::ZERO);
        let (mut last, mut time_s) = (start, 0.0);
        while time_s <= REST_S + SWINGS * SWING_S {
            let now = ticker.wait().started;
            self.check()?;
            time_s += now.since(last).as_seconds().min(LONGEST_STEP_S);
            last = now;
            commander.servo_actuators(&axis.counts(time_s))?;
            receive(&mut camera, start, &mut seen)?;
            if let Some(state) = client.operating_state()? {
                monitor.check(&state, clock::now())?;
            }
        }
        clock::sleep(CAMERA_DELAY);
        receive(&mut camera, start, &mut seen)?;
        client.state_command(StateCommand::Release)?;
        let row = |(stamp, [pitch, yaw]): &(u64, [f64; 2])| {
            vec![Nanos(*stamp).since(start).as_seconds(), *pitch, *yaw]
        };
        let rows: Vec<Vec<f64>> = seen.iter().map(row).collect();
        csv_table::write(&self.path(&format!("{name}.csv")), &csv_table::ANGLES, &rows)?;
        finish(&bar, "done");
        Ok(())
    }
}

fn receive(
    camera: &mut Subscription<ExternalPosition>,
    start: Nanos,
    seen: &mut TimeSeries<2>,
) -> Result<(), Failure> {
    camera.drain(|frame| {
        if frame.flags & ExternalPosition::VALID != 0 && frame.stamp_ns >= start.0 {
            let [pitch, yaw, _] = frame.position.map(f64::to_degrees);
            seen.push(frame.stamp_ns, [pitch, yaw]);
        }
    })?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_motion_rests_first_moves_one_axis_softly_and_ends_at_rest() {
        for (swing, sign) in [(SingleAxisMotion::Pitch, -1), (SingleAxisMotion::Yaw, 1)] {
            let positions: Vec<[i32; 2]> =
                (0..=5200).map(|k| swing.counts(f64::from(k) * 0.005)).collect();
            assert!(positions.iter().all(|[a, b]| *b == sign * a));
            assert!(positions[..400].iter().all(|position| *position == [0, 0]));
            assert!(positions.windows(2).all(|pair| (pair[1][0] - pair[0][0]).abs() < 6));
            assert!(
                positions.iter().any(|[a, _]| *a > 900) && positions.iter().any(|[a, _]| *a < -900)
            );
            assert_eq!(positions.last(), Some(&[0, 0]));
        }
    }
}
