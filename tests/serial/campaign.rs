//! The fault campaign: seeded faults of every kind at random instants while two motors move.
//!
//! Every rig has two emulated drives on two ports and the drive layer with its port threads. A
//! simple control loop sends setpoints of a slow sine, acknowledges faults, homes and enables
//! again. `I2RIS_FAULTS` and `I2RIS_FAULT_SEED` set number and seed.

use std::collections::{BTreeMap, VecDeque};
use std::f64::consts::TAU;

use super::conformance::RunningAxis;
use super::*;

const RIGS: u64 = 4;

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
/// Length of the true-position history.
const HISTORY: Nanos = Nanos::from_millis(4000);
/// The largest age of a position: a reply timeout and its retry.
const LARGEST_AGE: Nanos = Nanos::from_millis(1500);
/// Motion between two samples of the true position, counts.
const TOLERANCE: i32 = 12;

/// No setpoint outside the limits reaches a drive with power, no wrong position is accepted, no
/// axis is disabled without an event that gives the reason, and every axis moves again.
#[test]
#[ignore = "2000 faults take half an hour"]
fn random_faults_of_every_kind_leave_axes_safe() {
    let number = |name: &str, default: u64| {
        std::env::var(name).map_or(default, |text| text.parse().unwrap())
    };
    let (faults, seed) = (number("I2RIS_FAULTS", 2000), number("I2RIS_FAULT_SEED", 1));
    let rigs: Vec<_> = (0..RIGS)
        .map(|rig| {
            let share = faults / RIGS + u64::from(rig < faults % RIGS);
            thread::spawn(move || CampaignRig::start(seed * 1000 + rig).run(share))
        })
        .collect();
    let mut total = Findings::default();
    for rig in rigs {
        let Findings { wrong, preloads, kinds } = rig.join().unwrap();
        total.wrong.extend(wrong);
        total.preloads += preloads;
        for (kind, spans) in kinds {
            total.kinds.entry(kind).or_default().extend(spans);
        }
    }
    println!("targets set to the position of an axis without a zero, off: {}", total.preloads);
    println!(
        "| kind | number | stayed enabled | ms to safe: median | max |\n|---|---|---|---|---|"
    );
    for (kind, spans) in &mut total.kinds {
        spans.sort_unstable();
        let ms = |index: usize| spans[index].0.as_seconds() * 1e3;
        let (number, stayed) = (spans.len(), spans.iter().filter(|(_, stayed)| *stayed).count());
        println!(
            "| {kind} | {number} | {stayed} | {:.0} | {:.0} |",
            ms(number / 2),
            ms(number - 1)
        );
    }
    assert!(total.wrong.is_empty(), "{:#?}", total.wrong);
    assert_eq!(total.kinds.values().map(Vec::len).sum::<usize>() as u64, faults);
}

#[derive(Debug, Default)]
struct Findings {
    /// Violations.
    wrong: Vec<String>,
    /// Setpoints outside the limits for a drive without power, which are allowed.
    preloads: usize,
    /// By kind: time until the axis was confirmed safe, with a flag whether it stayed enabled.
    kinds: BTreeMap<&'static str, Vec<(Nanos, bool)>>,
}

/// How often each of [`Injection::all`] comes: those that end in a reset or a fault cost seconds.
const WEIGHTS: [usize; 23] = [2, 2, 2, 2, 2, 2, 2, 3, 2, 2, 2, 4, 2, 2, 1, 1, 1, 1, 1, 1, 1, 1, 1];

fn injection(random: &mut Random) -> Injection {
    let all = Injection::all_of(random.below(u64::MAX));
    let kinds = all.into_iter().zip(WEIGHTS);
    let mut kinds = kinds.flat_map(|(kind, weight)| std::iter::repeat_n(kind, weight));
    let drawn = random.below(WEIGHTS.iter().sum::<usize>() as u64);
    kinds.nth(drawn as usize).unwrap()
}

struct CampaignRig {
    axes: Vec<CampaignAxis>,
    emulator: Emulator,
    random: Random,
    found: Findings,
    _folder: tempfile::TempDir,
}

impl CampaignRig {
    fn start(seed: u64) -> Self {
        let (folder, mut config) = emulation();
        config.seed = seed;
        // Each axis has a line of its own to lose.
        config.connect(Line::UsbEach);
        let serial_numbers = config.drives.clone().map(|drive| drive.serial_number);
        let emulator = Emulator::start(config).unwrap();
        let limits = [Counts(-LIMIT), Counts(LIMIT)];
        let axes = serial_numbers.into_iter().enumerate();
        let axes = axes.map(|(motor, number)| fast_axis(motor, number, limits)).collect();
        let ports = Line::UsbEach.ports(axes, |motor| emulator.device(motor).to_owned());
        let start = |port| CampaignAxis::start(&PortConfig { reply_timeout_ms: 60, ..port });
        let axes = ports.into_iter().map(start).collect();
        let (random, found) = (Random::new(seed), Findings::default());
        Self { axes, emulator, random, found, _folder: folder }
    }

    fn run(mut self, faults: u64) -> Findings {
        for _ in 0..faults {
            let (axis, what) = (self.random.between(0, 2) as usize, injection(&mut self.random));
            if !self.wait_for_motion() {
                self.found.wrong.push(format!("hangs before {}", what.name()));
                break;
            }
            let moment = clock::now() + Nanos::from_millis(self.random.between(20, 200));
            while clock::now() < moment {
                self.tick();
            }
            self.inject(axis, what);
        }
        self.wait_for_motion();
        self.check_set_points();
        self.found
    }

    /// An axis without a zero can be anywhere. Before homing, its target is set to its position.
    fn check_set_points(&mut self) {
        let log = self.emulator.log();
        for (place, event) in log.iter().enumerate() {
            let EventKind::Setpoint(counts) = event.kind else { continue };
            if (-LIMIT..=LIMIT).contains(&counts) {
                continue;
            }
            let earlier = log[..place].iter().rev().filter(|earlier| earlier.axis == event.axis);
            let mut before = earlier.map(|earlier| earlier.kind);
            let state = before.clone().find_map(|kind| match kind {
                EventKind::State { to, .. } => Some(to),
                _ => None,
            });
            if state.is_some_and(|state| state != State::OperationEnabled) {
                self.found.preloads += 1;
            } else {
                let before: Vec<_> = before.by_ref().take(6).collect();
                self.found.wrong.push(format!("{:?} after, latest first, {before:?}", event.kind));
            }
        }
    }

    /// Injects a fault and waits until the axis is known to be safe.
    fn inject(&mut self, axis: usize, what: Injection) {
        self.axes[axis].is_explained = false;
        let begin = clock::now();
        self.emulator.inject(axis, what);
        let mut stayed_enabled = true;
        let is_safe = loop {
            self.tick();
            let feedback = self.axes[axis].last;
            let is_enabled = feedback.phase == AxisPhase::Enabled;
            stayed_enabled &= is_enabled;
            // Safe: enabled with fresh feedback, or without power.
            let is_fresh = feedback.stamp > begin + Nanos::from_millis(10);
            let drive = self.emulator.snapshot().axes[axis].drive.state;
            let is_safe = if is_enabled { is_fresh } else { !drive.is_powered() };
            if is_safe || clock::now() - begin > HANG_TIMEOUT {
                break is_safe;
            }
        };
        if !is_safe {
            self.found.wrong.push(format!("{} hangs: {:?}", what.name(), self.axes[axis].last));
        }
        let span = clock::now() - begin;
        self.found.kinds.entry(what.name()).or_default().push((span, stayed_enabled));
    }

    /// Waits until both axes move again.
    fn wait_for_motion(&mut self) -> bool {
        let begin = clock::now();
        while !self.axes.iter().all(|axis| axis.last.phase == AxisPhase::Enabled) {
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
            axis.truth.push_back((seen.stamp, seen.axes[index].drive.position));
            while axis.truth.front().is_some_and(|(old, _)| *old + HISTORY < seen.stamp) {
                axis.truth.pop_front();
            }
            axis.check(&mut self.found.wrong);
            axis.command();
        }
        clock::sleep(TICK);
    }
}

/// One axis with its simple control loop.
struct CampaignAxis {
    axis: RunningAxis,
    is_explained: bool,
    /// When the axis was disabled without a known cause, and its status.
    disabled: Option<(Nanos, String)>,
    last: AxisFeedback,
    /// True position of the encoder over time.
    truth: VecDeque<(Nanos, i32)>,
    /// Center and start of the sine.
    origin: i32,
    begin: Nanos,
}

impl CampaignAxis {
    fn start(port: &PortConfig) -> Self {
        let motor = port.axes[0].motor;
        let port = Port::open(port).unwrap().bring_up().unwrap();
        Self {
            axis: RunningAxis::start(port, motor),
            is_explained: true,
            disabled: None,
            last: AxisFeedback::default(),
            truth: VecDeque::new(),
            origin: 0,
            begin: Nanos::ZERO,
        }
    }

    /// Reads events and feedback of the port thread and checks them.
    fn check(&mut self, wrong: &mut Vec<String>) {
        for kind in self.axis.kinds() {
            self.is_explained |= !matches!(kind, PortEventKind::Phase { .. });
        }
        let feedback = self.axis.feedback();
        let AxisFeedback { sequence, position, stamp, phase, statusword, error_code, .. } =
            feedback;
        if sequence != self.last.sequence && !self.was_at(&feedback) {
            wrong.push(format!("wrong position {position} at {stamp:?}"));
        }
        let fell = self.last.phase == AxisPhase::Enabled && phase != AxisPhase::Enabled;
        let now = clock::now();
        if fell && self.axis.request.demand == Demand::Enabled {
            let status = format!("statusword {statusword:04X}, error code {error_code:04X}");
            self.disabled = Some((now, format!("unexplained {phase:?}, {status}")));
        }
        if self.is_explained {
            self.disabled = None;
        }
        let overdue = self.disabled.take_if(|(since, _)| now - *since > CAUSE_TIMEOUT);
        wrong.extend(overdue.map(|(_, how)| how));
        self.last = feedback;
    }

    /// Whether the encoder was at this position when it could have been read.
    fn was_at(&self, feedback: &AxisFeedback) -> bool {
        let (from, to) = (feedback.stamp - LARGEST_AGE, feedback.stamp + TICK + TICK);
        let then = self.truth.iter().filter(|(stamp, _)| *stamp >= from && *stamp <= to);
        let at = || then.clone().map(|(_, position)| *position);
        let (Some(low), Some(high)) = (at().min(), at().max()) else { return true };
        (low - TOLERANCE..=high + TOLERANCE).contains(&feedback.position.0)
    }

    /// Requests what an operator and the control loop would request now.
    fn command(&mut self) {
        let (feedback, mut request) = (self.last, self.axis.request);
        let is_outside = feedback.position.0.abs() > LIMIT - AMPLITUDE as i32;
        match feedback.phase {
            AxisPhase::Enabled if request.demand == Demand::Enabled => {
                let time = (clock::now() - self.begin).as_seconds();
                // Around the start position, never outside the limits.
                let sine = AMPLITUDE * (TAU * HERTZ * time).sin();
                request.target = Counts((self.origin + sine as i32).clamp(-LIMIT, LIMIT));
            }
            AxisPhase::Faulted => {
                request.demand = Demand::Disabled;
                if request.fault_resets == feedback.fault_resets {
                    request.fault_resets += 1;
                }
            }
            AxisPhase::Disabled if request.demand == Demand::Enabled => {
                request.demand = Demand::Disabled;
            }
            // An axis outside its limits is not enabled: homing sets a new zero.
            AxisPhase::Disabled if !feedback.homed || is_outside => {
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
        self.axis.request(|it| *it = request);
    }
}
