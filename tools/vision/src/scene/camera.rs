//! A pinhole camera that looks at the snake from the side.

/// Position and resolution of the camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PinholeCamera {
    /// Columns of the image.
    pub width: usize,
    /// Rows of the image.
    pub height: usize,
    /// Scale at the base, px/mm.
    pub px_per_mm: f64,
    /// Distance from the base to the pinhole, mm. An object nearer by a hundredth of this is drawn
    /// one per cent larger.
    pub distance_mm: f64,
    /// Start of the bending section in the image, px.
    pub origin_px: [f64; 2],
    /// Direction that the view calls positive, turned from x (pitch) towards y (yaw).
    pub plane_rad: f64,
    /// Turn of the image, counter-clockwise.
    pub roll_rad: f64,
}

impl PinholeCamera {
    /// A microscope that looks straight at the plane of pitch, 85 mm away, base from the left at
    /// half height.
    pub fn microscope(width: usize, height: usize, px_per_mm: f64) -> Self {
        Self {
            width,
            height,
            px_per_mm,
            distance_mm: 85.0,
            origin_px: [0.3 * width as f64, 0.5 * height as f64],
            plane_rad: 0.0,
            roll_rad: 0.0,
        }
    }

    /// A point in the frame of the view, mm: along the base, across it (positive side), towards the
    /// camera.
    pub fn in_view(&self, [x, y, z]: [f64; 3]) -> (f64, f64, f64) {
        let (sin, cos) = self.plane_rad.sin_cos();
        (z, cos * x + sin * y, -sin * x + cos * y)
    }

    /// A point in the image, px, and its scale relative to `px_per_mm`.
    pub fn project(&self, point: [f64; 3]) -> ([f64; 2], f64) {
        let (along, across, near) = self.in_view(point);
        let scale = self.distance_mm / (self.distance_mm - near);
        let (sin, cos) = self.roll_rad.sin_cos();
        let k = self.px_per_mm;
        let [ox, oy] = self.origin_px;
        let (x, y) = (ox + k * (cos * along - sin * across), oy - k * (sin * along + cos * across));
        // The camera looks along its axis, through the middle of the image: things grow away from
        // there.
        let [cx, cy] = [self.width, self.height].map(|size| 0.5 * (size as f64 - 1.0));
        ([cx + scale * (x - cx), cy + scale * (y - cy)], scale)
    }
}
