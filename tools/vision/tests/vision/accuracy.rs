//! The accuracy that is promised, on a sample of synthetic images that is small enough for every
//! test run. `i2ris vision accuracy` measures the whole table.

use i2ris_vision::accuracy::{AccuracyRow, clear, cluttered, conditions, rigs, stereo};

fn rows(which: impl Fn(&str) -> bool) -> Vec<AccuracyRow> {
    let rows: Vec<AccuracyRow> =
        conditions().iter().filter(|c| which(&c.name)).map(|c| clear(c, 12, 11)).collect();
    assert!(rows.len() >= 3, "the names of the conditions have changed");
    rows
}

#[test]
fn light_blur_and_noise() {
    for row in rows(|name| name.contains("light")) {
        assert_eq!(row.good, row.frames, "{row:?}");
        assert!(row.bias_deg.abs() <= 0.05 && row.std_deg <= 0.05 && row.tip_um <= 5.0, "{row:?}");
    }
}

#[test]
fn strong_blur_and_noise() {
    for row in rows(|name| name.contains("strong")) {
        assert!(row.good >= row.frames - 1, "{row:?}");
        assert!(row.bias_deg.abs() <= 0.2 && row.std_deg <= 0.2 && row.tip_um <= 5.0, "{row:?}");
        assert!(row.claimed_deg > 0.5 * row.std_deg, "claims to be better than it is: {row:?}");
    }
}

/// Two views together, both axes bent: perspective and the bend towards the other camera are taken
/// out.
#[test]
fn both_axes_at_once() {
    for (name, rig) in
        rigs().iter().filter(|(name, _)| name.contains("turned") || name.contains("strong"))
    {
        let row = stereo(name, rig, 8, 11).unwrap();
        let limit = if name.contains("strong") { 0.2 } else { 0.05 };
        assert_eq!(row.good, row.frames, "{row:?}");
        assert!(
            row.bias_deg.abs() <= limit && row.std_deg <= limit && row.tip_um <= 5.0,
            "{row:?}"
        );
    }
}

#[test]
fn clutter_never_makes_a_confident_wrong_value() {
    let outcome = cluttered(300, 5);
    assert!(outcome.wrong.is_empty(), "{outcome:?}");
    // A detector that never says anything would pass the first check.
    assert!(outcome.good >= 50, "{outcome:?}");
    assert_eq!(outcome.good + outcome.issues.values().sum::<usize>(), outcome.frames);
}
