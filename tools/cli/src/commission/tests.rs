//! Whole commissionings in simulated time: every combination of the unknowns, on both families and
//! all lines, with healthy and wrong benches. Judged at the emulated motors, not by the output.

use std::path::{Path, PathBuf};
use std::{cell::Cell, collections::BTreeMap, rc::Rc, thread};

use i2ris::config::{AxisConfig, Config, Family, PortConfig};
use i2ris::drive::link::{DriveLink, Retry};
use i2ris::drive::{DriveError, cia402::Controlword, family_selection::family_of_port};
use i2ris::drive::{object::CONTROLWORD, transport::Transport};
use i2ris::units::{Counts, Nanos};
use i2ris_report::Failure;
use i2ris_simulation::drive::{self, DeviceFile, DriveConfig};
use i2ris_simulation::lines::{Bench, BenchLine};
use i2ris_simulation::{EmulatorConfig, Line, SnakeSource};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::page::page;
use super::record::{NOT_ASKED, Record, Topic};
use super::session::{Lines, Session};
use crate::procedure::{Gone, Person, Procedure};

const TURN: f64 = 1024.0;
const LINES: [Line; 3] = [Line::Lab, Line::UsbEach, Line::Rs232];
const FAMILIES: [Family; 2] = [Family::Epos2, Family::Epos4];

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Wrong {
    Family,
    Swapped,
    Enabled,
    Blocked,
    Reversed,
    Resolution,
    NoSignal,
    EndOfInput,
    CtrlC,
    NobodyActs,
    NoPulses,
    NotPermitted,
}

const WRONG: [Wrong; 10] = {
    use Wrong::*;
    [
        Family, Swapped, Enabled, Blocked, Reversed, Resolution, NoSignal, EndOfInput, CtrlC,
        NobodyActs,
    ]
};

#[derive(Debug, Clone, Copy)]
struct Case {
    family: Family,
    line: Line,
    /// A bit for each of the first eight unknowns.
    unknowns: u8,
    /// Gear play, counts; 0: nothing is coupled.
    play: u32,
    wrong: Option<Wrong>,
    bad: usize,
    seed: u64,
}

impl Case {
    fn is(&self, bit: u8) -> bool {
        self.unknowns >> bit & 1 == 1
    }

    fn motors(&self) -> usize {
        if self.line == Line::Lab { 3 } else { 2 }
    }

    fn emulated(&self) -> EmulatorConfig {
        let snake = SnakeSource::load("steel").unwrap();
        let mut config = EmulatorConfig::new(snake, Path::new("/nowhere"));
        config.connect(self.line);
        let family = match self.family {
            Family::Epos2 => drive::Family::Epos2,
            Family::Epos4 => drive::Family::Epos4,
        };
        if self.wrong == Some(Wrong::Swapped) {
            let [first, second] = &mut config.drives;
            std::mem::swap(&mut first.serial_number, &mut second.serial_number);
        }
        for (motor, drive) in config.drives.iter_mut().chain(&mut config.auxiliary).enumerate() {
            self.prepare(family, motor, drive);
        }
        config
    }

    fn prepare(&self, family: drive::Family, motor: usize, drive: &mut DriveConfig) {
        drive.family = family;
        drive.error_reply_words = if self.is(0) { 4 } else { 2 };
        drive.fill_unused_bytes = self.is(1);
        drive.cyclic_halt = self.is(2);
        drive.clips_setpoints = self.is(3);
        drive.interpolation_timeout = self.is(4);
        drive.forwards_segments = self.is(5);
        drive.boot_fault = self.is(6).then_some(0x8120);
        drive.silence_fault_ms = self.is(7).then_some(300);
        if self.play > 0 {
            (drive.motor.gear_play, drive.motor.output_friction_ma) = (f64::from(self.play), 4.0);
        }
        match self.wrong.filter(|_| motor == self.bad) {
            Some(Wrong::NoPulses) => {
                let objects = i2ris::drive::objects::of_family(Family::Epos2);
                let objects = objects.filter(|it| it.index != 0x2210);
                drive.device = Some(DeviceFile { family, objects: objects.cloned().collect() });
            }
            Some(Wrong::Blocked) => drive.motor.stops = [0.0, 0.0],
            Some(Wrong::Reversed) => drive.motor.reversed = true,
            Some(Wrong::Resolution) => {
                drive.motor.encoder_pulses = if self.seed.is_multiple_of(2) { 128 } else { 512 };
            }
            _ => {}
        }
    }

    fn config(&self, emulated: &EmulatorConfig) -> Config {
        let text = include_str!("../../../../config/emulator.toml");
        let mut config = Config::parse(text, Path::new("emulator.toml")).unwrap();
        let axis = |motor: usize| {
            AxisConfig::new(motor, 62_000_001 + motor as u32, [Counts(-2400), Counts(2400)])
        };
        let axes = (0..self.motors()).map(axis).collect();
        config.ports = self.line.ports(axes, |number| PathBuf::from(format!("port{number}")));
        for port in &mut config.ports {
            port.baud = emulated.line.baud;
            port.family = match (self.family, self.wrong == Some(Wrong::Family)) {
                (Family::Epos2, false) | (Family::Epos4, true) => Family::Epos2,
                _ => Family::Epos4,
            };
        }
        config
    }

    fn truth(&self, topic: Topic, motor: usize) -> Option<String> {
        let either = |bit, yes: &str, no: &str| if self.is(bit) { yes } else { no }.to_owned();
        let is_epos2 = self.family == Family::Epos2;
        Some(match topic {
            Topic::RefusedRead => either(0, "4 words", "2 words"),
            Topic::UpperBytes => either(1, "filled", "zeros"),
            Topic::Halt => either(2, "acts", "does not act"),
            Topic::SoftLimit if is_epos2 => "clipped".to_owned(),
            Topic::SoftLimit => either(3, "clipped", "fault 0x8A82"),
            Topic::Interpolation if is_epos2 => return None,
            Topic::Interpolation => either(4, "fault 0x8250", "no timeout"),
            Topic::SegmentsBehindGateway if motor == 0 || self.line != Line::Lab => return None,
            Topic::SegmentsBehindGateway => either(5, "forwarded", "refused"),
            Topic::PowerUp => either(6, "fault 0x8120", "no fault"),
            Topic::Silence => either(7, "fault 0x8130", "stays on"),
            Topic::CablePulled => either(7, "fault 0x8130", "holds with power"),
            Topic::SupplySwitched => "off, and stays off".to_owned(),
            _ => return None,
        })
    }
}

struct BenchLines(Bench);

impl Lines for BenchLines {
    type Line = BenchLine;

    fn open(&mut self, number: usize, _port: &PortConfig) -> Result<BenchLine, DriveError> {
        Ok(self.0.line(number))
    }

    fn kill_controller(&mut self) -> Result<String, Failure> {
        unreachable!("there is no process in simulated time, and it is not permitted")
    }
}

struct Operator {
    case: Case,
    bench: Bench,
    patience: Option<usize>,
    interrupted: Rc<Cell<bool>>,
    few: bool,
    further: Vec<bool>,
}

impl Operator {
    fn judge(&self) {
        let case = self.case;
        for motor in 0..case.motors() {
            let [lowest, highest] = self.bench.with_drive(motor, |drive| drive.reached());
            let went = highest.max(-lowest);
            let may = match (self.few, self.further[motor]) {
                (false, _) => 0.5,
                (true, false) => 20.5,
                (true, true) => 2.0 * TURN + 20.5,
            };
            assert!(went <= may, "motor {motor} went {went} of {may}: {case:?}");
            let is_of_others = case.wrong == Some(Wrong::Enabled) && motor == 0;
            let state = self.bench.with_drive(motor, |drive| drive.snapshot().state);
            assert!(is_of_others || !state.is_powered(), "motor {motor} {state:?}: {case:?}");
        }
    }
}

fn motor_of(text: &str) -> usize {
    let (_, number) = text.split_once("motor ").unwrap();
    number.split(|c: char| !c.is_ascii_digit()).next().unwrap().parse().unwrap()
}

impl Person for Operator {
    fn say(&mut self, text: &str) {
        if self.case.wrong == Some(Wrong::NobodyActs) {
            if text.contains("pull the cable NOW") {
                // A read, and its repetition after the two of the synchronisation.
                self.bench.with_drive(motor_of(text), |drive| drive.lose(0b1001));
            }
            return;
        }
        let act = |act: fn(&mut drive::Drive)| {
            for motor in 0..self.case.motors() {
                self.bench.with_drive(motor, act);
            }
        };
        if text.contains("pull the cable NOW") {
            act(|drive| drive.set_silent(true));
        } else if text.contains("plug it in") {
            act(|drive| drive.set_silent(false));
        } else if text.contains("supply off NOW") {
            act(drive::Drive::power_cycle);
        }
    }

    fn answer(&mut self, question: &str) -> Result<String, Gone> {
        self.judge();
        if self.interrupted.get() {
            return Err(Gone::Interrupted);
        }
        if let Some(left) = &mut self.patience {
            *left = left.checked_sub(1).ok_or(Gone::EndOfInput)?;
        }
        let typed = |word: &str| question.contains(&format!("Type {word} "));
        let Case { wrong, seed, .. } = self.case;
        let is_turned = wrong == Some(Wrong::Resolution) || seed.is_multiple_of(3);
        self.few |= question.contains("== 4 of 7: steps");
        let answer = match () {
            () if wrong == Some(Wrong::NotPermitted) => "no",
            () if typed("yes") => "yes",
            () if typed("cable") => "cable",
            () if typed("supply") => "supply",
            () if typed("turn") && is_turned => {
                self.further[motor_of(question)] = true;
                "turn"
            }
            () if question.contains("How many turns") => {
                let motor = motor_of(question);
                let [_, highest] = self.bench.with_drive(motor, |drive| drive.reached());
                return Ok(format!("{:.1}", highest / TURN));
            }
            () if question.contains("Which way") => "c",
            // No pulses beyond the first permission, and no processes.
            () => "",
        };
        Ok(answer.to_owned())
    }
}

/// Enables the first drive as a controller does, and ends.
pub fn enable<T: Transport>(line: T, port: &PortConfig) {
    let mut link = DriveLink::new(line, family_of_port(port), port);
    for word in [Controlword::FAULT_RESET, Controlword::SHUTDOWN, Controlword::ENABLE_OPERATION] {
        link.write(port.axes[0].node_id, CONTROLWORD.set(word.0), Retry::Safe).unwrap();
    }
}

fn commission(case: Case) -> (Result<(), String>, Record) {
    let emulated = case.emulated();
    let (bench, config) = (Bench::new(&emulated), case.config(&emulated));
    if case.wrong == Some(Wrong::NoSignal) {
        bench.with_drive(case.bad, |drive| drive.freeze_encoder(true));
    }
    if case.wrong == Some(Wrong::Enabled) {
        enable(bench.line(0), &config.ports[0]);
    }
    let mut random = Pcg64Mcg::seed_from_u64(case.seed);
    let looks = Cell::new(random.random_range(0..2000u32));
    let flag = Rc::new(Cell::new(false));
    let mut operator = Operator {
        case,
        bench: bench.clone(),
        patience: (case.wrong == Some(Wrong::EndOfInput)).then(|| random.random_range(0..12)),
        interrupted: Rc::clone(&flag),
        few: false,
        further: vec![false; case.motors()],
    };
    let mut until = 0;
    let mut session = Session {
        config: &config,
        lines: &mut BenchLines(bench),
        person: &mut operator,
        interrupted: Rc::new(move || {
            looks.set(looks.get().saturating_sub(1));
            flag.set(flag.get() || case.wrong == Some(Wrong::CtrlC) && looks.get() == 0);
            flag.get()
        }),
        record: Record::default(),
        ports: Vec::new(),
        device: None,
        exchanges: if case.unknowns == 0x0F && case.wrong.is_none() { 10_000 } else { 60 },
        origins: BTreeMap::new(),
        keep: &mut |_, stage, ports| {
            let stamps = ports.iter().flat_map(|port| &port.events).map(|event| event.time.0);
            let ends = stamps.clone().min().zip(stamps.max());
            assert!(ends.is_none_or(|(first, _)| first > until), "{stage}: of another: {case:?}");
            until = ends.map_or(until, |(_, last)| last);
            let most = Nanos::from_millis(60_000).0;
            let is_short = ends.is_none_or(|(first, last)| last - first < most);
            assert!(is_short || case.wrong == Some(Wrong::NobodyActs), "{stage}: {case:?}");
            Ok(())
        },
        closed: Vec::new(),
        kept: Nanos::ZERO,
    };
    let outcome = session.run().map_err(|failure| failure.to_string());
    let record = session.record;
    operator.judge();
    (outcome, record)
}

fn check_findings(case: Case, record: &Record, is_whole: bool) {
    for (topic, ..) in Topic::ALL {
        let mut found = record.findings.iter().filter(|it| it.topic == topic).peekable();
        assert!(!is_whole || found.peek().is_some(), "{topic:?} is missing: {case:?}");
        for it in found {
            let motor = it.place.strip_prefix("motor ").map_or(0, |it| it.parse().unwrap());
            let is_asked = it.value != NOT_ASKED;
            let cable = (Topic::CablePulled, Some(Wrong::NobodyActs));
            assert!(!is_asked || (topic, case.wrong) != cable, "the cable was not pulled: {it:?}");
            if is_asked && let Some(truth) = case.truth(topic, motor) {
                assert_eq!(it.value, truth, "{topic:?}, {}: {case:?}", it.evidence);
            }
            assert!(is_asked || it.evidence.starts_with("because "), "{it:?}");
            let must = is_whole && case.wrong.is_none() && case.truth(topic, motor).is_some();
            assert!(is_asked || !must, "{it:?}: {case:?}");
            if topic == Topic::Play && is_asked {
                let counts: Option<u32> =
                    it.value.strip_suffix(" counts").map(|it| it.parse().unwrap());
                let is_right = counts.unwrap_or(0).abs_diff(case.play) <= 4;
                assert!(is_right, "{} of {}: {case:?}", it.value, case.play);
            }
        }
    }
}

fn run(case: Case) {
    let (outcome, record) = commission(case);
    let output = outcome.as_ref().err().map_or("", String::as_str);
    let parts: &[&str] = match case.wrong {
        None | Some(Wrong::NobodyActs | Wrong::NoPulses | Wrong::NotPermitted) => &[],
        Some(Wrong::Family) => &["identify", "is this an EPOS", "correct `family`"],
        Some(Wrong::Swapped) => &["identify", "serial number 62000002", "swap the cables back"],
        Some(Wrong::Enabled) => &["identify", "already switched on", "another program"],
        Some(Wrong::Blocked | Wrong::NoSignal) => &["steps", "blocked", "no signal"],
        Some(Wrong::Reversed) => &["steps", "turns the other way", "0x3010:02"],
        Some(Wrong::Resolution) => &["gear", "another resolution", "1024 counts"],
        Some(Wrong::EndOfInput) => &["end of input", "drives are off"],
        // It may come after the end.
        Some(Wrong::CtrlC) if outcome.is_ok() => &[],
        Some(Wrong::CtrlC) => &["interrupted"],
    };
    assert_eq!(outcome.is_ok(), parts.is_empty(), "{output}: {case:?}");
    parts.iter().for_each(|part| assert!(output.contains(part), "{part}: {output}: {case:?}"));
    check_findings(case, &record, outcome.is_ok());
    let proposes = matches!(case.wrong, Some(Wrong::Family | Wrong::Swapped));
    assert_eq!(record.changes.is_empty(), !proposes, "{:?}: {case:?}", record.changes);
    let html = page(&record, "robot.toml").html();
    assert!(html.contains("Proposed configuration") && html.ends_with("</html>\n"), "{html}");
}

pub fn output_of(bench: &str) -> String {
    let wrong = match bench {
        "encoder has no object for its pulses" => Wrong::NoPulses,
        "encoder of another resolution" => Wrong::Resolution,
        "encoder counts the other way" => Wrong::Reversed,
        "encoder without signal" => Wrong::NoSignal,
        "motor is blocked" => Wrong::Blocked,
        "nobody pulls and switches" => Wrong::NobodyActs,
        "no permission" => Wrong::NotPermitted,
        other => panic!("{other}"),
    };
    let case = Case { play: 12, bad: 1, seed: 2, ..draw(0, 0, Some(wrong)) };
    let (outcome, record) = commission(case);
    outcome.err().unwrap_or_else(|| record.sum())
}

fn draw(number: u64, unknowns: u8, wrong: Option<Wrong>) -> Case {
    let mut random = Pcg64Mcg::seed_from_u64(number);
    let (family, line) = (FAMILIES[number as usize % 2], LINES[number as usize / 2 % 3]);
    let play = if random.random_range(0..3) == 0 { 0 } else { random.random_range(8..24) };
    let bad = random.random_range(0..2);
    Case { family, line, unknowns, play, wrong, bad, seed: random.random() }
}

/// Any three unknowns meet in every combination, on every family and line; every wrong bench once.
#[test]
fn unknowns_are_found_and_nothing_moves_further_than_it_may() {
    thread::scope(|scope| {
        for (number, word) in (0..).zip([0x0F, 0x33, 0x55, 0x69, 0x3C, 0x5A]) {
            scope.spawn(move || {
                run(draw(number, word, None));
                for wrong in WRONG.iter().skip(number as usize).step_by(6) {
                    run(draw(number + 6, !word, Some(*wrong)));
                }
            });
        }
    });
}

#[test]
#[ignore = "an hour: for .ci/nightly"]
fn every_combination_of_the_unknowns_on_healthy_and_wrong_benches() {
    // The environment may limit the number of combinations.
    let most = std::env::var("I2RIS_UNKNOWNS").map_or(256, |it| it.parse().unwrap());
    thread::scope(|scope| {
        for part in 0..2 {
            scope.spawn(move || {
                for number in (0..6 * most).skip(part).step_by(2) {
                    let unknowns = (number / 6 * 256 / most) as u8;
                    run(draw(number, unknowns, None));
                    let mut random = Pcg64Mcg::seed_from_u64(number);
                    for again in 0..10 {
                        let wrong = WRONG[random.random_range(0..WRONG.len())];
                        run(draw(number + 1536 * again, unknowns, Some(wrong)));
                    }
                }
            });
        }
    });
}
