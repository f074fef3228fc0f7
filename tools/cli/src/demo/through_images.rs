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

use std::fs;
use std::path::Path;

use i2ris_report::Failure;
use i2ris_report::pose_table::{self, Pose};

use super::commands::{Demo, finish};
use super::single_axis::{REST_S, SingleAxisMotion};
use super::tracking::{self, Followed, rms_deg};
use crate::progress_bar::bar_of_time;
use crate::start::text;
use i2ris_simulation::motion::unseen_motion::Motion;

/// Rotation of the cameras, deg, which their calibration has to find.
const TURNED_DEG: &str = "10";
/// Every Nth frame of a single-axis motion is rendered: 10 images a second are enough.
const EVERY: &str = "3";

/// The recording with true angles at the instants of the images only.
const DIRECT: &str = "direct.csv";

/// Roughly, of a table of angles: for the bar.
const BYTES_A_ROW: u64 = 60;

/// The two sources of angles: name, and recording.
const VARIANTS: [(&str, &str); 2] = [("direct", DIRECT), ("images", "images.csv")];

pub fn show(demo: &mut Demo, size: &str) -> Result<(), Failure> {
    if demo.arguments.from.is_none() {
        // From the straight pose on: nothing has moved the snake before.
        demo.swing(SingleAxisMotion::Pitch)?;
        demo.swing(SingleAxisMotion::Yaw)?;
        demo.collect()?;
    }
    if !demo.path("images.csv").exists() {
        let every = demo.arguments.pictures_every;
        keep_every(&demo.path("recording.csv"), &demo.path(DIRECT), every)?;
        measure_images(demo, size)?;
    }
    let families = demo.families("gmr-stop");
    let mut followed = Vec::new();
    for family in &families {
        for (variant, recording) in VARIANTS {
            let model = format!("{family}-{variant}");
            demo.fit(recording, family, &model)?;
            followed.extend(demo.follow(&model)?);
        }
    }
    demo.end()?;
    tracking::print(&followed, "The camera adds nothing: its angles are the true ones.");
    print_image_errors(demo)?;
    for family in &families {
        demo.arguments.motions.iter().for_each(|motion| print_loss(&followed, family, *motion));
    }
    Ok(())
}

fn measure_images(demo: &mut Demo, size: &str) -> Result<(), Failure> {
    for axis in ["pitch", "yaw"] {
        let (angles, folder) = (demo.file(&format!("{axis}.csv"))?, demo.file(axis)?);
        let render = ["vision", "render", "--angles", &angles, "--output", &folder];
        let options = ["--size", size, "--turned-deg", TURNED_DEG, "--every", EVERY];
        demo.run(&format!("render the motion of {axis}"), &[&render[..], &options].concat())?;
    }
    write_uncalibrated_setup(&demo.path("pitch/vision.toml"), &demo.path("guess.toml"))?;
    let (guess, setup, rest) =
        (demo.file("guess.toml")?, demo.file("vision.toml")?, REST_S.to_string());
    let pitch = [demo.file("pitch/view0")?, demo.file("pitch/view1")?];
    let yaw = [demo.file("yaw/view0")?, demo.file("yaw/view1")?];
    let calibrate =
        ["vision", "calibrate", "--setup", &guess, "--output", &setup, "--rest-s", &rest];
    let motions = ["--pitch", &pitch[0], &pitch[1], "--yaw", &yaw[0], &yaw[1]];
    let words = [&calibrate[..], &motions].concat();
    demo.run("calibrate the views by those motions", &words)?;
    stream(demo, size, &setup)?;
    let (recording, angles, images) =
        (demo.file(DIRECT)?, demo.file("angles.csv")?, demo.file("images.csv")?);
    let merge = ["calibrate", "merge", &recording, &angles, "--output", &images];
    demo.run("bring angles and counts together", &merge)
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
fn stream(demo: &mut Demo, size: &str, setup: &str) -> Result<(), Failure> {
    let (recording, folder, angles) =
        (demo.file(DIRECT)?, demo.file("pictures")?, demo.path("angles.csv"));
    let (first, second) = (demo.file("pictures/view0")?, demo.file("pictures/view1")?);
    let images = pose_table::read(&demo.path(DIRECT))?.len();
    let render = ["vision", "render", "--angles", &recording, "--output", &folder];
    let options = ["--size", size, "--turned-deg", TURNED_DEG, "--stream"];
    let mut renderer = demo.child("render", &[&render[..], &options].concat())?;
    while !Path::new(&second).exists() {
        renderer.check()?;
        demo.pause()?;
    }
    // Every image carries its stamp. The option --fps marks them as recorded: they may be late.
    let output = text(&angles)?;
    let measure = ["vision", "--setup", setup, &first, &second, "--output", &output];
    let words = [&measure[..], &["--rest-s", "0", "--fps", "30"]].concat();
    let bar = bar_of_time("render the recording as images and measure them", images as f64 / 10.0);
    demo.run_behind(&words, |_| {
        bar.set_position(fs::metadata(&angles).map_or(0, |file| file.len() / BYTES_A_ROW));
        Ok(())
    })?;
    finish(&bar, &format!("{images} pairs of images"));
    while !renderer.finished()? {
        demo.pause()?;
    }
    Ok(())
}

/// Prints the errors of the measured angles against the true ones of the same instants.
fn print_image_errors(demo: &Demo) -> Result<(), Failure> {
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
         {yaw:.3} in yaw, {length:.3} in length (RMS)",
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
             {images:.3} deg, loss {:+.3} deg",
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
