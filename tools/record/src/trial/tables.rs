//! The numbers of a study as CSV: what was measured, what was compared, every target.

use super::comparison::{MadeWith, Measure, Row, StudyReport};
use super::workload::SCALES;

/// An empty cell: not known.
fn cell(value: Option<f64>) -> String {
    value.map_or(String::new(), |it| it.to_string())
}

fn table(rows: impl IntoIterator<Item = Vec<String>>) -> Result<Vec<u8>, csv::Error> {
    let mut csv = csv::Writer::from_writer(Vec::new());
    rows.into_iter().try_for_each(|row| csv.write_record(row))?;
    csv.into_inner().map_err(|error| error.into_error().into())
}

fn header<'a>(names: impl IntoIterator<Item = &'a str>) -> Vec<String> {
    names.into_iter().map(str::to_owned).collect()
}

impl StudyReport {
    /// The tables, by the end of their file names.
    pub fn tables(&self) -> Result<[(&'static str, Vec<u8>); 3], csv::Error> {
        Ok([
            ("", table(self.trial_rows())?),
            ("-effects", table(self.effect_rows())?),
            ("-targets", table(self.target_rows())?),
        ])
    }

    fn trial_rows(&self) -> Vec<Vec<String>> {
        let fixed =
            ["trial", "participant", "condition", "started", "outcome", "marks", "left_out"];
        let scales = SCALES.map(|(name, ..)| name);
        let measures = Measure::ALL.map(Measure::name);
        let names = fixed.into_iter().chain(MadeWith::NAMES).chain(measures).chain(scales);
        let mut rows = vec![header(names)];
        for trial in &self.trials {
            let outcome = trial.outcome.map(|outcome| format!("{outcome:?}").to_lowercase());
            let mut row = vec![
                trial.name.clone(),
                trial.participant.clone(),
                trial.condition.clone(),
                trial.started.clone(),
                outcome.unwrap_or_default(),
                trial.marks.to_string(),
                trial.left_out.clone().unwrap_or_default(),
            ];
            row.extend(trial.made_with.cells());
            row.extend(trial.values.map(cell));
            let answers = trial.workload.map(|workload| workload.0.map(f64::from).map(Some));
            row.extend(answers.unwrap_or_default().map(cell));
            rows.push(row);
        }
        rows
    }

    fn effect_rows(&self) -> Vec<Vec<String>> {
        let names = "measure,condition,mean,difference,low_95,high_95,participants";
        let mut rows = vec![header(names.split(','))];
        for Row { measure, means, effects, .. } in &self.rows {
            for (condition, (mean, effect)) in self.conditions.iter().zip(means.iter().zip(effects))
            {
                let interval = effect.as_ref().and_then(|effect| effect.interval);
                let numbers = [
                    *mean,
                    effect.as_ref().map(|effect| effect.difference),
                    interval.map(|[low, _]| low),
                    interval.map(|[_, high]| high),
                    effect.as_ref().map(|effect| effect.differences.len() as f64),
                ];
                let mut row = vec![measure.name().to_owned(), condition.clone()];
                row.extend(numbers.map(cell));
                rows.push(row);
            }
        }
        rows
    }

    fn target_rows(&self) -> Vec<Vec<String>> {
        let names = "trial,target,t_s,from_pitch_deg,from_yaw_deg,to_pitch_deg,to_yaw_deg,\
                     distance_deg,arrived_s,held_s,overshoot_deg,detour";
        let mut rows = vec![header(names.split(','))];
        for trial in &self.trials {
            for target in &trial.targets {
                let [[a, b], [c, d]] = [target.from_deg, target.to_deg];
                let mut row = vec![trial.name.clone(), target.number.to_string()];
                row.extend([target.t_s, a, b, c, d, target.distance_deg].map(Some).map(cell));
                row.extend([target.arrived_s, target.held_s].map(cell));
                row.extend([target.overshoot_deg, target.detour].map(Some).map(cell));
                rows.push(row);
            }
        }
        rows
    }
}
