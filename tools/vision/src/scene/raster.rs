//! Painting with soft edges.

/// A rod with round sides: a polyline with half-widths, cut square at its end.
#[derive(Debug, Clone, PartialEq)]
pub struct Rod {
    /// x, y and half the thickness of every corner, px. A rod with fewer than two corners is not
    /// painted.
    pub points: Vec<[f64; 3]>,
    pub brightness: f32,
    pub rim: f32,
}

/// An unfinished image: brightness in floating point, not yet blurred.
pub struct Raster {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) data: Vec<f32>,
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

/// Pieces meet at small angles, so on the outer side of a bend a piece reaches this far beyond its
/// ends at most, px.
const BEYOND: f64 = 8.0;

impl Raster {
    pub fn new(width: usize, height: usize, ground: f32) -> Self {
        Self { width, height, data: vec![ground; width * height] }
    }

    /// Paints a rod over the existing image.
    pub fn rod(&mut self, rod: &Rod) {
        let mut touches = vec![UNCOVERED; self.data.len()];
        let Some(cut) = Cut::of(&rod.points) else {
            return;
        };
        let last = rod.points.len().saturating_sub(2);
        for (number, pair) in rod.points.windows(2).enumerate() {
            let is_outer = [number == 0, number == last];
            self.touch(&mut touches, pair[0], pair[1], is_outer, &cut);
        }
        for (pixel, touch) in self.data.iter_mut().zip(&touches) {
            if touch.cover > 0.0 {
                *pixel += touch.cover * (rod.shade(touch) - *pixel);
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
                // At the end the rod is cut square, so only the distance from its middle line
                // counts there.
                let distance = if is_at_end {
                    side.abs()
                } else {
                    distance(px - clamped * ux, py - clamped * uy)
                };
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

    /// The columns and rows of a rectangle that lie in the image.
    fn window(&self, x: [f64; 2], y: [f64; 2]) -> (std::ops::Range<usize>, std::ops::Range<usize>) {
        // A cast of a negative number gives 0, which is what is wanted here.
        let range = |[low, high]: [f64; 2], size: usize| {
            (low.floor() as usize).min(size)..(high.ceil().max(-1.0) + 1.0) as usize
        };
        let clip = |range: std::ops::Range<usize>, size: usize| range.start..range.end.min(size);
        (clip(range(x, self.width), self.width), clip(range(y, self.height), self.height))
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

/// Without the overflow protection of `hypot`, which would take most of the time of an image.
fn distance(x: f64, y: f64) -> f64 {
    (x * x + y * y).sqrt()
}

struct Cut {
    at: [f64; 2],
    unit: [f64; 2],
    half: f64,
}

impl Cut {
    fn of(points: &[[f64; 3]]) -> Option<Self> {
        let [.., a, b] = points else {
            return None;
        };
        let length = (b[0] - a[0]).hypot(b[1] - a[1]).max(1e-9);
        Some(Self {
            at: [b[0], b[1]],
            unit: [(b[0] - a[0]) / length, (b[1] - a[1]) / length],
            half: b[2],
        })
    }

    /// Share of a pixel that the cut leaves, and whether it is close enough to the cut for the rod
    /// to be straight.
    fn kept(&self, [x, y]: [f64; 2]) -> (f64, bool) {
        let (dx, dy) = (x - self.at[0], y - self.at[1]);
        let inside = -(dx * self.unit[0] + dy * self.unit[1]);
        // Farther away the rod may return, and is not cut.
        let is_near = dx.hypot(dy) < 2.0 * self.half + 3.0;
        (if is_near { edge(inside) } else { 1.0 }, is_near && inside < 1.0)
    }
}

impl Rod {
    fn shade(&self, touch: &Coverage) -> f32 {
        let rim = self.rim * touch.across * touch.across;
        self.brightness - rim
    }
}

/// Covered share of a pixel whose centre lies `inside` px inside a straight edge.
fn edge(inside: f64) -> f64 {
    (inside + 0.5).clamp(0.0, 1.0)
}

/// An object in front of the snake, in pixels.
#[derive(Debug, Clone, PartialEq)]
pub enum Clutter {
    /// A straight instrument that tapers from `from` to its free end `to`.
    Instrument {
        /// Its fixed end, usually outside the image.
        from: [f64; 2],
        to: [f64; 2],
        /// Half its thickness at both ends.
        half_width: [f64; 2],
        /// Brightness along its middle.
        brightness: f32,
        /// Darkening of its rims.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rod_covers_its_own_area() {
        let mut canvas = Raster::new(100, 60, 0.0);
        let points = vec![[-20.0, 30.0, 5.0], [40.0, 30.0, 5.0], [80.0, 30.0, 5.0]];
        canvas.rod(&Rod { points, brightness: 1.0, rim: 0.0 });
        // Its end lies at 80; the first pixel's left border at -0.5.
        assert!(
            (canvas.data.iter().sum::<f32>() - 805.0).abs() < 1.0,
            "{}",
            canvas.data.iter().sum::<f32>()
        );
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
        canvas.rod(&Rod {
            points: vec![[200.0, 200.0, 4.0], [300.0, 250.0, 4.0]],
            brightness: 9.0,
            rim: 0.0,
        });
        canvas.rod(&Rod { points: vec![[1.0, 1.0, 4.0]], brightness: 9.0, rim: 0.0 });
        assert!(canvas.data.iter().all(|v| *v == 3.0));
    }
}
