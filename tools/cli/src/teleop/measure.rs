//! Measures the orientation of the camera image by two small motions.

use i2ris::ipc::client::{Client, Commander, Latest};
use i2ris::{clock, ipc::Message, ipc::payload::ExternalPosition, realtime::Ticker, units::Nanos};
use i2ris_report::{Failure, Interrupt, bail};
use i2ris_teleop::view::{SeenMotion, View};

use crate::command::stream::present_pose;
use crate::command::trajectory::Angles;

const MOTION_DEG: f64 = 1.0;
const SPEED_DEG_S: f64 = 2.0;
const PERIOD: Nanos = Nanos::from_millis(5);
const REST: Nanos = Nanos::from_millis(500);
const LOOK: Nanos = Nanos::from_millis(1000);
/// On a busy computer, images come late.
const LONGEST_LOOK: Nanos = Nanos::from_millis(5000);
const MIN_FRAMES: usize = 5;

/// Camera reading: mean, right and up, deg, and the variance of that mean.
struct Seen {
    mean: [f64; 2],
    variance: f64,
    setpoint: Angles,
}

/// Moves pitch and yaw by a degree to both sides, and returns to the start.
///
/// Both ends of a motion are reached from the same side: backlash is not taken for a rotation.
pub fn measure(client: &Client, interrupt: &Interrupt) -> Result<View, Failure> {
    let (commander, camera) = (client.commander(), Latest::new(client.watcher().external()));
    let pose = present_pose(client)?;
    let mut mover = Mover { commander, camera, pose, interrupt };
    let start = mover.pose;
    let mut motion = |axis: usize| -> Result<SeenMotion, Failure> {
        let at = |by_deg: f64| {
            let mut pose = start;
            pose[axis] += by_deg;
            pose
        };
        mover.go(at(-2.0 * MOTION_DEG))?;
        mover.go(at(-MOTION_DEG))?;
        let before = mover.look(client)?;
        mover.go(at(MOTION_DEG))?;
        let after = mover.look(client)?;
        mover.go(start)?;
        let difference = |a: [f64; 2], b: [f64; 2]| [b[0] - a[0], b[1] - a[1]];
        Ok(SeenMotion {
            moved_deg: after.setpoint[axis] - before.setpoint[axis],
            picture: difference(before.mean, after.mean),
            deviation: (before.variance + after.variance).sqrt(),
        })
    };
    Ok(View::measured(motion(0)?, motion(1)?)?)
}

struct Mover<'a> {
    commander: Commander,
    camera: Latest<ExternalPosition>,
    pose: Angles,
    interrupt: &'a Interrupt,
}

impl Mover<'_> {
    fn go(&mut self, to: Angles) -> Result<(), Failure> {
        let from = self.pose;
        let distance = (to[0] - from[0]).hypot(to[1] - from[1]);
        let steps = (distance / (SPEED_DEG_S * PERIOD.as_seconds())).ceil().max(1.0);
        let mut ticker = Ticker::new(clock::now() + PERIOD, PERIOD, Nanos::ZERO);
        for step in 1..=steps as u64 {
            ticker.wait();
            let share = step as f64 / steps;
            self.pose = [0, 1].map(|axis| from[axis] + share * (to[axis] - from[axis]));
            self.send()?;
        }
        Ok(())
    }

    fn send(&mut self) -> Result<(), Failure> {
        if self.interrupt.came() {
            bail!("interrupted while measuring the view; the snake holds");
        }
        self.commander.servo_jp(&self.pose.map(f64::to_radians))?;
        Ok(())
    }

    fn look(&mut self, client: &Client) -> Result<Seen, Failure> {
        let start = clock::now();
        let mut ticker = Ticker::new(start + PERIOD, PERIOD, Nanos::ZERO);
        let (mut frames, mut last): (Vec<[f64; 2]>, _) = (Vec::new(), Nanos::ZERO);
        loop {
            let looked = ticker.wait().started.duration_since(start + REST);
            if looked > if frames.len() < MIN_FRAMES { LONGEST_LOOK } else { LOOK } {
                break;
            }
            self.send()?;
            if let Some(frame) = self.camera.refresh()?.copied()
                && frame.flags & ExternalPosition::VALID != 0
                && frame.count == 2
                && frame.stamp() > last.max(start + REST)
            {
                last = frame.stamp();
                let [pitch, yaw, _] = frame.position;
                // The camera's up is pitch, and its right is yaw.
                frames.push([yaw.to_degrees(), pitch.to_degrees()]);
            }
        }
        let count = frames.len() as f64;
        if frames.len() < MIN_FRAMES {
            bail!(
                "the view cannot be measured: {} images in {} s; start `i2ris vision`, or give \
                 the view by --view",
                frames.len(),
                LONGEST_LOOK.as_seconds()
            );
        }
        let mean = [0, 1].map(|axis| frames.iter().map(|frame| frame[axis]).sum::<f64>() / count);
        let square = |frame: &[f64; 2], axis: usize| (frame[axis] - mean[axis]).powi(2);
        let squares = |axis: usize| frames.iter().map(|frame| square(frame, axis)).sum::<f64>();
        let variance = squares(0).max(squares(1)) / (count - 1.0) / count;
        Ok(Seen { mean, variance, setpoint: present_pose(client)? })
    }
}
