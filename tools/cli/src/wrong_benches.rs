//! First output on a bench with one fault: the table next to this file, on the emulator.

use std::{fs, thread};

use i2ris::config::{AxisConfig, Config, Family};
use i2ris::drive::serial_transport::SerialTransport;
use i2ris::ipc::payload::{OperatingStateMsg, PeriodStatistics, ReasonMsg};
use i2ris::robot::{Cause, Reason, Stop};
use i2ris::units::{Counts, Nanos};
use i2ris_report::view::{LatestMessages, reasons};
use i2ris_simulation::{Emulator, EmulatorConfig, Line, SnakeSource, drive::DriveConfig};

use crate::doctor::Report;
use crate::doctor::drives::check_port;
use crate::{commission, preflight};

const TABLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/src/wrong_benches.md");
const AT_ONCE: usize = 4;

fn doctor(bench: &str) -> Report {
    let folder = tempfile::tempdir().unwrap();
    let snake = SnakeSource::load("steel").unwrap();
    let mut emulated = EmulatorConfig::new(snake, &folder.path().join("ports"));
    let is_each = bench == "cables are swapped";
    let line = if is_each { Line::UsbEach } else { Line::Lab };
    emulated.connect(line);
    emulated.line.strict_baud = true;
    emulated.drives[0].gateway_timeout_ms = 500;
    let drives = emulated.drives.iter_mut().chain(&mut emulated.auxiliary);
    match (bench, drives.last()) {
        ("DIP switches of the third drive say 5", Some(third)) => third.node_id = 5,
        ("two drives with node 2", Some(third)) => third.node_id = 2,
        ("a spare drive", _) => emulated.drives[1].serial_number = 99_000_001,
        ("serial number typed without 0x", _) => emulated.drives[0].serial_number = 0x6000_3005,
        ("adapter holds replies back", _) => emulated.line.latency_timer_ms = 16,
        ("cables are swapped", _) => {
            emulated.drives = emulated
                .drives
                .map(|it| DriveConfig { serial_number: 124_000_003 - it.serial_number, ..it });
        }
        _ => {}
    }
    let emulator = Emulator::start(emulated).unwrap();
    let axis = |motor| AxisConfig::new(motor, 62_000_001 + motor as u32, [-600, 600].map(Counts));
    let text = include_str!("../../../config/emulator.toml");
    let mut config = Config::parse(text, "emulator.toml".as_ref()).unwrap();
    let axes = (0..if is_each { 2 } else { 3 }).map(axis).collect();
    config.ports = line.ports(axes, |number| emulator.device(number).to_owned());
    config.ports.iter_mut().for_each(|port| port.reply_timeout_ms = 100);
    let port = &mut config.ports[0];
    let mut held = None;
    match bench {
        "third drive without power" => emulator.silence(2, true),
        "CAN plug of the second drive is out" => (1..3).for_each(|it| emulator.silence(it, true)),
        "no drive has power" => (0..3).for_each(|it| emulator.silence(it, true)),
        "line at another rate" => port.baud = 115_200,
        "family of the drives is the other one" => port.family = Family::Epos4,
        "a node number that no drive has" => port.axes[2].node_id = 7,
        "serial number is still 0" => port.axes[0].serial_number = 0,
        "serial number typed without 0x" => port.axes[0].serial_number = 60_003_005,
        "device is unplugged" => port.device = folder.path().join("usb-maxon"),
        "port is taken" => held = SerialTransport::open(port).ok(),
        "fault of over-current" => emulator.raise_fault(1, 0x2310, true),
        "a controller died and left a drive on" => {
            commission::tests::enable(SerialTransport::open(port).unwrap(), port)
        }
        _ => {}
    }
    let mut report = Report::default();
    config.ports.iter().for_each(|port| check_port(&config, port, true, &mut report));
    drop(held);
    report
}

/// Output of `i2ris status` for a stop without feedback on a computer that misses ticks.
fn status() -> [String; 2] {
    let (ticks, missed, total_ticks, total_missed) = (880, 120, 60_000, 7000);
    let rest = PeriodStatistics::default();
    let statistics = Some(PeriodStatistics { ticks, missed, total_ticks, total_missed, ..rest });
    let state = Some(OperatingStateMsg { state: 1, ..OperatingStateMsg::default() });
    let all = LatestMessages { state, statistics, ..LatestMessages::default() };
    let stop = ReasonMsg::new(&Reason::from(Cause::Stop(Stop::Feedback)), 0, Nanos::ZERO);
    let output = reasons(&all, &[stop], Nanos::ZERO);
    let output = output.into_iter().find(|it| it.code == "stop 2").unwrap();
    [output.text, output.advice]
}

fn output_of(of: &str, bench: &str) -> [String; 2] {
    let whole = |text: String| [text.clone(), text];
    match (of, bench) {
        ("status", _) => status(),
        ("commission", _) => whole(commission::tests::output_of(bench)),
        ("preflight", _) => preflight::tests::output_of(bench).first("never").unwrap_or_default(),
        ("doctor", "adapter holds replies back") => {
            doctor(bench).first("never").unwrap_or_default()
        }
        _ => doctor(bench).first("ms an exchange").unwrap_or_default(),
    }
}

fn masked(text: &str) -> String {
    let text = text.replace('|', "/").replace('\n', " ");
    let shown = |word| if str::contains(word, "/tmp/") { "DEVICE" } else { word };
    text.split_whitespace().map(shown).collect::<Vec<_>>().join(" ")
}

#[test]
fn first_cause_is_right_on_forty_wrong_benches() {
    let table = fs::read_to_string(TABLE).unwrap();
    let (head, rows) = table.split_once("|---|---|---|---|---|---|---|\n").unwrap();
    let rows: Vec<Vec<&str>> =
        rows.lines().map(|row| row.trim_matches('|').split('|').map(str::trim).collect()).collect();
    assert_eq!(rows.len(), 40);
    let output = |row: &[&str]| output_of(row[1], row[2]).map(|it| masked(&it));
    let has = |row: &[&str], output: &[String; 2], which: usize| {
        let text = output[which].to_lowercase();
        row[3 + which].to_lowercase().split(" + ").all(|part| text.contains(part))
    };
    let outputs = |some: &[Vec<&str>]| -> Vec<[String; 2]> {
        thread::scope(|scope| {
            let threads: Vec<_> = some.iter().map(|row| scope.spawn(|| output(row))).collect();
            threads.into_iter().map(|it| it.join().unwrap()).collect()
        })
    };
    let (mut right, mut new) = ([0, 0], format!("{head}|---|---|---|---|---|---|---|\n"));
    for (row, mut found) in rows.iter().zip(rows.chunks(AT_ONCE).flat_map(outputs)) {
        // Alone once more: with others at the same time a reply may come too late.
        if ![0, 1].iter().all(|which| has(row, &found, *which)) {
            found = output(row);
        }
        for which in [0, 1] {
            right[which] += usize::from(has(row, &found, which));
            if !has(row, &found, which) {
                println!("{}: not `{}`: {found:?}", row[2], row[3 + which]);
            }
        }
        let now = if found[0] == found[1] { found[0].clone() } else { found.join(" -> ") };
        new += &format!("| {} | {now} |\n", row[..6].join(" | "));
    }
    if std::env::var_os("I2RIS_UPDATE").is_some() {
        fs::write(TABLE, new).unwrap();
    }
    assert!(right[0] >= 38 && right[1] == 40, "{right:?} of 40");
}
