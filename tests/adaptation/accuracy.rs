//! How well a robot that drifts is tracked.

use super::fitted::first_model;
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
    // 0.08 deg when it is new, where plays have 0.36: they came to 1.6 times that.
    assert!(aged_adapted < 3.0 * new, "{aged_adapted}");
}
