//! The fault campaign: seeded fault injections of every kind at random instants while two motors
//! move.
//!
//! ```text
//! cargo run --release -p i2ris-bench --example fault_campaign [INJECTIONS] [SEED] [RIGS]
//! ```
//!
//! Every rig has two emulated drives on two ports and the drive layer with its port threads. A
//! simple control loop sends set-points of a slow sine, acknowledges faults, homes and enables
//! again. The campaign counts set-points outside the limits that a drive accepted, wrong positions
//! that were accepted, states without an event with their cause, and hangs.
#![allow(clippy::print_stdout, reason = "it prints what it counted")]

use std::collections::{BTreeMap, VecDeque};
use std::error::Error;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::thread::{self, JoinHandle};

use i2ris::clock;
use i2ris::config::{AxisConfig, PortConfig};
use i2ris::drive::{
    AxisFeedback, AxisLink, AxisPhase, AxisRequest, Demand, Port, PortEvent, PortEventKind,
};
use i2ris::units::{Counts, Nanos};
use i2ris_emulator::drive::State;
use i2ris_emulator::log::EventKind;
use i2ris_emulator::snake::SnakeConfig;
use i2ris_emulator::{Emulator, EmulatorConfig, Injection};

/// Position limits of both axes, counts.
const LIMIT: i32 = 1500;

/// Amplitude and frequency of the motion, counts and Hz.
const AMPLITUDE: f64 = 300.0;
const HERTZ: f64 = 0.5;

const TICK: Nanos = Nanos::from_millis(2);

/// An axis that does not move again within this time hangs.
const HANG_TIMEOUT: Nanos = Nanos::from_millis(30_000);

/// Time until the cause of a disabled axis is known: the drive must be read.
const CAUSE_TIMEOUT: Nanos = Nanos::from_millis(500);

/// Length of the history of true positions.
const HISTORY: Nanos = Nanos::from_millis(4000);

/// The largest age of a position: a reply timeout and its retry.
const LARGEST_AGE: Nanos = Nanos::from_millis(1500);

/// Motion between two samples of the true position, counts.
const TOLERANCE: i32 = 12;

/// The counts.
#[derive(Debug, Default)]
struct CampaignCounts {
    injections: usize,
    outside: Vec<String>,
    /// Set-points outside the limits for a drive without power, which are allowed.
    preloads: usize,
    wrong: Vec<String>,
    unexplained: Vec<String>,
    hangs: Vec<String>,
    host_bugs: u64,
    /// By kind: the time until the axis is known to be safe, and how often it stayed enabled.
    safe: BTreeMap<&'static str, Vec<Nanos>>,
    stayed_enabled: BTreeMap<&'static str, usize>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let mut number =
        |default: u64| arguments.next().map_or(Ok(default), |text| text.parse::<u64>());
    let (injections, seed, rigs) = (number(2000)?, number(1)?, number(4)?.max(1));
    let begin = clock::now();
    let threads: Vec<_> = (0..rigs)
        .map(|rig| {
            let share = injections / rigs + u64::from(rig < injections % rigs);
            thread::spawn(move || {
                CampaignRig::start(seed * 1000 + rig)
                    .map(|rig| rig.run(share as usize))
                    .map_err(|e| e.to_string())
            })
        })
        .collect();
    let mut total = CampaignCounts::default();
    for thread in threads {
        total.add(thread.join().map_err(|_| "a rig panicked")??);
    }
    total.print((clock::now() - begin).as_seconds());
    let clean = total.outside.is_empty()
        && total.wrong.is_empty()
        && total.unexplained.is_empty()
        && total.hangs.is_empty();
    if clean { Ok(()) } else { Err("see above".into()) }
}

/// Splitmix64 (G. L. Steele et al., 2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut value = self.0;
        value = (value ^ value >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        value = (value ^ value >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        value ^ value >> 31
    }

    fn between(&mut self, low: u64, high: u64) -> u64 {
        low + self.next() % (high - low)
    }

    /// A random kind. Kinds that end in a reset or a fault are rare: they cost seconds each.
    fn injection(&mut self) -> Injection {
        let place = self.between(0, 64) as usize;
        let bit = self.between(0, 192) as usize;
        match self.between(0, 40) {
            0 | 1 => Injection::LoseRequest,
            2 | 3 => Injection::DropRequest { offset: place },
            4 | 5 => Injection::FlipRequest { offset: bit },
            6 | 7 => Injection::DoubleRequest { offset: place },
            8 | 9 => Injection::CutRequest { offset: place },
            10 | 11 => Injection::LoseReply,
            12 | 13 => Injection::DropReply { offset: place },
            14..=16 => Injection::FlipReply { offset: bit },
            17 | 18 => Injection::DoubleReply { offset: place },
            19 | 20 => Injection::CutReply { offset: place },
            21 | 22 => Injection::CutReplyInPair,
            23..=26 => Injection::LateReply { delay_ms: self.between(1, 300) },
            27 | 28 => Injection::WrongLength,
            29 | 30 => Injection::StrayReply,
            31 => Injection::HangUp { for_ms: self.between(50, 400) },
            32 => Injection::Mute { for_ms: self.between(20, 600) },
            33 => Injection::Reset,
            34 => Injection::Fault {
                code: [0x2310, 0x3210, 0x3220, 0x8611, 0x4210][self.between(0, 5) as usize],
            },
            35 => Injection::FreezeEncoder { for_ms: self.between(50, 500) },
            36 => Injection::SlipEncoder { counts: self.between(0, 600) as i32 - 300 },
            37 => Injection::SlackWire { counts: self.between(20, 200) as u32 },
            38 => Injection::BreakWire,
            _ => Injection::MendWire,
        }
    }
}

/// One axis with its simple control loop.
struct CampaignAxis {
    link: AxisLink,
    request: AxisRequest,
    events: Receiver<PortEvent>,
    is_explained: bool,
    /// When the axis was disabled without a known cause, and its status.
    disabled: Option<(Nanos, String)>,
    last: AxisFeedback,
    /// True position of the encoder over time.
    truth: VecDeque<(Nanos, i32)>,
    /// Center and start of the sine.
    origin: i32,
    begin: Nanos,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

struct CampaignRig {
    emulator: Emulator,
    axes: Vec<CampaignAxis>,
    random: Random,
    counts: CampaignCounts,
    _folder: tempfile::TempDir,
}

impl CampaignRig {
    fn start(seed: u64) -> Result<Self, Box<dyn Error>> {
        let folder = tempfile::tempdir()?;
        let snake = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/snakes/steel.toml");
        let mut config =
            EmulatorConfig::new(SnakeConfig::load(&snake)?, &folder.path().join("ports"));
        config.seed = seed;
        let serial_numbers = config.drives.clone().map(|drive| drive.serial_number);
        let emulator = Emulator::start(config)?;
        let mut axes = Vec::new();
        for (motor, serial_number) in serial_numbers.into_iter().enumerate() {
            let axis = AxisConfig::new(motor, serial_number, [Counts(-LIMIT), Counts(LIMIT)]);
            let port = PortConfig {
                reply_timeout_ms: 60,
                ..PortConfig::new(emulator.device(motor).to_owned(), vec![axis])
            };
            axes.push(CampaignAxis::start(&port)?);
        }
        Ok(Self {
            emulator,
            axes,
            random: Random(seed),
            counts: CampaignCounts::default(),
            _folder: folder,
        })
    }

    fn run(mut self, injections: usize) -> CampaignCounts {
        for count in 0..injections {
            let (axis, what) = (self.random.between(0, 2) as usize, self.random.injection());
            if !self.wait_for_motion() {
                self.counts.hangs.push(format!("before injection {count} ({})", what.name()));
                break;
            }
            let moment = clock::now() + Nanos::from_millis(self.random.between(20, 200));
            while clock::now() < moment {
                self.tick();
            }
            self.inject(axis, what);
        }
        self.wait_for_motion();
        let log = self.emulator.log();
        let outside = |kind| match kind {
            EventKind::Setpoint(counts) => !(-LIMIT..=LIMIT).contains(&counts),
            _ => false,
        };
        for (place, event) in log.iter().enumerate().filter(|(_, event)| outside(event.kind)) {
            let before = || {
                log[..place]
                    .iter()
                    .rev()
                    .filter(|earlier| earlier.axis == event.axis)
                    .map(|earlier| earlier.kind)
            };
            let state = before().find_map(|kind| {
                if let EventKind::State { to, .. } = kind { Some(to) } else { None }
            });
            // An axis that lost its zero can be at any position. Before homing, its target is set
            // to its position.
            if state.is_some_and(|state| state != State::OperationEnabled) {
                self.counts.preloads += 1;
            } else {
                self.counts.outside.push(format!(
                    "{:?} after, the latest first, {:?}",
                    event.kind,
                    before().take(6).collect::<Vec<_>>()
                ));
            }
        }
        self.counts.host_bugs = self.emulator.host_bugs();
        for axis in &mut self.axes {
            axis.end();
        }
        self.counts
    }

    /// Injects a fault and waits until the axis is known to be safe.
    fn inject(&mut self, axis: usize, what: Injection) {
        self.axes[axis].is_explained = false;
        let begin = clock::now();
        self.emulator.inject(axis, what);
        self.counts.injections += 1;
        let mut was_disabled = false;
        loop {
            self.tick();
            let feedback = self.axes[axis].last;
            was_disabled |= feedback.phase != AxisPhase::Enabled;
            // Safe: enabled with fresh feedback, or without power.
            let fresh = feedback.stamp > begin + Nanos::from_millis(10);
            let drive = self.emulator.snapshot().axes[axis].drive.state;
            let off = matches!(
                drive,
                State::SwitchOnDisabled | State::ReadyToSwitchOn | State::Fault | State::SwitchedOn
            );
            let safe = (feedback.phase == AxisPhase::Enabled && fresh)
                || (feedback.phase != AxisPhase::Enabled && off);
            if safe || clock::now() - begin > HANG_TIMEOUT {
                break;
            }
        }
        let span = clock::now() - begin;
        if span > HANG_TIMEOUT {
            self.counts.hangs.push(format!("{}: {:?}", what.name(), self.axes[axis].last));
        }
        self.counts.safe.entry(what.name()).or_default().push(span);
        *self.counts.stayed_enabled.entry(what.name()).or_default() += usize::from(!was_disabled);
    }

    /// Waits until both axes move again.
    fn wait_for_motion(&mut self) -> bool {
        let begin = clock::now();
        while !self.axes.iter().all(|side| side.last.phase == AxisPhase::Enabled) {
            if clock::now() - begin > HANG_TIMEOUT {
                return false;
            }
            self.tick();
        }
        true
    }

    fn tick(&mut self) {
        let seen = self.emulator.snapshot();
        for (index, axis) in self.axes.iter_mut().enumerate() {
            axis.add_true_position(seen.stamp, seen.axes[index].drive.position);
            axis.check(&mut self.counts);
            axis.command();
        }
        clock::sleep(TICK);
    }
}

impl CampaignAxis {
    fn start(port: &PortConfig) -> Result<Self, Box<dyn Error>> {
        let (runner, links) = Port::open(port)?.bring_up()?.split();
        let (sender, events) = channel();
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let thread = thread::spawn(move || {
            runner.run(&stopped, |event| {
                let _ = sender.send(event);
            })
        });
        Ok(Self {
            link: links.into_iter().next().ok_or("no axis")?,
            request: AxisRequest::default(),
            events,
            is_explained: true,
            disabled: None,
            last: AxisFeedback::default(),
            truth: VecDeque::new(),
            origin: 0,
            begin: Nanos::ZERO,
            stop,
            thread: Some(thread),
        })
    }

    fn add_true_position(&mut self, stamp: Nanos, position: i32) {
        self.truth.push_back((stamp, position));
        while self.truth.front().is_some_and(|(old, _)| *old + HISTORY < stamp) {
            self.truth.pop_front();
        }
    }

    /// Reads events and feedback of the port thread and checks them.
    fn check(&mut self, counts: &mut CampaignCounts) {
        for event in self.events.try_iter() {
            self.is_explained |= !matches!(event.kind, PortEventKind::Phase { .. });
        }
        let feedback = *self.link.feedback.read();
        if feedback.sequence != self.last.sequence && !self.was_at(&feedback) {
            counts.wrong.push(format!("position {} at {:?}", feedback.position, feedback.stamp));
        }
        let (fell, now) = (
            self.last.phase == AxisPhase::Enabled && feedback.phase != AxisPhase::Enabled,
            clock::now(),
        );
        if fell && self.request.demand == Demand::Enabled {
            let AxisFeedback { phase, statusword, error_code, .. } = feedback;
            self.disabled = Some((
                now,
                format!("{phase:?}, statusword {statusword:04X}, error code {error_code:04X}"),
            ));
        }
        if self.is_explained {
            self.disabled = None;
        } else if let Some((_, how)) =
            self.disabled.take_if(|(since, _)| now - *since > CAUSE_TIMEOUT)
        {
            counts.unexplained.push(how);
        }
        self.last = feedback;
    }

    /// Whether the encoder was at this position when it could have been read.
    fn was_at(&self, feedback: &AxisFeedback) -> bool {
        let (from, to) = (feedback.stamp - LARGEST_AGE, feedback.stamp + TICK + TICK);
        let span = self
            .truth
            .iter()
            .filter(|(stamp, _)| *stamp >= from && *stamp <= to)
            .map(|(_, position)| *position);
        let (low, high) =
            span.fold((i32::MAX, i32::MIN), |(low, high), at| (low.min(at), high.max(at)));
        low > high || (low - TOLERANCE..=high + TOLERANCE).contains(&feedback.position.0)
    }

    /// Requests what an operator and the control loop would request now.
    fn command(&mut self) {
        let feedback = self.last;
        let request = &mut self.request;
        request.sequence += 1;
        match feedback.phase {
            AxisPhase::Enabled if request.demand == Demand::Enabled => {
                let time = (clock::now() - self.begin).as_seconds();
                // Around the start position, never outside the limits.
                let sine = AMPLITUDE * (std::f64::consts::TAU * HERTZ * time).sin();
                request.target = Counts((self.origin + sine as i32).clamp(-LIMIT, LIMIT));
            }
            AxisPhase::Faulted => {
                request.demand = Demand::Disabled;
                if request.fault_resets == feedback.fault_resets {
                    request.fault_resets += 1;
                }
            }
            AxisPhase::Disabled if request.demand == Demand::Enabled => {
                request.demand = Demand::Disabled
            }
            // An axis outside its limits is not enabled: homing sets a new zero.
            AxisPhase::Disabled
                if !feedback.homed || feedback.position.0.abs() > LIMIT - AMPLITUDE as i32 =>
            {
                if request.homings == feedback.homings {
                    request.homings += 1;
                }
            }
            AxisPhase::Disabled => {
                self.origin = feedback.position.0;
                self.begin = clock::now();
                request.target = feedback.position;
                request.demand = Demand::Enabled;
            }
            AxisPhase::Enabling => self.begin = clock::now(),
            _ => request.demand = Demand::Disabled,
        }
        let request = *request;
        self.link.requests.write(request);
    }

    fn end(&mut self) {
        self.stop.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            drop(thread.join());
        }
    }
}

impl CampaignCounts {
    fn add(&mut self, other: Self) {
        self.injections += other.injections;
        self.outside.extend(other.outside);
        self.preloads += other.preloads;
        self.wrong.extend(other.wrong);
        self.unexplained.extend(other.unexplained);
        self.hangs.extend(other.hangs);
        self.host_bugs += other.host_bugs;
        for (kind, spans) in other.safe {
            self.safe.entry(kind).or_default().extend(spans);
        }
        for (kind, count) in other.stayed_enabled {
            *self.stayed_enabled.entry(kind).or_default() += count;
        }
    }

    fn print(&mut self, seconds: f64) {
        println!("{} injections in {seconds:.0} s", self.injections);
        println!(
            "set-points outside the limits accepted by a drive with power: {}",
            self.outside.len()
        );
        println!(
            "targets set to the position of an axis without a zero, power off: {}",
            self.preloads
        );
        println!("wrong positions accepted: {}", self.wrong.len());
        println!("hangs: {}", self.hangs.len());
        println!("unexplained states: {}", self.unexplained.len());
        println!("protocol errors of the host: {} (a late reply looks like one)", self.host_bugs);
        for line in self
            .outside
            .iter()
            .chain(&self.wrong)
            .chain(&self.unexplained)
            .chain(&self.hangs)
            .take(20)
        {
            println!("  {line}");
        }
        println!(
            "| kind | number | stayed enabled | ms to safe: median | p90 | max |\n\
             |---|---|---|---|---|---|"
        );
        for (kind, spans) in &mut self.safe {
            spans.sort_unstable();
            let ms = |quantile: f64| {
                spans[((spans.len() - 1) as f64 * quantile) as usize].as_seconds() * 1e3
            };
            let through = self.stayed_enabled.get(kind).copied().unwrap_or(0);
            println!(
                "| {kind} | {} | {through} | {:.0} | {:.0} | {:.0} |",
                spans.len(),
                ms(0.5),
                ms(0.9),
                ms(1.0)
            );
        }
    }
}
