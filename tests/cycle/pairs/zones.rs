//! Random forbidden regions: their distances and the tip position, with formulae of their own.

use super::*;

/// A degree of bend moves the tip by less, mm.
const MM_PER_DEG: f64 = 0.02;
/// Geometry of the snake: joints per axis, distance between two joints (mm), rolling radius (mm).
const JOINTS: usize = 6;
const PITCH_MM: f64 = 0.1495;
const RADIUS_MM: f64 = 0.75;

/// A region in angles, degrees, or of the tip, mm.
#[derive(Debug, Clone, Copy)]
pub struct Zone {
    pub region: SimpleRegion,
    wire: Wire,
}

impl Zone {
    pub fn draw(random: &mut Random, wire: Wire) -> Self {
        let is_round = random.one_in(2);
        let size = if is_round { random.within(1.0, 3.0) } else { random.within(2.0, 8.0) };
        let [x, y] = random.direction();
        let of_tip = wire == Wire::Place || random.one_in(4);
        let (space, size) = match of_tip {
            true => (FixtureSpace::Tip, size * mm(wire)),
            false => (FixtureSpace::Angles, size),
        };
        let shape = if is_round {
            let centre =
                if of_tip { tip([6.0 * x, 6.0 * y], wire) } else { [6.0 * x, 6.0 * y, 0.0] };
            SimpleShape::Ball { centre, radius: size }
        } else {
            SimpleShape::HalfSpace { normal: [x, y, 0.0], offset: size }
        };
        Self { region: SimpleRegion { space, shape }, wire }
    }

    /// Distance in degrees, positive outside; for the tip a lower bound.
    pub fn distance(&self, at: Angles) -> f64 {
        let is_tip = self.region.space == FixtureSpace::Tip;
        let (point, unit) =
            if is_tip { (tip(at, self.wire), mm(self.wire)) } else { ([at[0], at[1], 0.0], 1.0) };
        let distance = match self.region.shape {
            SimpleShape::Ball { centre, radius } => {
                let apart = [0, 1, 2].map(|axis: usize| point[axis] - centre[axis]);
                dot(apart, apart).sqrt() - radius
            }
            SimpleShape::HalfSpace { normal, offset } => offset - dot(normal, point),
        };
        distance / unit
    }

    /// For a configuration.
    pub fn table(&self, index: usize) -> String {
        let is_tip = self.region.space == FixtureSpace::Tip;
        let shape = match self.region.shape {
            SimpleShape::Ball { centre, radius } if is_tip => {
                format!("ball = {{ centre_mm = {centre:?}, radius_mm = {radius:?} }}")
            }
            SimpleShape::Ball { centre: [a, b, _], radius } => {
                format!("circle = {{ centre_deg = [{a:?}, {b:?}], radius_deg = {radius:?} }}")
            }
            SimpleShape::HalfSpace { normal, offset } if is_tip => {
                format!("half_space = {{ normal = {normal:?}, offset_mm = {offset:?} }}")
            }
            SimpleShape::HalfSpace { normal: [a, b, _], offset } => {
                format!("half_plane = {{ normal = [{a:?}, {b:?}], offset_deg = {offset:?} }}")
            }
        };
        format!("[[virtual_fixtures]]\nname = \"r{index}\"\nshape = {{ {shape} }}\n")
    }

    /// For a request: rad or m.
    pub fn request(&self) -> SimpleRegion {
        let is_tip = self.region.space == FixtureSpace::Tip;
        let si = |value: f64| if is_tip { 1e-3 * value } else { value.to_radians() };
        let shape = match self.region.shape {
            SimpleShape::Ball { centre, radius } => {
                SimpleShape::Ball { centre: centre.map(si), radius: si(radius) }
            }
            SimpleShape::HalfSpace { normal, offset } => {
                SimpleShape::HalfSpace { normal, offset: si(offset) }
            }
        };
        SimpleRegion { shape, ..self.region }
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Length that corresponds to a degree, mm.
fn mm(wire: Wire) -> f64 {
    if wire == Wire::Place { 1.0 } else { MM_PER_DEG }
}

/// Tip position, mm: link after link on rolling joints, first towards y, then towards x.
fn tip([pitch, yaw]: Angles, wire: Wire) -> [f64; 3] {
    if wire == Wire::Place {
        return [pitch, yaw, 0.0];
    }
    // The axes of a link, and its end.
    let mut axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let mut end = [0.0; 3];
    for joint in 0..2 * JOINTS {
        let (across, degrees) = if joint.is_multiple_of(2) { (1, pitch) } else { (0, yaw) };
        let angle = (degrees / JOINTS as f64).to_radians();
        let (side, along) = (axes[across], axes[2]);
        let turned = |angle: f64| -> [f64; 3] {
            std::array::from_fn(|at| side[at] * angle.sin() + along[at] * angle.cos())
        };
        let (half, whole) = (turned(0.5 * angle), turned(angle));
        for at in 0..3 {
            end[at] += RADIUS_MM * (2.0 * half[at] - whole[at] - along[at]) + PITCH_MM * whole[at];
            axes[across][at] = side[at] * angle.cos() - along[at] * angle.sin();
        }
        axes[2] = whole;
    }
    end
}

#[test]
fn tip_geometry_of_pairs_matches_the_robot() {
    for angles in [[0.0, 0.0], [8.0, -3.0], [-20.0, 11.0]] {
        let [pitch, yaw] = angles.map(f64::to_radians);
        let place = i2ris::model::kinematic::tip_position(pitch, yaw).position_m;
        let found = tip(angles, Wire::Taut);
        for (found, place) in found.iter().zip(place) {
            assert!((found - 1e3 * place).abs() < 1e-9, "{angles:?}: {found}, {place}");
        }
    }
}
