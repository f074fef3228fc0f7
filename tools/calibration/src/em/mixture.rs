//! A fitted mixture, its criterion and its number of parameters.

use i2ris::model::file::MixtureParameters;

/// A fitted mixture, in the units of the data.
#[derive(Debug, Clone, PartialEq)]
pub struct MixtureFit {
    /// Components in falling order of weight.
    pub parameters: MixtureParameters,
    /// Mean log-likelihood per row, nats.
    pub log_likelihood: f64,
    /// Bayesian information criterion, see [`bic`].
    pub bic: f64,
}

/// Free parameters of a mixture of `components` over `variables`: weights that sum to 1, means,
/// symmetric covariances.
pub fn free_parameters(components: usize, variables: usize) -> usize {
    components * (1 + variables + variables * (variables + 1) / 2) - 1
}

/// Maximum number of components for the given rows: no more free parameters than rows.
pub fn most_components(rows: usize, variables: usize) -> usize {
    (rows + 1) / (free_parameters(1, variables) + 1)
}

/// Bayesian information criterion `p ln N - 2 ln L` with `p` free parameters, `N` rows and the
/// likelihood `L` of all of them: the lower the better (G. Schwarz, "Estimating the dimension of a
/// model", Annals of Statistics, 1978). It assumes independent rows; neighbouring rows of a slow
/// motion are not, so it favours too many components.
pub fn bic(log_likelihood: f64, rows: usize, components: usize, variables: usize) -> f64 {
    let rows = rows as f64;
    free_parameters(components, variables) as f64 * rows.ln() - 2.0 * rows * log_likelihood
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn free_parameters_are_counted() {
        // One Gaussian in the plane: two means, three covariances. A second one adds a weight.
        let counts = [(1, 2), (2, 2), (10, 4)].map(|(k, n)| free_parameters(k, n));
        assert_eq!(counts, [5, 11, 149]);
        for rows in [5, 14, 28, 29, 30, 1000] {
            let most = most_components(rows, 4);
            assert!(most == 0 || free_parameters(most, 4) <= rows);
            assert!(free_parameters(most + 1, 4) > rows);
        }
        assert!((bic(-2.0, 100, 1, 2) - (5.0 * 100f64.ln() + 400.0)).abs() < 1e-9);
    }
}
