//! How well a robot that drifts is tracked.

use i2ris_calibration::fit::Family;

use super::fitted::{first_model, model};
use super::trial::{ON, SNAKES, Trial, aged};

#[test]
fn an_aged_snake_is_tracked_nearly_as_well_as_a_new_one_and_a_new_one_no_worse() {
    let model = first_model();
    let errors = [vec![], aged()].map(|ageing| {
        ["", ON].map(|table| {
            let mut trial = Trial::new(table, SNAKES[0], &model, &ageing);
            trial.move_for(50.0);
            trial.move_for(30.0)
        })
    });
    let [[new, new_adapted], [aged, aged_adapted]] = errors;
    println!("new {new:.3}, adapted {new_adapted:.3}; aged {aged:.3}, adapted {aged_adapted:.3}");
    assert!(new_adapted <= new + 0.02);
    assert!(aged > 2.5 * new, "{aged}");
    assert!(aged_adapted < 1.6 * new, "{aged_adapted}");
}

#[test]
#[ignore = "a table of some minutes, for people"]
fn table_of_errors() {
    for family in [Family::GmrPlay, Family::GmrPrandtlIshlinskii, Family::GmrStop] {
        for snake in SNAKES {
            let model = model(snake, family);
            for (name, ageing) in [("none", vec![]), ("aged", aged())] {
                let mut off = Trial::new("", snake, &model, &ageing);
                off.move_for(60.0);
                let off = off.move_for(60.0);
                let mut on = Trial::new(ON, snake, &model, &ageing);
                let first = on.move_for(20.0);
                on.move_for(40.0);
                let last = on.move_for(60.0);
                println!(
                    "{family} {snake} {name}: off {off:.3}, on first {first:.3}, last {last:.3}"
                );
                let report = on.adaptation();
                println!("   est {:.3?}\n   app {:.3?}", report.estimate, report.applied);
                println!(
                    "   {:?} used {:.2} err {:.3} {:.3} {:?}",
                    report.frames,
                    report.total_used,
                    report.calibrated_error.to_degrees(),
                    report.adapted_error.to_degrees(),
                    report.pauses.iter().collect::<Vec<_>>()
                );
            }
        }
    }
}
