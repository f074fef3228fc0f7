//! Scenes drawn by chance from a seed: clear ones to measure how exact a reading is, cluttered ones
//! to see whether it is ever wrong without saying so.

use rand::{Rng, RngExt};

use super::Scene;
use super::camera::PinholeCamera;
use super::clutter::{Clutter, cover};
use super::optics::{Brightness, Optics};
use super::snake_shape::{JointPose, SnakeShape};

/// A scene without clutter: any angle in the plane of the view and away from it up to `max_rad`,
/// any position of the base within a few degrees and pixels.
pub fn clear(
    random: &mut impl Rng,
    camera: PinholeCamera,
    snake: SnakeShape,
    paint: Brightness,
    optics: Optics,
    [pitch, yaw]: [f64; 2],
) -> Scene {
    let pose = JointPose {
        pitch_rad: random.random_range(-pitch..=pitch),
        yaw_rad: random.random_range(-yaw..=yaw),
    };
    let mut camera = camera;
    camera.roll_rad += random.random_range(-0.06..0.06);
    camera.origin_px[0] += random.random_range(-8.0..8.0);
    camera.origin_px[1] += random.random_range(-15.0..15.0);
    Scene { snake, pose, camera, paint, clutter: Vec::new(), optics }
}

/// Puts instruments, covers, specks and hairs before a scene, most of them near the fibre;
/// sometimes the camera has been pushed so that part of the fibre is out of the image.
pub fn clutter(random: &mut impl Rng, mut scene: Scene) -> Scene {
    if random.random_bool(0.08) {
        let (width, height) = (scene.camera.width as f64, scene.camera.height as f64);
        scene.camera.origin_px[0] += random.random_range(0.0..0.5) * width;
        scene.camera.origin_px[1] += random.random_range(-0.45..0.45) * height;
    }
    let mut things = Vec::new();
    for _ in 0..count(random, &[0.25, 0.5, 0.25]) {
        things.push(instrument(random, &scene));
    }
    for _ in 0..count(random, &[0.75, 0.25]) {
        let radius = scene.camera.px_per_mm * random.random_range(0.1..0.8);
        things.push(cover(near(random, &scene, 0.3), radius, brightness(random, &scene)));
    }
    for _ in 0..count(random, &[0.7, 0.2, 0.1]) {
        things.push(hair(random, &scene));
    }
    for _ in 0..random.random_range(0..30) {
        things.push(speck(random, &scene));
    }
    scene.clutter = things;
    scene
}

/// How many, by the chance of each number.
fn count(random: &mut impl Rng, chances: &[f64]) -> usize {
    let mut rest: f64 = random.random_range(0.0..1.0);
    for (number, chance) in chances.iter().enumerate() {
        rest -= chance;
        if rest < 0.0 {
            return number;
        }
    }
    0
}

/// A place within `spread_mm` of the fibre, anywhere along it.
fn near(random: &mut impl Rng, scene: &Scene, spread_mm: f64) -> [f64; 2] {
    let end = scene.snake.arc_mm + scene.snake.tip_mm;
    let at = scene.snake.at(&scene.pose, random.random_range(-1.0..end + 0.3));
    let ([x, y], _) = scene.camera.project(at);
    let spread = spread_mm * scene.camera.px_per_mm;
    [x + random.random_range(-spread..spread), y + random.random_range(-spread..spread)]
}

/// Often the fibre's own brightness or the ground's, which is hardest to tell apart; else any.
fn brightness(random: &mut impl Rng, scene: &Scene) -> f32 {
    match random.random_range(0..4) {
        0 => scene.paint.fibre,
        1 => scene.paint.ground,
        _ => random.random_range(10.0..245.0),
    }
}

fn instrument(random: &mut impl Rng, scene: &Scene) -> Clutter {
    let aim = near(random, scene, 0.25);
    let from_rad = random.random_range(0.0..std::f64::consts::TAU);
    let reach = (scene.camera.width + scene.camera.height) as f64;
    let half = 0.5 * scene.camera.px_per_mm * random.random_range(0.06..0.9);
    // Its free end lies around the aim: short of it, on it, or across.
    let past = random.random_range(-0.5..2.0) * scene.camera.px_per_mm;
    let along = |length: f64| [aim[0] + length * from_rad.cos(), aim[1] + length * from_rad.sin()];
    Clutter::Instrument {
        from: along(reach),
        to: along(-past),
        half_width: [half, half * random.random_range(0.4..1.0)],
        brightness: brightness(random, scene),
        rim: random.random_range(0.0..40.0),
    }
}

fn hair(random: &mut impl Rng, scene: &Scene) -> Clutter {
    let mut at = near(random, scene, 0.5);
    let mut direction: f64 = random.random_range(0.0..std::f64::consts::TAU);
    let mut points = vec![at];
    for _ in 0..random.random_range(4..14) {
        direction += random.random_range(-0.4..0.4);
        let length = 0.15 * scene.camera.px_per_mm;
        at = [at[0] + length * direction.cos(), at[1] + length * direction.sin()];
        points.push(at);
    }
    Clutter::Hair {
        points,
        half_width: random.random_range(0.7..4.0),
        brightness: brightness(random, scene),
    }
}

fn speck(random: &mut impl Rng, scene: &Scene) -> Clutter {
    let anywhere = [
        random.random_range(0.0..scene.camera.width as f64),
        random.random_range(0.0..scene.camera.height as f64),
    ];
    let centre = if random.random_bool(0.5) { near(random, scene, 0.15) } else { anywhere };
    let half = random.random_range(0.7..9.0);
    Clutter::Speck {
        centre,
        half: [half, half * random.random_range(0.5..1.0)],
        turn_rad: random.random_range(0.0..3.0),
        brightness: random.random_range(5.0..250.0),
    }
}
