//! Pulses of the device near limits: the same beats as the sound of the operator's page. Never a
//! command.

use i2ris::ipc::Domain;
use i2ris::ipc::client::{Client, ClientError, Latest};
use i2ris::ipc::payload::{JointState, OperatingStateMsg, VirtualFixturesMsg};
use i2ris::units::Nanos;
use i2ris_report::model_poller::ModelPoller;
use i2ris_report::view::{LatestMessages, View};

/// Period of checking for a limit: that of the fastest beat.
const LOOK: Nanos = Nanos::from_millis(100);

/// Timing of device pulses.
pub(super) struct Pulses {
    measured: Latest<JointState>,
    state: Latest<OperatingStateMsg>,
    fixtures: Latest<VirtualFixturesMsg>,
    models: ModelPoller,
    last: Nanos,
    looked: Nanos,
}

impl Pulses {
    pub fn new(client: &Client, domain: &Domain) -> Self {
        let watcher = client.watcher();
        let models = ModelPoller::start(domain);
        models.poll_now();
        Self {
            measured: Latest::new(watcher.measured_js()),
            state: Latest::new(watcher.operating_state()),
            fixtures: Latest::new(watcher.virtual_fixtures()),
            models,
            last: Nanos::ZERO,
            looked: Nanos::ZERO,
        }
    }

    /// Whether the device should pulse now.
    pub fn due(&mut self, now: Nanos) -> Result<bool, ClientError> {
        if now.duration_since(self.looked) < LOOK {
            return Ok(false);
        }
        self.looked = now;
        let messages = LatestMessages {
            measured: self.measured.refresh()?.copied(),
            state: self.state.refresh()?.copied(),
            fixtures: self.fixtures.refresh()?.copied(),
            ..LatestMessages::default()
        };
        let cue = View::new(&messages, now).cue(&self.models.known().outline.points);
        let due = cue.is_some_and(|cue| now.duration_since(self.last) >= cue.beat());
        if due {
            self.last = now;
        }
        Ok(due)
    }
}

#[cfg(test)]
mod tests {
    use i2ris::clock;
    use i2ris::ipc::FixtureKind;
    use i2ris_testing::{Controller, wait_until};

    use super::*;

    #[test]
    fn pulses_are_faster_nearer_to_a_fixture() {
        let controller = Controller::enabled();
        let mut fixtures = VirtualFixturesMsg { active: 1, ..VirtualFixturesMsg::default() };
        fixtures.kind[0] = FixtureKind::Circle.number();
        // It ends 5.73 deg from the middle.
        fixtures.values[0][..3].copy_from_slice(&[0.0, 0.2, 0.1]);
        controller.robot().fixtures = Some(fixtures);
        let client = Client::connect(&controller.domain, Nanos::from_millis(10_000)).unwrap();
        let mut pulses = Pulses::new(&client, &controller.domain);
        wait_until("the fixture", || pulses.fixtures.refresh().unwrap().is_some());
        let beat = |pulses: &mut Pulses, yaw_deg: f64| {
            controller.robot().pose = [0.0, yaw_deg];
            wait_until("the snake is there", || {
                let measured = pulses.measured.refresh().unwrap();
                measured.is_some_and(|it| (it.position[1].to_degrees() - yaw_deg).abs() < 0.01)
            });
            // Backdates the last pulse, so that the test need not wait for a beat.
            let due_after = |pulses: &mut Pulses, wait_ms: u64| {
                let now = clock::now();
                (pulses.looked, pulses.last) = (Nanos::ZERO, now - Nanos::from_millis(wait_ms));
                pulses.due(now).unwrap()
            };
            (1..=10).map(|step| 100 * step).find(|wait_ms| due_after(pulses, *wait_ms))
        };
        // 0.1 s when it touches, 1 s from 3 deg away.
        assert_eq!(beat(&mut pulses, 5.7), Some(100));
        assert_eq!(beat(&mut pulses, 4.0), Some(700));
        assert_eq!(beat(&mut pulses, 0.0), None);
    }
}
