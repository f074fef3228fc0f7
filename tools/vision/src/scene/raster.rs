//! Painting with soft edges, and its way to a sensor: grey levels, blur, uneven light, noise.

use rand::Rng;

use crate::image::GreyImage;

/// A rod with round sides: a polyline with half-widths, cut square at its end.
#[derive(Debug, Clone, PartialEq)]
pub struct Rod {
    /// x, y and half the thickness of every corner, px. At least two.
    pub points: Vec<[f64; 3]>,
    pub brightness: f32,
    pub rim: f32,
}

/// An unfinished image: brightness in floating point, not yet blurred.
pub struct Raster {
    width: usize,
    height: usize,
    data: Vec<f32>,
}

/// One pixel's view of the rod piece nearest to it.
#[derive(Clone, Copy)]
struct Coverage {
    distance: f32,
    cover: f32,
    /// Across the rod: -1 and 1 are its rims.
    across: f32,
}

const UNCOVERED: Coverage = Coverage { distance: f32::INFINITY, cover: 0.0, across: 0.0 };
/// Pieces meet at small angles: on the outer side one reaches this far beyond its ends, px.
const BEYOND: f64 = 8.0;

impl Raster {
    pub fn new(width: usize, height: usize, ground: f32) -> Self {
        Self { width, height, data: vec![ground; width * height] }
    }

    pub fn rod(&mut self, rod: &Rod) {
        let mut touches = vec![UNCOVERED; self.data.len()];
        let Some(cut) = Cut::of(&rod.points) else { return };
        let last = rod.points.len().saturating_sub(2);
        for (number, pair) in rod.points.windows(2).enumerate() {
            let is_outer = [number == 0, number == last];
            self.touch(&mut touches, pair[0], pair[1], is_outer, &cut);
        }
        for (pixel, touch) in self.data.iter_mut().zip(&touches) {
            if touch.cover > 0.0 {
                let shade = rod.brightness - rod.rim * touch.across * touch.across;
                *pixel += touch.cover * (shade - *pixel);
            }
        }
    }

    /// Notes for every pixel how the piece from `a` to `b` covers it. `is_outer`: which of its ends
    /// is one of the rod; beyond the others the next piece is nearer.
    fn touch(
        &self,
        touches: &mut [Coverage],
        a: [f64; 3],
        b: [f64; 3],
        is_outer: [bool; 2],
        cut: &Cut,
    ) {
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let length = dx.hypot(dy).max(1e-9);
        let (ux, uy) = (dx / length, dy / length);
        let reach = a[2].max(b[2]) + 1.5;
        let (columns, rows) = self.window(
            [a[0].min(b[0]) - reach, a[0].max(b[0]) + reach],
            [a[1].min(b[1]) - reach, a[1].max(b[1]) + reach],
        );
        let low = if is_outer[0] { f64::NEG_INFINITY } else { -BEYOND };
        let high = if is_outer[1] { f64::INFINITY } else { length + BEYOND };
        for row in rows {
            for column in columns_along(columns.clone(), [low, high], a, [ux, uy], row) {
                let (x, y) = (column as f64, row as f64);
                let (px, py) = (x - a[0], y - a[1]);
                let t = px * ux + py * uy;
                let clamped = t.clamp(0.0, length);
                let side = ux * py - uy * px;
                let half = a[2] + (b[2] - a[2]) * clamped / length;
                let (kept, is_at_end) = cut.kept([x, y]);
                // At its end, cut square, only the distance from the middle line counts. Without
                // the overflow protection of `hypot`, which takes most time of an image.
                let (off_x, off_y) = (px - clamped * ux, py - clamped * uy);
                let distance =
                    if is_at_end { side.abs() } else { (off_x * off_x + off_y * off_y).sqrt() };
                let touch = &mut touches[row * self.width + column];
                let cover = (edge(half - distance) * kept) as f32;
                if cover > 0.0 && (distance as f32) < touch.distance {
                    let across = (side / half) as f32;
                    let cover = cover.max(touch.cover);
                    *touch = Coverage { distance: distance as f32, cover, across };
                }
            }
        }
    }

    /// Paints an ellipse: centre, half axes, turn, brightness.
    pub fn blob(&mut self, centre: [f64; 2], half: [f64; 2], turn_rad: f64, brightness: f32) {
        let reach = half[0].max(half[1]) + 1.5;
        let (sin, cos) = turn_rad.sin_cos();
        let (columns, rows) = self
            .window([centre[0] - reach, centre[0] + reach], [centre[1] - reach, centre[1] + reach]);
        for row in rows {
            for column in columns.clone() {
                let (dx, dy) = (column as f64 - centre[0], row as f64 - centre[1]);
                let (u, v) = ((cos * dx + sin * dy) / half[0], (cos * dy - sin * dx) / half[1]);
                let cover = edge((1.0 - u.hypot(v)) * half[0].min(half[1])) as f32;
                let pixel = &mut self.data[row * self.width + column];
                *pixel += cover * (brightness - *pixel);
            }
        }
    }

    fn window(&self, x: [f64; 2], y: [f64; 2]) -> (std::ops::Range<usize>, std::ops::Range<usize>) {
        // A cast of a negative number gives 0, which is what is wanted here.
        let range = |[low, high]: [f64; 2], size: usize| {
            let end = (high.ceil().max(-1.0) + 1.0) as usize;
            (low.floor() as usize).min(size)..end.min(size)
        };
        (range(x, self.width), range(y, self.height))
    }
}

/// The columns of a row that lie between `low` and `high` along a piece.
fn columns_along(
    columns: std::ops::Range<usize>,
    [low, high]: [f64; 2],
    from: [f64; 3],
    [ux, uy]: [f64; 2],
    row: usize,
) -> std::ops::Range<usize> {
    if ux.abs() < 1e-3 {
        return columns;
    }
    let at = |t: f64| from[0] + (t - (row as f64 - from[1]) * uy) / ux;
    let (one, other) = (at(low), at(high));
    // Casts of values outside give the ends of the range.
    let first = (one.min(other).floor() as usize).max(columns.start);
    let end = (one.max(other).ceil() as usize).saturating_add(1).min(columns.end);
    first.min(end)..end
}

struct Cut {
    at: [f64; 2],
    unit: [f64; 2],
    half: f64,
}

impl Cut {
    fn of(points: &[[f64; 3]]) -> Option<Self> {
        let [.., a, b] = points else { return None };
        let length = (b[0] - a[0]).hypot(b[1] - a[1]).max(1e-9);
        Some(Self {
            at: [b[0], b[1]],
            unit: [(b[0] - a[0]) / length, (b[1] - a[1]) / length],
            half: b[2],
        })
    }

    /// Share of a pixel that the cut leaves, and whether the rod is straight there.
    fn kept(&self, [x, y]: [f64; 2]) -> (f64, bool) {
        let (dx, dy) = (x - self.at[0], y - self.at[1]);
        let inside = -(dx * self.unit[0] + dy * self.unit[1]);
        // Farther away the rod may return, and is not cut.
        let is_near = dx.hypot(dy) < 2.0 * self.half + 3.0;
        (if is_near { edge(inside) } else { 1.0 }, is_near && inside < 1.0)
    }
}

/// Covered share of a pixel whose centre lies `inside` px inside a straight edge.
fn edge(inside: f64) -> f64 {
    (inside + 0.5).clamp(0.0, 1.0)
}

#[derive(Debug, Clone, PartialEq)]
pub enum Clutter {
    /// A straight instrument that tapers from `from` to its free end `to`.
    Instrument {
        from: [f64; 2],
        to: [f64; 2],
        /// Half its thickness at both ends.
        half_width: [f64; 2],
        brightness: f32,
        rim: f32,
    },
    /// A speck of dust, a bubble, a drop.
    Speck { centre: [f64; 2], half: [f64; 2], turn_rad: f64, brightness: f32 },
}

impl Clutter {
    pub(super) fn paint(&self, canvas: &mut Raster) {
        match self {
            Self::Instrument { from, to, half_width, brightness, rim } => canvas.rod(&Rod {
                points: vec![[from[0], from[1], half_width[0]], [to[0], to[1], half_width[1]]],
                brightness: *brightness,
                rim: *rim,
            }),
            Self::Speck { centre, half, turn_rad, brightness } => {
                canvas.blob(*centre, *half, *turn_rad, *brightness)
            }
        }
    }
}

/// A sheet of one brightness over the circle of `radius` around `centre`: hides everything below.
pub fn cover(centre: [f64; 2], radius: f64, brightness: f32) -> Clutter {
    Clutter::Speck { centre, half: [radius, radius], turn_rad: 0.0, brightness }
}

/// Brightness of everything, in grey levels before uneven light: 0 black, 255 white.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Brightness {
    pub ground: f32,
    pub body: f32,
    pub fibre: f32,
    /// How much darker (negative: brighter) the rims are than the middle: round things shade.
    pub rim: f32,
}

impl Brightness {
    /// A dark fibre on bright ground, lit from behind.
    pub const fn dark() -> Self {
        Self { ground: 190.0, body: 55.0, fibre: 55.0, rim: 12.0 }
    }

    /// A bright fibre on dark ground, lit from the side.
    pub const fn bright() -> Self {
        Self { ground: 40.0, body: 185.0, fibre: 185.0, rim: 15.0 }
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Optics {
    /// Standard deviation of the blur, px.
    pub blur_px: f64,
    /// Standard deviation of the noise, grey levels.
    pub noise: f32,
    /// Part of the light that the corners lose.
    pub vignette: f32,
    /// Part of the light by which right and lower border are brighter than left and upper.
    pub slope: [f32; 2],
}

impl Optics {
    /// A well adjusted microscope.
    pub const fn light() -> Self {
        Self { blur_px: 1.0, noise: 3.0, vignette: 0.25, slope: [0.1, -0.1] }
    }

    /// Out of focus, too little light, unevenly lit.
    pub const fn strong() -> Self {
        Self { blur_px: 4.0, noise: 15.0, vignette: 0.5, slope: [0.3, 0.25] }
    }

    pub(super) fn expose(&self, mut canvas: Raster, random: &mut impl Rng) -> GreyImage {
        blur(&mut canvas, self.blur_px);
        let (width, height) = (canvas.width, canvas.height);
        let mut noise = Noise { random, spare: None };
        let (cx, cy) = (0.5 * width as f32, 0.5 * height as f32);
        let corner = cx * cx + cy * cy;
        let mut data = Vec::with_capacity(canvas.data.len());
        for (row, line) in canvas.data.chunks_exact(width).enumerate() {
            let dy = row as f32 - cy;
            for (column, value) in line.iter().enumerate() {
                let dx = column as f32 - cx;
                let light = 1.0 - self.vignette * (dx * dx + dy * dy) / corner
                    + 0.5 * (self.slope[0] * dx / cx + self.slope[1] * dy / cy);
                // The cast saturates, as a sensor does.
                data.push((value * light + self.noise * noise.next() + 0.5) as u8);
            }
        }
        // A canvas has exactly as many values as pixels; an empty one gives the smallest image.
        GreyImage::new(width, height, data).unwrap_or_else(GreyImage::black)
    }
}

/// Noise of mean 0 and standard deviation 1: sums of four uniform bytes.
struct Noise<'a, R> {
    random: &'a mut R,
    spare: Option<u32>,
}

impl<R: Rng> Noise<'_, R> {
    fn next(&mut self) -> f32 {
        let bits = self.spare.take().unwrap_or_else(|| {
            let bits = self.random.next_u64();
            self.spare = Some((bits >> 32) as u32);
            bits as u32
        });
        let sum: u32 = bits.to_le_bytes().iter().map(|byte| u32::from(*byte)).sum();
        // Four times the variance (256^2 - 1) / 12 of a uniform byte.
        (sum as f32 - 510.0) / 147.8
    }
}

/// Gaussian blur, rows then columns; the border is continued outside.
fn blur(canvas: &mut Raster, sigma: f64) {
    if sigma <= 0.0 {
        return;
    }
    let reach = (3.5 * sigma).ceil() as usize;
    let weight = |i| (-0.5 * ((i as f64 - reach as f64) / sigma).powi(2)).exp() as f32;
    let mut kernel: Vec<f32> = (0..=2 * reach).map(weight).collect();
    let sum: f32 = kernel.iter().sum();
    kernel.iter_mut().for_each(|k| *k /= sum);

    let (width, height) = (canvas.width, canvas.height);
    let mut padded = vec![0.0_f32; width + 2 * reach];
    for line in canvas.data.chunks_exact_mut(width) {
        padded[..reach].fill(line[0]);
        padded[reach..reach + width].copy_from_slice(line);
        padded[reach + width..].fill(line[width - 1]);
        line.fill(0.0);
        for (k, weight) in kernel.iter().enumerate() {
            for (out, value) in line.iter_mut().zip(&padded[k..]) {
                *out += weight * value;
            }
        }
    }
    let source = canvas.data.clone();
    for (row, line) in canvas.data.chunks_exact_mut(width).enumerate() {
        line.fill(0.0);
        for (k, weight) in kernel.iter().enumerate() {
            let from = (row + k).saturating_sub(reach).min(height - 1) * width;
            for (out, value) in line.iter_mut().zip(&source[from..from + width]) {
                *out += weight * value;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rod_covers_its_own_area() {
        let mut canvas = Raster::new(100, 60, 0.0);
        let points = vec![[-20.0, 30.0, 5.0], [40.0, 30.0, 5.0], [80.0, 30.0, 5.0]];
        canvas.rod(&Rod { points, brightness: 1.0, rim: 0.0 });
        // Its end lies at 80; the first pixel's left border at -0.5.
        let sum: f32 = canvas.data.iter().sum();
        assert!((sum - 805.0).abs() < 1.0, "{sum}");
    }

    #[test]
    fn a_rod_of_many_short_pieces_ends_square() {
        let mut canvas = Raster::new(100, 100, 0.0);
        let points = (-3..=10).map(|i| [f64::from(i) * 5.0, 50.0, 30.0]).collect();
        canvas.rod(&Rod { points, brightness: 1.0, rim: 0.0 });
        let sum: f32 = canvas.data.iter().sum();
        assert!((sum - 50.5 * 60.0).abs() < 2.0, "{sum}");
    }

    #[test]
    fn things_outside_the_image_leave_it_alone() {
        let mut canvas = Raster::new(20, 20, 3.0);
        canvas.blob([-50.0, -50.0], [5.0, 5.0], 0.0, 9.0);
        for points in [vec![[200.0, 200.0, 4.0], [300.0, 250.0, 4.0]], vec![[1.0, 1.0, 4.0]]] {
            canvas.rod(&Rod { points, brightness: 9.0, rim: 0.0 });
        }
        assert!(canvas.data.iter().all(|v| *v == 3.0));
    }
}
