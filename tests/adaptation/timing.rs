//! Time of a tick with adaptation, with and without a frame.

use i2ris_calibration::fit::Family;

use crate::ageing::Ageing;
use crate::fitted::model;
use crate::plant::SNAKES;
use crate::trial::{ON, Trial};

/// Microseconds at p50, p99 and at most.
fn percentiles(mut times: Vec<f64>) -> [f64; 3] {
    times.sort_by(f64::total_cmp);
    let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize];
    [at(0.5), at(0.99), at(1.0)]
}

#[test]
#[ignore = "a table of times, for people"]
fn table_of_times() {
    for family in [Family::GmrPlay, Family::GmrStop] {
        let model = model(SNAKES[0], family, Ageing::NONE);
        for (name, table, seconds) in [("off", "", 20.0), ("on", ON, 20.0)] {
            let mut trial = Trial::new(table, SNAKES[0], &model, Ageing::NONE);
            trial.move_for(5.0);
            trial.times = Some(Vec::new());
            trial.move_for(seconds);
            let times = trial.times.take().unwrap();
            let of = |with_frame: bool| {
                let chosen = times.iter().filter(|(frame, _)| *frame == with_frame);
                percentiles(chosen.map(|(_, time)| *time).collect())
            };
            println!(
                "{family} {name}: tick {:.1?} us, with a frame {:.1?} us",
                of(false),
                of(true)
            );
        }
    }
}
