//! `i2ris monitor`: shows what the controller tells. Reads only; it cannot move anything.

mod view;

use i2ris::clock;
use i2ris::ipc::Message;
use i2ris::ipc::client::{Client, ClientError, Latest, Watcher};
use i2ris::ipc::payload::{ActuatorState, ExternalPosition, JointState, OperatingStateMsg, PeriodStatistics};
use i2ris::units::{MAX_MOTORS, Nanos};

use crate::Failure;
use crate::console::{DomainOption, Interrupt, Screen, until_closed};
use view::View;

/// How long to wait for a controller that is just starting.
const CONNECT: Nanos = Nanos::from_millis(2000);
/// How often a person sees something new, and how often a file gets a line.
const DRAW_PERIOD: Nanos = Nanos::from_millis(100);
const LINE_PERIOD: Nanos = Nanos::from_millis(1000);
/// How often streams are read: their buffers hold 128 messages.
const READ_PERIOD: Nanos = Nanos::from_millis(50);
/// The first rate is told early, from fewer exchanges.
const FIRST_SPAN: Nanos = Nanos::from_millis(250);
/// Statistics come once a second: what is not there by then will not come.
const FIRST_NEWS: Nanos = Nanos::from_millis(1500);

/// Arguments of `i2ris monitor`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    domain: DomainOption,
    /// Show everything once and end
    #[arg(long)]
    once: bool,
    /// End after this time instead of with Ctrl-C
    #[arg(long = "duration-s", visible_alias = "duration", value_name = "S")]
    duration_s: Option<f64>,
}

/// Runs it.
pub fn run(arguments: Arguments) -> Result<(), Failure> {
    let mut client = Client::connect(&arguments.domain.domain()?, CONNECT)?;
    let interrupt = Interrupt::catch()?;
    let title = title(&mut client, &arguments)?;
    let mut sight = Sight::new(&client.watcher());
    if arguments.once {
        return once(&mut sight, &interrupt, title);
    }
    let start = clock::now();
    let end = arguments.duration_s.map(|seconds| start + Nanos((seconds.max(0.0) * 1e9) as u64));
    let mut screen = Screen::stdout();
    let period = if screen.is_terminal() { DRAW_PERIOD } else { LINE_PERIOD };
    let (mut next_draw, mut open) = (start + READ_PERIOD, true);
    while open && !interrupt.came() && end.is_none_or(|end| clock::now() < end) {
        let outcome = sight.refresh();
        let now = clock::now();
        if now >= next_draw {
            next_draw = now + period;
            open = until_closed(screen.draw(&lines(&sight, outcome, &screen, &title, now)))?;
        }
        clock::sleep(READ_PERIOD);
    }
    Ok(())
}

fn lines(sight: &Sight, outcome: Result<(), ClientError>, screen: &Screen, title: &str, now: Nanos) -> Vec<String> {
    match outcome {
        Err(error) => vec![error.to_string()],
        Ok(()) if screen.is_terminal() => [vec![title.to_owned()], sight.view.page(now)].concat(),
        Ok(()) => vec![sight.view.line(now)],
    }
}

/// Waits until every stream that a controller always tells has told something, then shows the page.
fn once(sight: &mut Sight, interrupt: &Interrupt, title: String) -> Result<(), Failure> {
    let start = clock::now();
    loop {
        sight.refresh()?;
        let now = clock::now();
        if sight.is_complete() || now.since(start) > FIRST_NEWS || interrupt.came() {
            let page = [vec![title], sight.view.page(now)].concat();
            until_closed(Screen::stdout().draw(&page))?;
            return Ok(());
        }
        clock::sleep(Nanos::from_millis(5));
    }
}

fn title(client: &mut Client, arguments: &Arguments) -> Result<String, Failure> {
    let version = client.version()?;
    let [major, minor, patch] = version.software;
    let domain = arguments.domain.domain()?;
    let model: String = match version.model_id {
        [0, ..] if version.model_id == [0; 32] => "no model".to_owned(),
        id => format!("model {}", id.iter().take(4).map(|byte| format!("{byte:02x}")).collect::<String>()),
    };
    Ok(format!("i2ris {major}.{minor}.{patch}, domain {}, process {}, {model}", domain.name(), version.pid))
}

/// All streams, and what they told last.
struct Sight {
    state: Latest<OperatingStateMsg>,
    goal: Latest<JointState>,
    setpoint: Latest<JointState>,
    measured: Latest<JointState>,
    camera: Latest<ExternalPosition>,
    actuators: Latest<ActuatorState>,
    statistics: Latest<PeriodStatistics>,
    exchanges: Exchanges,
    view: View,
}

impl Sight {
    fn new(watcher: &Watcher) -> Self {
        Self {
            state: Latest::new(watcher.operating_state()),
            goal: Latest::new(watcher.goal_js()),
            setpoint: Latest::new(watcher.setpoint_js()),
            measured: Latest::new(watcher.measured_js()),
            camera: Latest::new(watcher.external()),
            actuators: Latest::new(watcher.actuators()),
            statistics: Latest::new(watcher.period_statistics()),
            exchanges: Exchanges::default(),
            view: View::default(),
        }
    }

    fn refresh(&mut self) -> Result<(), ClientError> {
        self.view = View::default();
        let actuators = self.actuators.refresh()?.copied();
        self.view = View {
            state: self.state.refresh()?.copied(),
            goal: self.goal.refresh()?.copied(),
            setpoint: self.setpoint.refresh()?.copied(),
            measured: self.measured.refresh()?.copied(),
            camera: self.camera.refresh()?.copied(),
            actuators,
            statistics: self.statistics.refresh()?.copied(),
            exchange_rates: actuators.and_then(|message| self.exchanges.rates(&message)),
        };
        Ok(())
    }

    fn is_complete(&self) -> bool {
        let View { state, measured, actuators, statistics, exchange_rates, .. } = &self.view;
        let all = state.is_some() && measured.is_some() && actuators.is_some() && statistics.is_some();
        all && exchange_rates.is_some()
    }
}

/// Turns counters into rates, about once a second.
#[derive(Debug, Default)]
struct Exchanges {
    before: Option<ActuatorState>,
    rates: Option<[f64; MAX_MOTORS]>,
}

impl Exchanges {
    /// `None` until there are two messages to compare.
    fn rates(&mut self, message: &ActuatorState) -> Option<[f64; MAX_MOTORS]> {
        let before = *self.before.get_or_insert(*message);
        let span = message.stamp() - before.stamp();
        if before.boot_id != message.boot_id {
            *self = Self { before: Some(*message), ..Self::default() };
        } else if span >= if self.rates.is_none() { FIRST_SPAN } else { LINE_PERIOD } {
            self.rates = Some(std::array::from_fn(|motor| {
                message.exchanges[motor].saturating_sub(before.exchanges[motor]) as f64 / span.as_seconds()
            }));
            self.before = Some(*message);
        }
        self.rates
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counters_become_rates() {
        let message = |milliseconds, count, boot_id| ActuatorState {
            stamp_ns: Nanos::from_millis(milliseconds).0,
            exchanges: [count, 2 * count],
            boot_id,
            ..ActuatorState::default()
        };
        let mut exchanges = Exchanges::default();
        assert_eq!(exchanges.rates(&message(1000, 100, 1)), None);
        assert_eq!(exchanges.rates(&message(1200, 180, 1)), None);
        assert_eq!(exchanges.rates(&message(1500, 300, 1)), Some([400.0, 800.0]));
        assert_eq!(exchanges.rates(&message(2000, 550, 1)), Some([400.0, 800.0]), "once a second");
        assert_eq!(exchanges.rates(&message(2500, 800, 1)), Some([500.0, 1000.0]));
        assert_eq!(exchanges.rates(&message(2600, 3, 2)), None, "another controller counts anew");
        assert_eq!(exchanges.rates(&message(3600, 103, 2)), Some([100.0, 200.0]));
    }
}
