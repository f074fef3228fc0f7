//! The snake of [`crate::physics::springs`] with random parameters: gear, loose wires, bristles
//! under the capstan equation and segments in series.
//!
//! Sources: see there. Unlike the snakes in `config/snakes` it does not drift, so that two runs
//! can be compared.

use crate::physics::draw::Draw;
use crate::physics::springs::{
    BristleConfig, DriftConfig, FrictionConfig, GearConfig, SegmentConfig, SnakeConfig, WireConfig,
};

/// Parameters around those of the three snakes in `config/snakes`.
pub(in crate::physics) fn draw(draw: &mut Draw, name: String) -> SnakeConfig {
    let count = [1, 1, 2, 3][draw.uniform(0.0, 4.0) as usize];
    let segments = segments(draw, count);
    let kinds = draw.uniform(2.0, 4.0) as usize;
    let friction = friction(draw, count, kinds);
    let slack = draw.uniform(0.1, 0.5);
    SnakeConfig {
        name,
        deg_per_count: draw.uniform(0.025, 0.0275) + 0.001 * count as f64,
        motor_axes_deg: 45.0 + draw.uniform(-6.0, 6.0),
        drag_s: 0.004,
        stop_stiffness: 3.0,
        gear: GearConfig {
            backlash_deg: draw.both(0.3, 1.0),
            contact_stiffness: 8.0,
            softness_deg: 0.06,
            friction: draw.both(0.25, 0.45),
        },
        wire: WireConfig {
            slack_deg: [0, 1].map(|_| draw.both(0.4, 1.3).map(|factor| factor * slack)),
            slack_stiffness: draw.uniform(0.06, 0.12),
            softness_deg: draw.uniform(0.15, 0.3),
        },
        friction,
        segments,
        drift: DriftConfig {
            offset_deg: 0.0,
            offset_time_s: 300.0,
            friction: 0.0,
            friction_time_s: 600.0,
            creep_time_s: 1e12,
        },
        ageing: Vec::new(),
    }
}

/// Segments in series; each bends separately, so that the total stiffness is that of one.
fn segments(draw: &mut Draw, count: usize) -> Vec<SegmentConfig> {
    let whole = draw.uniform(0.12, 0.17);
    let limit = draw.uniform(50.0, 60.0);
    (0..count)
        .map(|_| SegmentConfig {
            stiffness: whole * count as f64 * draw.uniform(0.85, 1.15),
            stiffening: draw.uniform(0.0, 0.00002) * (count * count) as f64,
            limit_deg: limit / count as f64 * draw.uniform(0.9, 1.2),
            friction: draw.uniform(0.6, 1.5),
        })
        .collect()
}

fn friction(draw: &mut Draw, segments: usize, kinds: usize) -> FrictionConfig {
    let shares: Vec<f64> = (0..kinds).map(|_| draw.uniform(0.3, 1.0)).collect();
    let total: f64 = shares.iter().sum();
    let bristle = |(kind, share): (usize, &f64)| BristleConfig {
        stiffness: [10.0, 4.0, 1.5][kind] * draw.uniform(0.8, 1.2),
        share: share / total,
    };
    let bristles = shares.iter().enumerate().map(bristle).collect();
    let growth = if segments > 1 { 1.15 } else { 1.0 };
    FrictionConfig {
        base: growth * draw.uniform(0.6, 1.0),
        shared: draw.uniform(0.1, 0.5),
        coefficient: draw.uniform(0.08, 0.14),
        wrap_deg: [0, 1].map(|_| draw.both(80.0, 130.0)),
        bristles,
    }
}
