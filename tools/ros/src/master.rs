//! A CRTK arm as an input device: a master and its pedal.
//!
//! Its messages become events of a device in a pipe, like those of `i2ris teleop input play`, and
//! `i2ris teleop --device PIPE` reads them. So all checks of a hand device apply: rest before the
//! clutch closes, silence, repetition, values beyond the range, identity, view.
//!
//! A master has no centre. Its deflection is measured from where it last stood still while the
//! pedal was up; one that moves when the pedal goes down is deflected, and the clutch stays open.
//! If its messages end, or come from a different program, the device is unplugged.

use std::fs::{self, File, OpenOptions};
use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use i2ris::clock;
use i2ris::units::Nanos;
use i2ris_teleop::evdev_decoder::{encode, restamp};
use i2ris_teleop::identity::Identity;
use i2ris_teleop::profile::DEAD_MAN_MS;
use i2ris_teleop::recording::{write_frame, write_head};
use i2ris_teleop::state::{Description, Range};
use nix::sys::stat::Mode;
use ros2_client::{Gid, Subscription};
use serde::de::DeserializeOwned;

use crate::message::{JointState, Joy, Maker, PoseStamped};
use crate::{RosError, RosNetwork, join, robot_name};

/// Timeout of a master: without messages for this time it is gone. CRTK streams at 100 Hz and more.
const SILENCE: Nanos = Nanos::from_millis(200);
/// It stands still if it moves less than this share of its range for this time.
const STILL: f64 = 0.02;
const STILL_FOR: Nanos = Nanos::from_millis(200);
const POLL: Nanos = Nanos::from_millis(2);
/// Value of full deflection, and maximum value of the device.
const FULL: f64 = 10_000.0;
const MAX_VALUE: f64 = 1.4 * FULL;
const EV_KEY: u16 = 1;
const EV_ABS: u16 = 3;
const BTN_TRIGGER: u16 = 0x120;
/// "cr" and "tk": no vendor has this number.
const CRTK: (u16, u16) = (0x6372, 0x746b);

/// Master to follow, and its axes.
#[derive(Debug, Clone, clap::Args)]
pub struct MasterOptions {
    /// Name of the arm, e.g. MTML
    #[arg(value_parser = robot_name)]
    arm: String,
    /// Topic of the pedal that is the dead-man (sensor_msgs/Joy, first button)
    #[arg(long, default_value = "/footpedals/coag", value_name = "TOPIC")]
    pedal: String,
    /// Axes to the right and up in the picture: x, y, z of measured_cp, or joints of measured_js; a
    /// leading - reverses the direction
    #[arg(long, default_value = "x,y", value_name = "RIGHT,UP", allow_hyphen_values = true,
          value_parser = axes)]
    axes: [Axis; 2],
    /// Travel of full deflection, m or rad; `i2ris teleop` sets the resulting motion
    #[arg(long, default_value_t = 0.05, value_name = "WAY", value_parser = way)]
    full: f64,
    /// The pipe; created if it does not exist
    #[arg(long, value_name = "PIPE")]
    to: PathBuf,
    #[command(flatten)]
    ros: RosNetwork,
}

fn way(text: &str) -> Result<f64, String> {
    let way = text.parse().ok().filter(|way: &f64| (0.001..=10.0).contains(way));
    way.ok_or_else(|| "must be 0.001 to 10".to_owned())
}

fn axes(text: &str) -> Result<[Axis; 2], String> {
    let (right, up) = text.split_once(',').ok_or("must be two, with a comma between them")?;
    Ok([right, up].map(Axis::new))
}

#[derive(Debug, Clone)]
struct Axis {
    name: String,
    sign: f64,
}

impl Axis {
    fn new(text: &str) -> Self {
        let (sign, name) = text.strip_prefix('-').map_or((1.0, text), |name| (-1.0, name));
        Self { name: name.to_owned(), sign }
    }

    fn of_pose(&self) -> Option<usize> {
        ["x", "y", "z"].iter().position(|axis| *axis == self.name)
    }

    fn in_joints(&self, joints: &JointState) -> Option<f64> {
        let place = joints.name.iter().position(|name| *name == self.name)?;
        Some(self.sign * joints.position.get(place)?)
    }

    fn in_pose(&self, PoseStamped { pose, .. }: &PoseStamped) -> Option<f64> {
        let at = &pose.position;
        Some(self.sign * [at.x, at.y, at.z][self.of_pose()?])
    }
}

/// Conversion of a master and its pedal to events of a device. Pure.
#[derive(Debug, Default)]
struct Follower {
    full: f64,
    /// Position of its centre, and time since which it stands still at `still`.
    centre: Option<[f64; 2]>,
    still: Option<([f64; 2], Nanos)>,
    /// The pedal, and its last message: it sends changes only, and the arm also sends without it.
    pedal: (bool, Nanos),
}

impl Follower {
    fn new(full: f64) -> Self {
        Self { full, ..Self::default() }
    }

    /// The events of a message; `None` while the master has no centre.
    fn events(&mut self, at: [f64; 2], now: Nanos) -> Option<Vec<u8>> {
        let (is_pressed, last_seen) = self.pedal;
        let is_alive = now.duration_since(last_seen) <= Nanos::from_millis(DEAD_MAN_MS);
        let is_pressed = is_pressed && is_alive;
        let away = |from: [f64; 2]| (at[0] - from[0]).hypot(at[1] - from[1]) / self.full;
        match self.still {
            Some((place, since)) if away(place) < STILL => {
                if !is_pressed && now.duration_since(since) >= STILL_FOR {
                    self.centre = Some(at);
                }
            }
            _ => self.still = Some((at, now)),
        }
        let centre = self.centre?;
        let value = |axis: usize| {
            let share = (at[axis] - centre[axis]) / self.full;
            (FULL * share).clamp(-MAX_VALUE, MAX_VALUE).round() as i32
        };
        let mut events = [
            encode(EV_ABS, 0, value(0)),
            encode(EV_ABS, 1, value(1)),
            encode(EV_KEY, BTN_TRIGGER, is_pressed.into()),
            encode(0, 0, 0),
        ]
        .concat();
        restamp(&mut events, now);
        Some(events)
    }
}

/// The device in the pipe. It is unplugged when this is dropped.
#[derive(Debug)]
struct Plug {
    pipe: File,
    from: Gid,
}

impl Plug {
    fn new(path: &Path, arm: &str, from: Gid) -> Result<Self, RosError> {
        let failed = |source| RosError::System { action: "open the pipe", source };
        // Opened for reading as well: it does not wait for a reader, and readers may come and go.
        let mut options = OpenOptions::new();
        options.read(true).write(true).custom_flags(nix::libc::O_NONBLOCK);
        let mut pipe = options.open(path).map_err(failed)?;
        let range = |code| Range { code, minimum: -(FULL as i32), maximum: FULL as i32, flat: 0 };
        let identity = Identity::new(CRTK.0, CRTK.1, &format!("CRTK {arm}"));
        let device = Description::new(identity, vec![range(0), range(1)], vec![BTN_TRIGGER]);
        write_head(&mut pipe, &device).map_err(failed)?;
        Ok(Self { pipe, from })
    }
}

enum Arm {
    Joints(Subscription<JointState>),
    Pose(Subscription<PoseStamped>),
}

impl Arm {
    /// The newest message: position and sender.
    fn newest(&self, axes: &[Axis; 2]) -> Option<([f64; 2], Gid)> {
        let newest = match self {
            Self::Joints(topic) => newest(topic, |at| axes.each_ref().map(|it| it.in_joints(at))),
            Self::Pose(topic) => newest(topic, |at| axes.each_ref().map(|it| it.in_pose(at))),
        };
        newest.filter(|(at, _)| at.iter().all(|value| value.is_finite()))
    }
}

fn newest<M: DeserializeOwned + 'static>(
    topic: &Subscription<M>,
    at: impl Fn(&M) -> [Option<f64>; 2],
) -> Option<([f64; 2], Gid)> {
    let (message, info) = std::iter::from_fn(|| topic.take().ok().flatten()).last()?;
    let [Some(right), Some(up)] = at(&message) else { return None };
    Some(([right, up], info.publisher_gid()))
}

/// Follows a master until `stop`. `say` receives a line for every event.
pub fn follow(
    options: &MasterOptions,
    stop: impl Fn() -> bool,
    mut say: impl FnMut(&str),
) -> Result<(), RosError> {
    let MasterOptions { arm: name, axes, full, to, ros, .. } = options;
    let (_context, mut node) = join(ros.ros_domain, &ros.network, "i2ris_master")?;
    let mut make = Maker { node: &mut node, robot: name };
    let pedal = make.subscription::<Joy>(&options.pedal)?;
    let arm = if axes.iter().all(|axis| axis.of_pose().is_some()) {
        Arm::Pose(make.subscription("measured_cp")?)
    } else {
        Arm::Joints(make.subscription("measured_js")?)
    };
    let _pipe = Pipe::make(to)?;
    let follows = format!("`i2ris teleop --mode position --device {}` follows it", to.display());
    say(&format!("waiting for /{name}; {follows}; Ctrl-C stops"));
    let mut follower = Follower::new(*full);
    let (mut plug, mut last_seen) = (None::<Plug>, Nanos::ZERO);
    while !stop() {
        let now = clock::now();
        while let Ok(Some((joy, _))) = pedal.take() {
            let is_pressed = joy.buttons.first().is_some_and(|button| *button != 0);
            follower.pedal = (is_pressed, now);
        }
        if let Some((at, from)) = arm.newest(axes) {
            last_seen = now;
            if plug.as_ref().is_some_and(|plug| plug.from != from) {
                say("a different program sends for the master now: plugging it in again");
                (plug, follower.centre) = (None, None);
            } else if let Some(events) = follower.events(at, now) {
                if plug.is_none() {
                    say(&format!("/{name} is connected"));
                    plug = Some(Plug::new(to, name, from)?);
                }
                // The reader is late, or gone: the next message repeats everything.
                let _ = plug.as_mut().map(|plug| write_frame(&mut plug.pipe, now, &events));
            }
        } else if plug.is_some() && now.duration_since(last_seen) > SILENCE {
            say(&format!("/{name} is silent: unplugged until it sends again"));
            (plug, follower) = (None, Follower::new(*full));
        }
        clock::sleep(POLL);
    }
    Ok(())
}

/// The pipe in the file system, removed at the end if it was made here.
struct Pipe<'a>(Option<&'a Path>);

impl<'a> Pipe<'a> {
    fn make(path: &'a Path) -> Result<Self, RosError> {
        if fs::metadata(path).is_ok_and(|file| file.file_type().is_fifo()) {
            return Ok(Self(None));
        }
        let made = nix::unistd::mkfifo(path, Mode::S_IRUSR | Mode::S_IWUSR);
        made.map_err(|error| RosError::System { action: "create the pipe", source: error.into() })?;
        Ok(Self(Some(path)))
    }
}

impl Drop for Pipe<'_> {
    fn drop(&mut self) {
        if let Some(path) = self.0 {
            // Only tidying: it may be gone already.
            let _ = fs::remove_file(path);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(events: Option<Vec<u8>>) -> Option<[i32; 3]> {
        let events = events?;
        let value = |place: usize| {
            i32::from_le_bytes(events[24 * place + 20..24 * place + 24].try_into().unwrap())
        };
        Some([value(0), value(1), value(2)])
    }

    #[test]
    fn master_counts_from_rest_with_the_pedal_up() {
        let mut follower = Follower::new(0.05);
        let ms = Nanos::from_millis;
        assert_eq!(values(follower.events([0.2, 0.1], ms(0))), None, "its centre is unknown");
        assert_eq!(values(follower.events([0.2, 0.1], ms(200))), Some([0, 0, 0]));
        // Moved with the pedal up: deflected, until it stands still.
        assert_eq!(values(follower.events([0.225, 0.1], ms(210))), Some([5000, 0, 0]));
        assert_eq!(values(follower.events([0.225, 0.1], ms(420))), Some([0, 0, 0]));
        follower.pedal = (true, ms(425));
        assert_eq!(values(follower.events([0.225, 0.1], ms(430))), Some([0, 0, 1]));
        // It may stand still for any time while the pedal is down.
        for at in [440, 1000, 5000] {
            assert_eq!(values(follower.events([0.225, 0.075], ms(at))), Some([0, -5000, 1]));
        }
        assert_eq!(values(follower.events([9.0, 0.1], ms(5010))), Some([14_000, 0, 1]));
        // A pedal that was silent for long does not count, even if the arm is alive.
        let late = ms(426 + DEAD_MAN_MS);
        assert_eq!(values(follower.events([9.0, 0.1], late)), Some([0, 0, 0]));
    }
}
