//! How many frames a second one processor measures.

use i2ris::clock;
use i2ris::units::Nanos;

use super::stereo::setup;
use crate::scene::{JointPose, Rig};
use crate::source::{FrameClock, FrameSource, SourceError, Y4mStream};
use crate::view_detector::ViewDetector;

/// Poses of the experiment: enough to be typical, few enough to keep their frames in memory.
const POSES: u64 = 32;
/// Times that the frames are measured; the median counts, for other programs take the processor
/// now and then.
const ROUNDS: usize = 5;

/// Frames of 1280x960 that one view measures per second in one thread: the stream is read, every
/// frame is checked against the one before, and measured.
///
/// # Errors
///
/// When the stream cannot be read: not before the reader has a fault.
pub fn speed(seed: u64) -> Result<f64, SourceError> {
    let rig = Rig { seed, ..Rig::laboratory(1280, 960, 200.0) };
    let settings = setup(&rig).views.first().map(crate::setup::View::settings);
    let Some(settings) = settings else {
        return Ok(f64::NAN);
    };
    let stream = stream(&rig);
    let mut rates = Vec::new();
    for _ in 0..ROUNDS {
        let mut source = Y4mStream::open(stream.as_slice(), FrameClock::Rate(30.0))?;
        let mut detector = ViewDetector::new(settings.clone());
        let (start, mut measured) = (clock::now(), 0);
        while let Some(item) = source.next()? {
            measured += u64::from(detector.detect(item).good().is_ok());
        }
        let Nanos(elapsed) = clock::now().since(start);
        rates.push(measured as f64 / (elapsed.max(1) as f64 * 1e-9));
    }
    rates.sort_by(f64::total_cmp);
    Ok(rates[ROUNDS / 2])
}

/// A stream of the first view over the plane of angles.
fn stream(rig: &Rig) -> Vec<u8> {
    let mut bytes = Vec::new();
    for number in 0..POSES {
        let turn = number as f64 * 2.4;
        let bend = 0.7 * ((number as f64 + 0.5) / POSES as f64).sqrt();
        let pose = JointPose { pitch_rad: bend * turn.cos(), yaw_rad: bend * turn.sin() };
        let Some(image) = rig.render_views(pose, number).into_iter().next() else {
            continue;
        };
        if bytes.is_empty() {
            bytes.extend(
                format!("YUV4MPEG2 W{} H{} F30:1 Cmono\n", image.width(), image.height()).bytes(),
            );
        }
        bytes.extend(b"FRAME\n");
        bytes.extend(image.data());
    }
    bytes
}
