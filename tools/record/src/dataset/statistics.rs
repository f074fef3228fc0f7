//! What LeRobot knows of each column: range, mean, deviation, quantiles.

use i2ris_report::statistics::{quantile, sort};
use serde_json::{Map, Value, json};

/// Names and probabilities of the quantiles.
pub const QUANTILES: [(&str, f64); 5] =
    [("q01", 0.01), ("q10", 0.1), ("q50", 0.5), ("q90", 0.9), ("q99", 0.99)];
/// Decoded pictures of an episode: more do not change its brightness.
const MOST_PICTURES: usize = 100;

/// The numbers of one column: one entry for each value of a row.
#[derive(Debug, Clone, PartialEq)]
pub struct Statistics {
    /// By name, in the order of LeRobot.
    pub values: Vec<(&'static str, Vec<f64>)>,
    pub count: usize,
}

impl Statistics {
    /// `rows`: the values of all rows, one after the other.
    pub fn of(rows: &[f64], width: usize) -> Self {
        let count = rows.len() / width.max(1);
        let mut all = Collected::default();
        for entry in 0..width {
            let mut values: Vec<f64> = rows.iter().skip(entry).step_by(width).copied().collect();
            let mean = values.iter().sum::<f64>() / count as f64;
            let squares = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
            sort(&mut values);
            all.add(mean, (squares / count as f64).sqrt(), |share| {
                quantile(&values, share).unwrap_or(0.0)
            });
        }
        Self { values: all.0, count }
    }

    /// As LeRobot writes it; values of pictures are one number for each colour.
    pub fn json(&self, is_picture: bool) -> Value {
        let shaped = |values: &Vec<f64>| {
            if is_picture {
                json!(values.iter().map(|it| [[it]]).collect::<Vec<_>>())
            } else {
                json!(values)
            }
        };
        let mut map: Map<String, Value> =
            self.values.iter().map(|(name, values)| ((*name).to_owned(), shaped(values))).collect();
        map.insert("count".to_owned(), json!([self.count]));
        Value::Object(map)
    }
}

#[derive(Default)]
struct Collected(Vec<(&'static str, Vec<f64>)>);

impl Collected {
    fn add(&mut self, mean: f64, deviation: f64, quantile: impl Fn(f64) -> f64) {
        let ends =
            [("min", quantile(0.0)), ("max", quantile(1.0)), ("mean", mean), ("std", deviation)];
        let quantiles = QUANTILES.map(|(name, share)| (name, quantile(share)));
        for (index, (name, value)) in ends.into_iter().chain(quantiles).enumerate() {
            if self.0.len() == index {
                self.0.push((name, Vec::new()));
            }
            self.0[index].1.push(value);
        }
    }
}

/// The brightness of some pictures, 0 to 1, by colour.
#[derive(Debug, Clone)]
pub struct PictureStatistics {
    histogram: Vec<[u64; 256]>,
    pictures: usize,
}

impl Default for PictureStatistics {
    fn default() -> Self {
        Self { histogram: vec![[0; 256]; 3], pictures: 0 }
    }
}

impl PictureStatistics {
    /// Which of so many pictures are looked at.
    pub fn step(pictures: usize) -> usize {
        pictures.div_ceil(MOST_PICTURES).max(1)
    }

    /// Red, green and blue of every pixel.
    pub fn add(&mut self, pixels: &[u8]) {
        self.pictures += 1;
        for pixel in pixels.chunks_exact(3) {
            for (histogram, value) in self.histogram.iter_mut().zip(pixel) {
                histogram[usize::from(*value)] += 1;
            }
        }
    }

    pub fn merge(&mut self, other: &Self) {
        self.pictures += other.pictures;
        for (own, other) in self.histogram.iter_mut().zip(&other.histogram) {
            own.iter_mut().zip(other).for_each(|(own, other)| *own += other);
        }
    }

    pub fn statistics(&self) -> Statistics {
        let mut all = Collected::default();
        for histogram in &self.histogram {
            let total = histogram.iter().sum::<u64>().max(1) as f64;
            let values =
                || histogram.iter().enumerate().map(|(it, n)| (it as f64 / 255.0, *n as f64));
            let mean = values().map(|(value, n)| value * n).sum::<f64>() / total;
            let square = values().map(|(value, n)| (value - mean).powi(2) * n).sum::<f64>() / total;
            all.add(mean, square.sqrt(), |share| {
                let mut below = 0.0;
                let reached = values().find(|(_, n)| {
                    below += n;
                    below > 0.0 && below >= share * total
                });
                reached.map_or(0.0, |(value, _)| value)
            });
        }
        Statistics { values: all.0, count: self.pictures }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_value_of_a_row_has_its_own() {
        let rows = [1.0, 10.0, 3.0, 20.0];
        let found = Statistics::of(&rows, 2);
        let expected = |name: &str, values: [f64; 2]| {
            let of = found.values.iter().find(|(it, _)| *it == name).unwrap();
            assert_eq!(of.1, values, "{name}");
        };
        expected("min", [1.0, 10.0]);
        expected("max", [3.0, 20.0]);
        expected("mean", [2.0, 15.0]);
        expected("std", [1.0, 5.0]);
        assert_eq!(found.json(false)["count"], json!([2]));
    }

    #[test]
    fn pictures_have_their_brightness_by_colour() {
        let mut pictures = PictureStatistics::default();
        pictures.add(&[0, 255, 51, 255, 255, 51]);
        let found = pictures.statistics().json(true);
        assert_eq!(found["min"], json!([[[0.0]], [[1.0]], [[0.2]]]));
        assert_eq!(found["max"], json!([[[1.0]], [[1.0]], [[0.2]]]));
        assert_eq!(found["mean"], json!([[[0.5]], [[1.0]], [[0.2]]]));
    }
}
