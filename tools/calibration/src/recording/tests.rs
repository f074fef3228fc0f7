//! Reading of tables, and recordings that no robot makes.

use std::path::PathBuf;

use i2ris::model::file::{OutputSpec, OutputUnit};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::rows::hash;
use super::*;
use crate::testing::{assert_contains, degrees, play};

const COMMON: &str = "t_s,q0_counts,q1_counts,pitch_deg,yaw_deg";

fn read_as(text: &[u8], columns: &ColumnMap) -> Result<(Recording, ReadReport), RecordingError> {
    let folder = tempfile::tempdir().unwrap();
    let path: PathBuf = folder.path().join("rows.csv");
    std::fs::write(&path, text).unwrap();
    Recording::read(&path, columns)
}

fn read(text: &str) -> Result<(Recording, ReadReport), RecordingError> {
    read_as(text.as_bytes(), &ColumnMap { options: true, ..ColumnMap::default() })
}

/// A good recording of 30 rows in the common format, lines 2 to 31.
fn good() -> Vec<String> {
    let row = |i: i32| {
        format!("{}.5,{},{},{}.25,{}", i, 10 * i, i * i - 100, i - 15, 0.5 * f64::from(i % 7))
    };
    std::iter::once(COMMON.to_owned()).chain((0..30).map(row)).collect()
}

/// The good recording with one cell replaced.
fn with_cell(line: usize, column: usize, cell: &str) -> String {
    let mut lines = good();
    let mut cells: Vec<_> = lines[line - 1].split(',').collect();
    cells[column] = cell;
    lines[line - 1] = cells.join(",");
    lines.join("\n")
}

#[track_caller]
fn refused(text: &str, parts: &[&str]) {
    let message = read(text).unwrap_err();
    assert_contains(&message, &["rows.csv"]);
    assert_contains(&message, parts);
}

#[test]
fn one_motor_without_time_is_recognised() {
    let rows: Vec<_> = (0..25).map(|i| format!("{},{}.5", 1600 + i, i)).collect();
    let (recording, report) = read(&format!("q0_counts,pitch_deg\n{}", rows.join("\n"))).unwrap();
    assert_eq!((recording.motors(), recording.outputs().len(), report.time_column), (1, 1, None));
    assert_eq!(recording.rows()[0].time_s, None);
}

#[test]
fn an_output_column_is_parsed() {
    let parse =
        |text: &str| text.parse::<OutputColumn>().map(|o| (o.column, o.output.name, o.output.unit));
    let deg = |column: &str, name: &str| Ok((column.to_owned(), name.to_owned(), OutputUnit::Deg));
    assert_eq!(parse("pitches"), deg("pitches", "pitch"));
    assert_eq!(parse("bend_deg"), deg("bend_deg", "bend"));
    assert_eq!(parse(" a = b "), deg("a", "b"));
    assert_eq!(parse("x_mm"), Ok(("x_mm".to_owned(), "x".to_owned(), OutputUnit::Mm)));
    assert!(parse("").is_err() && parse("a=").is_err() && parse("a=seventeen-letters").is_err());
}

#[test]
fn rows_with_an_empty_cell_are_dropped_and_named() {
    let mut lines = good();
    lines[4] = lines[4].replace(",-12.25,", ", ,");
    lines.splice(10..10, ["".to_owned(), " ".to_owned(), "\r".to_owned()]);
    lines.push(",7,7,7,7".to_owned());
    let (recording, report) = read(&lines.join("\n")).unwrap();
    let dropped: Vec<_> =
        report.dropped.iter().map(|row| (row.line, row.column.as_str())).collect();
    assert_eq!(dropped, [(5, "pitch_deg"), (35, "t_s")]);
    assert_eq!((report.rows, recording.rows().len()), (31, 29));
    // The blank lines 11 to 13 are not rows, but they count as lines.
    let lines: Vec<u64> = recording.rows().iter().map(|row| row.line).skip(7).take(3).collect();
    assert_eq!(lines, [10, 14, 15]);
}

#[test]
fn the_hash_is_that_of_the_bytes() {
    let mut lines = good();
    let (recording, _) = read(&lines.join("\n")).unwrap();
    lines.push(String::new());
    let (longer, _) = read(&lines.join("\n")).unwrap();
    assert_eq!(recording.rows(), longer.rows());
    assert_ne!(recording.sha256(), longer.sha256());
    let both = recording.followed_by(&longer).unwrap();
    assert_eq!(both.sha256(), format!("{} {}", recording.sha256(), longer.sha256()));
    // Output of `printf abc | sha256sum`.
    let abc = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
    assert_eq!(hash(b"abc"), abc);
}

#[test]
fn wrong_cells_are_named_with_line_and_column() {
    for (line, column, cell, message) in [
        (7, 3, "left", "line 7, column `pitch_deg`: `left` is not a number"),
        (7, 0, "left", "line 7, column `t_s`: `left` is not a time"),
        (9, 1, "-inf", "line 9, column `q0_counts`: `-inf` is not a finite number"),
        (9, 4, "180.5", "line 9, column `yaw_deg`: `180.5` is not between -180 and 180 degrees"),
        (3, 2, "5e9", "line 3, column `q1_counts`: `5e9` is outside the 32-bit range"),
        (3, 2, "3e9", "line 3, column `q1_counts`: counts are 3000000000, but -100 in the"),
        (3, 2, "1,2", "line 3: has 6 cells, but the header names 5 columns"),
        (6, 0, "3.5", "line 6, column `t_s`: time 3.5 s occurs twice (3.5 s in line 5)"),
        (6, 0, "3.25", "line 6, column `t_s`: time 3.25 s goes backwards"),
    ] {
        refused(&with_cell(line, column, cell), &[message]);
    }
    let bytes = [good().join("\n").as_bytes(), b"\n30,\xff,2,3,4"].concat();
    let error = read_as(&bytes, &ColumnMap::default()).unwrap_err();
    assert_contains(&error, &["line 32: is not text in UTF-8"]);
    // An error next to an empty cell is found as well.
    let text = with_cell(7, 1, "").replace("\n5.5,,-75,", "\n5.5,,minus,");
    refused(&text, &["line 7, column `q1_counts`: `minus`"]);
}

#[test]
fn too_few_rows_are_counted() {
    refused("", &["is empty"]);
    refused(COMMON, &["0 complete row(s), but a model needs at least 20"]);
    refused(&good()[..2].join("\n"), &["1 complete row(s)"]);
    refused(&good()[..20].join("\n"), &["19 complete row(s)"]);
    assert!(read(&good()[..21].join("\n")).is_ok());
}

fn any_row() -> impl Strategy<Value = Row> {
    let counts = prop::array::uniform2(1.9e9..1_900_000_200.0);
    let outputs = prop::array::uniform2(-180.0..180.0);
    (counts, outputs).prop_map(|(counts, [pitch, yaw])| Row::new(None, counts, [pitch, yaw, 0.0]))
}

proptest! {
    #[test]
    fn written_rows_are_read_to_the_bit(rows in prop::collection::vec(any_row(), 20..40)) {
        let outputs = ["pitch", "yaw"].map(degrees);
        let mut writer = RecordingWriter::new(Vec::new(), false, 2, &outputs).unwrap();
        for row in &rows {
            writer.row(row).unwrap();
        }
        let (recording, _) = read_as(&writer.finish().unwrap(), &ColumnMap::default()).unwrap();
        prop_assert_eq!(recording.outputs(), &outputs);
        for (read, row) in recording.rows().iter().zip(&rows) {
            prop_assert_eq!((read.counts, read.outputs), (row.counts, row.outputs));
        }
    }

    #[test]
    fn written_times_are_read_to_the_bit(steps in prop::collection::vec(1e-6..10.0_f64, 20..40)) {
        let mut writer = RecordingWriter::new(Vec::new(), true, 1, &[degrees("pitch")]).unwrap();
        let mut time = 1.746e9;
        let mut times = Vec::new();
        for (i, step) in steps.iter().enumerate() {
            time += step;
            times.push(Some(time));
            writer.row(&Row::new(Some(time), [i as f64, 0.0], [*step, 0.0, 0.0])).unwrap();
        }
        let (recording, _) = read_as(&writer.finish().unwrap(), &ColumnMap::default()).unwrap();
        let read: Vec<_> = recording.rows().iter().map(|row| row.time_s).collect();
        prop_assert_eq!(read, times);
    }

    #[test]
    fn no_bytes_make_the_reader_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        let mut file = COMMON.as_bytes().to_vec();
        file.extend(&bytes);
        let _ = read_as(&bytes, &ColumnMap::default());
        let _ = read_as(&file, &ColumnMap::default());
    }
}

#[test]
fn a_cell_that_was_not_measured_is_left_empty() {
    let outputs = [OutputSpec { unit: OutputUnit::Mm, ..degrees("x") }];
    let mut writer = RecordingWriter::new(Vec::new(), true, 1, &outputs).unwrap();
    let row = Row::new(Some(0.5), [3.0, 9.0], [f64::NAN, 1.0, 1.0]);
    writer.row(&row).unwrap();
    let text = String::from_utf8(writer.finish().unwrap()).unwrap();
    assert_eq!(text, "t_s,q0_counts,x_mm\n0.5,3,\n");
}

#[test]
fn positions_without_outputs_are_path_points_only() {
    let mut lines = good();
    lines.insert(6, "4.95,55,0,,".to_owned());
    lines.insert(8, "5.95,57,0,3,".to_owned());
    let (recording, report) = read(&lines.join("\n")).unwrap();
    let plain = read(&good().join("\n")).unwrap().0;
    let rows = plain.rows().len();
    assert_eq!((recording.path().len(), recording.rows().len()), (rows + 2, rows));
    assert_eq!((report.positions, report.dropped.len()), (1, 1));
    for row in recording.rows() {
        let place = recording.path()[row.path_index];
        assert_eq!((place.line, place.counts), (row.line, row.counts));
    }
}

const ROWS: usize = 900;

/// Time, counts of both motors, pitch and yaw.
type Line = [f64; 5];

/// Five minutes of a snake with play, seen by a camera with noise.
fn sound(random: &mut Pcg64, noise_deg: f64) -> Vec<Line> {
    let mut played = [0.0_f64; 2];
    let rates = [random.random_range(0.05..0.09), random.random_range(0.09..0.15)];
    let rows = (0..ROWS).map(|row| {
        let time = row as f64 / 3.0;
        let counts = [0, 1].map(|motor| {
            let decay = 1.0 - 0.5 * (0.011 * time * (1.0 + motor as f64)).sin().abs();
            (450.0 * decay * (rates[motor] * time).sin()).round()
        });
        play(&mut played, counts, 40.0);
        let mut seen = |angle: f64| angle + noise_deg * random.random_range(-1.7..1.7);
        let pitch = seen(0.04 * played[0] + 0.004 * played[1] + 1e-5 * played[0] * played[0]);
        [time, counts[0], counts[1], pitch, seen(0.035 * played[1] - 0.003 * played[0])]
    });
    rows.collect()
}

fn read_lines(lines: &[Line], names: &str) -> Result<(Recording, ReadReport), RecordingError> {
    let columns = names.split(',').count();
    let skipped = 5 - columns;
    let cells = |line: &Line| {
        let cells: Vec<String> = line[skipped..].iter().map(f64::to_string).collect();
        cells.join(",")
    };
    let text: Vec<String> =
        std::iter::once(names.to_owned()).chain(lines.iter().map(cells)).collect();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rows.csv");
    std::fs::write(&path, text.join("\n")).unwrap();
    Recording::read(&path, &ColumnMap { options: true, ..ColumnMap::default() })
}

/// Kind of nonsense, what is said of it, and how it comes to be from a row on.
type Kind = (&'static str, &'static str, fn(&mut Vec<Line>, usize));

const KINDS: [Kind; 9] = [
    ("a camera repeats itself", "the camera repeats itself", |rows, from| {
        let [.., pitch, yaw] = rows[from];
        rows[from..from + 60].iter_mut().for_each(|row| (row[3], row[4]) = (pitch, yaw));
    }),
    ("a zero is set again", "homed, restarted or slipped there", |rows, from| {
        let from = (from..ROWS).find(|row| rows[*row][1].abs() > 150.0).unwrap();
        let zero = rows[from][1];
        rows[from..].iter_mut().for_each(|row| row[1] -= zero);
    }),
    ("a motor slips", "homed, restarted or slipped there", |rows, from| {
        rows[from..].iter_mut().for_each(|row| row[1] += 250.0);
    }),
    ("a camera is bumped", "no motor made", |rows, from| {
        rows[from..].iter_mut().for_each(|row| row[3] += 9.0);
    }),
    ("angles wrap", "wraps from one end", |rows, _| {
        for row in rows {
            row[3] = (row[3] + 170.0 + 180.0).rem_euclid(360.0) - 180.0;
        }
    }),
    ("a wire is broken", "hardly follows", |rows, _| {
        rows.iter_mut().for_each(|row| row[3] = row[3].max(0.02 * row[3]));
    }),
    ("half of the gain is lost", "times as far", |rows, _| {
        rows[ROWS / 2..].iter_mut().for_each(|row| row[3] *= 0.5);
    }),
    ("counts wrap", "a counter that wraps", |rows, _| {
        rows.iter_mut().for_each(|row| row[1] = row[1].rem_euclid(1024.0));
    }),
    ("time goes backwards", "goes backwards", |rows, from| {
        rows[from..].iter_mut().for_each(|row| row[0] -= 50.0);
    }),
];

#[test]
fn nonsense_is_named() {
    for (kind, said, make) in KINDS {
        for draw in 0..5 {
            let mut random = Pcg64::seed_from_u64(draw);
            let mut rows = sound(&mut random, 0.05);
            make(&mut rows, random.random_range(300..600));
            let found = match read_lines(&rows, COMMON) {
                Ok((_, report)) => report.notes.join("; "),
                Err(error) => error.to_string(),
            };
            assert!(found.contains(said) && found.contains("column"), "{kind}, {draw}: {found}");
        }
    }
}

#[test]
fn rows_in_random_order_and_metres_are_refused() {
    for draw in 0..5 {
        let mut random = Pcg64::seed_from_u64(draw);
        let mut rows = sound(&mut random, 0.05);
        rows.iter_mut().for_each(|row| (row[3], row[4]) = (row[3] * 1e-3, row[4] * 1e-3));
        let error = read_lines(&rows, "t_s,q0_counts,q1_counts,x_mm,y_mm").unwrap_err().to_string();
        assert!(error.contains("if these are metres"), "{error}");
        let mut rows = sound(&mut random, 0.05);
        for last in (1..ROWS).rev() {
            rows.swap(last, random.random_range(0..=last));
        }
        let error = read_lines(&rows, &COMMON["t_s,".len()..]).unwrap_err().to_string();
        assert!(error.contains("not a path of a motor"), "{error}");
    }
}

#[test]
fn repeats_leave_the_path_as_it_is() {
    let mut rows = sound(&mut Pcg64::seed_from_u64(1), 0.05);
    let [.., pitch, yaw] = rows[400];
    rows[400..460].iter_mut().for_each(|row| (row[3], row[4]) = (pitch, yaw));
    let (recording, report) = read_lines(&rows, COMMON).unwrap();
    assert_eq!((recording.rows().len(), recording.path().len()), (ROWS - 59, ROWS));
    assert_eq!((report.dropped.len(), report.positions), (0, 59));
}

/// A camera without noise, as emulated: the snake stands inside gaps, and whenever motors rest.
#[test]
fn gaps_without_noise_are_not_repeats() {
    let (mut play, mut at) = ([-30.0_f64, -15.0], 0.0);
    let line = |row: usize| {
        // Strokes of 450 counts, with a rest of five rows at each end.
        let step = if row % 60 >= 55 { 0.0 } else { 450.0 / 55.0 };
        at += if (row / 60).is_multiple_of(2) { step } else { -step };
        let counts = [1.0, 0.5].map(|share| f64::round(share * at));
        for (motor, (play, count)) in play.iter_mut().zip(counts).enumerate() {
            let half = [30.0, 15.0][motor];
            *play = play.clamp(count - half, count + half);
        }
        [row as f64 / 3.0, counts[0], counts[1], 0.04 * play[0], 0.02 * play[1]]
    };
    let rows: Vec<Line> = (0..ROWS).map(line).collect();
    let (_, report) = read_lines(&rows, COMMON).unwrap();
    assert!(report.notes.is_empty(), "{:?}", report.notes);
}

#[test]
fn sound_recordings_are_read_without_a_word() {
    for draw in 0..20 {
        for noise_deg in [0.0, 0.01, 0.05, 0.3] {
            let mut random = Pcg64::seed_from_u64(100 + draw);
            let mut rows = sound(&mut random, noise_deg);
            // One motor at a time, with rests between.
            if draw % 2 == 0 {
                let (first, second) = rows.split_at_mut(ROWS / 2);
                let rest = first[0];
                first.iter_mut().for_each(|row| row[2] = rest[2]);
                second.iter_mut().for_each(|row| row[1] = rest[1]);
                first.iter_mut().for_each(|row| (row[3], row[4]) = (0.04 * row[1], 0.001 * row[1]));
                second.iter_mut().for_each(|row| (row[3], row[4]) = (0.0, 0.035 * row[2]));
            }
            let (_, report) = read_lines(&rows, COMMON).unwrap();
            assert!(report.notes.is_empty(), "{draw}, {noise_deg} deg: {:?}", report.notes);
        }
    }
}
