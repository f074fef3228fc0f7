//! Setup of a synthetic scene, as a person would write it.

use crate::fibre::{Background, DetectorSettings, EntrySide};
use crate::scene::{Brightness, PinholeCamera, Rig, Scene, SnakeShape};
use crate::setup::{JointAxis, View, VisionSetup};

fn view(snake: &SnakeShape, paint: &Brightness, camera: &PinholeCamera) -> View {
    let is_bright = paint.ground > paint.fibre;
    let mut view = View {
        name: "view0".to_owned(),
        axis: JointAxis::Pitch,
        reversed: false,
        turn_deg: 0.0,
        px_per_mm: camera.px_per_mm,
        distance_mm: Some(camera.distance_mm),
        ground: if is_bright { Background::Bright } else { Background::Dark },
        side: EntrySide::Left,
        near_px: None,
        body_width_mm: snake.body_width_mm,
        fibre_width_mm: snake.fibre_width_mm,
        base_length_mm: 0.9 * camera.origin_px[0] / camera.px_per_mm,
        arc_length_mm: snake.arc_mm,
        tip_length_mm: snake.tip_mm,
    };
    view.set_plane(camera.plane_rad);
    view
}

/// Parameters of the detector for a scene, wherever its base begins.
pub fn settings(scene: &Scene) -> DetectorSettings {
    let settings = view(&scene.snake, &scene.paint, &scene.camera).settings();
    DetectorSettings { base_length: 0.9 * 0.3 * scene.camera.width as f64, ..settings }
}

pub fn setup(rig: &Rig) -> VisionSetup {
    let named = |(number, camera): (usize, &PinholeCamera)| View {
        name: format!("view{number}"),
        ..view(&rig.snake, &rig.paint, camera)
    };
    VisionSetup { pair_within_ms: 12.0, views: rig.cameras.iter().enumerate().map(named).collect() }
}
