//! `i2ris vision calibrate`: which view shows which axis, which way round, how far turned; and the
//! straight pose.

use std::path::PathBuf;

use i2ris::units::Nanos;
use i2ris_vision::frame_pairing::{FramePairer, PairResult};
use i2ris_vision::rest_pose::{RestPose, RestPoseEstimator};
use i2ris_vision::setup::{JointAxis, VisionSetup};
use i2ris_vision::view_alignment::{is_reversed, two_views};
use i2ris_vision::view_detector::{ViewDetector, ViewResult};

use super::input::{Format, check_count};
use super::measure::span;
use super::report::rest_words;
use i2ris_report::Failure;

/// Arguments of `i2ris vision calibrate`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Description of the views so far; axis, reversed and turn_deg may be anything that is
    /// allowed
    #[arg(long, value_name = "FILE", default_value = "config/vision.toml")]
    setup: PathBuf,
    /// Where to write what is found
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
    /// Frames of each view while only pitch moves: rest first, then towards positive, then as you
    /// like
    #[arg(long, value_name = "IMAGES", num_args = 1..=2)]
    pitch: Vec<PathBuf>,
    /// Frames of each view while only yaw moves, likewise
    #[arg(long, value_name = "IMAGES", num_args = 1..=2)]
    yaw: Vec<PathBuf>,
    /// Frames of each view at rest [default: the beginning of the pitch motion, or of the yaw
    /// motion]
    #[arg(long, value_name = "IMAGES", num_args = 1..=2)]
    #[arg(required_unless_present_any = ["pitch", "yaw"])]
    rest: Vec<PathBuf>,
    /// How long every motion rests at its beginning
    #[arg(long, value_name = "SECONDS", default_value = "2", value_parser = span)]
    rest_s: Nanos,
    /// Angle between both cameras
    #[arg(long, value_name = "DEG", default_value_t = 90.0, value_parser = between)]
    between_deg: f64,
    #[command(flatten)]
    format: Format,
}

fn between(text: &str) -> Result<f64, String> {
    let value = text.parse().ok().filter(|deg: &f64| (15.0..=165.0).contains(deg));
    value.ok_or_else(|| "must be an angle from 15 to 165".to_owned())
}

/// What one set of frames showed.
struct Motion {
    rests: Vec<RestPose>,
    /// Tangents of every view's angle from rest, where all views could be measured.
    tangents: Vec<Vec<f64>>,
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let mut setup = VisionSetup::load(&arguments.setup)?;
    let read = |paths: &Vec<PathBuf>, rest_s| {
        (!paths.is_empty()).then(|| motion(arguments, &setup, paths, rest_s))
    };
    let pitch = read(&arguments.pitch, arguments.rest_s).transpose()?;
    let yaw = read(&arguments.yaw, arguments.rest_s).transpose()?;
    let rest = read(&arguments.rest, Nanos(u64::MAX)).transpose()?;
    orient(&mut setup, arguments, pitch.as_ref(), yaw.as_ref())?;
    if let Some(motion) = rest.or(pitch).or(yaw) {
        for (view, rest) in setup.views.iter_mut().zip(motion.rests) {
            println!("view {}: {}", view.name, rest_words(&rest));
            view.rest = Some(rest);
        }
    }
    setup.save(&arguments.output)?;
    // What was written has to be readable: two views on one axis, say, are not.
    VisionSetup::load(&arguments.output)?;
    println!("wrote {}", arguments.output.display());
    Ok(())
}

fn orient(
    setup: &mut VisionSetup,
    arguments: &Arguments,
    pitch: Option<&Motion>,
    yaw: Option<&Motion>,
) -> Result<(), Failure> {
    match (setup.views.as_mut_slice(), pitch, yaw) {
        (_, None, None) => return Ok(()),
        ([first, second], Some(pitch), Some(yaw)) => {
            let pairs = |motion: &Motion| -> Vec<[f64; 2]> {
                motion.tangents.iter().filter_map(|row| row.as_slice().try_into().ok()).collect()
            };
            let found = two_views(&pairs(pitch), &pairs(yaw), arguments.between_deg.to_radians())?;
            first.set_plane(found.planes_rad[0]);
            second.set_plane(found.planes_rad[1]);
            println!("both motions agree to {:.2} deg", found.apart_rad.to_degrees());
        }
        ([view], pitch, yaw) => {
            let (axis, motion, name) = match (pitch, yaw) {
                (Some(motion), None) => (JointAxis::Pitch, motion, "pitch"),
                (None, Some(motion)) => (JointAxis::Yaw, motion, "yaw"),
                _ => return Err("one view shows one axis: give --pitch or --yaw, not both".into()),
            };
            let tangents: Vec<f64> =
                motion.tangents.iter().filter_map(|row| row.first().copied()).collect();
            (view.axis, view.turn_deg) = (axis, 0.0);
            view.reversed = is_reversed(name, &tangents)?;
        }
        _ => return Err("two views need two motions: give --pitch and --yaw".into()),
    }
    for view in &setup.views {
        let reversed = if view.reversed { ", reversed" } else { "" };
        println!(
            "view {}: shows {:?}{reversed}, turned by {:+.2} deg",
            view.name, view.axis, view.turn_deg
        );
    }
    Ok(())
}

/// Measures a motion: the straight pose from its first `rest`, and everything from there.
fn motion(
    arguments: &Arguments,
    setup: &VisionSetup,
    paths: &[PathBuf],
    rest: Nanos,
) -> Result<Motion, Failure> {
    check_count(paths, setup, &arguments.setup)?;
    let mut views: Vec<Vec<ViewResult>> = Vec::new();
    let mut rests = Vec::new();
    for (view, path) in setup.views.iter().zip(paths) {
        let (mut source, mut detector) =
            (arguments.format.open(path)?, ViewDetector::new(view.settings()));
        let (mut results, mut estimator) = (Vec::new(), RestPoseEstimator::default());
        while let Some(item) = source.next()? {
            let mut result = detector.detect(item);
            result.image = None;
            let first = results.first().map_or(result.stamp, |first: &ViewResult| first.stamp);
            if result.stamp.since(first) < rest {
                estimator.add(result.seen.as_ref().ok());
            }
            results.push(result);
        }
        rests.push(
            estimator.finish(&view.name).map_err(|error| format!("{}: {error}", path.display()))?,
        );
        views.push(results);
    }
    let tangent = |view: usize, result: &ViewResult| {
        result
            .good()
            .ok()
            .map(|reading| (reading.angle_rad - rests[view].angle_deg.to_radians()).tan())
    };
    let tangents = match views.as_slice() {
        [only] => only.iter().filter_map(|result| tangent(0, result).map(|t| vec![t])).collect(),
        _ => pairs(setup, views)
            .iter()
            .filter_map(|[a, b]| Some(vec![tangent(0, a)?, tangent(1, b)?]))
            .collect(),
    };
    Ok(Motion { rests, tangents })
}

fn pairs(setup: &VisionSetup, views: Vec<Vec<ViewResult>>) -> Vec<[ViewResult; 2]> {
    let mut pairer = FramePairer::new(Nanos((setup.pair_within_ms * 1e6) as u64));
    for (view, results) in views.into_iter().enumerate() {
        results.into_iter().for_each(|result| pairer.push(view, result.stamp, result));
        pairer.end(view);
    }
    let mut pairs = Vec::new();
    while let Some(pair) = pairer.pop() {
        if let PairResult::Matched(_, both) = pair {
            pairs.push(both);
        }
    }
    pairs
}
