//! Statistics and distances of plain numbers, once for all crates of this repository.
//!
//! | file | contains |
//! |---|---|
//! | `moments` | mean, variance, standard deviation, root mean square |
//! | `quantile` | median and other quantiles, extremes |
//! | `histogram` | counts between edges |
//! | `distance` | distances between points, interpolation |
//! | `time_series` | values over time |
//!
//! A statistic of no values is `None`. No function checks for values that are not finite: the
//! caller leaves them out. For histograms of durations with a fixed resolution use the crate
//! `hdrhistogram`.

#![forbid(unsafe_code)]

mod distance;
mod histogram;
mod moments;
mod quantile;
mod time_series;

pub use distance::{distance, distance_to_segment, interpolate, largest_difference};
pub use histogram::histogram;
pub use moments::{mean, root_mean_square, standard_deviation, variance};
pub use quantile::{median, min_max, quantile, quantile_of_unsorted, sort};
pub use time_series::TimeSeries;
