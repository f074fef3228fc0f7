//! Pairs: whole situations, drawn at random, in which any stage may undo the limit of another.
//! Limits, fixtures, adaptation, a swap in progress, conditioning, the clutch, stale streams, a
//! camera that misleads, two clients and a clock that jumps meet in every combination.
//!
//! `defects`: deliberate defects in the order of filters, which the pairs must find.

mod actions;
mod defects;
mod drawing;
mod expected;
mod jaw;
mod oracle;
mod routes;
mod setpoint_path;
mod snake;
mod stream;
mod zones;

use std::collections::VecDeque;

use i2ris::units::OutputVec;

use drawing::{braking, configuration, limits};
use expected::{Angles, Expected, What, first_step_counts};
use jaw::Jaw;
use oracle::{LARGEST_GAIN, Limits, Oracle, SLANTED, SQUARE, Stop, adapted};
use routes::{distance, plus};
use setpoint_path::SetpointPath;
use snake::{Snake, Wire};
use zones::Zone;

use super::*;

const OTHER: u64 = CLIENT + 1;
/// Only stops the robot and enables motion again.
const THIRD: u64 = CLIENT + 2;
/// `command.lease_timeout_ms` by default.
const LEASE: Nanos = Nanos::from_millis(500);
/// Silence after which a stream held by another client may start again.
const BREAK: Nanos = Nanos::from_millis(1000);
/// Ticks in which a camera gains influence.
const MISLED_TICKS: u64 = 40_000;
/// Longer than the window of the setpoint path.
const CALM_TICKS: u64 = 400;
/// Ticks of a situation.
const TICKS: u64 = 4000;
/// Seeds that found a defect. 1157: after a cycle stopped, the gate mistook the remaining speed for
/// growth and allowed twice the jerk. 1204: regions led the goal along a wedge and away. 1205: the
/// margin of the gate was a share of the speed, and thus many times that of the acceleration. 3189:
/// a held client that sent hold itself was free of the hold. 3198: setpoints left the hull although
/// they would have come to rest inside. The draws have changed since these two seeds, which no
/// longer find their defects. 1686: the blend of a swap took up what the snake had still to go, so
/// it went on for 3.7 deg at a rate of zero.
const SEEDS: [u64; 6] = [1157, 1204, 1205, 3189, 3198, 1686];

/// Kinds of goals in joint space and of the tip.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    Angles,
    Interpolated,
    Rate,
    Tip,
    TipRate,
}

const KINDS: [Kind; 5] = [Kind::Angles, Kind::Interpolated, Kind::Rate, Kind::Tip, Kind::TipRate];
const RATES: [Kind; 2] = [Kind::Rate, Kind::TipRate];

struct Situation {
    random: Random,
    /// Kind of goals in the stream; in every fifth situation angles only.
    kind: Kind,
    kinds: Option<Random>,
    rates_only: bool,
    bench: Bench,
    oracle: Oracle,
    /// The regions of the configuration, and those of requests.
    zones: Vec<Zone>,
    configured: usize,
    zones_on: bool,
    /// The goal of the stream, its rate in deg/s, and the time from command to command, ms.
    goal: [f64; 2],
    rate: [f64; 2],
    period: u64,
    /// Goals that are sent one after the other, and how long the first has been sent, ms.
    route: VecDeque<[f64; 2]>,
    waited: u64,
    is_streaming: bool,
    /// Ticks in which a held client stays silent.
    quiet: u64,
    /// Ticks in which a rate continues undisturbed.
    calm: u64,
    clutched: bool,
    sequence: u64,
    /// Maximum age of a command on arrival, ms: the stamps do not rise.
    jitter: u64,
    /// Motion stops and a conditioning cycle begins, in which only the gate limits the angles.
    is_conditioned: bool,
    /// Stamps run backwards, in half of the rate situations.
    is_out_of_order: bool,
    /// Goals of a hand, one per command.
    hand: VecDeque<[f64; 2]>,
    /// The client accepted last, and when.
    leader: Option<(u64, Nanos)>,
    /// When each client was last held by the other, and when it last sent.
    held: [Option<Nanos>; 2],
    sent: [Nanos; 2],
    /// Whether each client has a session since the last stop; `None` if unknown.
    begun: [Option<bool>; 2],
    /// The client that started the move or conditioning in progress.
    mover: Option<u64>,
    hull: &'static [[f64; 2]],
    /// The camera: shift and its rate, degrees.
    camera: Option<([f64; 2], f64)>,
    /// The staged model with its gain, and the gains of the active and the previous model.
    next: Option<(Arc<Model>, f64)>,
    gains: [f64; 2],
    wire: Wire,
    /// The adaptation follows a wrong camera; the effect shows at the edge of a region.
    misled: Option<Random>,
    jaw: Option<Jaw>,
}

impl Situation {
    fn new(seed: u64) -> Self {
        let mut random = Random::new(seed);
        let (mut wire, mut is_shipped) = (snake::wire(&mut random), random.one_in(4));
        let is_conditioned = seed % 10 == 7;
        if is_conditioned {
            (wire, is_shipped) = (Wire::Taut, false);
        }
        let has_angles = wire.unit() == OutputUnit::Deg;
        let mut limits =
            if has_angles { limits(&mut random, is_shipped) } else { Limits::default() };
        if is_conditioned {
            let (velocity, acceleration) = (random.within(5.0, 25.0), random.within(100.0, 600.0));
            // It would be refused with a position limit.
            limits = Limits::default();
            (limits.velocity, limits.acceleration) = (Some(velocity), Some(acceleration));
        }
        let count = if is_conditioned { 0 } else { random.below(4) };
        let zones: Vec<Zone> = (0..count).map(|_| Zone::draw(&mut random, wire)).collect();
        let config = configuration(&mut random, &limits, &zones, is_shipped);
        let (jaw, mut config) = Jaw::draw(seed, config);
        if is_conditioned {
            let jerk = limits.acceleration.map(|limit| limit / random.within(1e-3, 8e-3));
            (config.joint_limits.jerk_deg_s3, config.adaptation.enabled) = (jerk, false);
        }
        let hull: &[[f64; 2]] = if seed.is_multiple_of(3) { &SLANTED } else { &SQUARE };
        let misleads = wire == Wire::Taut && config.adaptation.enabled && random.one_in(2);
        let stop = Stop::new(&config);
        let bench = Bench::enabled_with(config, Some(wire.model(1.0, hull)));
        let path = SetpointPath::new(Expected::new(&bench.config, wire), braking(&bench.config));
        let mut oracle = Oracle::new(Snake::new(wire), limits, hull, stop, path);
        oracle.set_zones(&bench, &zones);
        let mut situation = Self {
            kind: if seed % 5 == 1 { Kind::Rate } else { Kind::Angles },
            kinds: (!seed.is_multiple_of(5)).then(|| Random::new(seed ^ 0x9E37_79B9)),
            rates_only: seed % 5 == 1,
            configured: zones.len(),
            zones,
            zones_on: true,
            goal: [0.0; 2],
            rate: [0.0; 2],
            period: 5,
            route: VecDeque::new(),
            waited: 0,
            is_streaming: true,
            quiet: 0,
            calm: 0,
            clutched: false,
            sequence: 1,
            is_conditioned,
            is_out_of_order: seed % 10 == 1,
            jitter: if random.one_in(4) { 41 } else { 1 },
            hand: VecDeque::new(),
            leader: None,
            held: [None; 2],
            sent: [Nanos::ZERO; 2],
            begun: [Some(true), None],
            mover: None,
            hull,
            camera: None,
            next: None,
            gains: [1.0; 2],
            wire,
            misled: misleads.then(|| Random::new(seed ^ 0x94D0_49BB)),
            jaw,
            random,
            bench,
            oracle,
        };
        if misleads {
            situation.mislead();
        }
        situation
    }

    /// A camera drifts towards smaller angles and is followed, with no region that would reveal it.
    fn mislead(&mut self) {
        let has_zones = !self.zones.is_empty();
        self.switch(has_zones, FixtureChange::SwitchOff);
        let [x, y] = self.random.direction().map(|part| 2.6 * part);
        for k in 0..MISLED_TICKS {
            let share = (1.25 * k as f64 / MISLED_TICKS as f64).min(1.0);
            self.camera = Some(([share * x, share * y], 0.0));
            self.see();
            let phase = 0.004 * k as f64;
            let [pitch, yaw] = [phase.sin(), (0.7 * phase).sin()].map(|part| 1.9 * part);
            self.bench.joint(pitch, yaw);
        }
        assert_eq!(self.bench.ask(StateCommand::Hold), Refusal::None);
        self.bench.run(60);
        self.switch(has_zones, FixtureChange::SwitchOn);
        self.goal = self.present();
        self.sent[0] = self.bench.now;
        self.leader = Some((CLIENT, self.bench.now));
        self.oracle.begin(&self.bench);
        self.oracle.set_zones(&self.bench, &self.zones);
        let applied = self.bench.report().adaptation.unwrap().applied.zero.map(f64::to_degrees);
        println!("misled by {applied:?} of {x} {y}");
    }

    fn switch(&mut self, is_any: bool, change: FixtureChange) {
        if is_any {
            assert_eq!(self.bench.change_fixtures(CLIENT, change), Refusal::None);
        }
    }

    fn run(&mut self, ticks: u64) {
        for tick in 0..ticks {
            if self.quiet > 0 {
                self.quiet -= 1;
                self.see();
                self.tick();
                if self.quiet == 0 {
                    let _ = self.ask(CLIENT, StateCommand::Hold);
                }
                continue;
            }
            let acts = self.random.one_in(if self.route.is_empty() { 60 } else { 600 });
            self.calm = self.calm.saturating_sub(1);
            if acts && self.calm == 0 {
                self.act();
            }
            self.see();
            if self.is_streaming && tick.is_multiple_of(self.period) {
                self.stream();
            } else {
                self.tick();
            }
        }
    }

    fn check(&mut self) {
        self.mover = self.mover.filter(|_| !self.bench.report().holding);
        self.oracle.check(&self.bench);
        if let Some(jaw) = &mut self.jaw {
            jaw.check(&self.bench);
        }
    }

    fn present(&self) -> Angles {
        self.wire.angles(self.bench.joints().setpoint)
    }

    /// Angles as a client sends them.
    fn output(&self, [pitch, yaw]: Angles) -> OutputVec {
        self.wire.outputs([pitch, yaw])
    }

    fn ask(&mut self, client_id: u64, command: StateCommand) -> Refusal {
        let is_enabled = self.bench.state() == OperatingState::Enabled;
        let refusal = self.bench.ask_as(client_id, command).refusal;
        if refusal == Refusal::None {
            self.note_session(client_id, command);
        }
        if (command, refusal) == (StateCommand::Hold, Refusal::None) {
            self.leader = self.leader.filter(|(leader, _)| *leader == client_id);
            let other = usize::from(client_id == CLIENT);
            self.held[other] = self.held[other].max(is_enabled.then_some(self.bench.now));
        }
        if command.only_stops() && self.bench.state() != OperatingState::Disabled {
            assert_eq!(refusal, Refusal::None, "{command:?} only stops");
        }
        if let Some(jaw) = &mut self.jaw
            && command.only_stops()
            && refusal == Refusal::None
        {
            jaw.stopped();
        }
        self.check();
        refusal
    }

    fn act(&mut self) {
        self.route.clear();
        self.hand.clear();
        if let Some(misled) = &mut self.misled
            && self.zones_on
            && !self.zones.is_empty()
            && !misled.one_in(4)
        {
            return self.draw_route();
        }
        if self.is_conditioned && self.random.one_in(4) {
            return self.condition_after_a_stop();
        }
        match self.random.below(21) {
            0..=3 => self.turn(),
            16 | 17 if self.rates_only => self.swap(),
            16 | 17 => self.draw_route(),
            18 if !self.rates_only => self.draw_hand(),
            19 => self.move_to(OTHER),
            20 if self.random.one_in(3) => {
                let _ = self.ask(OTHER, StateCommand::Hold);
            }
            20 => self.go_on_through_a_stop(),
            4 => self.is_streaming = !self.is_streaming || self.random.one_in(2),
            5 => self.clutched = !self.clutched,
            6 => self.compete(),
            7 => self.change_zones(),
            8 => self.swap(),
            9 => self.move_to(CLIENT),
            10 => self.condition(),
            11 => {
                let stops = [StateCommand::Hold, StateCommand::Pause, StateCommand::Release];
                let stop = stops[self.random.below(3) as usize];
                if (self.bench.now.0 / 1_000_000).is_multiple_of(9) {
                    let _ = self.ask(OTHER, StateCommand::Hold);
                }
                if self.ask(CLIENT, stop) == Refusal::None && stop == StateCommand::Release {
                    self.leader = None;
                }
                let _ = self.ask(CLIENT, StateCommand::Resume);
            }
            12 => {
                let (shift, rate) = (self.random.within(-3.0, 3.0), self.random.within(-0.3, 0.3));
                self.camera = (!self.random.one_in(3)).then_some(([0.3 * shift, 0.0], rate));
            }
            13 => self.bench.skip(Nanos::from_millis(self.random.below(90))),
            14 => self.begin_in_counts(),
            _ => self.disable_and_enable(),
        }
    }

    fn turn(&mut self) {
        let most = if self.rates_only && self.random.one_in(2) { 12.0 } else { 40.0 };
        let is_zero = self.random.one_in(if self.rates_only { 2 } else { 4 });
        let speed = if is_zero { 0.0 } else { self.random.within(0.0, most) };
        self.rate = self.random.direction().map(|part| speed * part);
        self.period = 1 + self.random.below(10);
        if self.rates_only {
            (self.calm, self.clutched, self.is_streaming) = (CALM_TICKS, false, true);
        }
        if self.rates_only || self.random.one_in(3) {
            self.goal = self.present();
        }
        // The largest step allowed: the motors arrive at different times.
        if self.hull.len() == SLANTED.len() && self.random.one_in(2) {
            let direction = self.random.direction();
            let step = 0.98 * self.oracle.path.expected.step;
            self.goal = [0, 1].map(|at: usize| self.goal[at] + step * direction[at]);
        }
        if self.random.one_in(5) {
            self.goal = [self.random.within(-9.0, 9.0), self.random.within(-9.0, 9.0)];
        }
        // No goal is expected, and the blend lasts.
        if is_zero && self.rates_only {
            self.swap();
        }
    }
}

fn check(seed: u64) {
    println!("seed {seed}");
    Situation::new(seed).run(TICKS);
}

#[test]
fn no_stage_undoes_the_limit_of_another() {
    SEEDS.into_iter().chain(0..25).for_each(check);
}

/// Runs `I2RIS_TICKS` ticks from `I2RIS_SEED` on; with `I2RIS_FIRST`, up to the first failure.
#[test]
#[ignore = "a minute: for .ci/nightly"]
fn pairs_of_a_million_ticks() {
    let number = |name: &str, default: u64| {
        std::env::var(name).map_or(default, |number| number.parse().unwrap())
    };
    let first = number("I2RIS_SEED", 1000);
    let situations = number("I2RIS_TICKS", 1_000_000) / TICKS;
    let fails = |seed: &u64| std::panic::catch_unwind(|| check(*seed)).is_err();
    let most = if std::env::var_os("I2RIS_FIRST").is_some() { 1 } else { usize::MAX };
    let failed: Vec<u64> = (first..first + situations).filter(fails).take(most).collect();
    println!("{situations} situations of {TICKS} ticks");
    assert!(failed.is_empty(), "seeds {failed:?}");
}
