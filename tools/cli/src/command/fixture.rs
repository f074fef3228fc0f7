//! `i2ris command fixture`: virtual fixtures by request.

use i2ris::ipc::payload::{VirtualFixturesMsg, unpadded_text};
use i2ris::ipc::{FixtureAction, FixtureKind};
use i2ris::{ipc::client::Client, units::Nanos};
use i2ris_report::{DomainOption, Failure, exit::Coded};

use super::stream_monitor::StopReason;
use crate::command::name_holder;
use crate::numbers::finite;
use crate::procedure::say;

/// Kind and values of a region, rad or m.
type Region = (FixtureKind, [f64; 4]);

/// `None`: list only.
type Request = Option<(FixtureAction, Option<Region>)>;

/// The stream is sent once a second.
const WAIT: Nanos = Nanos::from_millis(3000);

#[derive(Debug, clap::Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "Examples:
  i2ris command fixture list
  i2ris command fixture circle 10 5 3            PITCH_DEG YAW_DEG RADIUS_DEG
  i2ris command fixture half-plane 1 0 12        NORMAL_PITCH NORMAL_YAW OFFSET_DEG
  i2ris command fixture ball 1 0 15 0.5          X_MM Y_MM Z_MM RADIUS_MM
  i2ris command fixture half-space 0 0 1 18      NORMAL_X NORMAL_Y NORMAL_Z OFFSET_MM

z is along the straight snake; yaw bends towards x, pitch towards y. A half-plane or half-space
forbids everything beyond the offset in the direction of the normal."
)]
pub struct Arguments {
    /// Action
    #[arg(value_enum)]
    action: Action,
    /// Numbers of the region to add, as in the examples
    #[arg(value_parser = finite)]
    numbers: Vec<f64>,
    #[command(flatten)]
    domain: DomainOption,
}

#[derive(Debug, Clone, Copy, PartialEq, clap::ValueEnum)]
enum Action {
    /// Show the regions
    List,
    /// Switch all regions on
    On,
    /// Switch all regions off, until `on`. Needs the lease and a robot without a goal
    Off,
    /// Remove the regions added by request. Same conditions as `off`
    Remove,
    /// Forbid a circle in the plane of pitch and yaw
    Circle,
    /// Forbid everything beyond a line in the plane of pitch and yaw
    HalfPlane,
    /// Keep the tip out of a ball
    Ball,
    /// Keep the tip from going beyond a plane
    HalfSpace,
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let request = request(arguments.action, &arguments.numbers)?;
    let domain = arguments.domain.domain()?;
    let carry_out = || -> Result<(), Failure> {
        let mut client = super::prepare::connect(&domain)?;
        if let Some((action, region)) = request {
            client.virtual_fixture(action, region)?;
        }
        say(&table(&newest(&client)?))
    };
    carry_out().map_err(|failure| name_holder(failure, &domain))
}

fn request(action: Action, numbers: &[f64]) -> Result<Request, Failure> {
    let (rad, m) = (f64::to_radians, |mm: f64| mm * 1e-3);
    let region = match (action, numbers) {
        (Action::List, []) => return Ok(None),
        (Action::On, []) => return Ok(Some((FixtureAction::On, None))),
        (Action::Off, []) => return Ok(Some((FixtureAction::Off, None))),
        (Action::Remove, []) => return Ok(Some((FixtureAction::Remove, None))),
        (Action::Circle, &[pitch, yaw, radius]) => {
            (FixtureKind::Circle, [rad(pitch), rad(yaw), rad(radius), 0.0])
        }
        (Action::HalfPlane, &[pitch, yaw, offset]) => {
            (FixtureKind::HalfPlane, [pitch, yaw, rad(offset), 0.0])
        }
        (Action::Ball, &[x, y, z, radius]) => (FixtureKind::Ball, [m(x), m(y), m(z), m(radius)]),
        (Action::HalfSpace, &[x, y, z, offset]) => (FixtureKind::HalfSpace, [x, y, z, m(offset)]),
        (_, numbers) => {
            let count = numbers.len();
            let sentence = format!(
                "{count} number(s) do not fit; see the regions in `i2ris command fixture --help`"
            );
            return Err(Coded { code: 2, sentence }.into());
        }
    };
    Ok(Some((FixtureAction::Add, Some(region))))
}

fn newest(client: &Client) -> Result<VirtualFixturesMsg, Failure> {
    let mut stream = client.watcher().virtual_fixtures();
    let start = i2ris::clock::now();
    loop {
        if let Some(message) = stream.newest()?
            && message.stamp_ns > start.0
        {
            return Ok(message);
        }
        if i2ris::clock::now().duration_since(start) > WAIT {
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
    let plain = |index: usize| values.get(index).copied().unwrap_or(0.0);
    let (deg, mm) = (|index| f64::to_degrees(plain(index)), |index| plain(index) * 1e3);
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
        FixtureKind::HalfSpace => {
            let [x, y, z] = [0, 1, 2].map(plain);
            format!("beyond {:+.3} mm along {x:+.2} {y:+.2} {z:+.2}", mm(3))
        }
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
    fn table_shows_every_region_in_degrees_and_mm() {
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
    fn degrees_and_mm_are_converted_and_wrong_counts_refused() {
        let requested =
            |action, numbers: &[f64]| request(action, numbers).map_err(|error| error.to_string());
        let ball = Some((FixtureKind::Ball, [1e-3, 0.0, 1.5e-3, 2e-4]));
        let asked = Ok(Some((FixtureAction::Add, ball)));
        assert_eq!(requested(Action::Ball, &[1.0, 0.0, 1.5, 0.2]), asked);
        assert_eq!(requested(Action::List, &[]), Ok(None));
        for (action, numbers) in [(Action::Ball, &[1.0, 2.0][..]), (Action::Off, &[1.0])] {
            assert!(requested(action, numbers).unwrap_err().contains("do not fit"));
        }
    }
}
