//! Small inputs that failed, after public reports and external recordings: each case is a row of a
//! printed table with the expected and the actual result.

use std::fmt::Write as _;
use std::fs::read_to_string;

use i2ris::model::Model;

use crate::bench::{WorkFolder, repository};

const HEADER: &str = "t_s,q0_counts,q1_counts,pitch_deg,yaw_deg";

/// Commands on the file of a case. There are a model, `m.json`, and the rows as they should be.
const COMMANDS: [(&str, &str); 8] = [
    ("fit", "calibrate fit x.csv --family linear --overwrite --output m.json"),
    ("compare", "calibrate compare m.json --recording x.csv"),
    ("merge", "calibrate merge x.csv angles.csv --overwrite --output o.csv"),
    ("merge-into", "calibrate merge right.csv x.csv --overwrite --output o.csv"),
    ("predict", "model predict m.json x.csv --output p.csv"),
    ("history", "model predict m.json right.csv --history x.csv --output p.csv"),
    ("invert", "model invert m.json x.csv --no-limits --output c.csv"),
    ("file", "command file x.csv --domain nobody-serves-this"),
];

/// Cases that are not tables of numbers: name, file and test.
const ELSEWHERE: [&str; 11] = [
    "choice-with-unseen-input | tools/calibration/tests/choice.rs | \
     an_unrecorded_input_does_not_hide_memory",
    "mjpeg-bytes-between | tools/vision/src/source/mjpeg.rs | \
     padding_is_skipped_and_a_damaged_picture_is_one_gap",
    "video-interlaced | tools/vision/src/source/stream.rs | \
     interlaced_pictures_are_refused_with_a_remedy",
    "mcap-one-damaged-chunk | tools/record/tests/record/files.rs | \
     a_damaged_place_costs_one_chunk_and_is_counted",
    "shm-gone-while-it-runs | tests/process/ipc_processes.rs | \
     removed_ipc_files_are_reported_by_controller_and_clients",
    "shm-too-small | tests/process/start_refusals.rs | \
     too_small_shared_memory_is_refused_with_required_size",
    "played-first-frame | tools/teleop/src/device.rs | frame_that_arrives_with_the_head_is_read",
    "rt-cgroup-without-budget | src/realtime/scheduling.rs | \
     control_group_is_named_to_a_process_with_the_right",
    "serial-hex-typed-as-decimal | tests/drive/bring_up.rs | \
     wrong_drive_is_refused_with_both_serial_numbers",
    "drive-answers-otherwise | tests/serial/conformance/bad_input.rs | \
     reply_from_non_drive_is_shown_not_reported_as_silence",
    "drive-answers-otherwise, another family | tests/serial/conformance/bad_input.rs | \
     a_drive_of_the_other_family_is_named",
];

#[derive(Default)]
struct Table {
    printed: String,
    wrong: usize,
}

impl Table {
    /// Runs the lines of a script: `+ COMMAND | expected text | ...`. The mark `+` means success,
    /// `=` success with a model like that of the correct rows, `!` a refusal, and `3` a missing
    /// controller after the file was read.
    fn case(&mut self, name: &str, text: &str, script: &str) {
        let folder = WorkFolder::with("x.csv", text);
        folder.write("right.csv", &written(&rows(), ","));
        folder.write("angles.csv", &angles(0.05, 0.05));
        folder.run("calibrate fit right.csv --family linear --output m.json");
        let gain = || {
            let model = Model::load(&folder.path("m.json")).ok()?;
            let family = serde_json::to_value(&model.file().family).ok()?;
            let gain: [[f64; 2]; 2] = serde_json::from_value(family["gain"].clone()).ok()?;
            Some(gain.as_flattened().to_vec())
        };
        let wanted = gain().unwrap();
        for line in script.lines().map(str::trim) {
            let (mark, rest) = line.split_once(' ').unwrap();
            let (command, says) = rest.split_once(" | ").unwrap_or((rest, ""));
            let (verb, options) = command.split_once(' ').unwrap_or((command, ""));
            let (_, words) = COMMANDS.iter().find(|(known, _)| *known == verb).unwrap();
            let result = folder.run(&format!("{words} {options}"));
            let text = format!("{}{}", result.error, result.output);
            let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
            let near = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-6;
            let is_near = mark != "=" || gain().is_some_and(|it| it.iter().zip(&wanted).all(near));
            let code = ["+", "!", "2", "3"].iter().position(|it| mark.replace('=', "+") == **it);
            let is_code = result.code.and_then(|code| usize::try_from(code).ok()) == code;
            let is_right = is_code && is_near && says.split(" | ").all(|it| text.contains(it));
            self.wrong += usize::from(!is_right);
            let (verdict, code) = (if is_right { "right" } else { "WRONG" }, result.code);
            let start: String = text.chars().take(200).collect();
            let _ = writeln!(self.printed, "{verdict} | {name} | {line} | {code:?}: {start}");
        }
    }
}

#[test]
fn all_cases_are_right() {
    let mut table = Table::default();
    counters(&mut table);
    dialects(&mut table);
    more_dialects(&mut table);
    ends(&mut table);
    times(&mut table);
    units(&mut table);
    merges(&mut table);
    other_readers(&mut table);
    elsewhere(&mut table);
    println!("{}", table.printed);
    assert_eq!(table.wrong, 0, "{}", table.printed);
}

/// Checks that the tests of the other cases exist.
fn elsewhere(table: &mut Table) {
    for row in ELSEWHERE {
        let [name, file, test] = row.split(" | ").collect::<Vec<_>>()[..] else { panic!("{row}") };
        let exists = read_to_string(repository(file)).unwrap().contains(&format!("fn {test}()"));
        table.wrong += usize::from(!exists);
        let verdict = if exists { "right" } else { "WRONG" };
        let _ = writeln!(table.printed, "{verdict} | {name} | {file}: {test}");
    }
}

/// Both motors with reversals, 20 rows a second, and a straight snake.
fn rows() -> Vec<[f64; 5]> {
    let row = |k: u32| {
        let time = 0.05 * f64::from(k);
        let q0 = (300.0 * (2.1 * time).sin() + 90.0 * (5.3 * time).sin()).round();
        let q1 = (120.0 * (1.3 * time).cos() - 80.0 * (4.1 * time).sin()).round();
        let noise = 0.02 * (57.0 * time).sin();
        [time, q0, q1, 0.02 * q0 + noise, 0.015 * q1 - noise]
    };
    (0..60).map(row).collect()
}

fn written(rows: &[[f64; 5]], separator: &str) -> String {
    let mut text = format!("{HEADER}\n");
    for [time, q0, q1, pitch, yaw] in rows {
        let _ = writeln!(text, "{time:.3},{q0},{q1},{pitch:.3},{yaw:.3}");
    }
    text.replace(',', separator)
}

fn with_column(column: usize, change: impl Fn(f64) -> f64) -> String {
    let mut rows = rows();
    rows.iter_mut().for_each(|row| row[column] = change(row[column]));
    let digits = |cell: &f64| format!("{cell:.6}").trim_end_matches('0').to_owned() + "0";
    let line = |row: &[f64; 5]| row.iter().map(digits).collect::<Vec<_>>().join(",") + "\n";
    format!("{HEADER}\n{}", rows.iter().map(line).collect::<String>())
}

/// Rows with one cell replaced, in a line of the file.
fn with_cell(line: usize, column: usize, cell: &str) -> String {
    let text = written(&rows(), ",");
    let mut lines: Vec<&str> = text.lines().collect();
    let mut cells: Vec<&str> = lines[line - 1].split(',').collect();
    cells[column] = cell;
    let changed = cells.join(",");
    lines[line - 1] = &changed;
    lines.join("\n") + "\n"
}

/// Angles of 20 images, `step_s` apart, with stamps of a clock in units of `tick_s`.
fn angles(step_s: f64, tick_s: f64) -> String {
    let row = |k: u32| {
        let (angle, time) = (0.1 * f64::from(k), f64::from(k) * step_s / tick_s + 1e-9);
        format!("{:.4},{angle:.3},{:.3}\n", 0.5 + time.floor() * tick_s, -angle)
    };
    format!("t_s,pitch_deg,yaw_deg\n{}", (0..20).map(row).collect::<String>())
}

/// huggingface/lerobot#3586: a counter that wraps has to be named at once.
fn counters(table: &mut Table) {
    for (bits, modulus) in [(12, "4096"), (16, "65536"), (32, "4294967296")] {
        let half = f64::from(bits - 1).exp2();
        let unsigned = with_column(1, |count| (count - 20.0).rem_euclid(2.0 * half));
        let signed = with_column(2, |count| count.rem_euclid(2.0 * half) - half);
        let script = "! fit | counts jump by about MODULUS | --unwrap
            = fit --unwrap | a counter of MODULUS steps, unwrapped
            ! predict | jump by about MODULUS | --unwrap
            + predict --unwrap | unwrapped
            ! compare | jump by about MODULUS | --unwrap
            + compare --unwrap | unwrapped
            ! merge | jump by about MODULUS | --unwrap
            + merge --unwrap | 20 images with counts";
        let script = script.replace("MODULUS", modulus);
        table.case(&format!("counts-wrap {bits} bits"), &unsigned, &script);
        table.case(&format!("counts-wrap {bits} bits, signed"), &signed, &script);
    }
    let glitch = "! fit | line 27, column `q0_counts`: counts are 2147483647 | empty the cell";
    table.case("counts-wrap one glitch", &with_cell(27, 1, "2147483647"), glitch);
    table.case("counts-wrap one glitch, emptied", &with_cell(27, 1, ""), "+ fit | 1 dropped");
    let unsigned = with_column(1, |count| count - 1000.0 + 32.0_f64.exp2());
    table.case("counts-wrap below 0 without a sign", &unsigned, "= fit --unwrap");
    table.case("counts of a motor that moves", &with_cell(27, 1, "900"), "+ fit");
    let steps = "t_s,q0_counts,q1_counts\n0,0,0\n1,1000,0\n2,1000,1024\n3,0,0\n";
    table.case("counts of a step that was commanded", steps, "+ predict\n+ history");
}

fn dialects(table: &mut Table) {
    let plain = written(&rows(), ",");
    let (head, body) = plain.split_once('\n').unwrap();
    let comma = |separator| written(&rows(), "\t").replace('.', ",").replace('\t', separator);
    let iso = |line: &str| format!("2026-01-02T03:04:0{}Z{}\n", &line[..5], &line[5..]);
    let capitals = "T_s,Q0 counts,Q1 counts,Pitch (deg),Yaw (deg)";
    for (name, text) in [
        ("ISO time", format!("{head}\n{}", body.lines().map(iso).collect::<String>())),
        ("% head", format!("% rig of my own, spring\n% idx=0\n%{plain}")),
        ("blanks", format!("# {}", written(&rows(), " "))),
        ("two headers", plain.replacen("\n1.500", &format!("\n{head}\n1.500"), 1)),
        ("U+2212", plain.replace('-', "\u{2212}")),
        ("semicolons", written(&rows(), ";")),
        ("semicolons and decimal commas", comma(";")),
        ("blanks and decimal commas", comma("  ")),
        ("tabs and a BOM", format!("\u{feff}{}", written(&rows(), "\t"))),
        ("a comment before the head", format!("# rig, spring\n#\n{plain}")),
        ("words before the head", format!("Rig 5\nRate: fast\n{plain}")),
        ("capitals", plain.replacen(head, capitals, 1)),
        ("CR LF and a comma at the end", plain.replace('\n', ",\r\n")),
    ] {
        table.case(&format!("csv-dialects {name}"), &text, "= fit | rows 60; 0 dropped | time `");
    }
    let nan = plain.replacen(&plain[plain.find("\n0.500").unwrap() + 1..][..5], "nan", 1);
    table.case("csv-dialects nan", &nan, "+ fit | rows 60; 1 dropped | line 12 (t_s)");
    table.case("csv-dialects nan, angle", &with_cell(9, 3, "NaN"), "+ fit | line 9 (pitch_deg)");
    let both = "! fit | line 2: has 8 cells | separate all cells by semicolons";
    table.case("csv-dialects comma beside comma", &comma(", ").replacen(", ", ",", 4), both);
    table.case("csv-dialects no head", body, "! fit | begins with numbers | `t_s,q0_counts,");
}

/// Dialects of spreadsheets and libraries, and other units.
fn more_dialects(table: &mut Table) {
    let plain = written(&rows(), ",");
    let (head, body) = plain.split_once('\n').unwrap();
    let comma = written(&rows(), "\t").replace('.', ",").replace('\t', "\",\"");
    let quoted: String = comma.lines().map(|line| format!("\"{line}\"\r\n")).collect();
    let offset = |line: &str| format!("2026-01-02T03:04:0{}+00:00{}\n", &line[..5], &line[5..]);
    for (name, text) in [
        ("quoted decimal commas", quoted),
        ("offset", format!("{head}\n{}", body.lines().map(offset).collect::<String>())),
        ("carriage returns", plain.replace('\n', "\r")),
    ] {
        table.case(&format!("csv-more-dialects {name}"), &text, "= fit | rows 60; 0 dropped");
    }
    table.case("csv-more-dialects #N/A", &with_cell(9, 3, "#N/A"), "+ fit | line 9 (pitch_deg)");
    let grouped = |count: f64| match 10.0 * count {
        count if count.abs() < 1000.0 => format!("{count}"),
        count => format!("{}.{:03}", (count / 1e3).trunc(), count.abs() % 1e3),
    };
    let line = |[time, q0, q1, pitch, yaw]: &[f64; 5]| {
        let [q0, q1] = [q0, q1].map(|count| grouped(*count));
        format!("{time:.2};{q0};{q1};{pitch:.2};{yaw:.2}\n")
    };
    // Decimal points become commas, those of thousands stay.
    let decimals = |line: String| -> String {
        let cells = line.split(';').enumerate();
        let cells = cells.map(|(cell, text)| match cell {
            1 | 2 => text.to_owned(),
            _ => text.replace('.', ","),
        });
        cells.collect::<Vec<_>>().join(";")
    };
    let thousands: String = rows().iter().map(line).map(decimals).collect();
    let text = format!("{}\n{thousands}", HEADER.replace(',', ";"));
    table.case("csv-more-dialects thousands", &text, "+ fit | moves pitch by +0.0020 deg");
    let wide: String = plain.chars().flat_map(|letter| [letter, '\0']).collect();
    table.case("csv-more-dialects UTF-16", &wide, "! fit | is not text in UTF-8");
    let turns = with_column(1, |count| count / 4096.0);
    let both = turns.lines().map(|line| {
        let cells: Vec<&str> = line.split(',').collect();
        format!("{},{},{},{},{}\n", cells[0], cells[1], cells[1], cells[3], cells[4])
    });
    let both: String =
        both.collect::<String>().replacen("q0_counts,q0_counts", "q0_counts,q1_counts", 1);
    table.case("csv-more-dialects turns", &both, "! fit | if these are turns");
    let radians = plain.replacen("pitch_deg,yaw_deg", "pitch_rad,yaw_rad", 1);
    let remedy = "! fit | `pitch_rad` is in radians: multiply it by 57.29578
        ! file | `pitch_rad` is in radians: multiply it by 57.29578";
    table.case("remedy-renames-a-unit", &radians, remedy);
    table.case(
        "compare-still-motor",
        &with_column(2, |_| 17.0),
        "+ compare | pitch\n! fit | is 17",
    );
}

fn ends(table: &mut Table) {
    let whole = written(&rows(), ",");
    let zeros = format!("{whole}{}\n", "\0".repeat(32));
    for (name, text, says) in [
        ("cut", &whole[..whole.len() - 8], "line 61, the last one, is truncated and left out"),
        ("cut in the last cell", &whole[..whole.len() - 2], "line 61, the last one, is truncated"),
        ("zeros", &zeros, "32 zero bytes at the end are left out"),
    ] {
        let script =
            "+ fit | SAYS\n+ compare | SAYS\n+ merge | SAYS\n+ predict | SAYS\n3 file | SAYS";
        table.case(&format!("cut-last-line {name}"), text, &script.replace("SAYS", says));
    }
    table.case("cut-last-line, whole without a line end", whole.trim_end(), "= fit | rows 60;");
    let middle =
        "! fit | line 10: has 2 cells, but the header names 5 columns; complete or remove it";
    table.case("cut-last-line in the middle", &with_cell(9, 4, "1\n2,3"), middle);
}

fn times(table: &mut Table) {
    let plain = written(&rows(), ",");
    let times = |scale: f64, name| with_column(0, |time| scale * time).replacen("t_s", name, 1);
    for (name, text) in [
        ("time", times(1.0, "time")),
        ("hash", format!("# {plain}")),
        ("timestamp", times(1.0, "Timestamp [s]")),
        ("t_ms", times(1e3, "t_ms")),
        ("time (us)", times(1e6, "time (us)")),
    ] {
        table.case(&format!("time-not-found {name}"), &text, "= fit | time `\n+ merge | 20 images");
    }
    let milliseconds = "! fit | 0.02 row(s) per second as read, 20 if it is in ms | --time t_s=ms
        = fit --time t_s=ms | time `t_s`
        + predict
        ! merge | 0.02 row(s) per second as read, 20 if it is in ms | --time t_s=ms
        + merge --time t_s=ms | 20 images";
    table.case("time-not-found milliseconds", &times(1e3, "t_s"), milliseconds);
    let expected = "+ invert | 20 if it is in ms; give its unit with --time t_s=ms
        + invert --time t_s=ms
        3 file | 20 if it is in ms; call it `t_ms`";
    // Eleven points: the trajectory in question is also played.
    let points = times(1e3, "t_s").lines().take(12).collect::<Vec<_>>().join("\n") + "\n";
    table.case("time-not-found milliseconds of a trajectory", &points, expected);
    let fast = "! fit | 20000 row(s) per second | --time t_s=\n= fit --time t_s=s";
    table.case("time-not-found 20 kHz", &times(1e-3, "t_s"), fast);
    let back = "! fit | line 52, column `t_s`: time 0.3 s goes backwards (2.45 s in line 51) | cut
        = fit --time none";
    table.case("time that goes back", &with_cell(52, 0, "0.300"), back);
    let when = "+ fit | column `when` increases from row to row but is not read | --time 'when'
        = fit --time when | time `when`";
    table.case("time-not-found when", &times(1.0, "when"), when);
}

fn merges(table: &mut Table) {
    let twice = "+ merge-into | 10 images with counts | 10 with a duplicate stamp";
    table.case("merge-one-instant", &angles(0.03125, 0.0625), twice);
    let cells = |line: &str| line.splitn(4, ',').take(3).collect::<Vec<_>>().join(",") + "\n";
    let counts: String = written(&rows(), ",").lines().map(cells).collect();
    let all = "+ merge | 20 images with counts; skipped: 0 without counts, 0 with a duplicate";
    table.case("merge-without-angles", &counts, all);
    let empty = counts.replace('\n', ",,\n").replacen(",,\n", ",pitch_deg,yaw_deg\n", 1);
    table.case("merge-without-angles, empty", &empty, all);
    let short = counts.lines().take(19).collect::<Vec<_>>().join("\n");
    table.case("merge-without-angles, 18 rows", &short, "+ merge | 8 images with");
    let named = "! merge | column `q0_counts` | select the columns with --counts
        + merge --counts left,right | 20 images";
    let odd = counts.replacen("q0_counts,q1_counts", "left,right", 1);
    table.case("merge-without-angles, other names", &odd, named);
}

/// A line of units under the one with the names.
fn units(table: &mut Table) {
    let times = |scale: f64| with_column(0, |time| scale * time).replacen("t_s", "time", 1);
    let with = |text: &str, line: &str| text.replacen('\n', &format!("\n{line}\n"), 1);
    let all = "= fit | rows 60;\n+ predict\n+ invert\n+ merge | 20 images\n3 file";
    table.case("units", &with(&times(1.0), "s,counts,counts,deg,deg"), all);
    table.case("units in brackets", &with(&times(1e3), "[ms],[],[],[\u{b0}],[\u{b0}]"), all);
    let rad = "! fit | line 2, column `pitch_deg`: `rad` differs from the unit | convert
        ! invert | `rad` differs from the unit\n! file | `rad` differs from the unit\n+ predict";
    table.case("units, radians", &with(&times(1.0), "s,counts,counts,rad,rad"), rad);
    let unknown = "! fit | `hours` is not a unit of time; write s, ms, us or ns\n! file | `hours`";
    table.case("units, hours", &with(&times(1.0), "hours,,,deg,deg"), unknown);
}

/// The other readers accept the same files as `fit`.
fn other_readers(table: &mut Table) {
    let plain = written(&rows(), ",");
    let all = "+ predict\n+ history\n+ invert\n3 file";
    let laboratory = "Enc TS,Encoder counts 0,Encoder counts 1,pitches,yaws";
    for (name, text) in [
        ("", plain.replacen(HEADER, laboratory, 1)),
        (" semicolons", written(&rows(), "\t").replace('.', ",").replace('\t', ";")),
        (" % head", format!("% rig\n%{plain}")),
    ] {
        table.case(&format!("predict-lab-names{name}"), &text, all);
    }
    let gap = "+ predict | 1 row(s) with an empty cell are left out, the first in line 42 (q0_counts)\n+ history";
    table.case("predict-lab-names gap", &with_cell(42, 1, ""), gap);
    let gap = "+ invert | 1 row(s) with an empty cell are left out, the first in line 42 (pitch_deg)\n3 file | line 42";
    table.case("predict-lab-names gap of angles", &with_cell(42, 3, "nan"), gap);
    let double = "+ predict\n+ history\n! invert | line 9, column `t_s`: time 0.3 s occurs twice";
    table.case("predict-lab-names double stamp", &with_cell(9, 0, "0.300"), double);
    let odd = "! predict | column `q0_counts` | --counts COLUMN
        + predict --counts left,right --time when
        ! fit --angles bend=pitch | column `q0_counts` | `left`, `right`
        = fit --counts left,right --angles up=pitch,side=yaw --time when | pitch `up`, yaw `side`
        ! invert | column `t_s` | --time COLUMN
        + invert --time when --angles up=pitch,side=yaw
        ! file | column `t_s` | rename the columns";
    let named = plain.replacen(HEADER, "when,left,right,up,side", 1);
    table.case("predict-lab-names other names", &named, odd);
}
