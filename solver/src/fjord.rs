//! The fjord's width along the bedrock. Knows nothing of the ice in it.

/// Width as a function of the distance x down-fjord from the terminus' position at t = 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fjord {
    /// Width at x = 0, m.
    pub width_m: f64,
    /// dW/dx.
    pub gradient: f64,
}

impl Fjord {
    /// W(x) in m; x in m in the bedrock frame. Not positive where the walls have met.
    pub fn width(&self, x: f64) -> f64 {
        self.width_m + self.gradient * x
    }

    /// dW/dx at x.
    pub fn slope(&self, _x: f64) -> f64 {
        self.gradient
    }

    /// Where the walls meet down-fjord of the terminus, m; infinite if they do not.
    pub fn closes_at_m(&self) -> f64 {
        if self.gradient < 0.0 { -self.width_m / self.gradient } else { f64::INFINITY }
    }

    /// Whether the width is the same everywhere.
    pub fn is_constant(&self) -> bool {
        self.gradient == 0.0
    }
}
