//! EM against results of other programs.
//!
//! Origin of the golden numbers: the one-step update from the textbook formulas in 40-digit
//! arithmetic (mpmath 1.4.1), the log-likelihood from scipy 1.17.1 (`multivariate_normal.logpdf`,
//! `logsumexp`), the converged fit from scikit-learn 1.9.1
//! (`GaussianMixture(2, tol=1e-14, reg_covar=0)` with weights, means and precisions given), all on
//! the data below.

use nalgebra::{DMatrix, Matrix1, Matrix2, SMatrix, SVector, Vector1, Vector2};

use super::component::Component;
use super::iteration::{EmResult, EmRules, iterate};
use super::properties::{PLAIN, plane};
use super::restarts::{fit_mixture, parameters};
use super::samples::Samples;
use crate::progress::Silent;
use crate::table::DataTable;

fn line() -> DataTable {
    DataTable::from_rows(1, [-2.0, -1.0, 0.0, 1.0, 2.5, 4.0].map(|x| [x]))
}

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
    let samples = Samples::<1>::new(&line());
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
