//! Goal against estimate and camera, while the robot followed commands.

use super::summary::{Spread, Tracked};
use super::trial::Trial;
use i2ris_plot::series::{Series, percentile};

/// Goals further apart than this are not brought together: the controller tells one every tick.
const GAP_NS: u64 = 60_000_000;

/// An error: when, s, and in pitch and yaw, degrees.
pub type Error = (f64, [f64; 2]);

/// What was seen minus what was asked, at every instant at which something was seen.
pub fn errors(trial: &Trial, seen: &Series<2>) -> Vec<Error> {
    seen.iter()
        .filter(|(stamp, _)| trial.followed_at(*stamp))
        .filter_map(|(stamp, seen)| {
            let goal = trial.goal.at(*stamp, GAP_NS)?;
            Some((
                trial.seconds(*stamp),
                [seen[0] - goal[0], seen[1] - goal[1]],
            ))
        })
        .collect()
}

/// The numbers of errors; `None` without any.
pub fn tracked(errors: &[Error]) -> Option<Tracked> {
    let count = errors.len();
    let rms = |square: &dyn Fn(&[f64; 2]) -> f64| {
        (errors.iter().map(|(_, error)| square(error)).sum::<f64>() / count as f64).sqrt()
    };
    let mut lengths: Vec<f64> = errors
        .iter()
        .map(|(_, error)| error[0].hypot(error[1]))
        .collect();
    lengths.sort_by(f64::total_cmp);
    (count > 0).then(|| Tracked {
        samples: count as u64,
        pitch_rms_deg: rms(&|error| error[0] * error[0]),
        yaw_rms_deg: rms(&|error| error[1] * error[1]),
        length_rms_deg: rms(&|error| error[0] * error[0] + error[1] * error[1]),
        length: Spread {
            p50: percentile(&lengths, 0.5),
            p90: percentile(&lengths, 0.9),
            p99: percentile(&lengths, 0.99),
            max: percentile(&lengths, 1.0),
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_was_followed_counts_and_a_delay_is_an_error() {
        let mut trial = Trial::default();
        for ms in 0..2000u64 {
            let t = ms as f64 * 1e-3;
            trial.goal.push(ms * 1_000_000, [10.0 * t, 0.0]);
        }
        let mut seen = Series::default();
        (100..1900u64)
            .for_each(|ms| seen.push(ms * 1_000_000, [10.0 * (ms as f64 * 1e-3 - 0.02), 0.1]));
        let all = tracked(&errors(&trial, &seen)).unwrap();
        assert_eq!(all.samples, 1800);
        assert!((all.pitch_rms_deg - 0.2).abs() < 1e-9 && (all.yaw_rms_deg - 0.1).abs() < 1e-9);
        assert!(
            (all.length_rms_deg - 0.05_f64.sqrt()).abs() < 1e-9
                && (all.length.p99 - 0.05_f64.sqrt()).abs() < 1e-9
        );
        // Disabled from the start: nothing was followed.
        trial.states.push(Default::default());
        assert!(tracked(&errors(&trial, &seen)).is_none());
    }
}
