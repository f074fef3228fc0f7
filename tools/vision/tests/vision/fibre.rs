//! Single readings: results of the detector for a scene, and its issues.

use i2ris_vision::fibre::{DetectorSettings, EntrySide, QualityIssue, Reading, measure};
use i2ris_vision::image::GreyImage;
use i2ris_vision::scene::{
    Brightness, Clutter, JointPose, Optics, PinholeCamera, Scene, SnakeShape, cover,
};
use i2ris_vision::scene_setup::settings;
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

fn scene(pitch_deg: f64) -> Scene {
    Scene {
        snake: SnakeShape::fibre(0.125),
        pose: JointPose { pitch_rad: pitch_deg.to_radians(), yaw_rad: 0.0 },
        camera: PinholeCamera::microscope(640, 480, 100.0),
        paint: Brightness::dark(),
        clutter: Vec::new(),
        optics: Optics::light(),
    }
}

fn image(scene: &Scene) -> GreyImage {
    scene.render(&mut Pcg64Mcg::seed_from_u64(5))
}

fn read(scene: &Scene) -> Result<Reading, QualityIssue> {
    measure(&image(scene), &settings(scene))
}

fn assert_right(reading: &Reading, scene: &Scene) {
    let error = (reading.angle_rad - scene.angle_rad()).to_degrees();
    assert!(reading.is_good() && error.abs() < 0.1, "{error} deg, {:?}", reading.issue);
}

fn assert_doubt(reading: Result<Reading, QualityIssue>, issue: QualityIssue) {
    let found = reading.map_or_else(|it| (false, Some(it)), |it| (it.is_good(), it.issue));
    assert_eq!(found, (false, Some(issue)));
}

/// A place on the fibre, `mm` from where it begins to bend.
fn on_fibre(scene: &Scene, mm: f64) -> [f64; 2] {
    scene.camera.project(scene.snake.at(&scene.pose, mm)).0
}

#[test]
fn both_signs_and_the_straight_pose() {
    for pitch in [-45.0, -20.0, 0.0, 3.0, 45.0] {
        let scene = scene(pitch);
        let reading = read(&scene).unwrap();
        assert_right(&reading, &scene);
        let [x, y] = scene.tip_px();
        assert!((reading.tip_px[0] - x).hypot(reading.tip_px[1] - y) < 0.3, "{:?}", reading.tip_px);
    }
}

#[test]
fn bright_on_dark_and_a_body_with_a_fibre() {
    let bright = Scene { paint: Brightness::bright(), ..scene(30.0) };
    assert_right(&read(&bright).unwrap(), &bright);
    let robot = Scene { snake: SnakeShape::robot(), ..scene(-30.0) };
    assert_right(&read(&robot).unwrap(), &robot);
}

#[test]
fn the_base_may_come_in_from_any_side() {
    let upright = scene(20.0);
    let sides = [EntrySide::Left, EntrySide::Bottom, EntrySide::Right, EntrySide::Top];
    for (quarters, side) in sides.into_iter().enumerate() {
        let mut scene = upright.clone();
        scene.camera.roll_rad = f64::to_radians(90.0 * quarters as f64);
        let sideways = !quarters.is_multiple_of(2);
        (scene.camera.width, scene.camera.height) = if sideways { (480, 640) } else { (640, 480) };
        let (w, h) = (scene.camera.width as f64 - 1.0, scene.camera.height as f64 - 1.0);
        scene.camera.origin_px = match side {
            EntrySide::Left => [192.0, h / 2.0],
            EntrySide::Right => [w - 192.0, h / 2.0],
            EntrySide::Top => [w / 2.0, 192.0],
            EntrySide::Bottom => [w / 2.0, h - 192.0],
        };
        let settings = DetectorSettings { side, base_length: 170.0, ..settings(&upright) };
        assert_right(&measure(&image(&scene), &settings).unwrap(), &scene);
    }
}

#[test]
fn an_instrument_across_the_bend_is_bridged() {
    let mut scene = scene(25.0);
    let [x, y] = on_fibre(&scene, 1.0);
    scene.clutter.push(Clutter::Instrument {
        from: [x + 30.0, y - 600.0],
        to: [x - 8.0, y + 160.0],
        half_width: [25.0, 25.0],
        brightness: 40.0,
        rim: 10.0,
    });
    assert_right(&read(&scene).unwrap(), &scene);
}

#[test]
fn specks_on_the_fibre_do_not_turn_it() {
    let mut scene = scene(-15.0);
    for (mm, brightness) in [(-1.2, 20.0), (-0.5, 240.0), (2.3, 240.0), (2.7, 15.0), (2.9, 120.0)] {
        let [x, y] = on_fibre(&scene, mm);
        scene.clutter.push(cover([x + 2.0, y + 5.0], 4.0, brightness));
    }
    assert_right(&read(&scene).unwrap(), &scene);
}

#[test]
fn hidden_ends_and_bases_and_fibres_out_of_the_image_are_doubted() {
    type Change = fn(&mut Scene);
    let cases: [(QualityIssue, f64, Change); 4] = [
        (QualityIssue::EndCovered, 25.0, |it| {
            it.clutter.push(cover(on_fibre(it, 3.2), 25.0, 90.0))
        }),
        // Like the ground, over the whole straight tip: what is left to see ends in the arc.
        (QualityIssue::TipBent, 40.0, |it| {
            it.clutter.push(cover(on_fibre(it, 2.4), 95.0, it.paint.ground));
        }),
        (QualityIssue::OutOfPicture, 30.0, |it| it.camera.origin_px[0] += 250.0),
        (QualityIssue::NoBase, 10.0, |it| it.clutter.push(cover([60.0, 240.0], 130.0, 100.0))),
    ];
    for (issue, pitch_deg, change) in cases {
        let mut scene = scene(pitch_deg);
        change(&mut scene);
        assert_doubt(read(&scene), issue);
    }
}

#[test]
fn two_fibres_on_one_side_need_a_configured_place() {
    let mut scene = scene(10.0);
    scene.clutter.push(Clutter::Instrument {
        from: [-50.0, 380.0],
        to: [500.0, 380.0],
        half_width: [6.25, 6.25],
        brightness: scene.paint.fibre,
        rim: scene.paint.rim,
    });
    assert_doubt(read(&scene), QualityIssue::TwoBases);
    let reported = DetectorSettings { near: Some([240.0, 40.0]), ..settings(&scene) };
    assert_right(&measure(&image(&scene), &reported).unwrap(), &scene);
}

#[test]
fn an_empty_image_and_pure_noise_have_no_base() {
    let mut empty = Scene {
        snake: SnakeShape { base_mm: -50.0, arc_mm: 0.1, tip_mm: 0.1, ..SnakeShape::fibre(0.125) },
        ..scene(0.0)
    };
    empty.camera.origin_px = [-5000.0, -5000.0];
    empty.optics = Optics::strong();
    assert_doubt(measure(&image(&empty), &settings(&scene(0.0))), QualityIssue::NoBase);
}

#[test]
fn images_smaller_than_the_settings_expect_are_doubted_not_fatal() {
    for (width, height) in [(1, 1), (2, 40), (40, 2), (30, 30), (640, 20), (20, 480)] {
        let image = GreyImage::new(width, height, vec![100; width * height]).unwrap();
        assert_eq!(measure(&image, &settings(&scene(0.0))).unwrap_err(), QualityIssue::NoBase);
    }
}
