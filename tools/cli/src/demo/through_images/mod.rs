//! `i2ris demo --through-images`: a calibration whose angles come from images, compared with one
//! from the true angles.
//!
//! One run of the emulator, its camera without noise, gives encoder counts and true angles. What a
//! microscope would have filmed is drawn from the angles and measured by `i2ris vision`, which
//! knows only what its own calibration, from motions of one axis at a time, found out. Both
//! recordings hold the same motion and the same instants; one has true angles, the other those of
//! the pictures. A model is fitted to each, and the controller follows an unseen motion with each.
//!
//! Pictures are drawn after the motion, not during it: two views at 30 pictures a second, drawn and
//! measured, take more than a processor. (`i2ris vision render --live` draws during it, for who has
//! them.)
//!
//! | file | holds |
//! |---|---|
//! | `single_axis` | motions of one joint axis |

mod single_axis;

use std::fs;
use std::path::Path;
use std::time::Duration;

use super::arguments::Arguments;
use super::process::Process;
use super::progress::{bar, check_children, finish, step};
use super::setup::{DemoSetup, text};
use super::steps::{calibrate, fit_to, follow};
use super::summary::Followed;
use super::tracking::rms_deg;
use super::unseen_motion::Motion;
use i2ris_terminal::Failure;
use i2ris_terminal::pose_table::{self, Pose};
use single_axis::{REST_S, SingleAxisMotion};

/// Rotation of the cameras, deg, which their calibration has to find.
const TURNED_DEG: &str = "10";
/// Every Nth frame of a single-axis motion is rendered: 10 images a second are enough.
const EVERY: &str = "3";

/// The recording with true angles at the instants of the images only.
const DIRECT: &str = "direct.csv";

/// The two sources of angles: name, and recording.
const VARIANTS: [(&str, &str); 2] = [("direct", DIRECT), ("images", "images.csv")];

/// Runs it.
pub fn show(demo: &DemoSetup, arguments: &Arguments, size: &str) -> Result<(), Failure> {
    let mut emulator = step("start two emulated drives with a snake behind them", || {
        demo.start_emulator(arguments.seed, &["--camera-noise-deg", "0"])
    })?;
    match &arguments.from {
        Some(folder) => demo.take(folder)?,
        None => {
            swing(demo, &mut emulator)?;
            calibrate(demo, &mut emulator, arguments)?;
        }
    }
    if !demo.path("images.csv").exists() {
        keep_every(&demo.path("recording.csv"), &demo.path(DIRECT), arguments.pictures_every)?;
        measure_images(demo, &mut emulator, size)?;
    }
    let families = arguments.families("gmr-stop");
    let mut followed = Vec::new();
    for family in &families {
        for (variant, recording) in VARIANTS {
            let model = format!("{family}-{variant}");
            if !demo.path(&format!("{model}.json")).exists() {
                step(&format!("fit `{family}` to {recording}"), || {
                    fit_to(demo, recording, family, &model, arguments.seed)
                })?;
            }
            followed.extend(follow(demo, &mut emulator, arguments, &model)?);
        }
    }
    step("stop the emulator", || emulator.end())?;
    super::summary::print(&followed, "The camera adds nothing: its angles are the true ones.");
    print_image_errors(demo)?;
    for family in &families {
        arguments.motions.iter().for_each(|motion| print_loss(&followed, family, *motion));
    }
    Ok(())
}

/// Records motions of one axis at a time, from the straight pose on: nothing has moved the snake
/// before.
fn swing(demo: &DemoSetup, emulator: &mut Process) -> Result<(), Failure> {
    let (mut controller, mut client) =
        step("start the controller, home, enable", || demo.start_controller(None))?;
    for (name, swing) in [("pitch", SingleAxisMotion::Pitch), ("yaw", SingleAxisMotion::Yaw)] {
        let file = demo.path(&format!("{name}.csv"));
        step(&format!("move {name} alone"), || {
            swing.record(&mut client, &mut [&mut *emulator, &mut controller], &file)
        })?;
    }
    drop(client);
    controller.end()
}

/// Renders the images of the cameras and measures them.
fn measure_images(demo: &DemoSetup, emulator: &mut Process, size: &str) -> Result<(), Failure> {
    let file = |name: &str| text(&demo.path(name));
    for axis in ["pitch", "yaw"] {
        let (angles, folder) = (file(&format!("{axis}.csv"))?, file(axis)?);
        let render = ["vision", "render", "--angles", &angles, "--output", &folder, "--size", size];
        let options = ["--turned-deg", TURNED_DEG, "--every", EVERY];
        run(
            demo,
            emulator,
            &format!("render the motion of {axis}"),
            &[&render[..], &options].concat(),
        )?;
    }
    write_uncalibrated_setup(&demo.path("pitch/vision.toml"), &demo.path("guess.toml"))?;
    let (guess, setup, rest) = (file("guess.toml")?, file("vision.toml")?, REST_S.to_string());
    let folders = ["pitch/view0", "pitch/view1", "yaw/view0", "yaw/view1"].map(file);
    let [p0, p1, y0, y1] = folders;
    let (p0, p1, y0, y1) = (p0?, p1?, y0?, y1?);
    let calibrate =
        ["vision", "calibrate", "--setup", &guess, "--output", &setup, "--rest-s", &rest];
    let motions = ["--pitch", &p0, &p1, "--yaw", &y0, &y1];
    run(
        demo,
        emulator,
        "calibrate the views by those motions",
        &[&calibrate[..], &motions].concat(),
    )?;
    stream(demo, emulator, size, &setup)?;
    let (recording, angles, images) = (file(DIRECT)?, file("angles.csv")?, file("images.csv")?);
    run(
        demo,
        emulator,
        "bring angles and counts together",
        &["calibrate", "merge", &recording, &angles, "--output", &images],
    )
}

/// Keeps the angles of every Nth row that has angles; the other rows keep their counts only.
fn keep_every(recording: &Path, to: &Path, every: u32) -> Result<(), Failure> {
    let mut reader = csv::Reader::from_path(recording)?;
    let header = reader.headers()?.clone();
    let is_angle = |column: usize| header.get(column).is_some_and(|name| name.ends_with("_deg"));
    let mut writer = csv::Writer::from_path(to)?;
    writer.write_record(&header)?;
    let mut images = 0_u32;
    for row in reader.records() {
        let row = row?;
        let has_angles =
            (0..row.len()).any(|column| is_angle(column) && row.get(column) != Some(""));
        let keeps = !has_angles || images.is_multiple_of(every);
        images += u32::from(has_angles);
        let cell = |(column, cell)| if keeps || !is_angle(column) { cell } else { "" };
        writer.write_record(row.iter().enumerate().map(cell))?;
    }
    Ok(writer.flush()?)
}

/// Writes the setup of a person who has not calibrated the views yet: one view per axis, in the
/// usual direction, without a straight pose.
fn write_uncalibrated_setup(drawn: &Path, to: &Path) -> Result<(), Failure> {
    let mut setup: toml::Table = fs::read_to_string(drawn)?.parse()?;
    let views = setup.get_mut("view").and_then(toml::Value::as_array_mut);
    let views = views.ok_or("the setup names no views")?;
    for (view, axis) in views.iter_mut().zip(["pitch", "yaw"]) {
        let view = view.as_table_mut().ok_or("a view is no table")?;
        view.insert("axis".to_owned(), axis.into());
        view.insert("reversed".to_owned(), false.into());
        view.insert("turn_deg".to_owned(), 0.0.into());
        view.remove("rest");
    }
    Ok(fs::write(to, toml::to_string(&setup)?)?)
}

/// Two processes: one renders the recording, the other measures it.
fn stream(
    demo: &DemoSetup,
    emulator: &mut Process,
    size: &str,
    setup: &str,
) -> Result<(), Failure> {
    let file = |name: &str| text(&demo.path(name));
    let (recording, folder, angles) = (file(DIRECT)?, file("pictures")?, file("angles.csv")?);
    let (first, second) = (file("pictures/view0")?, file("pictures/view1")?);
    let images = pose_table::read(&demo.path(DIRECT))?.len();
    let bar = bar("render the recording as images and measure them", images as f64 / 10.0);
    let mut renderer = demo.tool(
        "render",
        &[
            "vision",
            "render",
            "--angles",
            &recording,
            "--output",
            &folder,
            "--size",
            size,
            "--turned-deg",
            TURNED_DEG,
            "--stream",
        ],
    )?;
    while !Path::new(&second).exists() {
        renderer.check()?;
        std::thread::sleep(Duration::from_millis(10));
    }
    // Every image carries its stamp. The option --fps marks them as recorded: they may be late.
    let measure = [
        "vision", "--setup", setup, &first, &second, "--rest-s", "0", "--fps", "30", "--output",
        &angles,
    ];
    let mut vision = demo.tool("vision", &measure)?;
    while !vision.finished()? {
        check_children(&mut [&mut *emulator])?;
        bar.set_position(lines(Path::new(&angles)));
        std::thread::sleep(Duration::from_millis(500));
    }
    finish(&bar, &format!("{images} pairs of images"));
    while !renderer.finished()? {
        std::thread::sleep(Duration::from_millis(10));
    }
    Ok(())
}

fn lines(path: &Path) -> u64 {
    fs::read(path).map_or(0, |bytes| bytes.iter().filter(|byte| **byte == b'\n').count() as u64)
}

/// Runs `i2ris` with arguments to its end.
fn run(
    demo: &DemoSetup,
    emulator: &mut Process,
    what: &str,
    arguments: &[&str],
) -> Result<(), Failure> {
    step(what, || {
        let mut tool = demo.tool("images", arguments)?;
        while !tool.finished()? {
            check_children(&mut [&mut *emulator])?;
            std::thread::sleep(Duration::from_millis(20));
        }
        Ok(())
    })
}

/// Prints the errors of the measured angles against the true ones of the same instants.
fn print_image_errors(demo: &DemoSetup) -> Result<(), Failure> {
    let truth = pose_table::read(&demo.path(DIRECT))?;
    let measured = pose_table::read(&demo.path("images.csv"))?;
    let degrees = |pose: &Pose| [pose.pitch_rad.to_degrees(), pose.yaw_rad.to_degrees()];
    let errors: Vec<[f64; 2]> = measured
        .iter()
        .filter_map(|(stamp, pose)| {
            let (_, exact) =
                truth.get(truth.partition_point(|(other, _)| other.0 + 1000 < stamp.0))?;
            let (a, b) = (degrees(pose), degrees(exact));
            Some([a[0] - b[0], a[1] - b[1]])
        })
        .collect();
    let [pitch, yaw, length] = rms_deg(&errors);
    println!(
        "\nImages: {} of {} pairs gave angles; off from the true ones by {pitch:.3} deg in pitch, \
         {yaw:.3} in yaw, \
         {length:.3} in length (RMS)",
        measured.len(),
        truth.len()
    );
    Ok(())
}

/// Prints how much larger the tracking error is through images.
fn print_loss(followed: &[Followed], family: &str, motion: Motion) {
    let length = |variant: &str| {
        let run = followed
            .iter()
            .find(|run| run.family == format!("{family}-{variant}") && run.motion == motion);
        run.map(|run| rms_deg(&run.run.errors_deg)[2])
    };
    if let (Some(direct), Some(images)) = (length("direct"), length("images")) {
        println!(
            "{motion}, {family}: calibrated by true angles {direct:.3} deg, through images \
             {images:.3} deg, \
             loss {:+.3} deg",
            images - direct
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_other_frame_loses_its_angles_and_no_row_its_counts() {
        let folder = tempfile::tempdir().unwrap();
        let (from, to) = (folder.path().join("a.csv"), folder.path().join("b.csv"));
        fs::write(
            &from,
            "t_s,q0_counts,pitch_deg,yaw_deg\n1,5,0.1,0.2\n2,6,,\n3,7,0.3,0.4\n4,8,0.5,0.6\n",
        )
        .unwrap();
        keep_every(&from, &to, 2).unwrap();
        assert_eq!(
            fs::read_to_string(&to).unwrap(),
            "t_s,q0_counts,pitch_deg,yaw_deg\n1,5,0.1,0.2\n2,6,,\n3,7,,\n4,8,0.5,0.6\n"
        );
    }
}
