//! Percentiles of errors and latencies.

use hdrhistogram::Histogram;
use i2ris_report::statistics::{quantile, sort};
use serde::Serialize;

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Percentiles {
    pub p50: f64,
    pub p90: f64,
    pub p99: f64,
    pub max: f64,
}

impl Percentiles {
    /// Percentiles of values in any order; `None` for no values.
    pub fn of(mut values: Vec<f64>) -> Option<Self> {
        sort(&mut values);
        Some(Self {
            p50: quantile(&values, 0.5)?,
            p90: quantile(&values, 0.9)?,
            p99: quantile(&values, 0.99)?,
            max: *values.last()?,
        })
    }

    /// Percentiles in ms of a histogram in ns; `None` if it is empty.
    pub fn of_histogram_ms(histogram: &Histogram<u64>) -> Option<Self> {
        let ms = |share| histogram.value_at_quantile(share) as f64 * 1e-6;
        (!histogram.is_empty()).then(|| Self {
            p50: ms(0.5),
            p90: ms(0.9),
            p99: ms(0.99),
            max: histogram.max() as f64 * 1e-6,
        })
    }
}
