//! Properties of EM for any data.

use i2ris::model::file::MixtureParameters;
use nalgebra::{DMatrix, SMatrix};
use proptest::prelude::*;
use rand_pcg::Pcg64;

use super::error::EmError;
use super::iteration::{EmRules, iterate};
use super::k_means::random_start;
use super::mixture::MixtureFit;
use super::restarts::{EmOptions, fit_mixture};
use super::samples::Samples;
use crate::progress::Silent;
use crate::table::DataTable;
use crate::testing::{assert_near, few_starts, with_threads};

/// The plain maximum of the likelihood.
pub(super) const PLAIN: EmOptions =
    EmOptions { restarts: 3, seed: 7, tolerance: 1e-9, max_iterations: 200, regularisation: 0.0 };

/// Sixty rows on a bent curve, two clusters.
pub(super) fn plane() -> DataTable {
    let row = |i: u32| {
        let (a, odd) = (0.37 * f64::from(i), f64::from(i % 2));
        [3.0 * a.sin() + 4.0 * odd, (1.7 * a).cos() + 0.5 * a.sin() + 0.3 * (11.3 * a).sin() - odd]
    };
    DataTable::from_rows(2, (0..60).map(row))
}

#[test]
fn the_number_of_threads_does_not_change_a_bit() {
    let fit = || fit_mixture(&plane(), 4, &EmOptions::default(), &Silent).unwrap();
    assert_eq!(with_threads(1, fit), with_threads(3, fit));
}

#[test]
fn another_seed_gives_other_starts() {
    let with = |seed| fit_mixture(&plane(), 4, &EmOptions { seed, ..PLAIN }, &Silent).unwrap();
    assert_ne!(with(1), with(2));
}

#[test]
fn the_best_of_the_restarts_wins() {
    let fit = fit_mixture(&plane(), 4, &EmOptions::default(), &Silent).unwrap();
    let one = fit_mixture(&plane(), 4, &few_starts(1), &Silent).unwrap();
    assert!(fit.log_likelihood >= one.log_likelihood);
}

#[test]
fn regularisation_gives_degenerate_rows_a_density() {
    // Points on a line have no density in the plane.
    let data = DataTable::from_rows(2, (0..50).map(|i| [f64::from(i), 2.0 * f64::from(i)]));
    let error = fit_mixture(&data, 2, &PLAIN, &Silent).unwrap_err();
    assert_eq!(error, EmError::NoStartSucceeded);
    let propped_up = EmOptions { regularisation: 1e-6, ..PLAIN };
    assert!(fit_mixture(&data, 2, &propped_up, &Silent).is_ok());
}

/// Three clusters of which two have two rows each: no shape in the plane.
#[test]
fn a_starving_component_is_restarted_or_removed() {
    let spread = |i: u32| [f64::from(i % 10), f64::from(i / 10)];
    let far = [[100.0, 0.0], [100.1, 0.0], [0.0, 100.0], [0.1, 100.0]];
    let data = DataTable::from_rows(2, (0..100).map(spread).chain(far));
    for components in [3, 5, 12] {
        let fit = fit_mixture(&data, components, &EmOptions::default(), &Silent).unwrap();
        let weights = &fit.parameters.weights;
        assert!((1..=components).contains(&weights.len()), "{weights:?}");
        assert!(weights.iter().all(|weight| weight * 104.0 > 2.9), "{weights:?}");
    }
    let same = DataTable::from_rows(2, [[1.0, 2.0], [2.0, 1.0]].repeat(50));
    let fit = fit_mixture(&same, 5, &EmOptions::default(), &Silent).unwrap();
    assert_eq!(fit.parameters.weights.len(), 2);
}

#[test]
fn data_that_cannot_be_fitted_are_refused_with_the_reason() {
    let refusal = |data: &DataTable, components: usize| {
        fit_mixture(data, components, &PLAIN, &Silent).unwrap_err().to_string()
    };
    let wide = DataTable::from_rows(8, [[0.0; 8]; 100]);
    let hole = DataTable::from_rows(2, [[0.0, 1.0], [1.0, f64::NAN]]);
    for (data, components, reason) in [
        (&plane(), 11, "60 rows of 2 variables support at most 10 component(s); 11 were"),
        (&plane(), 0, "support at most 10 component(s); 0 were"),
        (&wide, 1, "2 to 6 variables, and the data have 8"),
        (&hole, 1, "row 1 of the data holds a number that is not finite"),
    ] {
        let text = refusal(data, components);
        assert!(text.contains(reason), "{text}");
    }
}

#[test]
fn units_and_offsets_do_not_matter() {
    let moved = DataTable::from_rows(2, plane().rows().map(|row| [row[0], 1e3 * row[1] + 7e5]));
    let fit = |data| fit_mixture(data, 2, &PLAIN, &Silent).unwrap().log_likelihood;
    assert_near(fit(&moved) + 1e3_f64.ln(), fit(&plane()), 1e-8);
}

fn check_mixture(mixture: &MixtureParameters) {
    assert!((mixture.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    assert!(mixture.weights.is_sorted_by(|a, b| a >= b));
    for covariance in &mixture.covariances {
        let matrix = DMatrix::from_fn(covariance.len(), covariance.len(), |i, j| covariance[i][j]);
        assert_eq!(matrix, matrix.transpose());
        assert!(matrix.cholesky().is_some());
    }
}

/// Rows on a bent sheet with noise.
fn rows() -> impl Strategy<Value = Vec<[f64; 3]>> {
    let row = (-300.0..300.0, -1.0..1.0, -1.0..1.0_f64);
    let bent = |(count, noise, other): (f64, f64, f64)| {
        [count, 1e4 + 0.02 * count + noise, (count / 100.0).sin() + other]
    };
    prop::collection::vec(row.prop_map(bent), 40..150)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn the_objective_never_falls(
        rows in rows(),
        components in 1_usize..5,
        seed in any::<u64>(),
    ) {
        let samples = Samples::<3>::new(&DataTable::from_rows(3, rows));
        let prior = SMatrix::identity() * 1e-6;
        let mut random = Pcg64::new(u128::from(seed), 0);
        let start = random_start(&samples, components, &prior, &mut random);
        let rules = EmRules { tolerance: -1.0, max_iterations: 100, prior };
        if let Some(result) = iterate(&samples, start, &rules) {
            for step in result.history.windows(2) {
                prop_assert!(step[1] >= step[0] - 1e-11, "{} after {}", step[1], step[0]);
            }
        }
    }

    #[test]
    fn weights_sum_to_1_and_covariances_are_positive_definite(
        rows in rows(),
        components in 1_usize..4,
    ) {
        let data = DataTable::from_rows(3, rows);
        let fit = fit_mixture(&data, components, &few_starts(2), &Silent);
        if let Ok(MixtureFit { parameters, .. }) = fit {
            check_mixture(&parameters);
        }
    }
}
