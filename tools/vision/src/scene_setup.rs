//! Setup of a synthetic scene, as a person would write it.

use crate::fibre::{Background, DetectorSettings, EntrySide};
use crate::scene::{Brightness, PinholeCamera, Rig, Scene};
use crate::setup::{JointAxis, View, VisionSetup};

fn ground(paint: &Brightness) -> Background {
    if paint.ground > paint.fibre { Background::Bright } else { Background::Dark }
}

/// Parameters of the detector for a scene.
pub fn settings(scene: &Scene) -> DetectorSettings {
    let k = scene.camera.px_per_mm;
    DetectorSettings {
        ground: ground(&scene.paint),
        side: EntrySide::Left,
        near: None,
        body_width: k * scene.snake.body_width_mm,
        fibre_width: k * scene.snake.fibre_width_mm,
        base_length: 0.9 * 0.3 * scene.camera.width as f64,
        arc_length: k * scene.snake.arc_mm,
        tip_length: k * scene.snake.tip_mm,
    }
}

/// The setup of a rig.
pub fn setup(rig: &Rig) -> VisionSetup {
    let view = |(number, camera): (usize, &PinholeCamera)| {
        let mut view = View {
            name: format!("view{number}"),
            axis: JointAxis::Pitch,
            reversed: false,
            turn_deg: 0.0,
            px_per_mm: camera.px_per_mm,
            distance_mm: Some(camera.distance_mm),
            ground: ground(&rig.paint),
            side: EntrySide::Left,
            near_px: None,
            body_width_mm: rig.snake.body_width_mm,
            fibre_width_mm: rig.snake.fibre_width_mm,
            base_length_mm: 0.9 * camera.origin_px[0] / camera.px_per_mm,
            arc_length_mm: rig.snake.arc_mm,
            tip_length_mm: rig.snake.tip_mm,
        };
        view.set_plane(camera.plane_rad);
        view
    };
    VisionSetup { pair_within_ms: 12.0, views: rig.cameras.iter().enumerate().map(view).collect() }
}
