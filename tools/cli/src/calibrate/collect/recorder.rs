//! Converts messages to rows of a recording, in order of time. Pure except for the writer.
//!
//! Every position of motor 0 makes a row, with the other motor between its own positions around
//! that instant; every frame makes a row with its angles and both motors between their positions
//! around its stamp. A row is written once all that may come before it has had time to arrive.

use std::io::{self, Write};

use i2ris::ipc::payload::{ActuatorState, ExternalPosition};
use i2ris::model::file::{OutputSpec, OutputUnit};
use i2ris::units::{MAX_MOTORS, MAX_OUTPUTS, MotorVec, Nanos, OutputVec};
use i2ris_calibration::recording::{RecordingWriter, Row};
use i2ris_report::statistics::TimeSeries;

use super::frame_queue::{CameraFrame, FrameQueue};
use super::sidecar::{Flag, FlagKind};

/// Positions come every 4 to 10 ms; motors may have turned back in a gap of this length, ns.
pub const GAP_NS: u64 = 60_000_000;
/// No camera is slower than 5 frames a second; a gap of this length is one.
const CAMERA_GAP_NS: u64 = 500_000_000;

pub struct Recorder<W: Write> {
    writer: RecordingWriter<W>,
    start: Nanos,
    pub motors: usize,
    outputs: usize,
    encoders: [TimeSeries<1>; MAX_MOTORS],
    frames: FrameQueue,
    next: usize,
    written: Option<Nanos>,
    last_seen: Option<Nanos>,
    rows: Vec<Row>,
    flags: Vec<Flag>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct RecordedRows {
    /// All rows; `outputs` are NaN where nothing was measured.
    pub rows: Vec<Row>,
    pub flags: Vec<Flag>,
}

impl RecordedRows {
    pub fn samples(&self) -> impl Iterator<Item = &Row> {
        self.rows.iter().filter(|row| row.outputs.iter().all(|output| output.is_finite()))
    }
}

/// A frame so far from its neighbours, which agree, is an outlier: deg (mm).
const OUTLIER: f64 = 3.0;

impl<W: Write> Recorder<W> {
    /// Writes the header. `start` is the time zero of the recording.
    pub fn new(to: W, start: Nanos, motors: usize, outputs: &[OutputSpec]) -> io::Result<Self> {
        let unit = outputs.first().map_or(OutputUnit::Deg, |output| output.unit);
        Ok(Self {
            writer: RecordingWriter::new(to, true, motors, outputs)?,
            start,
            motors,
            outputs: outputs.len(),
            encoders: Default::default(),
            frames: FrameQueue::new(unit, outputs.len(), OUTLIER),
            next: 0,
            written: None,
            last_seen: None,
            rows: Vec::new(),
            flags: Vec::new(),
        })
    }

    pub fn positions(&mut self, state: &ActuatorState) {
        for motor in 0..self.motors {
            let stamp = state.measured_stamp_ns[motor];
            if stamp < self.start.0 {
                continue;
            }
            let before = self.encoders[motor].last().map(|(stamp, _)| *stamp);
            if let Some(before) = before.filter(|before| stamp > *before + GAP_NS) {
                self.flag(Nanos(before), FlagKind::EncoderGap, stamp - before, &[]);
            }
            self.encoders[motor].push(stamp, [f64::from(state.measured_counts[motor])]);
        }
    }

    pub fn frame(&mut self, seen: &ExternalPosition) {
        let stamp = Nanos(seen.stamp_ns);
        if stamp < self.start {
            return;
        }
        if seen.flags & ExternalPosition::VALID == 0 {
            return self.nothing_seen(stamp);
        }
        let since = |before: &Nanos| stamp.duration_since(*before).0;
        if let Some(before) = self.last_seen.filter(|before| since(before) > CAMERA_GAP_NS) {
            self.flag(before, FlagKind::CameraGap, since(&before), &[]);
        }
        self.last_seen = Some(stamp);
        if !self.frames.push(seen) {
            self.flag(stamp, FlagKind::Late, 0, &[]);
        }
    }

    /// Writes every row up to an instant that is complete; `all` if no more messages follow.
    pub fn write(&mut self, until: Nanos, all: bool) -> io::Result<()> {
        while let Some(stamp) = self.encoders[0].get(self.next).map(|(stamp, _)| Nanos(*stamp)) {
            let frame = self.frames.next(all).filter(|frame| *frame <= stamp);
            let due = frame.unwrap_or(stamp);
            if due > until || !self.covered(due) {
                break;
            }
            if frame.is_none() {
                self.write_position(stamp)?;
            } else if let Some(frame) = self.frames.pop() {
                self.write_frame(frame)?;
            }
        }
        Ok(())
    }

    pub fn finish(mut self) -> io::Result<RecordedRows> {
        self.write(Nanos(u64::MAX), true)?;
        self.writer.finish()?;
        Ok(RecordedRows { rows: self.rows, flags: self.flags })
    }

    fn covered(&self, stamp: Nanos) -> bool {
        let mut series = self.encoders.iter().take(self.motors);
        series.all(|series| series.last().is_some_and(|(last, _)| *last >= stamp.0))
    }

    fn write_position(&mut self, stamp: Nanos) -> io::Result<()> {
        self.next += 1;
        // The other motor may have its first position later.
        match self.counts(stamp, u64::MAX) {
            Some(counts) if self.written.is_none_or(|written| written < stamp) => {
                self.row(stamp, counts, [f64::NAN; MAX_OUTPUTS])
            }
            _ => Ok(()),
        }
    }

    fn write_frame(&mut self, (frame, is_outlier): (CameraFrame, bool)) -> io::Result<()> {
        let CameraFrame { stamp, outputs } = frame;
        let flag = match (self.counts(stamp, GAP_NS), self.written) {
            (_, Some(written)) if written >= stamp => FlagKind::Late,
            // The recording begins with a position.
            (_, None) => return Ok(()),
            (Some(counts), _) if !is_outlier => return self.row(stamp, counts, outputs),
            (_, _) if is_outlier => FlagKind::Outlier,
            (_, _) => FlagKind::NoCounts,
        };
        self.flag(stamp, flag, 0, &outputs[..self.outputs]);
        Ok(())
    }

    fn counts(&self, stamp: Nanos, gap_ns: u64) -> Option<MotorVec> {
        let mut counts = MotorVec::default();
        for (counts, series) in counts.iter_mut().zip(&self.encoders).take(self.motors) {
            [*counts] = series.value_at(stamp.0, gap_ns)?;
        }
        Some(counts)
    }

    fn row(&mut self, stamp: Nanos, counts: MotorVec, outputs: OutputVec) -> io::Result<()> {
        let time_s = Some(stamp.duration_since(self.start).as_seconds());
        let (line, path_index) = (self.rows.len() as u64 + 2, self.rows.len());
        let row = Row { line, time_s, counts, outputs, path_index };
        self.written = Some(stamp);
        self.rows.push(row);
        self.writer.row(&row)
    }

    /// Extends a single flag while the camera sees nothing.
    fn nothing_seen(&mut self, stamp: Nanos) {
        let t_s = stamp.duration_since(self.start).as_seconds();
        match self.flags.last_mut() {
            Some(flag)
                if flag.kind == FlagKind::NothingSeen && t_s - flag.t_s - flag.span_s < 0.5 =>
            {
                flag.span_s = t_s - flag.t_s;
            }
            _ => self.flag(stamp, FlagKind::NothingSeen, 0, &[]),
        }
    }

    fn flag(&mut self, stamp: Nanos, kind: FlagKind, span_ns: u64, measured: &[f64]) {
        let measured = measured.iter().copied().filter(|value| value.is_finite()).collect();
        let t_s = stamp.duration_since(self.start).as_seconds();
        self.flags.push(Flag { t_s, kind, span_s: Nanos(span_ns).as_seconds(), measured });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const START: Nanos = Nanos(5_000_000_000);

    fn ms(milliseconds: u64) -> u64 {
        START.0 + milliseconds * 1_000_000
    }

    fn outputs() -> [OutputSpec; 2] {
        ["pitch", "yaw"].map(|name| OutputSpec { name: name.to_owned(), unit: OutputUnit::Deg })
    }

    /// Motor 1 is read one millisecond after motor 0; they go 1 and -2 counts per ms.
    fn positions(time: u64) -> ActuatorState {
        let measured_stamp_ns = [ms(time), ms(time + 1)];
        let measured_counts = [time as i32, -2 * (time as i32 + 1)];
        ActuatorState { measured_stamp_ns, measured_counts, count: 2, ..Default::default() }
    }

    fn frame(time: u64, pitch_deg: f64) -> ExternalPosition {
        let position = [pitch_deg.to_radians(), (1.0 - pitch_deg / 2.0).to_radians(), 0.0];
        ExternalPosition { stamp_ns: ms(time), position, count: 2, flags: 1, ..Default::default() }
    }

    fn sample_times_ms(recorded: &RecordedRows) -> Vec<u64> {
        recorded.samples().map(|row| (row.time_s.unwrap() * 1e3).round() as u64).collect()
    }

    fn recorder(file: &mut Vec<u8>) -> Recorder<&mut Vec<u8>> {
        Recorder::new(file, START, 2, &outputs()).unwrap()
    }

    #[test]
    fn rows_come_in_order_with_the_counts_of_their_instant() {
        let mut file = Vec::new();
        let mut recorder = recorder(&mut file);
        (0..=400).step_by(4).for_each(|time| recorder.positions(&positions(time)));
        (10..400).step_by(33).for_each(|time| recorder.frame(&frame(time, 2.0)));
        let recorded = recorder.finish().unwrap();
        assert_eq!(recorded.samples().count(), 12);
        assert!(recorded.rows.windows(2).all(|pair| pair[0].time_s < pair[1].time_s));
        for row in &recorded.rows {
            let time = row.time_s.unwrap() * 1e3;
            let off = [row.counts[0] - time, row.counts[1] + 2.0 * time];
            assert!(off.iter().all(|off| off.abs() < 1e-6), "{row:?}");
        }
        assert_eq!(recorded.flags, []);
        let text = String::from_utf8(file).unwrap();
        let head = "t_s,q0_counts,q1_counts,pitch_deg,yaw_deg\n0.004,4,-8,,\n";
        assert!(text.starts_with(head), "{text}");
        assert_eq!(text.lines().count(), recorded.rows.len() + 1);
    }

    #[test]
    fn a_row_waits_for_what_may_come_before_it() {
        let mut file = Vec::new();
        let mut recorder = recorder(&mut file);
        (0..=400).step_by(4).for_each(|time| recorder.positions(&positions(time)));
        recorder.write(Nanos(ms(100)), false).unwrap();
        recorder.frame(&frame(110, 1.0));
        recorder.frame(&frame(90, 1.0));
        recorder.frame(&frame(143, 1.0));
        let recorded = recorder.finish().unwrap();
        assert_eq!(sample_times_ms(&recorded), [110, 143]);
        assert!(matches!(recorded.flags[..], [Flag { kind: FlagKind::Late, .. }]));
    }

    #[test]
    fn gaps_outliers_and_blind_frames_are_flagged_without_angles() {
        let mut file = Vec::new();
        let mut recorder = recorder(&mut file);
        (0..=200).step_by(4).for_each(|time| recorder.positions(&positions(time)));
        (400..=600).step_by(4).for_each(|time| recorder.positions(&positions(time)));
        for (time, pitch) in [(30, 1.0), (63, 50.0), (96, 1.0), (300, 1.5), (430, 1.0)] {
            recorder.frame(&frame(time, pitch));
        }
        for time in [460, 490, 520] {
            recorder.frame(&ExternalPosition { flags: 0, ..frame(time, 0.0) });
        }
        let recorded = recorder.finish().unwrap();
        assert_eq!(sample_times_ms(&recorded), [30, 96, 430]);
        let entry = |flag: &Flag| (flag.kind, (flag.t_s * 1e3).round() as u64, flag.measured.len());
        let mut flags: Vec<_> = recorded.flags.iter().map(entry).collect();
        flags.sort_unstable();
        assert_eq!(flags[..2], [(FlagKind::EncoderGap, 200, 0), (FlagKind::EncoderGap, 201, 0)]);
        assert_eq!(flags[2..4], [(FlagKind::NoCounts, 300, 2), (FlagKind::NothingSeen, 460, 0)]);
        assert_eq!((flags[4], flags.len()), ((FlagKind::Outlier, 63, 2), 5));
        let mut blind = recorded.flags.iter().filter(|flag| flag.kind == FlagKind::NothingSeen);
        assert!((blind.next().unwrap().span_s - 0.06).abs() < 1e-9);
    }
}
