//! `i2ris command fixture`: virtual fixtures by request.

use i2ris::ipc::client::Client;
use i2ris::ipc::payload::{VirtualFixturesMsg, unpadded_text};
use i2ris::ipc::{FixtureAction, FixtureKind};
use i2ris::units::Nanos;

use i2ris_report::{Failure, Screen, until_closed};

use super::stream_monitor::StopReason;
use crate::numbers::finite;

/// Kind and values of a region, rad or m.
type Region = (FixtureKind, [f64; 4]);

/// The stream is sent once a second.
const WAIT: Nanos = Nanos::from_millis(3000);

#[derive(Debug, Clone, clap::Subcommand)]
pub enum FixtureCommand {
    /// All regions count
    On,
    /// No region counts, until `on`. Needs the lease, and a robot that follows no goal
    Off,
    /// Remove the regions that were added by request. As `off`
    Remove,
    /// Show the regions
    List,
    /// Forbid a circle in the plane of pitch and yaw
    #[command(allow_negative_numbers = true)]
    Circle {
        #[arg(value_parser = finite)]
        pitch_deg: f64,
        #[arg(value_parser = finite)]
        yaw_deg: f64,
        #[arg(value_parser = finite)]
        radius_deg: f64,
    },
    /// Forbid everything beyond a line in the plane of pitch and yaw: further than OFFSET_DEG in
    /// the direction of the normal
    #[command(allow_negative_numbers = true)]
    HalfPlane {
        #[arg(value_parser = finite)]
        normal_pitch: f64,
        #[arg(value_parser = finite)]
        normal_yaw: f64,
        #[arg(value_parser = finite)]
        offset_deg: f64,
    },
    /// Forbid a ball to the tip; z is along the straight snake, yaw bends towards x, pitch towards
    /// y
    #[command(allow_negative_numbers = true)]
    Ball {
        #[arg(value_parser = finite)]
        x_mm: f64,
        #[arg(value_parser = finite)]
        y_mm: f64,
        #[arg(value_parser = finite)]
        z_mm: f64,
        #[arg(value_parser = finite)]
        radius_mm: f64,
    },
    /// Forbid everything beyond a plane to the tip
    #[command(allow_negative_numbers = true)]
    HalfSpace {
        #[arg(value_parser = finite)]
        normal_x: f64,
        #[arg(value_parser = finite)]
        normal_y: f64,
        #[arg(value_parser = finite)]
        normal_z: f64,
        #[arg(value_parser = finite)]
        offset_mm: f64,
    },
}

/// Carries it out, and prints the regions as they are then.
pub fn run(client: &mut Client, command: &FixtureCommand) -> Result<(), Failure> {
    if let Some((action, region)) = request(command) {
        client.virtual_fixture(action, region)?;
    }
    until_closed(Screen::stdout().say(&table(&newest(client)?)))?;
    Ok(())
}

/// The request of a command; `None`: only the list is asked for.
fn request(command: &FixtureCommand) -> Option<(FixtureAction, Option<Region>)> {
    let rad = f64::to_radians;
    let region = match *command {
        FixtureCommand::On => return Some((FixtureAction::On, None)),
        FixtureCommand::Off => return Some((FixtureAction::Off, None)),
        FixtureCommand::Remove => return Some((FixtureAction::Remove, None)),
        FixtureCommand::List => return None,
        FixtureCommand::Circle { pitch_deg, yaw_deg, radius_deg } => {
            (FixtureKind::Circle, [rad(pitch_deg), rad(yaw_deg), rad(radius_deg), 0.0])
        }
        FixtureCommand::HalfPlane { normal_pitch, normal_yaw, offset_deg } => {
            (FixtureKind::HalfPlane, [normal_pitch, normal_yaw, rad(offset_deg), 0.0])
        }
        FixtureCommand::Ball { x_mm, y_mm, z_mm, radius_mm } => {
            (FixtureKind::Ball, [x_mm, y_mm, z_mm, radius_mm].map(|mm| mm * 1e-3))
        }
        FixtureCommand::HalfSpace { normal_x, normal_y, normal_z, offset_mm } => {
            (FixtureKind::HalfSpace, [normal_x, normal_y, normal_z, offset_mm * 1e-3])
        }
    };
    Some((FixtureAction::Add, Some(region)))
}

/// The regions after this moment.
fn newest(client: &Client) -> Result<VirtualFixturesMsg, Failure> {
    let mut stream = client.watcher().virtual_fixtures();
    let start = i2ris::clock::now();
    loop {
        if let Some(message) = stream.newest()?
            && message.stamp_ns > start.0
        {
            return Ok(message);
        }
        if i2ris::clock::now().since(start) > WAIT {
            return Err(StopReason::Silent.into());
        }
        i2ris::clock::sleep(Nanos::from_millis(5));
    }
}

pub fn table(message: &VirtualFixturesMsg) -> String {
    let kinds = message.kind.iter().enumerate();
    let lines: Vec<String> = kinds
        .filter_map(|(index, kind)| {
            let kind = FixtureKind::from_number(*kind).filter(|kind| *kind != FixtureKind::None)?;
            let counts = if message.active & (1 << index) != 0 { "on " } else { "off" };
            let name = unpadded_text(message.name.get(index)?);
            let values = describe(kind, message.values.get(index)?);
            Some(format!("{} {counts} {name}: {kind} {values}", index + 1))
        })
        .collect();
    if lines.is_empty() { "no virtual fixture".to_owned() } else { lines.join("\n") }
}

fn describe(kind: FixtureKind, values: &[f64; 17]) -> String {
    let deg = |index: usize| values.get(index).copied().unwrap_or(0.0).to_degrees();
    let mm = |index: usize| values.get(index).copied().unwrap_or(0.0) * 1e3;
    let plain = |index: usize| values.get(index).copied().unwrap_or(0.0);
    match kind {
        FixtureKind::None => String::new(),
        FixtureKind::Circle => {
            format!("around {:+.2} {:+.2} deg, radius {:.2} deg", deg(0), deg(1), deg(2))
        }
        FixtureKind::HalfPlane => {
            format!("beyond {:+.2} deg along {:+.2} {:+.2}", deg(2), plain(0), plain(1))
        }
        FixtureKind::Ball => {
            format!("around {:+.3} {:+.3} {:+.3} mm, radius {:.3} mm", mm(0), mm(1), mm(2), mm(3))
        }
        FixtureKind::HalfSpace => format!(
            "beyond {:+.3} mm along {:+.2} {:+.2} {:+.2}",
            mm(3),
            plain(0),
            plain(1),
            plain(2)
        ),
        FixtureKind::Polygon => {
            let corners = (0..plain(0) as usize).map(|k| {
                let (pitch, yaw) = (deg(1 + 2 * k), deg(2 + 2 * k));
                format!("{pitch:+.2} {yaw:+.2}")
            });
            format!("{} deg", corners.collect::<Vec<_>>().join(", "))
        }
    }
}

#[cfg(test)]
mod tests {
    use i2ris::ipc::payload::padded_text;

    use super::*;

    #[test]
    fn the_table_shows_every_region_in_degrees_and_mm() {
        let mut message = VirtualFixturesMsg::default();
        assert_eq!(table(&message), "no virtual fixture");
        message.active = 0b10;
        message.kind[..2].copy_from_slice(&[1, 3]);
        message.values[0][..3].copy_from_slice(&[0.1, -0.1, 0.05]);
        message.values[1][..4].copy_from_slice(&[1e-3, 0.0, 1.5e-3, 2e-4]);
        message.name[0] = padded_text("lens");
        message.name[1] = padded_text("request 1");
        assert_eq!(
            table(&message),
            "1 off lens: circle around +5.73 -5.73 deg, radius 2.86 deg\n2 on  request 1: ball \
             around +1.000 +0.000 +1.500 mm, radius 0.200 mm"
        );
    }

    #[test]
    fn degrees_and_mm_become_rad_and_m() {
        let ball = FixtureCommand::Ball { x_mm: 1.0, y_mm: 0.0, z_mm: 1.5, radius_mm: 0.2 };
        let (action, region) = request(&ball).unwrap();
        assert_eq!(action, FixtureAction::Add);
        assert_eq!(region, Some((FixtureKind::Ball, [1e-3, 0.0, 1.5e-3, 2e-4])));
        assert_eq!(request(&FixtureCommand::List), None);
    }
}
