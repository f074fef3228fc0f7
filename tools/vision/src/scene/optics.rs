//! Grey levels of a scene, and its way from the painting to the bytes of a sensor.

use rand::Rng;

use super::raster::Raster;
use crate::image::GreyImage;

/// Brightness of everything, in grey levels before uneven light: 0 black, 255 white.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Brightness {
    /// The background.
    pub ground: f32,
    /// The middle of the snake's body.
    pub body: f32,
    /// The fibre at its tip.
    pub fibre: f32,
    /// How much darker (or, negative, brighter) the rims of body and fibre are than their middle:
    /// round things shade.
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

/// Noise of mean 0 and standard deviation 1: sums of four uniform bytes, near enough to normal for
/// a sensor.
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
    let mut kernel: Vec<f32> = (0..=2 * reach)
        .map(|i| (-0.5 * ((i as f64 - reach as f64) / sigma).powi(2)).exp() as f32)
        .collect();
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
