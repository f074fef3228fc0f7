//! Motions of one joint axis at a time, seen by the emulated camera: what tells the views apart.

use std::f64::consts::TAU;
use std::path::Path;

use i2ris::clock;
use i2ris::ipc::StateCommand;
use i2ris::ipc::client::Client;
use i2ris::ipc::payload::ExternalPosition;
use i2ris::rt::Ticker;
use i2ris::units::Nanos;

use crate::command::watch::Watch;
use crate::demo::{process::Process, watch_over};
use i2ris_statistics::TimeSeries;
use i2ris_terminal::Failure;

/// How long a motion rests at its beginning, s.
pub const REST_S: f64 = 2.0;
/// Swings of a motion.
const SWINGS: f64 = 3.0;
/// Time of a swing, s.
const SWING_S: f64 = 8.0;
/// How far each motor turns, counts: about 28 deg of bend.
const REACH_COUNTS: f64 = 950.0;
/// Commands per second are four times what the deadline asks for.
const PERIOD: Nanos = Nanos::from_millis(5);
/// A program that was held up goes on where it was instead of jumping ahead, s.
const LONGEST_STEP_S: f64 = 0.02;
/// How long the controller may take to tell its state.
const NEWS: Nanos = Nanos::from_millis(3000);
/// Pictures that are on their way.
const AFTERGLOW: Nanos = Nanos::from_millis(300);

/// The motors pull at 45 degrees to the joint axes, so both turn for one axis. The signs are what a
/// person finds out by turning a motor and looking at the snake.
#[derive(Debug, Clone, Copy)]
pub enum Swing {
    Pitch,
    Yaw,
}

impl Swing {
    fn directions(self) -> [f64; 2] {
        match self {
            Self::Pitch => [1.0, -1.0],
            Self::Yaw => [1.0, 1.0],
        }
    }

    fn counts(self, time_s: f64) -> [i32; 2] {
        let swung = (time_s - REST_S).max(0.0);
        // The last swing comes to rest: no jump where it ends.
        let size = ((SWINGS * SWING_S - swung) / (0.5 * SWING_S)).clamp(0.0, 1.0);
        let place = REACH_COUNTS * size * (TAU * swung / SWING_S).sin();
        self.directions()
            .map(|direction| (direction * place).round() as i32)
    }

    /// Moves the robot and writes what the camera saw as angles over time.
    pub fn record(
        self,
        client: &mut Client,
        children: &mut [&mut Process],
        file: &Path,
    ) -> Result<(), Failure> {
        let mut camera = client.watcher().external();
        let mut commander = client.commander();
        let mut seen = TimeSeries::<2>::default();
        let start = clock::now();
        camera.drain(|_| {})?;
        let mut watch = Watch::new(client.id(), &client.wait_for(NEWS, |_| true)?, clock::now());
        let mut ticker = Ticker::new(start + PERIOD, PERIOD, Nanos::ZERO);
        let (mut last, mut time_s) = (start, 0.0);
        while time_s <= REST_S + SWINGS * SWING_S {
            let now = ticker.wait().started;
            watch_over(children)?;
            time_s += now.since(last).as_seconds().min(LONGEST_STEP_S);
            last = now;
            commander.servo_actuators(&self.counts(time_s))?;
            listen(&mut camera, &mut seen)?;
            if let Some(state) = client.operating_state()? {
                watch.judge(&state, clock::now())?;
            }
        }
        clock::sleep(AFTERGLOW);
        listen(&mut camera, &mut seen)?;
        client.state_command(StateCommand::Release)?;
        write(file, &seen, start)
    }
}

fn listen(
    camera: &mut i2ris::ipc::client::Subscription<ExternalPosition>,
    seen: &mut TimeSeries<2>,
) -> Result<(), Failure> {
    camera.drain(|picture| {
        if picture.flags & ExternalPosition::VALID != 0 {
            let [pitch, yaw, _] = picture.position;
            seen.push(picture.stamp_ns, [pitch.to_degrees(), yaw.to_degrees()]);
        }
    })?;
    Ok(())
}

fn write(file: &Path, seen: &TimeSeries<2>, start: Nanos) -> Result<(), Failure> {
    let mut writer = csv::Writer::from_path(file)?;
    writer.write_record(["t_s", "pitch_deg", "yaw_deg"])?;
    for (stamp, [pitch, yaw]) in seen.iter().filter(|(stamp, _)| *stamp >= start.0) {
        let time_s = Nanos(*stamp).since(start).as_seconds();
        writer.write_record([time_s.to_string(), pitch.to_string(), yaw.to_string()])?;
    }
    Ok(writer.flush()?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_swing_rests_first_moves_one_axis_softly_and_ends_at_rest() {
        for (swing, sign) in [(Swing::Pitch, -1), (Swing::Yaw, 1)] {
            let places: Vec<[i32; 2]> = (0..=5200)
                .map(|k| swing.counts(f64::from(k) * 0.005))
                .collect();
            assert!(places.iter().all(|[a, b]| *b == sign * a));
            assert!(places[..400].iter().all(|place| *place == [0, 0]));
            assert!(
                places
                    .windows(2)
                    .all(|pair| (pair[1][0] - pair[0][0]).abs() < 6)
            );
            assert!(places.iter().any(|[a, _]| *a > 900) && places.iter().any(|[a, _]| *a < -900));
            assert_eq!(places.last(), Some(&[0, 0]));
        }
    }
}
