//! Further starts of `force-balance`: shipped and drawn snakes, and an earlier calibration.
//!
//! The own starts run as without them. A further one is taken only if it explains the held-out rows
//! better, which no search saw, and blocks left out (surely) or the training rows agree.

use i2ris::model::file::{FamilyParameters, ModelFile};
use i2ris::model::hysteresis::force_balance::BalanceParameters;

use super::metrics::{Evidence, block_errors, predictions, rms};
use super::one_family::FamilyFitter;
use super::options::{Choice, Family};
use super::outcome::{FamilyOutcome, FitError};
use crate::families::force_balance::judge::{SURE, is_better};
use crate::families::force_balance::search::{SHIPPED_STARTS, Start};
use crate::recording::Recording;

/// Others are tried where the model leaves more than this many times the noise: shipped ones for at
/// most this many training rows (each costs half of the own ones together), beyond it a drawn one.
const ABOVE_NOISE: f64 = 1.1;
const MAX_SHIPPED_ROWS: usize = 4000;
const DRAWN: u64 = 1;
/// Error on the training rows at which a drawn start is taken, relative to the own ones.
const LOWER: f64 = 0.98;

/// The balance of an earlier model. Fails if it cannot be a start: its family or its number of
/// motors or outputs differs, or no force balance is fitted.
pub(super) fn balance_of<'a>(
    earlier: &'a ModelFile,
    recording: &Recording,
    choice: Choice,
) -> Result<&'a BalanceParameters, FitError> {
    let refused = |reason: String| Err(FitError::Earlier(reason));
    let FamilyParameters::ForceBalance { balance, .. } = &earlier.family else {
        return refused("its family is not `force-balance`".to_owned());
    };
    if !choice.includes(Family::ForceBalance) {
        return refused(format!("its family is `force-balance`, and `{choice}` is to be fitted"));
    }
    for (what, found, wanted) in [
        ("motor", balance.motors.len(), recording.motors()),
        ("output", earlier.outputs.len(), recording.outputs().len()),
    ] {
        if found != wanted {
            return refused(format!("it has {found} {what}(s), the recording {wanted}"));
        }
    }
    Ok(balance)
}

/// Held-out error of the own model and of another search, SI units, and which was taken.
pub(super) struct Judgement {
    is_taken: bool,
    own: Option<f64>,
    found: Option<f64>,
}

/// Takes what shipped or drawn starts lead to in place of the own model where that is better.
pub(super) fn try_others(
    own: &mut FamilyOutcome,
    fitter: &mut FamilyFitter<'_>,
    evidence: &Evidence<'_>,
) {
    let is_short = fitter.context.training.len() <= MAX_SHIPPED_ROWS;
    let is_poor = |own: &FamilyOutcome| {
        errors(own, evidence).is_none_or(|errors| rms(&errors) > ABOVE_NOISE * evidence.noise)
    };
    for index in 0..if is_short { SHIPPED_STARTS } else { 0 } {
        if is_poor(own) {
            fitter.start = Start::Shipped(index);
            take_better(own, fitter.attempt(Family::ForceBalance), evidence);
        }
    }
    // Rows of one motor at a time do not show which start is better.
    if !is_short && !evidence.hides_plane && is_poor(own) {
        fitter.start = Start::Drawn(DRAWN);
        let found = fitter.attempt(Family::ForceBalance);
        let training = [fitter.context.training.to_vec()];
        let on_training = Evidence { rows: &training, ..*evidence };
        let error = |outcome, evidence| errors(outcome, evidence).map(|errors| rms(&errors));
        let is_lower = |evidence, part: f64| match (error(own, evidence), error(&found, evidence)) {
            (Some(own), Some(found)) => found < part * own,
            (own, found) => own.is_none() && found.is_some(),
        };
        let is_taken = is_lower(evidence, 1.0) && is_lower(&on_training, LOWER);
        take(own, found, is_taken);
    }
}

fn take(own: &mut FamilyOutcome, found: FamilyOutcome, is_taken: bool) {
    let seconds = own.seconds + found.seconds;
    if is_taken {
        *own = found;
    }
    own.seconds = seconds;
}

/// Takes what another search has found if the rows held out show that it is better.
pub(super) fn take_better(
    own: &mut FamilyOutcome,
    found: FamilyOutcome,
    evidence: &Evidence<'_>,
) -> Judgement {
    let (before, after) = (errors(own, evidence), errors(&found, evidence));
    let is_taken = match (&before, &after) {
        (Some(before), Some(after)) => {
            // Few blocks alone are seldom sure.
            let has_more = own.left_out.len() == found.left_out.len();
            let all = |left_out: &[f64], errors: &[f64]| match has_more {
                true => [left_out, errors].concat(),
                false => errors.to_vec(),
            };
            let [own, found] = [all(&own.left_out, before), all(&found.left_out, after)];
            rms(after) < rms(before) && is_better([&own, &found], SURE, 0.0)
        }
        (before, after) => before.is_none() && after.is_some(),
    };
    take(own, found, is_taken);
    let [own, found] = [before, after].map(|errors| errors.map(|errors| rms(&errors)));
    Judgement { is_taken, own, found }
}

/// Mean square error of a model on every block held out, if there is one.
fn errors(outcome: &FamilyOutcome, evidence: &Evidence<'_>) -> Option<Vec<f64>> {
    let &Evidence { recording, rows, .. } = evidence;
    let model = outcome.result.as_ref().ok()?;
    Some(block_errors(&predictions(model, recording), recording, rows))
}

impl Judgement {
    pub fn note(&self, earlier: &ModelFile, recording: &Recording) -> String {
        let unit = recording.outputs().first().map(|output| output.unit);
        let shown = |error: Option<f64>| match (error, unit) {
            (Some(error), Some(unit)) => format!("{:.3} {unit}", error / unit.si()),
            _ => "no model".to_owned(),
        };
        let seen = earlier.training.data_sha256.contains(recording.sha256());
        format!(
            "the earlier calibration is one more start, and is {} (held out {}, own starts {}){}",
            if self.is_taken { "taken" } else { "not surely better" },
            shown(self.found),
            shown(self.own),
            if seen { "; it was fitted to these rows, so they do not test it" } else { "" }
        )
    }
}

#[cfg(test)]
mod tests {
    use i2ris::model::hysteresis::Operator;
    use i2ris::model::hysteresis::force_balance::{
        BalanceMotor, BalanceStop, ForceBalance, PER_MOTOR, REACH, USUAL_TURN,
    };
    use nalgebra::SVector;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    use super::*;
    use crate::fit::split::HoldOut;
    use crate::fit::{FitOptions, FitOutcome, fit};
    use crate::progress::Silent;
    use crate::testing::{assert_contains, one_motor, wander};

    /// A snake of one motor: preload, gap, friction, friction by tension, spring.
    fn balance([preload, gap, friction, by_tension, spring]: [f64; 5]) -> BalanceParameters {
        let mut motor = BalanceMotor::new(0.0, REACH / 450.0, &[0.0; PER_MOTOR]);
        (motor.gap, motor.preload) = (gap, [preload, 0.5 * preload]);
        (motor.stiffness, motor.spring, motor.hardening) = ([1.0; 2], spring, 0.02);
        (motor.friction, motor.friction_by_tension) = (friction, [by_tension, 0.5 * by_tension]);
        (motor.friction_growth, motor.preload_growth) = ([0.5, 0.0], 20.0);
        let stops =
            [(3.0, 0.1), (10.0, 0.3), (4.0, 0.2), (1.6, 0.2), (0.6, 0.1), (0.25, 0.1)].into_iter();
        let stop =
            |(place, (stiffness, share))| BalanceStop { stiffness, share, yields: place == 0 };
        BalanceParameters {
            motors: vec![motor],
            own_stops: stops.enumerate().map(stop).collect(),
            shared_stops: Vec::new(),
            shared_growth: 0.0,
            loose_stiffness: 0.08,
            softness: 8.0,
            friction_stays: 0.2,
            creep: [0.0; 3],
            counts_per_turn: USUAL_TURN,
        }
    }

    fn recording(balance: &BalanceParameters, seed: u64) -> Recording {
        let operator = ForceBalance::<1>::prepare(balance).unwrap();
        let at = |time| SVector::from([wander(time)[0]]);
        let (mut state, mut random) = (operator.begin(&at(0.0)), Pcg64::seed_from_u64(seed));
        one_motor(200, |time| {
            operator.advance(&mut state, &at(time));
            let bend = operator.bend(&state)[0] / REACH;
            let noise: f64 = (0..12).map(|_| random.random::<f64>() - 0.5).sum();
            (wander(time)[0], 30.0 * bend + 2.0 * bend * bend + 0.02 * noise)
        })
    }

    fn fitted(recording: &Recording, earlier: Option<&ModelFile>) -> FitOutcome {
        let choice = Choice::One(Family::ForceBalance);
        let options = FitOptions { choice, earlier: earlier.cloned(), ..FitOptions::default() };
        fit(recording, &options, &Silent).unwrap()
    }

    const USUAL: [f64; 5] = [-20.0, 16.0, 45.0, 0.2, 0.15];

    /// Two snakes that the own starts may miss, by friction growing with tension or a wide gap.
    #[test]
    fn earlier_calibration_helps_or_changes_nothing() {
        let mut least: f64 = 1.0;
        for (snake, seed) in
            [([200.0, 20.0, 20.0, 0.8, 0.1], 4), ([-30.0, 300.0, 30.0, 0.3, 0.2], 7)]
        {
            let recording = recording(&balance(snake), seed);
            let own = fitted(&recording, None);
            let held_out =
                |found: &FitOutcome| found.model.file().metrics[0].held_out.unwrap().rmsd;
            for start in [snake, USUAL] {
                let mut earlier = own.model.file().clone();
                match &mut earlier.family {
                    FamilyParameters::ForceBalance { balance: old, .. } => *old = balance(start),
                    _ => panic!("another family"),
                }
                let found = fitted(&recording, Some(&earlier));
                let note = found.families[1].note.clone().unwrap();
                match found.model.id() == own.model.id() {
                    true => assert_contains(&note, &["not surely better"]),
                    false => assert!(held_out(&found) < held_out(&own), "{note}"),
                }
                if start == snake {
                    least = least.min(held_out(&found) / held_out(&own));
                }
            }
        }
        assert!(least < 0.5, "{least}");
    }

    #[test]
    fn unsuitable_earlier_calibration_is_refused() {
        let recording = recording(&balance(USUAL), 1);
        let of = |choice, hold_out, earlier: &ModelFile| {
            let earlier = Some(earlier.clone());
            let options = FitOptions { choice, hold_out, earlier, ..FitOptions::default() };
            fit(&recording, &options, &Silent).unwrap_err()
        };
        let linear = FitOptions { choice: Choice::One(Family::Linear), ..FitOptions::default() };
        let mut file = fit(&recording, &linear, &Silent).unwrap().model.file().clone();
        let (choice, blocks) = (Choice::One(Family::ForceBalance), HoldOut::Blocks);
        assert_contains(&of(choice, blocks, &file), &["family is not `force-balance`", "--model"]);
        let FamilyParameters::ForceBalance { read_out, virtual_hull, .. } =
            fitted(&recording, None).model.file().family.clone()
        else {
            panic!("another family")
        };
        let mut two = balance(USUAL);
        two.motors.push(two.motors[0].clone());
        file.family = FamilyParameters::ForceBalance { balance: two, read_out, virtual_hull };
        assert_contains(&of(choice, blocks, &file), &["it has 2 motor(s), the recording 1"]);
        assert_contains(&of(choice, HoldOut::Nothing, &file), &["needs held-out rows"]);
        assert_contains(&of(linear.choice, blocks, &file), &["`linear` is to be fitted"]);
    }
}
