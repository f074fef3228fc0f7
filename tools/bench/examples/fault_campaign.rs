//! The fault campaign: seeded injections of every kind at random moments while two motors move, and
//! what became of them.
//!
//! ```text
//! cargo run --release -p i2ris-bench --example fault_campaign [INJECTIONS] [SEED] [RIGS]
//! ```
//!
//! Every rig is two emulated drives on two ports and the drive layer with its port threads.
//! Something like the control loop sends set-points of a slow sine, acknowledges faults, homes and
//! enables again. Counted are set-points that a drive accepted outside its limits, positions that
//! were believed and were none, states without an event that explains them, and hangs.
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

/// Amplitude of the motion, counts, and its frequency.
const AMPLITUDE: f64 = 300.0;
const HERTZ: f64 = 0.5;

const TICK: Nanos = Nanos::from_millis(2);

/// An axis that has not come back to motion after this long hangs.
const HANG: Nanos = Nanos::from_millis(30_000);

/// Why an axis fell is known once the drive has been asked for it.
const EXPLANATION: Nanos = Nanos::from_millis(500);

/// How far back the truth about positions is kept.
const MEMORY: Nanos = Nanos::from_millis(4000);

/// A position may be as old as the exchange that brought it: a reply time-out and its retry, at
/// most.
const OLDEST: Nanos = Nanos::from_millis(1500);

/// What the plant moves between two samples of the truth, counts.
const TOLERANCE: i32 = 12;

/// What is counted.
#[derive(Debug, Default)]
struct Tally {
    injections: usize,
    outside: Vec<String>,
    /// Of those, the ones that a drive without power was given.
    preloads: usize,
    wrong: Vec<String>,
    unexplained: Vec<String>,
    hangs: Vec<String>,
    host_bugs: u64,
    /// By kind: the time until the axis is known to be safe, and how often it moved on without
    /// leaving enabled.
    safe: BTreeMap<&'static str, Vec<Nanos>>,
    rode_through: BTreeMap<&'static str, usize>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let mut number = |default: u64| {
        arguments
            .next()
            .map_or(Ok(default), |text| text.parse::<u64>())
    };
    let (injections, seed, rigs) = (number(2000)?, number(1)?, number(4)?.max(1));
    let begin = clock::now();
    let threads: Vec<_> = (0..rigs)
        .map(|rig| {
            let share = injections / rigs + u64::from(rig < injections % rigs);
            thread::spawn(move || {
                Rig::start(seed * 1000 + rig)
                    .map(|rig| rig.run(share as usize))
                    .map_err(|e| e.to_string())
            })
        })
        .collect();
    let mut total = Tally::default();
    for thread in threads {
        total.add(thread.join().map_err(|_| "a rig panicked")??);
    }
    total.print((clock::now() - begin).as_seconds());
    let clean = total.outside.is_empty()
        && total.wrong.is_empty()
        && total.unexplained.is_empty()
        && total.hangs.is_empty();
    if clean {
        Ok(())
    } else {
        Err("see above".into())
    }
}

/// Splitmix64, by Vigna.
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

    /// Any kind, the ones that end in a reset or a fault more rarely: they cost seconds each.
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
            23..=26 => Injection::LateReply {
                delay_ms: self.between(1, 300),
            },
            27 | 28 => Injection::WrongLength,
            29 | 30 => Injection::StrayReply,
            31 => Injection::HangUp {
                for_ms: self.between(50, 400),
            },
            32 => Injection::Mute {
                for_ms: self.between(20, 600),
            },
            33 => Injection::Reset,
            34 => Injection::Fault {
                code: [0x2310, 0x3210, 0x3220, 0x8611, 0x4210][self.between(0, 5) as usize],
            },
            35 => Injection::FreezeEncoder {
                for_ms: self.between(50, 500),
            },
            36 => Injection::SlipEncoder {
                counts: self.between(0, 600) as i32 - 300,
            },
            37 => Injection::SlackWire {
                counts: self.between(20, 200) as u32,
            },
            38 => Injection::BreakWire,
            _ => Injection::MendWire,
        }
    }
}

/// One axis as its stand-in of the control loop sees it.
struct Side {
    link: AxisLink,
    request: AxisRequest,
    events: Receiver<PortEvent>,
    explained: bool,
    /// When the axis fell without a reason so far, and how.
    fell: Option<(Nanos, String)>,
    last: AxisFeedback,
    /// Position of the encoder as the drive would tell it, over time.
    truth: VecDeque<(Nanos, i32)>,
    /// Where the sine is around, and its start.
    origin: i32,
    begin: Nanos,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

struct Rig {
    emulator: Emulator,
    sides: Vec<Side>,
    random: Random,
    tally: Tally,
    _folder: tempfile::TempDir,
}

impl Rig {
    fn start(seed: u64) -> Result<Self, Box<dyn Error>> {
        let folder = tempfile::tempdir()?;
        let snake = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/snakes/steel.toml");
        let mut config =
            EmulatorConfig::new(SnakeConfig::load(&snake)?, &folder.path().join("ports"));
        config.seed = seed;
        let serial_numbers = config.drives.clone().map(|drive| drive.serial_number);
        let emulator = Emulator::start(config)?;
        let mut sides = Vec::new();
        for (motor, serial_number) in serial_numbers.into_iter().enumerate() {
            let axis = AxisConfig::new(motor, serial_number, [Counts(-LIMIT), Counts(LIMIT)]);
            let port = PortConfig {
                reply_timeout_ms: 60,
                ..PortConfig::new(emulator.device(motor).to_owned(), vec![axis])
            };
            sides.push(Side::start(&port)?);
        }
        Ok(Self {
            emulator,
            sides,
            random: Random(seed),
            tally: Tally::default(),
            _folder: folder,
        })
    }

    fn run(mut self, injections: usize) -> Tally {
        for count in 0..injections {
            let (axis, what) = (self.random.between(0, 2) as usize, self.random.injection());
            if !self.wait_for_motion() {
                self.tally
                    .hangs
                    .push(format!("before injection {count} ({})", what.name()));
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
        let outside = |kind| matches!(kind, EventKind::Setpoint(counts) if !(-LIMIT..=LIMIT).contains(&counts));
        for (place, event) in log
            .iter()
            .enumerate()
            .filter(|(_, event)| outside(event.kind))
        {
            let before = || {
                log[..place]
                    .iter()
                    .rev()
                    .filter(|earlier| earlier.axis == event.axis)
                    .map(|earlier| earlier.kind)
            };
            let state = before().find_map(|kind| {
                if let EventKind::State { to, .. } = kind {
                    Some(to)
                } else {
                    None
                }
            });
            // An axis that lost its zero stands anywhere. Before it is homed, its target is put to
            // where it stands.
            if state.is_some_and(|state| state != State::OperationEnabled) {
                self.tally.preloads += 1;
            } else {
                self.tally.outside.push(format!(
                    "{:?} after, the latest first, {:?}",
                    event.kind,
                    before().take(6).collect::<Vec<_>>()
                ));
            }
        }
        self.tally.host_bugs = self.emulator.host_bugs();
        self.sides.iter_mut().for_each(Side::end);
        self.tally
    }

    /// Injects, and waits until the axis is known to be safe.
    fn inject(&mut self, axis: usize, what: Injection) {
        self.sides[axis].explained = false;
        let begin = clock::now();
        self.emulator.inject(axis, what);
        self.tally.injections += 1;
        let mut left = false;
        loop {
            self.tick();
            let feedback = self.sides[axis].last;
            left |= feedback.phase != AxisPhase::Enabled;
            // Followed and watched; or off; or powered and holding still, and known to be so.
            let fresh = feedback.stamp > begin + Nanos::from_millis(10);
            let drive = self.emulator.snapshot().axes[axis].drive.state;
            let off = matches!(
                drive,
                State::SwitchOnDisabled | State::ReadyToSwitchOn | State::Fault | State::SwitchedOn
            );
            let safe = (feedback.phase == AxisPhase::Enabled && fresh)
                || (feedback.phase != AxisPhase::Enabled && off);
            if safe || clock::now() - begin > HANG {
                break;
            }
        }
        let span = clock::now() - begin;
        if span > HANG {
            self.tally
                .hangs
                .push(format!("{}: {:?}", what.name(), self.sides[axis].last));
        }
        self.tally.safe.entry(what.name()).or_default().push(span);
        *self.tally.rode_through.entry(what.name()).or_default() += usize::from(!left);
    }

    /// Lets both axes move again.
    fn wait_for_motion(&mut self) -> bool {
        let begin = clock::now();
        while !self
            .sides
            .iter()
            .all(|side| side.last.phase == AxisPhase::Enabled)
        {
            if clock::now() - begin > HANG {
                return false;
            }
            self.tick();
        }
        true
    }

    fn tick(&mut self) {
        let seen = self.emulator.snapshot();
        for (axis, side) in self.sides.iter_mut().enumerate() {
            side.remember(seen.stamp, seen.axes[axis].drive.position);
            side.listen(&mut self.tally);
            side.command();
        }
        clock::sleep(TICK);
    }
}

impl Side {
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
            explained: true,
            fell: None,
            last: AxisFeedback::default(),
            truth: VecDeque::new(),
            origin: 0,
            begin: Nanos::ZERO,
            stop,
            thread: Some(thread),
        })
    }

    fn remember(&mut self, stamp: Nanos, position: i32) {
        self.truth.push_back((stamp, position));
        while self
            .truth
            .front()
            .is_some_and(|(old, _)| *old + MEMORY < stamp)
        {
            self.truth.pop_front();
        }
    }

    /// Takes what the port thread tells, and judges it.
    fn listen(&mut self, tally: &mut Tally) {
        for event in self.events.try_iter() {
            self.explained |= !matches!(event.kind, PortEventKind::Phase { .. });
        }
        let feedback = *self.link.feedback.read();
        if feedback.sequence != self.last.sequence && !self.is_true(&feedback) {
            tally.wrong.push(format!(
                "position {} at {:?}",
                feedback.position, feedback.stamp
            ));
        }
        let (fell, now) = (
            self.last.phase == AxisPhase::Enabled && feedback.phase != AxisPhase::Enabled,
            clock::now(),
        );
        if fell && self.request.demand == Demand::Enabled {
            let AxisFeedback {
                phase,
                statusword,
                error_code,
                ..
            } = feedback;
            self.fell = Some((
                now,
                format!("{phase:?}, statusword {statusword:04X}, error code {error_code:04X}"),
            ));
        }
        if self.explained {
            self.fell = None;
        } else if let Some((_, how)) = self.fell.take_if(|(since, _)| now - *since > EXPLANATION) {
            tally.unexplained.push(how);
        }
        self.last = feedback;
    }

    /// Whether the encoder was at a position while it may have been asked for it.
    fn is_true(&self, feedback: &AxisFeedback) -> bool {
        let (from, to) = (feedback.stamp - OLDEST, feedback.stamp + TICK + TICK);
        let span = self
            .truth
            .iter()
            .filter(|(stamp, _)| *stamp >= from && *stamp <= to)
            .map(|(_, position)| *position);
        let (low, high) = span.fold((i32::MAX, i32::MIN), |(low, high), at| {
            (low.min(at), high.max(at))
        });
        low > high || (low - TOLERANCE..=high + TOLERANCE).contains(&feedback.position.0)
    }

    /// What an operator and the loop would ask for now.
    fn command(&mut self) {
        let feedback = self.last;
        let request = &mut self.request;
        request.sequence += 1;
        match feedback.phase {
            AxisPhase::Enabled if request.demand == Demand::Enabled => {
                let time = (clock::now() - self.begin).as_seconds();
                // From where it stands, and never outside the limits.
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
            // Where its encoder slips to is as good a zero as any; an axis outside its limits is
            // not enabled.
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

impl Tally {
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
        for (kind, count) in other.rode_through {
            *self.rode_through.entry(kind).or_default() += count;
        }
    }

    fn print(&mut self, seconds: f64) {
        println!("{} injections in {seconds:.0} s", self.injections);
        println!(
            "set-points accepted outside the limits by a drive with power: {}",
            self.outside.len()
        );
        println!(
            "targets put to where an axis without a zero stood, power off: {}",
            self.preloads
        );
        println!("wrong values believed: {}", self.wrong.len());
        println!("hangs: {}", self.hangs.len());
        println!("unexplained states: {}", self.unexplained.len());
        println!(
            "rules broken by the host: {} (a reply that comes late looks like it)",
            self.host_bugs
        );
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
            "| kind | number | rode through | ms to safe: median | p90 | max |\n|---|---|---|---|---|---|"
        );
        for (kind, spans) in &mut self.safe {
            spans.sort_unstable();
            let ms = |quantile: f64| {
                spans[((spans.len() - 1) as f64 * quantile) as usize].as_seconds() * 1e3
            };
            let through = self.rode_through.get(kind).copied().unwrap_or(0);
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
