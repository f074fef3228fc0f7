//! Recordings that no robot makes, each drawn five times: they are named with their line, and sound
//! ones are not.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::{ColumnMap, ReadReport, Recording, RecordingError};

const ROWS: usize = 900;

/// Time, counts of both motors, pitch and yaw.
type Line = [f64; 5];

/// Five minutes of a snake with play, seen by a camera with noise.
fn sound(random: &mut Pcg64, noise_deg: f64) -> Vec<Line> {
    let mut play = [0.0_f64; 2];
    let rates = [random.random_range(0.05..0.09), random.random_range(0.09..0.15)];
    let rows = (0..ROWS).map(|row| {
        let time = row as f64 / 3.0;
        let counts = [0, 1].map(|motor| {
            let decay = 1.0 - 0.5 * (0.011 * time * (1.0 + motor as f64)).sin().abs();
            (450.0 * decay * (rates[motor] * time).sin()).round()
        });
        for (play, count) in play.iter_mut().zip(counts) {
            *play = play.clamp(count - 40.0, count + 40.0);
        }
        let mut seen = |angle: f64| angle + noise_deg * random.random_range(-1.7..1.7);
        let pitch = seen(0.04 * play[0] + 0.004 * play[1] + 1e-5 * play[0] * play[0]);
        [time, counts[0], counts[1], pitch, seen(0.035 * play[1] - 0.003 * play[0])]
    });
    rows.collect()
}

fn read(lines: &[Line], names: &str) -> Result<(Recording, ReadReport), RecordingError> {
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

const COMMON: &str = "t_s,q0_counts,q1_counts,pitch_deg,yaw_deg";

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
            let found = match read(&rows, COMMON) {
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
        let error = read(&rows, "t_s,q0_counts,q1_counts,x_mm,y_mm").unwrap_err().to_string();
        assert!(error.contains("if these are metres"), "{error}");
        let mut rows = sound(&mut random, 0.05);
        for last in (1..ROWS).rev() {
            rows.swap(last, random.random_range(0..=last));
        }
        let error = read(&rows, &COMMON["t_s,".len()..]).unwrap_err().to_string();
        assert!(error.contains("not a path of a motor"), "{error}");
    }
}

#[test]
fn repeats_leave_the_path_as_it_is() {
    let mut rows = sound(&mut Pcg64::seed_from_u64(1), 0.05);
    let [.., pitch, yaw] = rows[400];
    rows[400..460].iter_mut().for_each(|row| (row[3], row[4]) = (pitch, yaw));
    let (recording, report) = read(&rows, COMMON).unwrap();
    assert_eq!((recording.rows().len(), recording.path().len()), (ROWS - 59, ROWS));
    assert_eq!((report.dropped.len(), report.positions), (0, 59));
}

/// A camera without noise, as emulated: the snake stands inside gaps of an eighth of the range, and
/// whenever the motors rest.
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
    let (_, report) = read(&rows, COMMON).unwrap();
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
            let (_, report) = read(&rows, COMMON).unwrap();
            assert!(report.notes.is_empty(), "{draw}, {noise_deg} deg: {:?}", report.notes);
        }
    }
}
