//! The brightness along a short line across the fibre, and the pairs of edges in it.

use super::Background;
use crate::image::{GreyImage, Px, advance};

const LINES: [f64; 3] = [-1.0, 0.0, 1.0];
/// An edge counts if it is this many times as high as the noise.
const EDGE_TO_NOISE: f32 = 4.5;
/// Ratio of the standard deviation of one value to the median absolute difference of neighbours.
const DIFFERENCE_TO_SIGMA: f32 = 1.4826 / std::f32::consts::SQRT_2;
/// An edge is evaluated to both sides over this multiple of its height over its slope: for a
/// Gaussian blur 4.3 standard deviations. Farther inside are glints, farther outside specks.
const EDGE_REACH: f64 = 1.7;
/// Thickness may differ from what is expected by this part.
const WIDTH_TOLERANCE: f64 = 0.3;

/// A stretch between a falling and a rising edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// Its middle, px from the middle of the profile.
    pub offset: f64,
    pub width: f64,
    /// Ground minus inside, the lower of both sides, grey levels.
    pub contrast: f32,
    /// Brightness of the adjacent ground, mean of both sides.
    pub ground: f32,
}

/// Brightness across the fibre, turned so that the fibre is dark.
#[derive(Debug, Default)]
pub struct IntensityProfile {
    values: Vec<f32>,
    sums: Vec<f32>,
    rise: Vec<f32>,
    half: usize,
    noise: f32,
}

impl IntensityProfile {
    /// Reads the profile from `-half` to `half` px along `unit` through `centre`, mean of three
    /// lines. Outside the image, its border is continued.
    pub fn read(
        &mut self,
        image: &GreyImage,
        ground: Background,
        centre: Px,
        unit: Px,
        half: usize,
    ) {
        self.half = half;
        self.values.clear();
        let sideways = [unit[1], -unit[0]];
        let (right, bottom) =
            ((image.width() as f64 - 1.001).max(0.0), (image.height() as f64 - 1.001).max(0.0));
        for i in 0..=2 * half {
            let on_line = advance(centre, unit, i as f64 - half as f64);
            let sum: f32 = LINES
                .iter()
                .map(|offset| advance(on_line, sideways, *offset))
                .filter_map(|[x, y]| image.sample(x.clamp(0.0, right), y.clamp(0.0, bottom)))
                .sum();
            let mean = sum / LINES.len() as f32;
            self.values.push(if ground == Background::Bright { mean } else { 255.0 - mean });
        }
        self.sums.clear();
        self.sums.push(0.0);
        let mut sum = 0.0;
        self.sums.extend(self.values.iter().map(|value| {
            sum += value;
            sum
        }));
        self.noise = noise(&self.values);
    }

    /// Mean from `from` to `to` px of the middle; the nearest value if there are none in between.
    pub fn mean(&self, from: f64, to: f64) -> f32 {
        let index = |offset: f64| {
            ((offset + self.half as f64).round().max(0.0) as usize).min(self.values.len() - 1)
        };
        self.mean_of(index(from), index(to).max(index(from)) + 1)
    }

    fn mean_of(&self, start: usize, end: usize) -> f32 {
        (self.sums[end] - self.sums[start]) / (end - start) as f32
    }

    /// Finds all stretches of about `width` with at least `contrast`, from left to right.
    pub fn find(&mut self, width: f64, contrast: f32, found: &mut Vec<Candidate>) {
        found.clear();
        let reach = (width / 6.0).clamp(2.0, 8.0) as usize;
        let length = self.values.len();
        if length < 4 * reach {
            return;
        }
        self.rise.clear();
        self.rise.resize(length, 0.0);
        for i in reach..=length - reach {
            self.rise[i] = self.mean_of(i, i + reach) - self.mean_of(i - reach, i);
        }
        let threshold =
            (0.5 * contrast).max(EDGE_TO_NOISE * self.noise * (2.0 / reach as f32).sqrt());
        let (narrow, wide) = (width * (1.0 - WIDTH_TOLERANCE), width * (1.0 + WIDTH_TOLERANCE));
        for fall in reach..length {
            if !self.is_peak(fall, reach, threshold, -1.0) {
                continue;
            }
            let last = (fall + wide.ceil() as usize).min(length - 1);
            for rise in fall + narrow.max(2.0) as usize..=last {
                if self.is_peak(rise, reach, threshold, 1.0) {
                    found
                        .extend(self.between(fall, rise, width).filter(|c| c.contrast >= contrast));
                }
            }
        }
    }

    fn is_peak(&self, i: usize, reach: usize, threshold: f32, sign: f32) -> bool {
        let here = sign * self.rise[i];
        let around = i.saturating_sub(reach)..(i + reach + 1).min(self.rise.len());
        here >= threshold && around.clone().all(|j| sign * self.rise[j] <= here)
            // Of equal neighbours only the first is the peak.
            && (around.start..i).all(|j| sign * self.rise[j] < here)
    }

    fn between(&self, fall: usize, rise: usize, width: f64) -> Option<Candidate> {
        let left = self.edge(fall as f64 - 0.5, self.edge_reach(fall, width))?;
        let right = self.edge(rise as f64 - 0.5, self.edge_reach(rise, width))?;
        let quarter = 0.25 * (right.at - left.at);
        let middle = 0.5 * (left.at + right.at) - self.half as f64;
        let inside = self.mean(middle - quarter, middle + quarter);
        let (first, second) = (left.before - inside, right.after - inside);
        let measured = right.at - left.at;
        ((measured / width - 1.0).abs() <= WIDTH_TOLERANCE).then_some(Candidate {
            offset: middle,
            width: measured,
            contrast: first.min(second),
            ground: 0.5 * (left.before + right.after),
        })
    }

    /// Distance to both sides over which an edge at index `at` is evaluated.
    fn edge_reach(&self, at: usize, width: f64) -> f64 {
        let most = (width / 3.0).clamp(3.0, 10.0);
        let (start, end) = (at.saturating_sub(most as usize).max(1), at + most as usize);
        let Some(around) = self.values.get(start - 1..=end) else { return most };
        let slope = around.windows(3).map(|v| 0.5 * (v[2] - v[0]).abs()).fold(0.0, f32::max);
        let height = (around[0] - around[around.len() - 1]).abs();
        (EDGE_REACH * f64::from(height / slope)).clamp(3.0, most)
    }

    /// Subpixel position of an edge near index `at`: that of a sharp step of the same height with
    /// the same area under the profile. Neither blur nor a gradient of the light moves it.
    fn edge(&self, at: f64, reach: f64) -> Option<Edge> {
        let mut edge = Edge { at, before: 0.0, after: 0.0 };
        for _ in 0..2 {
            let start = (edge.at - reach).round();
            let end = (edge.at + reach).round();
            if start < 1.0 || end + 2.0 > self.values.len() as f64 {
                return None;
            }
            let (start, end) = (start as usize, end as usize);
            let (before, after) =
                (self.mean_of(start - 1, start + 2), self.mean_of(end - 1, end + 2));
            let ends = 0.5 * (self.values[start] + self.values[end]);
            let area = self.sums[end] - self.sums[start + 1] + ends - (end - start) as f32 * after;
            let part = f64::from(area / (before - after));
            // Outside the window: not one edge but a mixture.
            if !(part >= 0.0 && part <= (end - start) as f64) {
                return None;
            }
            edge = Edge { at: start as f64 + part, before, after };
        }
        Some(edge)
    }
}

struct Edge {
    at: f64,
    before: f32,
    after: f32,
}

fn noise(values: &[f32]) -> f32 {
    let mut differences: Vec<_> = values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
    if differences.is_empty() {
        return 0.0;
    }
    let middle = differences.len() / 2;
    DIFFERENCE_TO_SIGMA * *differences.select_nth_unstable_by(middle, f32::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An image of vertical stripes with the brightness `f` of each column.
    fn stripes(f: impl Fn(f64) -> f64) -> GreyImage {
        let row: Vec<u8> = (0..200).map(|x| f(f64::from(x)).round() as u8).collect();
        GreyImage::new(200, 20, row.repeat(20)).unwrap()
    }

    fn soft_step(x: f64) -> f64 {
        1.0 / (1.0 + (-x / 0.8).exp())
    }

    fn candidates(image: &GreyImage, ground: Background, width: f64) -> Vec<Candidate> {
        let (mut profile, mut found) = (IntensityProfile::default(), Vec::new());
        profile.read(image, ground, [100.0, 10.0], [1.0, 0.0], 80);
        profile.find(width, 20.0, &mut found);
        found
    }

    #[test]
    fn finds_the_subpixel_middle_in_a_light_gradient() {
        let image = stripes(|x| {
            (200.0 - 130.0 * (soft_step(x - 88.3) - soft_step(x - 113.1))) * (0.7 + 0.0015 * x)
        });
        let found = candidates(&image, Background::Bright, 25.0);
        assert_eq!(found.len(), 1);
        assert!((found[0].offset - 0.7).abs() < 0.1, "{found:?}");
        assert!((found[0].width - 24.8).abs() < 0.4, "{found:?}");
    }

    #[test]
    fn bright_fibre_on_dark_ground_gives_the_same() {
        let image = stripes(|x| 40.0 + 130.0 * (soft_step(x - 90.0) - soft_step(x - 115.0)));
        let found = candidates(&image, Background::Dark, 25.0);
        assert_eq!(found.len(), 1);
        assert!((found[0].offset - 2.5).abs() < 0.05);
        assert!(candidates(&image, Background::Bright, 25.0).is_empty());
    }

    #[test]
    fn too_wide_or_too_narrow_stretches_are_ignored() {
        let image = stripes(|x| 200.0 - 130.0 * (soft_step(x - 70.0) - soft_step(x - 120.0)));
        assert!(candidates(&image, Background::Bright, 25.0).is_empty());
        assert_eq!(candidates(&image, Background::Bright, 50.0).len(), 1);
        assert!(candidates(&image, Background::Bright, 100.0).is_empty());
    }
}
