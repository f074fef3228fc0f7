//! Rows that no motor and no sensor makes: a random order, a zero that was set again, a camera that
//! repeats itself, was moved, or counts another unit. Fitted, they would look like a bad robot.

use i2ris::model::file::OutputUnit;
use i2ris::units::MAX_MOTORS;
use i2ris_report::statistics::{median, min_max, quantile_of_unsorted};
use nalgebra::{Matrix3, Vector3};

use super::sheet::{Problem, RecordingError};
use super::table::{ReadRow, Table};

/// Fewer rows show no pattern.
const MIN_SHOWN: usize = 50;

/// Mean squared step over twice the variance: 1 in random order, near 0 along a path, 2 end to end.
const RANDOM: std::ops::Range<f64> = 0.7..1.3;

/// Positions and motors of a calibration span more than this.
const MIN_SPAN_MM: f64 = 0.1;
const MIN_SPAN_COUNTS: f64 = 5.0;

/// A larger step is from one end of a scale of angles to the other, deg.
const MAX_ANGLE_STEP_DEG: f64 = 180.0;

/// A step is as many times the usual one (the 99th percentile) in counts, and in outputs.
const COUNT_STEP: f64 = 6.0;
const OUTPUT_STEP: f64 = 8.0;
/// Shorter steps of counts are gaps in the recording, not another zero.
const MIN_STEP_COUNTS: f64 = 30.0;
/// Share of the usual output change below which the outputs did not follow a step of counts.
const FOLLOWED: f64 = 0.25;
/// Rows on each side of a step whose medians have to differ by it.
const AROUND: usize = 5;

/// Successive equal rows that show a camera repeating itself. With a larger share of pairs of equal
/// rows, its resolution is coarse: motors must then have moved by a share of their range.
const MIN_REPEATS: usize = 5;
const COARSE: (f64, f64) = (0.002, 0.5);
/// Motors that move less during repeats are at rest, share of their range.
const MIN_MOVED: f64 = 0.03;
/// Motors that move less from row to row are at rest, share of their range. If this number and
/// share of rows at rest are equal, the camera has no noise: rows inside a gap are equal as well.
const REST: f64 = 2e-4;
const EQUAL_AT_REST: (usize, f64) = (3, 0.5);

/// Gain on one side over that on the other, and in one half over that in the other, below which it
/// is said; halves are compared if their strokes are as long as this share of each other.
const SIDE_GAIN: f64 = 0.2;
const HALF_GAIN: f64 = 0.6;
const EQUAL_STROKES: f64 = 0.8;

/// A quantile of the sizes of some numbers; 0 of none.
fn quantile(values: impl Iterator<Item = f64>, share: f64) -> f64 {
    let mut sizes: Vec<f64> = values.map(f64::abs).filter(|it| it.is_finite()).collect();
    quantile_of_unsorted(&mut sizes, share).unwrap_or_default()
}

fn span(values: impl Iterator<Item = f64>) -> f64 {
    let (low, high) = min_max(values);
    (high - low).max(0.0)
}

fn steps(values: &[f64]) -> Vec<f64> {
    values.windows(2).map(|pair| pair[1] - pair[0]).collect()
}

/// Least-squares slopes over the counts of both motors; `None` if rows do not tell them apart.
fn slopes(rows: &[([f64; MAX_MOTORS], f64)], motors: usize) -> Option<[f64; MAX_MOTORS]> {
    let count = rows.len() as f64;
    let mean =
        |value: fn(&([f64; MAX_MOTORS], f64)) -> f64| rows.iter().map(value).sum::<f64>() / count;
    let centre = Vector3::new(mean(|row| row.0[0]), mean(|row| row.0[1]), mean(|row| row.1));
    let (mut square, mut product) = (Matrix3::zeros(), Vector3::zeros());
    for (counts, output) in rows {
        let from = Vector3::new(counts[0], counts[1], *output) - centre;
        let counts = Vector3::new(from[0], from[1], 0.0);
        square += counts * counts.transpose();
        product += counts * from[2];
    }
    if motors < 2 {
        square[(1, 1)] = 1.0;
    }
    square[(2, 2)] = 1.0;
    // The motors move together: their slopes are not known apart.
    let together = square[(0, 1)].powi(2) > 0.9 * square[(0, 0)] * square[(1, 1)];
    if together && motors > 1 {
        return None;
    }
    let found = square.try_inverse()? * product;
    Some([found[0], found[1]])
}

impl Table<'_> {
    /// Refuses impossible rows, leaves repeated ones out, and notes what is strange in the others.
    pub fn check_plausible(&mut self) -> Result<(), RecordingError> {
        if self.complete().len() < MIN_SHOWN {
            return Ok(());
        }
        self.check_order()?;
        self.check_outputs()?;
        self.check_zero()?;
        self.leave_out_repeats();
        let notes = [self.output_steps(), self.gains()];
        self.notes.extend(notes.into_iter().flatten());
        Ok(())
    }

    /// Places of the rows in which nothing is empty.
    fn complete(&self) -> Vec<usize> {
        (0..self.rows.len()).filter(|place| self.rows[*place].empty.is_none()).collect()
    }

    fn column(&self, value: impl Fn(&ReadRow) -> f64) -> Vec<f64> {
        self.complete().iter().map(|place| value(&self.rows[*place])).collect()
    }

    fn counts(&self) -> Vec<Vec<f64>> {
        (0..self.layout.counts.len()).map(|motor| self.column(|row| row.counts[motor])).collect()
    }

    fn outputs(&self) -> Vec<Vec<f64>> {
        (0..self.layout.outputs.len()).map(|cell| self.column(|row| row.outputs[cell])).collect()
    }

    /// Without time nothing else says that the rows follow each other.
    fn check_order(&self) -> Result<(), RecordingError> {
        let is_random = |counts: &Vec<f64>| {
            let mean = counts.iter().sum::<f64>() / counts.len() as f64;
            let variance: f64 = counts.iter().map(|it| (it - mean).powi(2)).sum();
            let squares: f64 = steps(counts).iter().map(|it| it * it).sum();
            RANDOM.contains(&(squares / (2.0 * variance)))
        };
        let counts = self.counts();
        if self.layout.time.is_some() || !counts.iter().all(is_random) {
            return Ok(());
        }
        let step = quantile(counts.iter().flat_map(|it| steps(it)), 0.5).round();
        Err(self.error(Problem::Order { step }))
    }

    /// Angles jump by no half turn, and a snake is larger than a hair.
    fn check_outputs(&self) -> Result<(), RecordingError> {
        let (outputs, complete) = (self.outputs(), self.complete());
        for ((column, spec), values) in self.layout.outputs.iter().zip(&outputs) {
            let wrapped = steps(values).iter().position(|step| step.abs() > MAX_ANGLE_STEP_DEG);
            if let (OutputUnit::Deg, Some(at)) = (spec.unit, wrapped) {
                let (from, to) = (values[at], values[at + 1]);
                let place = self.place.line(self.rows[complete[at + 1]].line).column(&column.name);
                return Err(RecordingError::new(place, Problem::AngleWrap { from, to }));
            }
        }
        let turned = self.counts().iter().map(|it| span(it.iter().copied())).fold(0.0, f64::max);
        let is_whole = self.counts().concat().iter().all(|counts| counts.fract() == 0.0);
        if let Some(column) = self.layout.counts.first()
            && turned < MIN_SPAN_COUNTS
            && !is_whole
        {
            let place = self.place.column(&column.name);
            return Err(RecordingError::new(place, Problem::Turns { span: turned }));
        }
        let is_mm = |(_, spec): &&(_, i2ris::model::file::OutputSpec)| spec.unit == OutputUnit::Mm;
        let mm: Vec<_> = self.layout.outputs.iter().filter(is_mm).collect();
        let largest = outputs.iter().map(|it| span(it.iter().copied())).fold(0.0, f64::max);
        match mm.first() {
            Some((column, _)) if mm.len() == outputs.len() && largest < MIN_SPAN_MM => {
                let place = self.place.column(&column.name);
                Err(RecordingError::new(place, Problem::Metres { span: largest }))
            }
            _ => Ok(()),
        }
    }

    /// Refuses counts that jump where the outputs go on.
    fn check_zero(&self) -> Result<(), RecordingError> {
        let (outputs, complete) = (self.outputs(), self.complete());
        let times = self.column(|row| row.time_s.unwrap_or(f64::NAN));
        let period = quantile(steps(&times).into_iter(), 0.5);
        // Over a pause the motors may have gone far.
        let periods = |at: usize| match (times[at + 1] - times[at]) / period {
            found if found.is_finite() => found.max(1.0),
            _ => 1.0,
        };
        for (counts, column) in self.counts().iter().zip(&self.layout.counts) {
            let steps_counts = steps(counts);
            let usual = quantile(steps_counts.iter().copied(), 0.99);
            let range = span(counts.iter().copied());
            let follows = |at: usize| {
                outputs.iter().any(|values| {
                    let expected = steps_counts[at].abs() / range * span(values.iter().copied());
                    (values[at + 1] - values[at]).abs() > FOLLOWED * expected
                })
            };
            let is_step = |at: &usize| {
                let limit = (COUNT_STEP * usual).max(MIN_STEP_COUNTS) * periods(*at);
                steps_counts[*at].abs() > limit && !follows(*at)
            };
            if let Some(at) = (0..steps_counts.len()).find(is_step) {
                let line = |at: usize| self.rows[complete[at]].line;
                let problem = Problem::Zero { step: steps_counts[at], before: line(at) };
                let place = self.place.line(line(at + 1)).column(&column.name);
                return Err(RecordingError::new(place, problem));
            }
        }
        Ok(())
    }

    /// Leaves the rows out in which a camera repeats itself while the motors move.
    fn leave_out_repeats(&mut self) {
        let (complete, counts, outputs) = (self.complete(), self.counts(), self.outputs());
        let equal = |at: usize| outputs.iter().all(|values| values[at] == values[at + 1]);
        let (mut runs, mut at, mut pairs) = (Vec::new(), 0, 0);
        while at + 1 < complete.len() {
            let end = (at..complete.len() - 1).find(|at| !equal(*at)).unwrap_or(complete.len() - 1);
            match end - at + 1 {
                length if length >= MIN_REPEATS => runs.push((at, end)),
                length => pairs += length - 1,
            }
            at = end + 1;
        }
        let in_runs: usize = runs.iter().map(|(at, end)| end - at).sum();
        let moved = |(at, end): &(usize, usize)| {
            let ways = counts.iter().map(|it| span(it[*at..=*end].iter().copied()));
            ways.fold(0.0, f64::max)
        };
        let range = counts.iter().map(|it| span(it.iter().copied())).fold(0.0, f64::max);
        let resting = (0..complete.len() - 1).filter(|at| moved(&(*at, at + 1)) <= REST * range);
        let resting: Vec<bool> = resting.map(equal).collect();
        let still = resting.iter().filter(|equal| **equal).count();
        let is_coarse = pairs as f64 > COARSE.0 * (complete.len() - in_runs) as f64
            || still >= EQUAL_AT_REST.0 && still as f64 >= EQUAL_AT_REST.1 * resting.len() as f64;
        let limit = range * if is_coarse { COARSE.1 } else { MIN_MOVED };
        runs.retain(|run| moved(run) >= limit);
        let Some(first) = runs.first() else { return };
        let names: Vec<&str> = self.layout.outputs.iter().map(|it| it.0.name.as_str()).collect();
        let (names, line) = (names.join(", "), |at: usize| self.rows[complete[at]].line);
        let left_out: usize = runs.iter().map(|(at, end)| end - at).sum();
        self.notes.push(format!(
            "column `{names}`: the same values from line {} to {} while the motors moved {} \
             counts: the camera repeats itself; {left_out} row(s) of {} such place(s) are left out",
            line(first.0),
            line(first.1),
            moved(first).round(),
            runs.len()
        ));
        for place in runs.iter().flat_map(|(at, end)| &complete[at + 1..=*end]) {
            // The position stays on the path.
            self.rows[*place].outputs.fill(f64::NAN);
            self.rows[*place].empty = Some(names.clone());
        }
    }

    /// An output that steps, and stays there, while no motor steps.
    fn output_steps(&self) -> Option<String> {
        let (complete, counts) = (self.complete(), self.counts());
        let steps_counts: Vec<Vec<f64>> = counts.iter().map(|it| steps(it)).collect();
        let usual: Vec<f64> =
            steps_counts.iter().map(|it| quantile(it.iter().copied(), 0.99)).collect();
        for ((column, spec), values) in self.layout.outputs.iter().zip(self.outputs()) {
            let found = steps(&values);
            let limit = OUTPUT_STEP * quantile(found.iter().copied(), 0.99);
            let middle = |rows: &[f64]| median(&mut rows.to_vec()).unwrap_or_default();
            let lasts = |at: usize| {
                let before = &values[(at + 1).saturating_sub(AROUND)..=at];
                let after = &values[at + 1..(at + 1 + AROUND).min(values.len())];
                (middle(after) - middle(before)).abs() > 0.7 * found[at].abs()
            };
            let is_step = |at: &usize| {
                let mut motors = steps_counts.iter().zip(&usual);
                found[*at].abs() > limit
                    && limit > 0.0
                    && motors.all(|(steps, usual)| steps[*at].abs() <= *usual)
                    && lasts(*at)
            };
            if let Some(at) = (0..found.len()).find(is_step) {
                let unit = if spec.unit == OutputUnit::Deg { "deg" } else { "mm" };
                let line = |at: usize| self.rows[complete[at]].line;
                return Some(format!(
                    "column `{}`: a step of {:.2} {unit} between lines {} and {} that no motor \
                     made: if the camera was moved there, cut the recording there",
                    column.name,
                    found[at],
                    line(at),
                    line(at + 1)
                ));
            }
        }
        None
    }

    /// A motor that an output follows on one side only, or less in one half of the recording.
    fn gains(&self) -> Option<String> {
        let (complete, counts, outputs) = (self.complete(), self.counts(), self.outputs());
        let motors = counts.len();
        let at = |place: usize| std::array::from_fn(|it| counts.get(it).map_or(0.0, |c| c[place]));
        for motor in 0..motors {
            let (low, high) = min_max(counts[motor].iter().copied());
            let gain = |values: &[f64], part: &dyn Fn(usize) -> bool| {
                let rows = (0..complete.len()).filter(|place| part(*place));
                let rows: Vec<_> = rows.map(|place| (at(place), values[place])).collect();
                let found = slopes(&rows, motors).filter(|_| rows.len() >= MIN_SHOWN / 2)?;
                let stroke = span(rows.iter().map(|row| row.0[motor]));
                Some((found[motor], stroke))
            };
            let all = |_: usize| true;
            let effect = |values: &Vec<f64>| gain(values, &all).map_or(0.0, |it| it.0.abs());
            let (output, values) =
                outputs.iter().enumerate().max_by(|a, b| effect(a.1).total_cmp(&effect(b.1)))?;
            if effect(values) * (high - low) < 0.3 * span(values.iter().copied()) {
                continue;
            }
            let name = [&self.layout.outputs[output].0.name, &self.layout.counts[motor].name];
            let half = complete.len() / 2;
            let parts = (gain(values, &|it| it < half), gain(values, &|it| it >= half));
            if let (Some((first, a)), Some((second, b))) = parts
                && a.min(b) > EQUAL_STROKES * a.max(b)
                && first.abs().min(second.abs()) < HALF_GAIN * first.abs().max(second.abs())
            {
                return Some(format!(
                    "column `{}`: follows `{}` {:.1} times as far from line {} on: if a motor \
                     slips or the camera was changed there, fit the parts apart",
                    name[0],
                    name[1],
                    second / first,
                    self.rows[complete[half]].line
                ));
            }
            // Play blurs where the sides meet.
            let (middle, apart) = (f64::midpoint(low, high), 0.15 * (high - low));
            let below = gain(values, &|place| counts[motor][place] < middle - apart);
            let above = gain(values, &|place| counts[motor][place] > middle + apart);
            if let (Some((below, _)), Some((above, _))) = (below, above)
                && below.abs().min(above.abs()) < SIDE_GAIN * below.abs().max(above.abs())
            {
                let side = if below.abs() < above.abs() { "below" } else { "above" };
                return Some(format!(
                    "column `{}`: hardly follows `{}` {side} {middle:.0} counts ({:.0} % of the \
                     gain on the other side): look for a broken or slack wire, or a stop",
                    name[0],
                    name[1],
                    100.0 * below.abs().min(above.abs()) / below.abs().max(above.abs())
                ));
            }
        }
        None
    }
}
