//! Frames of recorded angles: as files, or as streams that are as fast as their reader.

use std::fs;

use i2ris::units::Nanos;
use i2ris_vision::drawing::save_grey;
use i2ris_vision::scene::{JointPose, Rig};

use super::fifo::Fifos;
use super::{Arguments, fifo, write_setup};
use i2ris_terminal::Failure;
use i2ris_terminal::Interrupt;

/// Frames of the straight pose that are drawn beside those of a recording.
const REST_FRAMES: u64 = 15;

/// Poses over time.
pub type Poses = [(Nanos, JointPose)];

/// Draws into folders, `view0` and `view1`, and the straight pose into `rest0` and `rest1`.
pub fn files(arguments: &Arguments, rig: &Rig, poses: &Poses) -> Result<(), Failure> {
    for view in 0..rig.cameras.len() {
        for kind in ["view", "rest"] {
            let folder = arguments.output.join(format!("{kind}{view}"));
            fs::create_dir_all(&folder)
                .map_err(|error| format!("{}: {error}", folder.display()))?;
        }
    }
    for number in 0..REST_FRAMES {
        // Numbers that no row has, so that the noise is another.
        draw(
            arguments,
            rig,
            "rest",
            Nanos::from_millis(33 * number),
            JointPose::default(),
            u64::MAX - number,
        )?;
    }
    let mut drawn = 0_u64;
    for (number, (stamp, pose)) in poses.iter().enumerate().step_by(arguments.every as usize) {
        draw(arguments, rig, "view", *stamp, *pose, number as u64)?;
        drawn += 1;
    }
    let path = write_setup(arguments, rig)?;
    println!("{drawn} poses drawn for {} views; wrote {}", rig.cameras.len(), path.display());
    Ok(())
}

/// Draws into FIFOs, `view0` and `view1`, and waits for their reader.
pub fn stream(
    arguments: &Arguments,
    rig: &Rig,
    poses: &Poses,
    interrupt: &Interrupt,
) -> Result<(), Failure> {
    let path = write_setup(arguments, rig)?;
    let fifos = Fifos::make(&[fifo(arguments, 0), fifo(arguments, 1)])?;
    println!("wrote {}; drawing for who reads view0 and view1 beside it", path.display());
    let mut drawn = 0_u64;
    for (number, (stamp, pose)) in poses.iter().enumerate().step_by(arguments.every as usize) {
        if interrupt.came() {
            return Err("interrupted".into());
        }
        let handed =
            fifos.sender().map(|to| to.send((*stamp, rig.render_views(*pose, number as u64))));
        if !matches!(handed, Some(Ok(()))) {
            return Err(format!("the reader went away after {drawn} poses").into());
        }
        drawn += 1;
    }
    fifos.finish();
    println!("{drawn} poses drawn for {} views", rig.cameras.len());
    Ok(())
}

fn draw(
    arguments: &Arguments,
    rig: &Rig,
    kind: &str,
    stamp: Nanos,
    pose: JointPose,
    number: u64,
) -> Result<(), Failure> {
    let name = format!("frame_t{}.{:09}.png", stamp.0 / 1_000_000_000, stamp.0 % 1_000_000_000);
    for (view, image) in rig.render_views(pose, number).iter().enumerate() {
        save_grey(&arguments.output.join(format!("{kind}{view}")).join(&name), image)?;
    }
    Ok(())
}
