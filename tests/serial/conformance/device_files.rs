//! Drives with the objects of real ones, whose files are not part of the repository, and drives
//! that lack objects or accept smaller ranges.

use i2ris::config;
use i2ris::drive::objects::{self, Entry};
use i2ris_needs::needs;
use i2ris_simulation::drive::{DeviceFile, Family};

use super::cases;
use super::*;

const CASES: [fn(&TestBench); 5] =
    [cases::identified, cases::enabled, cases::followed, cases::homed, cases::quick_stopped];

/// The files of real drives.
fn files() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/drive_objects");
    let paths = fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path());
    paths.filter(|path| path.extension().is_some_and(|end| end == "csv")).collect()
}

/// A drive with these objects on a port of its own.
fn bench(file: &DeviceFile) -> TestBench {
    bench_behind(file, 0)
}

/// The last of drives with these objects on one port.
fn bench_behind(file: &DeviceFile, drives_before: usize) -> TestBench {
    let setup = if file.family == Family::Epos4 { SETUPS[0] } else { SETUPS[3] };
    TestBench::with(&Setup { drives_before, ..setup }, |config| {
        for drive in config.drives.iter_mut().chain(&mut config.auxiliary) {
            drive.device = Some(file.clone());
        }
    })
}

/// An EPOS4 of firmware 0x0110 with all known objects, changed.
fn changed(change: impl FnOnce(&mut Vec<Entry>)) -> DeviceFile {
    let mut objects: Vec<Entry> = objects::of_family(config::Family::Epos4).copied().collect();
    entry(&mut objects, 0x1018, 3).default = 0x0110_0000;
    change(&mut objects);
    DeviceFile { family: Family::Epos4, objects: objects.into() }
}

fn entry(objects: &mut [Entry], index: u16, subindex: u8) -> &mut Entry {
    objects.iter_mut().find(|it| (it.index, it.subindex) == (index, subindex)).unwrap()
}

fn without(indices: &[u16]) -> DeviceFile {
    changed(|objects| objects.retain(|entry| !indices.contains(&entry.index)))
}

fn with_range(index: u16, subindex: u8, low: i64, high: i64) -> DeviceFile {
    changed(|objects| {
        let entry = entry(objects, index, subindex);
        (entry.range, entry.default) = (Some((low, high)), entry.default.clamp(low, high));
    })
}

#[needs("file: ../shared/data/drive_objects")]
#[test]
fn object_table_agrees_with_every_real_drive() {
    for path in files() {
        let name = path.file_name().unwrap().to_string_lossy();
        // Without the values that were set: defaults count.
        let text = fs::read_to_string(&path).unwrap();
        let (head, rows) = text.split_once('\n').unwrap();
        let rows = rows.lines().map(|row| format!("\n{},", row.rsplit_once(',').unwrap().0));
        let file =
            DeviceFile::parse(&format!("{head}{}", rows.collect::<String>()), &name).unwrap();
        let is_epos4 = file.family == Family::Epos4;
        let family = if is_epos4 { config::Family::Epos4 } else { config::Family::Epos2 };
        let firmware = u16::from_str_radix(&name[name.len() - 8..name.len() - 4], 16).unwrap();
        let mut compared = 0;
        for known in objects::of_family(family) {
            let of = |it: &&Entry| (it.index, it.subindex) == (known.index, known.subindex);
            let Some(found) = file.objects.iter().find(of) else {
                assert!(known.since > firmware, "{name} lacks {known:?}");
                continue;
            };
            assert_eq!((known.kind, known.access), (found.kind, found.access), "{name} {known:?}");
            if known.varies {
                let (low, high) = known.range.unwrap_or((i64::MIN, i64::MAX));
                let is_within = found.range.is_none_or(|(min, max)| low <= min && max <= high);
                assert!(is_within, "{name} {found:?}");
            } else {
                let (ranges, defaults) =
                    ([known.range, found.range], [known.default, found.default]);
                assert!(ranges[0] == ranges[1] && defaults[0] == defaults[1], "{name} {found:?}");
            }
            compared += 1;
        }
        assert!(compared >= 90, "{name}: {compared}");
    }
}

#[needs("file: ../shared/data/drive_objects")]
#[test]
fn the_controller_runs_on_every_real_drive() {
    for path in files() {
        let file = DeviceFile::load(&path).unwrap();
        // Alone, and as the third of the laboratory's line.
        for case in CASES {
            for drives_before in [0, 2] {
                println!("{} {drives_before}", path.display());
                case(&bench_behind(&file, drives_before));
            }
        }
    }
}

#[test]
fn controller_runs_without_objects_missing_in_old_firmware() {
    let convenience = [
        0x2005, 0x2006, 0x2200, 0x30B0, 0x30B2, 0x30D1, 0x603F, 0x605A, 0x605C, 0x605E, 0x607F,
        0x60C2,
    ];
    let file = without(&convenience);
    CASES.iter().for_each(|case| case(&bench(&file)));
    let bench = bench(&file);
    let texts: Vec<String> = bench.run().kinds().iter().map(PortEventKind::to_string).collect();
    for part in ["0x60C2:01): left out", "0x30D1:02): left out, so `limits.over_current_ma` has no"]
    {
        assert!(texts.iter().any(|text| text.contains(part)), "{part}: {texts:?}");
    }
    let seen = i2ris::drive::inspect::inspect(&bench.port()).unwrap();
    assert_eq!(seen.axes[0].as_ref().unwrap().supply_v, None);
    // A fault without a reported code is still a fault and can be reset.
    let mut axis = bench.run();
    bench.emulator().raise_fault(0, 0x2310, false);
    axis.until_phase(AxisPhase::Faulted);
    axis.request(|request| request.fault_resets = 1);
    axis.until_phase(AxisPhase::Disabled);
}

#[test]
fn rejected_setting_is_reported_with_key_object_and_range() {
    type Change = fn(&mut AxisConfig);
    let none: Change = |_| {};
    let stop: Change = |axis| {
        axis.homing = HomingMethod::StopNegative;
        axis.homing_current_ma = 30;
    };
    for (file, change, parts) in [
        (
            with_range(0x3001, 2, 0, 200),
            none,
            &["`current_limit_ma = 300`: this drive (EPOS4 50/5, firmware 0x0110) takes at most \
               200 in output current limit (0x3001:02)"][..],
        ),
        (with_range(0x6080, 0, 1, 777), none, &["`motor_speed_rpm = ", "at most 777", "0x6080:00"]),
        (
            with_range(0x6065, 0, 5000, 9000),
            none,
            &["`following_error_counts = ", "at least 5000", "0x6065:00"],
        ),
        (without(&[0x6065]), none, &["`following_error_counts = ", "has no", "0x6065:00"]),
        (without(&[0x6085]), none, &["quick-stop deceleration", "has no", "another firmware"]),
        (without(&[0x30B2]), stop, &["`homing_current_ma = 30`", "0x30B2:00", "0x0150 has it"]),
        (with_range(0x30B2, 0, 0, 20), stop, &["`homing_current_ma = 30`", "at most 20"]),
        (without(&[0x6081]), |axis| axis.streaming = Streaming::Profile, &["0x6081:00", "has no"]),
    ] {
        let bench = bench(&file);
        let port = bench.port_with(change);
        // The drive is left unchanged: the second run reports the same.
        for _ in 0..2 {
            let text = Port::open(&port).unwrap().bring_up().unwrap_err().to_string();
            assert!(parts.iter().all(|part| text.contains(part)), "{text}");
            assert!(text.len() < 300 && !text.contains('\n'), "{text}");
        }
        bench.assert_no_host_bugs();
    }
}
