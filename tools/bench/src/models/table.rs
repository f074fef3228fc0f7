//! Figures over the snakes that age.

use std::fmt::Write as _;

use i2ris_report::statistics::median;

use super::measures::Steps;
use super::subject::Judgement;

/// Median and worst of a figure over the draws.
fn spread(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let mut values: Vec<f64> = values.collect();
    let worst = values.iter().copied().fold(f64::NAN, f64::max);
    [median(&mut values).unwrap_or(f64::NAN), worst]
}

pub fn line(judged: &Judgement) -> String {
    let worn = &judged.worn;
    let back = judged.slip_back_s.map_or("not back".to_owned(), |s| format!("back in {s:.0} s"));
    let mut text = format!(
        "{}:{} {}: worn {:.3} -> {:.3} (fresh {:.3}); steady {:.3} -> {:.3}; slipped {:.3} -> \
         {:.3}, {back}; reached {:.0} % -> {:.0} %",
        judged.physics,
        judged.seed,
        judged.family,
        worn.not_adapted,
        worn.adapted,
        worn.fresh,
        judged.steady[0],
        judged.steady[1],
        judged.slipped[0],
        judged.slipped[1],
        100.0 * judged.steps[0].reached,
        100.0 * judged.steps[1].reached,
    );
    if let Some(drift) = &judged.drift {
        let _ = write!(
            text,
            "; {} h: first {:.3}, {:.3} -> {:.3}",
            drift.hours, drift.first, drift.not_adapted, drift.adapted
        );
    }
    if judged.taken_back > 0 {
        let _ = write!(text, "; taken back {} times", judged.taken_back);
    }
    text
}

pub fn table(judgements: &[Judgement]) -> String {
    let mut physics: Vec<&str> = judgements.iter().map(|it| it.physics.as_str()).collect();
    physics.dedup();
    let mut text = String::from(
        "RMS error of the tip, deg, without and with adaptation, medians over the snakes, and the \
         worst in brackets.\n`/ fresh`: with adaptation against a calibration of the worn snake. \
         `back`: s after a slip of 1 deg. Steps: s to\nwithin 0.15 deg on the worn snake, p50 and \
         p95.\n\n",
    );
    let _ = writeln!(
        text,
        "{:<18} {:>4} {:>7} {:>7} {:>7} {:>13} {:>7} {:>15} {:>11} {:>13} {:>13} {:>20}",
        "physics",
        "runs",
        "worn",
        "adapted",
        "fresh",
        "/ fresh",
        "steady",
        "cost",
        "back",
        "steps without",
        "steps with",
        "hours of drift",
    );
    for name in physics {
        let of: Vec<&Judgement> = judgements.iter().filter(|it| it.physics == name).collect();
        row(&mut text, name, &of);
    }
    row(&mut text, "all", &judgements.iter().collect::<Vec<_>>());
    text
}

fn row(text: &mut String, name: &str, of: &[&Judgement]) {
    let each = |figure: &dyn Fn(&Judgement) -> f64| spread(of.iter().map(|judged| figure(judged)));
    let [without, _] = each(&|it| it.worn.not_adapted);
    let [adapted, _] = each(&|it| it.worn.adapted);
    let [fresh, _] = each(&|it| it.worn.fresh);
    let [ratio, worst_ratio] = each(&|it| it.worn.adapted / it.worn.fresh);
    let [steady, _] = each(&|it| it.steady[0]);
    let [cost, worst_cost] = each(&|it| it.steady[1] - it.steady[0]);
    let [back, worst_back] = each(&|it| it.slip_back_s.unwrap_or(f64::INFINITY));
    let steps = |which: usize| {
        let of = |figure: &dyn Fn(&Steps) -> f64| each(&|it| figure(&it.steps[which]))[0];
        format!("{:.2} {:.2}", of(&|it| it.p50_s), of(&|it| it.p95_s))
    };
    let mut drifts = of.iter().filter_map(|it| it.drift.as_ref());
    let drift = drifts.next().map_or(String::new(), |drift| {
        format!("{:.3} {:.3} -> {:.3}", drift.first, drift.not_adapted, drift.adapted)
    });
    let _ = writeln!(
        text,
        "{name:<18} {:>4} {without:>7.3} {adapted:>7.3} {fresh:>7.3} {:>13} {steady:>7.3} {:>15} \
         {:>11} {:>13} {:>13} {drift:>20}",
        of.len(),
        format!("{ratio:.2} ({worst_ratio:.2})"),
        format!("{cost:+.3} ({worst_cost:+.3})"),
        format!("{back:.0} ({worst_back:.0})"),
        steps(0),
        steps(1),
    );
}
