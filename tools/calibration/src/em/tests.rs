//! EM against results of other programs, and properties for any data.
//!
//! Origin of the golden numbers: the one-step update from the textbook formulas in 40-digit
//! arithmetic (mpmath 1.4.1), the log-likelihood from scipy 1.17.1 (`multivariate_normal.logpdf`,
//! `logsumexp`), the converged fit from scikit-learn 1.9.1
//! (`GaussianMixture(2, tol=1e-14, reg_covar=0)` with weights, means and precisions given), all on
//! the data below.

use i2ris::model::file::MixtureParameters;
use nalgebra::{DMatrix, Matrix1, Matrix2, SMatrix, SVector, Vector1, Vector2};
use proptest::prelude::*;
use rand_pcg::Pcg64;

use super::iteration::{EmResult, EmRules, iterate, random_start};
use super::pass::{Component, Samples};
use super::restarts::{EmError, EmOptions, MixtureFit, fit_mixture, parameters};
use crate::progress::Silent;
use crate::table::DataTable;
use crate::testing::{assert_near, few_starts, with_threads};

/// Two components, given in the units of the data.
fn plane_start(samples: &Samples<2>) -> Vec<Component<2>> {
    let (first, second) = (Vector2::new(0.0, 0.5), Vector2::new(3.0, -0.5));
    let wide = Matrix2::new(4.0, 0.5, 0.5, 1.0);
    let tilted = Matrix2::new(5.0, -1.0, -1.0, 2.0);
    vec![standard(samples, 0.3, first, wide), standard(samples, 0.7, second, tilted)]
}

fn standard<const N: usize>(
    samples: &Samples<N>,
    weight: f64,
    mean: SVector<f64, N>,
    covariance: SMatrix<f64, N, N>,
) -> Component<N> {
    let scaling = &samples.scaling;
    let scale = scaling.deviation * scaling.deviation.transpose();
    let mean = (mean - scaling.mean).component_div(&scaling.deviation);
    Component { weight, mean, covariance: covariance.component_div(&scale) }
}

fn iterate_plainly<const N: usize>(
    samples: &Samples<N>,
    start: Vec<Component<N>>,
    max_iterations: usize,
) -> EmResult<N> {
    let rules = EmRules { tolerance: 1e-15, max_iterations, prior: SMatrix::zeros() };
    iterate(samples, start, &rules).unwrap()
}

fn assert_all_near(found: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(expected) {
        assert!(
            (found - expected).abs() <= tolerance * expected.abs().max(1.0),
            "{found} instead of {expected}"
        );
    }
}

#[test]
fn one_step_in_one_dimension_is_the_textbooks() {
    let line = DataTable::from_rows(1, [-2.0, -1.0, 0.0, 1.0, 2.5, 4.0].map(|x| [x]));
    let samples = Samples::<1>::new(&line);
    let start = [(0.4, -1.0, 1.0), (0.6, 2.0, 4.0)].map(|(weight, mean, variance)| {
        standard(&samples, weight, Vector1::new(mean), Matrix1::new(variance))
    });
    let rows = 6.0;
    let after_none = iterate_plainly(&samples, start.to_vec(), 1);
    let log_likelihood = rows * (after_none.log_likelihood + samples.scaling.log_jacobian());
    assert_all_near(&[log_likelihood], &[-12.409345135985989], 1e-14);
    let after_one = iterate_plainly(&samples, start.to_vec(), 2).mixture;
    let after_one = parameters(&after_one, &samples.scaling);
    let weights = [0.5991616593357856, 0.4008383406642144];
    let means = [1.902708382094692, -0.9730354406758084];
    let variances = [3.0085728917192563, 0.8907691105428526];
    assert_all_near(&after_one.weights, &weights, 1e-14);
    assert_all_near(&after_one.means.concat(), &means, 1e-14);
    assert_all_near(&after_one.covariances.concat().concat(), &variances, 1e-14);
}

#[test]
fn the_likelihood_of_given_parameters_is_scipys() {
    let samples = Samples::<2>::new(&plane());
    let first = iterate_plainly(&samples, plane_start(&samples), 1);
    let log_likelihood = first.log_likelihood + samples.scaling.log_jacobian();
    assert_all_near(&[log_likelihood], &[-3.9779783660924486], 1e-13);
}

#[test]
fn a_converged_fit_is_scikit_learns() {
    let samples = Samples::<2>::new(&plane());
    let result = iterate_plainly(&samples, plane_start(&samples), 100_000);
    assert!(result.converged);
    let log_likelihood = result.log_likelihood + samples.scaling.log_jacobian();
    assert_all_near(&[log_likelihood], &[-3.7667866416442655], 1e-12);
    let fit = parameters(&result.mixture, &samples.scaling);
    let means = [3.741687247349026, -0.8360577225846594, -0.2239726440936835, 0.19559548470085267];
    let first = [5.072225983515023, 0.30713306785892, 0.30713306785892, 0.6133753030071538];
    let second = [4.151291449138506, 0.9358853413564329, 0.9358853413564329, 0.643154904846281];
    assert_all_near(&fit.weights, &[0.6287561345099897, 0.37124386549001026], 1e-6);
    assert_all_near(&fit.means.concat(), &means, 1e-6);
    assert_all_near(&fit.covariances[0].concat(), &first, 1e-6);
    assert_all_near(&fit.covariances[1].concat(), &second, 1e-6);
}

#[test]
fn one_component_has_mean_and_covariance_of_the_data() {
    let data = plane();
    let fit = fit_mixture(&data, 1, &PLAIN, &Silent).unwrap();
    let x = DMatrix::from_row_iterator(60, 2, data.rows().flatten().copied());
    let mean = x.row_mean();
    let centred = DMatrix::from_fn(60, 2, |row, column| x[(row, column)] - mean[column]);
    let covariance = centred.transpose() * &centred / 60.0;
    assert_eq!(fit.parameters.weights, [1.0]);
    assert_all_near(&fit.parameters.means[0], mean.as_slice(), 1e-14);
    let found = fit.parameters.covariances[0].concat();
    assert_all_near(&found, covariance.as_slice(), 1e-13);
    // The closed form of the maximum log-likelihood of a Gaussian in two dimensions.
    let greatest = -(2.0 * std::f64::consts::PI).ln() - 0.5 * covariance.determinant().ln() - 1.0;
    assert_all_near(&[fit.log_likelihood], &[greatest], 1e-13);
}

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
