//! Grey levels of a scene.

/// Brightness of everything, in grey levels before uneven light: 0 black, 255 white.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Brightness {
    /// The ground behind.
    pub ground: f32,
    /// The snake's body, in the middle of it.
    pub body: f32,
    /// The fibre at its tip.
    pub fibre: f32,
    /// How much darker (or, negative, brighter) the rims of body and fibre are than their middle:
    /// round things shade.
    pub rim: f32,
    /// Brightness that a glint along the body adds. 0: none.
    pub glint: f32,
}

impl Brightness {
    /// A dark fibre on bright ground, lit from behind.
    #[must_use]
    pub const fn dark() -> Self {
        Self { ground: 190.0, body: 55.0, fibre: 55.0, rim: 12.0, glint: 0.0 }
    }

    /// A bright fibre on dark ground, lit from the side.
    #[must_use]
    pub const fn bright() -> Self {
        Self { ground: 40.0, body: 185.0, fibre: 185.0, rim: 15.0, glint: 0.0 }
    }

    /// The same with a glint along the body.
    #[must_use]
    pub const fn with_glint(self, glint: f32) -> Self {
        Self { glint, ..self }
    }
}
