//! Median and worst over the draws.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use i2ris_report::statistics::median;

use super::judge::Judgement;
use super::tracking::Tracking;

/// One row of the table: physics, family, motion.
type Row<'a> = (&'a str, &'a str, &'a str);

/// All motions, or all physics, together.
const ALL: &str = "all";

/// Median and worst of a figure over the draws. A robot that did not follow is worse than every
/// number.
pub(super) fn spread(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let mut values: Vec<f64> = values.collect();
    let worst = values.iter().copied().fold(f64::NAN, f64::max);
    [median(&mut values).unwrap_or(f64::NAN), worst]
}

/// One line for a snake: its families over all motions.
pub fn line(judgements: &[Judgement]) -> String {
    let mut families: BTreeMap<&str, Vec<&Judgement>> = BTreeMap::new();
    for judgement in judgements {
        families.entry(&judgement.family).or_default().push(judgement);
    }
    let mut parts = Vec::new();
    for (family, judged) in families {
        let first = judged[0];
        let named = if first.model == family {
            family.to_owned()
        } else {
            format!("{family} ({})", first.model)
        };
        let rms = mean_square(judged.iter().map(|judged| rms(judged.tracking.as_ref())));
        parts.push(format!("{named} {rms:.3} deg in {:.1} s", first.fit_s));
    }
    let exact = judgements.iter().map(|judged| judged.exact.rms_deg);
    parts.push(format!("exact {:.3} deg", mean_square(exact)));
    parts.join("; ")
}

fn mean_square(values: impl Iterator<Item = f64>) -> f64 {
    let squares: Vec<f64> = values.map(|value| value * value).collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

fn rms(tracking: Option<&Tracking>) -> f64 {
    tracking.map_or(f64::INFINITY, |tracking| tracking.rms_deg)
}

/// The whole table: by physics, family and motion, and each of them together.
pub fn table(judgements: &[Judgement]) -> String {
    let mut rows: BTreeMap<Row<'_>, Vec<&Judgement>> = BTreeMap::new();
    for judged in judgements {
        let family = judged.family.as_str();
        for physics in [judged.physics.as_str(), ALL] {
            for motion in [judged.motion.as_str(), ALL] {
                let row = (physics, family, motion);
                rows.entry(row).or_default().push(judged);
            }
        }
    }
    let mut text = String::from(
        "2-D RMS of the tip, deg; `below`: less than linear; travel: of both motors, relative to \
         exact\n\n",
    );
    let _ = writeln!(
        text,
        "{:<18} {:<14} {:<14} {:>5} {:>8} {:>8} {:>7} {:>7} {:>8} {:>8} {:>7} {:>7}",
        "physics",
        "family",
        "motion",
        "runs",
        "median",
        "worst",
        "below",
        "least",
        "exact",
        "worst",
        "travel",
        "most",
    );
    let is_all = |row: &Row<'_>| row.0 == ALL;
    let (together, single): (Vec<_>, Vec<_>) = rows.iter().partition(|(row, _)| is_all(row));
    for (row, judged) in single.into_iter().chain(together) {
        write_row(&mut text, *row, judged);
    }
    text
}

fn write_row(text: &mut String, (physics, family, motion): Row<'_>, judged: &[&Judgement]) {
    let each = |figure: &dyn Fn(&Judgement) -> f64| spread(judged.iter().map(|it| figure(it)));
    let [error, worst] = each(&|it| rms(it.tracking.as_ref()));
    let [exact, worst_exact] = each(&|it| it.exact.rms_deg);
    let [left, most_left] = each(&|it| rms(it.tracking.as_ref()) / rms(it.linear.as_ref()));
    let [travel, most_travel] = each(&|it| {
        let tracking = it.tracking.as_ref();
        tracking.map_or(f64::INFINITY, |t| t.travel_counts_s / it.exact.travel_counts_s)
    });
    let below = |left: f64| 100.0 * (1.0 - left);
    let _ = writeln!(
        text,
        "{physics:<18} {family:<14} {motion:<14} {:>5} {error:>8.3} {worst:>8.3} {:>6.1}% {:>6.1}% \
         {exact:>8.3} {worst_exact:>8.3} {travel:>7.2} {most_travel:>7.2}",
        judged.len(),
        below(left),
        below(most_left),
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judgement(physics: &str, rms_deg: Option<f64>) -> Judgement {
        let tracking = |rms_deg| Tracking { rms_deg, travel_counts_s: 100.0 * rms_deg };
        Judgement {
            physics: physics.to_owned(),
            seed: 1,
            family: "best".to_owned(),
            model: "force-balance".to_owned(),
            fit_s: 1.0,
            motion: "circle".to_owned(),
            tracking: rms_deg.map(tracking),
            linear: Some(tracking(2.0)),
            exact: tracking(0.1),
        }
    }

    fn row(table: &str, physics: &str) -> Vec<String> {
        let of = |line: &&str| line.starts_with(physics) && line.contains("circle");
        let line = table.lines().find(of).unwrap();
        line.split_whitespace().map(str::to_owned).collect()
    }

    #[test]
    fn median_and_worst_are_over_the_draws() {
        let of = |rms| judgement("gear", Some(rms));
        let table = table(&[of(0.2), of(0.3), of(1.0)]);
        let expected = "gear best circle 3 0.300 1.000 85.0% 50.0% 0.100 0.100 3.00 10.00";
        assert_eq!(row(&table, "gear").join(" "), expected);
    }

    #[test]
    fn a_robot_that_does_not_follow_is_the_worst() {
        let table = table(&[judgement("gear", Some(0.2)), judgement("gear", None)]);
        assert_eq!(row(&table, "all")[5], "inf");
    }
}
