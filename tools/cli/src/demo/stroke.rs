//! The calibration stroke: moves the motors by counts and records what the camera sees.

use i2ris::clock;
use i2ris::ipc::client::Client;
use i2ris::units::Nanos;
use i2ris_calibration::recording::Row;
use indicatif::ProgressBar;

use super::motion::calibration_counts;
use super::process::Process;
use super::watch_over;
use crate::Failure;
use crate::series::Series;

/// How long the stroke takes.
pub const DURATION_S: f64 = 40.0;
/// Encoder feedback comes 100 to 240 times a second; a hole of this length is a stall of the machine, not data.
const GAP_NS: u64 = 60_000_000;
/// Set-points are sent this often.
const COMMAND_PERIOD: Nanos = Nanos::from_millis(5);

/// Runs the stroke on an enabled controller and returns a row for every picture.
pub fn record(
    client: &Client,
    children: &mut [&mut Process],
    amplitude_counts: f64,
    bar: &ProgressBar,
) -> Result<Vec<Row>, Failure> {
    let watcher = client.watcher();
    let (mut actuators, mut camera) = (watcher.actuators(), watcher.external());
    let mut commander = client.commander();
    let (mut encoders, mut pictures) = ([Series::<1>::default(), Series::default()], Series::<2>::default());
    let start = clock::now();
    loop {
        let now = clock::now();
        let t_s = (now - start).as_seconds();
        if t_s > DURATION_S {
            break;
        }
        watch_over(children)?;
        commander.servo_actuators(&calibration_counts(t_s, DURATION_S, amplitude_counts))?;
        actuators.drain(|state| {
            for (motor, series) in encoders.iter_mut().enumerate() {
                series.push(state.measured_stamp_ns[motor], [f64::from(state.measured_counts[motor])]);
            }
        })?;
        camera.drain(|seen| {
            if seen.stamp_ns >= start.0 && seen.flags != 0 {
                pictures.push(seen.stamp_ns, [seen.position[0].to_degrees(), seen.position[1].to_degrees()]);
            }
        })?;
        bar.set_position((t_s * 10.0) as u64);
        clock::sleep_until(now + COMMAND_PERIOD);
    }
    let row = |&(stamp, angles_deg): &(u64, [f64; 2])| {
        let counts = [encoders[0].at(stamp, GAP_NS)?[0], encoders[1].at(stamp, GAP_NS)?[0]];
        let [pitch, yaw] = angles_deg;
        let time_s = Some((Nanos(stamp) - start).as_seconds());
        Some(Row { line: 0, time_s, counts, outputs: [pitch, yaw, 0.0], place: 0 })
    };
    Ok(pictures.iter().filter_map(row).collect())
}
