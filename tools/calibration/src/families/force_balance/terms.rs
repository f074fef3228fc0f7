//! The terms that not every snake has, each only where blocks that are left out show it.

use i2ris::model::hysteresis::force_balance::{CREEPING, USUAL_TURN};

use super::judge::{Judge, ONE_OF, SURE, is_better, mean};
use super::layout::Terms;
use super::levenberg_marquardt::{StoppingRule, minimise};
use super::search::{ALIKE_HELD_OUT, FOLD, Place, Search};
use crate::parallel;

/// When the search with another term ends.
const TERM: StoppingRule = StoppingRule { iterations: 8, tolerance: 2e-3 };

/// In a recording of less, creep of 5 s looks like hysteresis, and that of 50 s like drift, s.
const CREEP_S: f64 = 20.0;
const SLOW_CREEP_S: f64 = 200.0;

/// The slowest creep has to be surer: it learns drift, too.
const SURE_OF_SLOW: f64 = 2.0;

/// Periods that no gear has, over the turn of its motor. An improvement that is as large with them
/// is not a transmission error. They are near, because over two or three turns anything that waves
/// is explained in part by a turn and half a turn together, and better by what is nearer to it.
const WRONG_TURNS: [f64; 2] = [5.0 / 6.0, 6.0 / 5.0];

/// What a snake may have or not.
enum Term {
    Other,
    Transmission,
    Creep(usize),
}

impl<const D: usize> Search<'_, D> {
    /// What the other motor's bend does, the transmission error, and creep, each only where blocks
    /// that are left out, one fold after the other, are explained better with it.
    pub(super) fn with_terms_that_help(&self, mut best: Place) -> Place {
        let folds: Vec<Judge<D>> = (0..ONE_OF).map(|fold| self.judge(fold)).collect();
        let left_out = |place: &Place, terms: Terms| -> Option<(Place, Vec<f64>)> {
            let with = |fold: usize| self.with(&folds[fold], place, terms);
            let found: Option<Vec<_>> = parallel::map(ONE_OF, with).into_iter().collect();
            let (places, errors): (Vec<Place>, Vec<Vec<f64>>) = found?.into_iter().unzip();
            Some((places.into_iter().nth(FOLD)?, errors.concat()))
        };
        let Some((_, mut errors)) = left_out(&best, best.terms) else { return best };
        for term in [Term::Other, Term::Transmission, Term::Creep(2), Term::Creep(CREEPING)] {
            let Some([without, with]) = self.terms_of(&term, best.terms) else { continue };
            // More steps alone are not what helps.
            if matches!(term, Term::Creep(CREEPING)) {
                let Some(again) = left_out(&best, best.terms) else { continue };
                (best, errors) = again;
            }
            let has = best.terms == with;
            let Some(tried) = left_out(&best, if has { without } else { with }) else { continue };
            let pair = if has { [&tried.1, &errors] } else { [&errors, &tried.1] };
            let [before, after] = pair.map(Vec::as_slice);
            let helps = match term {
                // One axis at a time does not show it: a snake bends in a plane.
                Term::Other if !self.plane => !is_better([after, before], SURE, 0.0),
                Term::Other => is_better([before, after], SURE, 0.0),
                Term::Creep(CREEPING) => is_better([before, after], SURE_OF_SLOW, ALIKE_HELD_OUT),
                Term::Creep(_) => is_better([before, after], SURE, ALIKE_HELD_OUT),
                Term::Transmission => {
                    is_better([before, after], SURE, ALIKE_HELD_OUT)
                        && WRONG_TURNS.iter().all(|part| {
                            let wrong = with.transmission.map(|turn| part * turn);
                            left_out(&best, Terms { transmission: wrong, ..with })
                                .is_none_or(|(_, wrong)| is_better([&wrong, after], SURE, 0.0))
                        })
                }
            };
            if helps != has {
                (best, errors) = tried;
            }
        }
        Place { left_out: errors, ..best }
    }

    /// Terms without and with a further one, as far as the recording can show it.
    fn terms_of(&self, term: &Term, terms: Terms) -> Option<[Terms; 2]> {
        let Terms { transmission, creep, .. } = terms;
        let pair = match term {
            Term::Other => [false, true].map(|other| Terms { other, ..terms }),
            Term::Transmission => [None, Some(transmission.unwrap_or(USUAL_TURN))]
                .map(|transmission| Terms { transmission, ..terms }),
            Term::Creep(CREEPING) if creep < 2 => return None,
            Term::Creep(CREEPING) => [2, CREEPING].map(|creep| Terms { creep, ..terms }),
            Term::Creep(few) => [0, creep.max(*few)].map(|creep| Terms { creep, ..terms }),
        };
        (pair[1] == self.possible(pair[1])).then_some(pair)
    }

    /// Those of some terms that the recording can show.
    pub(super) fn possible(&self, terms: Terms) -> Terms {
        let time_s = self.target.time_s();
        let most =
            if time_s >= SLOW_CREEP_S { CREEPING } else { 2 * usize::from(time_s >= CREEP_S) };
        Terms { other: terms.other && D > 1, creep: terms.creep.min(most), ..terms }
    }

    /// Where other terms lead from a place, and the errors there on the blocks held out.
    fn with(&self, judge: &Judge<D>, place: &Place, terms: Terms) -> Option<(Place, Vec<f64>)> {
        let known = judge.whole.layout.with(place.terms).decode(&place.at);
        let judge = judge.with_terms(terms);
        let objective = self.objective(&judge.seen, place.error);
        let start = judge.whole.layout.encode(&known);
        let at = minimise(&objective, start, TERM, &|| ())?.at;
        let errors = judge.errors(&objective.read_out, &at)?;
        let held_out = mean(&errors);
        Some((Place { terms, at, error: place.error, held_out, left_out: Vec::new() }, errors))
    }
}
