//! How late the stamps of a camera are, through all processes that run in a trial: drives, snake,
//! controller, pictures, what measures them, recorder.

use std::fmt::Write as _;
use std::fs;
use std::process::{Child, Stdio};

use i2ris::clock;
use i2ris::ipc::Domain;
use i2ris::ipc::client::ExternalPublisher;
use i2ris::units::Nanos;
use i2ris_record::report::TrialReport;
use i2ris_testing::{
    Background, Program, Rig, TIMEOUT, home_and_enable, program, serve, wait_until,
};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

const FPS: f64 = 30.0;
/// How late the stamps of the pictures are made.
const LATE: Nanos = Nanos::from_millis(37);
const SECONDS: f64 = 60.0;

/// Hands the exposures of the emulated camera on to those who draw them, with late stamps.
fn late_camera(from: &Domain, to: &Domain) -> Background {
    let (from, to) = (from.clone(), to.clone());
    Background::start(move |stop| {
        let mut server = serve(&from);
        let mut publisher = ExternalPublisher::new(&to);
        while !stop.load(std::sync::atomic::Ordering::Relaxed) {
            server.maintain(clock::now());
            while let Some(seen) = server.poll_external() {
                // Fails until somebody draws.
                let stamp = Nanos(seen.stamp_ns) + LATE;
                let _ = publisher.publish(stamp, &seen.position[..2], &seen.deviation[..2]);
            }
            clock::sleep(Nanos::from_millis(1));
        }
    })
}

fn started(words: &[&str]) -> Child {
    program::command(words).stdin(Stdio::null()).stdout(Stdio::null()).spawn().unwrap()
}

fn end(mut child: Child) {
    kill(Pid::from_raw(child.id().cast_signed()), Signal::SIGINT).unwrap();
    child.wait().unwrap();
}

/// Desired angles over time: at rest for three seconds, then strokes of many speeds.
fn motion() -> String {
    let mut csv = String::from("t_s,pitch_deg,yaw_deg\n");
    for step in 0..=(SECONDS * 20.0) as u32 {
        let t = f64::from(step) * 0.05;
        let size = 12.0 * (0.6 + 0.4 * (0.3 * t).sin()) * (0.5 * (t - 3.0)).clamp(0.0, 1.0);
        let (pitch, yaw) = (size * (1.1 * t).sin(), size * (1.7 * t + 1.0).sin());
        writeln!(csv, "{t},{pitch},{yaw}").unwrap();
    }
    csv
}

#[test]
#[ignore = "minutes, and both cores: .ci/nightly"]
fn the_lateness_of_a_camera_is_found_through_all_running_processes() {
    let mut rig = Rig::with_model();
    let exposed = rig.domain();
    let (drawn, seen) = (rig.another_domain("drawn"), rig.another_domain("seen"));
    seen.name().clone_into(&mut rig.config.domain);
    rig.start_controller();
    let mut client = rig.client();
    home_and_enable(&mut client, TIMEOUT).unwrap();
    drop(client);
    let pictures = rig.folder.path().join("pictures");
    let path = |name: &str| pictures.join(name).to_str().unwrap().to_owned();
    let folder = pictures.to_str().unwrap();
    let draws = started(&[
        "vision",
        "render",
        "--live",
        drawn.name(),
        "--output",
        folder,
        "--size",
        "640x480",
    ]);
    wait_until("it draws", || pictures.join("view1").exists());
    let camera = late_camera(&exposed, &drawn);
    let [setup, top, side] = ["vision.toml", "view0", "view1"].map(path);
    let looks = started(&[
        "vision",
        "--setup",
        &setup,
        &top,
        &side,
        "--publish",
        "--pictures",
        "--domain",
        seen.name(),
        "--output",
        &path("angles.csv"),
    ]);
    let (file, csv) = (path("trial.mcap"), path("motion.csv"));
    let record = started(&["record", "--domain", seen.name(), "--output", &file]);
    wait_until("it records", || fs::metadata(&file).is_ok_and(|data| data.len() > 0));
    wait_until("angles are measured", || {
        fs::read_to_string(path("angles.csv")).is_ok_and(|text| text.lines().count() > 90)
    });
    fs::write(&csv, motion()).unwrap();
    let (is_done, _, error) = Program::run(&seen, &["command", "file", &csv]);
    assert!(is_done, "{error}");
    end(looks);
    end(record);
    end(draws);
    drop(camera);
    let outcome = TrialReport::read(file.as_ref()).unwrap().outcome;
    let number = |name: &str| outcome[name].parse::<f64>().unwrap();
    let (late_s, deviation_s) = (number("camera_late_s"), number("camera_late_deviation_s"));
    println!(
        "late {:.1} ms, found {:.1} ms, deviation {:.1} ms, {} pictures",
        1e3 * LATE.as_seconds(),
        1e3 * late_s,
        1e3 * deviation_s,
        outcome["pictures view0"]
    );
    assert!((late_s - LATE.as_seconds()).abs() < 0.25 / FPS, "{late_s}");
}
