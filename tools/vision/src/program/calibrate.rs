//! `i2ris vision calibrate`: which view shows which axis, which way round, how far turned; and the
//! straight pose.

use std::path::PathBuf;

use i2ris::units::Nanos;
use i2ris_vision::align::{is_reversed, two_views};
use i2ris_vision::look::{Eye, Look};
use i2ris_vision::pair::{Pairer, Together};
use i2ris_vision::rest::{Rest, Resting};
use i2ris_vision::setup::{Axis, Setup};

use super::input::Format;
use super::measure::span;
use super::report::rest_words;
use i2ris_terminal::Failure;

/// Arguments of `i2ris vision calibrate`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// What is known about the views so far; axis, reversed and turn_deg may be anything that is
    /// allowed
    #[arg(long, value_name = "FILE", default_value = "config/vision.toml")]
    setup: PathBuf,
    /// Where to write what is found
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
    /// Pictures of each view while only pitch moves: rest first, then towards positive, then as you
    /// like
    #[arg(long, value_name = "PICTURES", num_args = 1..=2)]
    pitch: Vec<PathBuf>,
    /// Pictures of each view while only yaw moves, likewise
    #[arg(long, value_name = "PICTURES", num_args = 1..=2)]
    yaw: Vec<PathBuf>,
    /// Pictures of each view at rest [default: the beginning of the pitch motion, or of the yaw
    /// motion]
    #[arg(long, value_name = "PICTURES", num_args = 1..=2, required_unless_present_any = ["pitch", "yaw"])]
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
    let value = text
        .parse()
        .ok()
        .filter(|deg: &f64| (15.0..=165.0).contains(deg));
    value.ok_or_else(|| "must be an angle from 15 to 165".to_owned())
}

/// What one set of pictures showed.
struct Motion {
    rests: Vec<Rest>,
    /// Tangents of every view's angle from rest, where all views could be measured.
    tangents: Vec<Vec<f64>>,
}

/// Runs it.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let mut setup = Setup::load(&arguments.setup)?;
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
    Setup::load(&arguments.output)?;
    println!("wrote {}", arguments.output.display());
    Ok(())
}

fn orient(
    setup: &mut Setup,
    arguments: &Arguments,
    pitch: Option<&Motion>,
    yaw: Option<&Motion>,
) -> Result<(), Failure> {
    match (setup.views.as_mut_slice(), pitch, yaw) {
        (_, None, None) => return Ok(()),
        ([first, second], Some(pitch), Some(yaw)) => {
            let pairs = |motion: &Motion| -> Vec<[f64; 2]> {
                motion
                    .tangents
                    .iter()
                    .filter_map(|row| row.as_slice().try_into().ok())
                    .collect()
            };
            let found = two_views(
                &pairs(pitch),
                &pairs(yaw),
                arguments.between_deg.to_radians(),
            )?;
            first.set_plane(found.planes_rad[0]);
            second.set_plane(found.planes_rad[1]);
            println!(
                "both motions agree to {:.2} deg",
                found.apart_rad.to_degrees()
            );
        }
        ([view], pitch, yaw) => {
            let (axis, motion, name) = match (pitch, yaw) {
                (Some(motion), None) => (Axis::Pitch, motion, "pitch"),
                (None, Some(motion)) => (Axis::Yaw, motion, "yaw"),
                _ => return Err("one view shows one axis: give --pitch or --yaw, not both".into()),
            };
            let tangents: Vec<f64> = motion
                .tangents
                .iter()
                .filter_map(|row| row.first().copied())
                .collect();
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
    setup: &Setup,
    paths: &[PathBuf],
    rest: Nanos,
) -> Result<Motion, Failure> {
    if paths.len() != setup.views.len() {
        let (given, wanted) = (paths.len(), setup.views.len());
        return Err(format!(
            "{given} sources of pictures for {wanted} views in {}",
            arguments.setup.display()
        )
        .into());
    }
    let mut views: Vec<Vec<Look>> = Vec::new();
    let mut rests = Vec::new();
    for (view, path) in setup.views.iter().zip(paths) {
        let (mut source, mut eye) = (arguments.format.open(path)?, Eye::new(view.settings()));
        let (mut looks, mut resting) = (Vec::new(), Resting::default());
        while let Some(shot) = source.next()? {
            let mut look = eye.look(shot);
            look.picture = None;
            let first = looks.first().map_or(look.stamp, |first: &Look| first.stamp);
            if look.stamp.since(first) < rest {
                resting.add(look.seen.as_ref().ok());
            }
            looks.push(look);
        }
        rests.push(
            resting
                .finish(&view.name)
                .map_err(|error| format!("{}: {error}", path.display()))?,
        );
        views.push(looks);
    }
    let tangent = |view: usize, look: &Look| {
        look.good()
            .ok()
            .map(|reading| (reading.angle_rad - rests[view].angle_deg.to_radians()).tan())
    };
    let tangents = match views.as_slice() {
        [only] => only
            .iter()
            .filter_map(|look| tangent(0, look).map(|t| vec![t]))
            .collect(),
        _ => pairs(setup, views)
            .iter()
            .filter_map(|[a, b]| Some(vec![tangent(0, a)?, tangent(1, b)?]))
            .collect(),
    };
    Ok(Motion { rests, tangents })
}

fn pairs(setup: &Setup, views: Vec<Vec<Look>>) -> Vec<[Look; 2]> {
    let mut pairer = Pairer::new(Nanos((setup.pair_within_ms * 1e6) as u64));
    for (view, looks) in views.into_iter().enumerate() {
        looks
            .into_iter()
            .for_each(|look| pairer.push(view, look.stamp, look));
        pairer.end(view);
    }
    let mut pairs = Vec::new();
    while let Some(together) = pairer.pop() {
        if let Together::Both(_, both) = together {
            pairs.push(both);
        }
    }
    pairs
}
