//! Pictures of a camera together with the states: all of them, with their stamps, within a budget;
//! and the delay of the stamps.

use std::path::Path;

use i2ris::clock;
use i2ris::ipc::Domain;
use i2ris::ipc::client::PicturePublisher;
use i2ris::units::Nanos;
use i2ris_record::messages::{Picture, view_of_topic};
use i2ris_record::pictures::Alignment;
use i2ris_record::read::Records;
use i2ris_record::report::TrialReport;
use i2ris_testing::bench::{WorkFolder, prints, start};
use i2ris_testing::{Controller, Program, wait_until};
use i2ris_vision::scene::{JointPose, Rig};
use i2ris_vision::scene_setup::setup;
use i2ris_vision::session::Session;
use i2ris_vision::source::Frame;
use i2ris_vision::view_detector::ViewDetector;
use mcap::records::Record;

use crate::{camera, motors};

fn recorder(domain: &Domain, bench: &WorkFolder, more: &str) -> Program {
    start(domain, &bench.words(&format!("record --output @a.mcap {more}")))
}

/// Ends the recorder, and returns its output.
fn end(mut recorder: Program) -> String {
    recorder.interrupt();
    prints(recorder, &[])
}

/// Pictures of a recording: view, exposure in Unix time, bytes.
fn pictures(file: &Path) -> Vec<(String, Picture)> {
    let (mut views, mut found) = (std::collections::BTreeMap::new(), Vec::new());
    for record in Records::open(file).unwrap() {
        match record {
            Record::Channel(channel) => {
                if let Some(view) = view_of_topic(&channel.topic) {
                    views.insert(channel.id, view.to_owned());
                }
            }
            Record::Message { header, data } => {
                if let Some(view) = views.get(&header.channel_id) {
                    let picture = Picture::decode(&data).unwrap();
                    assert_eq!(header.publish_time, picture.unix_ns, "the stamp of the exposure");
                    found.push((view.clone(), picture));
                }
            }
            _ => {}
        }
    }
    found
}

#[test]
fn pictures_are_recorded_unchanged_with_their_exposure_stamp() {
    let (controller, bench) = (Controller::enabled(), WorkFolder::empty());
    let file = bench.path("a.mcap");
    let recorder = recorder(&controller.domain, &bench, "");
    let mut cameras = ["top", "side"].map(|it| PicturePublisher::new(&controller.domain, it));
    // Long ones and short ones: the camera makes room.
    let jpeg = |number: u64| [number as u8].repeat(1000 + 40_000 * (number % 20) as usize);
    let (mut number, begun) = (0, clock::now());
    wait_until("two hundred pictures are taken", || {
        number += 1;
        for camera in &mut cameras {
            camera.publish(begun + Nanos(number), &jpeg(number)).unwrap();
        }
        clock::sleep(Nanos::from_millis(5));
        number == 200 + 100
    });
    let printed = end(recorder);
    assert!(printed.contains("pictures of top"), "{printed}");
    let (pictures, report) = (pictures(&file), TrialReport::read(&file).unwrap());
    for view in ["top", "side"] {
        let taken = pictures.iter().filter(|(name, _)| name == view).map(|(_, picture)| picture);
        let taken: Vec<&Picture> = taken.collect();
        assert!(taken.len() > 100, "{view}: {}", taken.len());
        // Only those before the recorder started are lost, and those that it counted while it was
        // held up. The last one is never lost: newer ones replace older ones.
        let offset = taken[taken.len() - 1].unix_ns - (begun.0 + 300);
        let numbers: Vec<u64> = taken.iter().map(|it| it.unix_ns - offset - begun.0).collect();
        for (number, picture) in numbers.iter().zip(&taken) {
            assert_eq!(picture.jpeg, jpeg(*number), "{view} {number}");
        }
        assert!(numbers.is_sorted_by(|a, b| a < b), "{view}: {numbers:?}");
        let lost = 300 - numbers[0] + 1 - numbers.len() as u64;
        let counted = &report.outcome[&format!("pictures {view} dropped")];
        assert_eq!(counted, &lost.to_string(), "{view}: {numbers:?}");
    }
}

#[test]
fn pictures_over_budget_are_counted_and_states_recorded() {
    let (controller, bench) = (Controller::enabled(), WorkFolder::empty());
    let file = bench.path("a.mcap");
    let recorder = recorder(&controller.domain, &bench, "--pictures-mb 1");
    let mut camera = PicturePublisher::new(&controller.domain, "top");
    wait_until("the recorder is running", || file.exists());
    for number in 0..100 {
        camera.publish(clock::now(), &[number; 50_000]).unwrap();
        clock::sleep(Nanos::from_millis(5));
    }
    let printed = end(recorder);
    assert!(printed.contains("more exceeded the budget --pictures-mb"), "{printed}");
    assert!(pictures(&file).len() <= 20, "{}", pictures(&file).len());
    let report = TrialReport::read(&file).unwrap();
    assert!(report.cut_off.is_none() && report.length_s > 0.1, "{}", report.length_s);
}

/// Pictures per second of the emulated scene, and the delay of its stamps.
const FPS: f64 = 15.0;
const LATE_S: f64 = 0.037;

/// Loops that grow and shrink, after a second at rest: angles in rad over time.
fn motion(time: f64) -> [f64; 2] {
    let size = 0.35 * (0.6 + 0.4 * (0.3 * time).sin()) * (0.5 * (time - 1.0)).clamp(0.0, 1.0);
    [size * (1.1 * time).sin(), size * (1.7 * time + 1.0).sin()]
}

/// The snake with play: it follows the motors only where they pull.
fn with_play(motors: [f64; 2], snake: &mut [f64; 2]) {
    const HALF_RAD: f64 = 0.02;
    for (snake, motor) in snake.iter_mut().zip(motors) {
        *snake = snake.clamp(motor - HALF_RAD, motor + HALF_RAD);
    }
}

#[test]
fn snake_motion_in_pictures_shows_their_delay() {
    let rig = Rig::laboratory(640, 480, 100.0);
    let setup = setup(&rig);
    let (seconds, mut snake) = (60.0, [0.0; 2]);
    let mut alignment = Alignment::default();
    let mut session = Session::new(&setup, Nanos::from_millis(500));
    let mut detectors: Vec<_> =
        setup.views.iter().map(|view| ViewDetector::new(view.settings())).collect();
    let (mut rows, mut number) = (Vec::new(), 0_u64);
    for ms in 0..(1000.0 * seconds) as u64 {
        let places = motion(ms as f64 * 1e-3);
        with_play(places, &mut snake);
        let now = Nanos::from_millis(ms + 1000);
        alignment.add(&motors(0, now, places.map(|angle| (1e5 * angle) as i32)));
        if ms as f64 * 1e-3 < number as f64 / FPS {
            continue;
        }
        number += 1;
        let pose = JointPose { pitch_rad: snake[0], yaw_rad: snake[1] };
        let stamp = now + Nanos((LATE_S * 1e9) as u64);
        for (view, image) in rig.render_views(pose, number).into_iter().enumerate() {
            session.take(view, detectors[view].detect(Frame::new(stamp, number, image)));
        }
        rows.extend(session.rows().unwrap());
    }
    for row in rows {
        let Ok(seen) = &row.seen else { continue };
        alignment.add(&camera(row.stamp, seen.angle_rad.map(Option::unwrap_or_default)));
    }
    let good = session.statistics().good;
    let found = alignment.measure();
    let found = found.unwrap_or_else(|| panic!("not seen in {good} of {number} pictures"));
    let quarter = 0.25 / FPS;
    assert!((found.seconds - LATE_S).abs() < quarter, "{found:?}");
    assert!(found.deviation_s < quarter, "{found:?}");
}
