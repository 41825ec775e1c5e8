//! Curves through the points of a table: monotone and smooth, or piecewise linear. Knows nothing of
//! what the numbers mean, and says what is wrong with a table so that a caller can name its field.

use std::fmt;

/// One of a table's two arrays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Axis {
    /// The places.
    X,
    /// The values there.
    Y,
}

impl fmt::Display for Axis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::X => "x",
            Self::Y => "y",
        })
    }
}

/// What is true beyond a table's ends, where its curve is held constant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Beyond {
    /// Nothing is known: a final state must not reach there.
    Refused,
    /// What is true at the end.
    Constant,
}

/// Why a table is no curve, or not the one it was given for.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TableError {
    /// The arrays differ in length.
    #[error("there are {x} x and {y} y: {}", self.permitted())]
    LengthsDiffer {
        /// Number of places.
        x: usize,
        /// Number of values.
        y: usize,
    },
    /// Fewer than two points.
    #[error("there are {points} points: {}", self.permitted())]
    TooFewPoints {
        /// Number of points.
        points: usize,
    },
    /// Infinite or no number.
    #[error("{axis}[{index}] = {value}: {}", self.permitted())]
    NotFinite {
        /// The array.
        axis: Axis,
        /// The place in it.
        index: usize,
        /// The value there.
        value: f64,
    },
    /// Not above the one before it.
    #[error("x[{index}] = {value}: {}", self.permitted())]
    NotAscending {
        /// The place in x.
        index: usize,
        /// The value there.
        value: f64,
        /// The one before it.
        previous: f64,
    },
    /// A step or slope to this point that leaves no room for arithmetic.
    #[error("y[{index}] = {value}: {}", self.permitted())]
    TooSteep {
        /// The place in y.
        index: usize,
        /// The value there.
        value: f64,
    },
    /// A curve, but not one for its purpose.
    #[error("{} = {value}: {permitted}", element(*axis, *index))]
    Unfit {
        /// The array.
        axis: Axis,
        /// The place in it, unless it is about all.
        index: Option<usize>,
        /// The value there, or of all.
        value: f64,
        /// What its purpose permits.
        permitted: &'static str,
    },
}

fn element(axis: Axis, index: Option<usize>) -> String {
    index.map_or_else(|| axis.to_string(), |i| format!("{axis}[{i}]"))
}

impl TableError {
    /// The array, the place in it and the value there that are to blame, as far as there is one.
    pub fn place(&self) -> (Axis, Option<usize>, Option<f64>) {
        match *self {
            Self::LengthsDiffer { .. } => (Axis::Y, None, None),
            Self::TooFewPoints { .. } => (Axis::X, None, None),
            Self::NotFinite { axis, index, value } => (axis, Some(index), Some(value)),
            Self::NotAscending { index, value, .. } => (Axis::X, Some(index), Some(value)),
            Self::TooSteep { index, value } => (Axis::Y, Some(index), Some(value)),
            Self::Unfit { axis, index, value, .. } => (axis, index, Some(value)),
        }
    }

    /// What is permitted there, as a phrase.
    pub fn permitted(&self) -> String {
        match self {
            Self::LengthsDiffer { x, .. } => format!("as many as the places, {x}"),
            Self::TooFewPoints { .. } => "at least two points".into(),
            Self::NotFinite { .. } => "finite numbers".into(),
            Self::NotAscending { previous, .. } => {
                format!("strictly ascending, so above {previous}")
            }
            Self::TooSteep { .. } => {
                format!("steps and slopes below {LARGEST:e} from point to point")
            }
            Self::Unfit { permitted, .. } => (*permitted).into(),
        }
    }
}

/// Steps and slopes stay below this, so that the small multiples taken of them are finite.
const LARGEST: f64 = 1e300;

/// A curve that is monotone wherever its points are, and C¹ between the table's ends: cubic Hermite
/// pieces with the slopes of Fritsch & Butland (SIAM J. Sci. Stat. Comput. 5, 300–304, 1984,
/// doi:10.1137/0905021), which lie in the region that Fritsch & Carlson (SIAM J. Numer. Anal. 17,
/// 238–246, 1980, doi:10.1137/0717021) show to be monotone: at most three times either secant.
#[derive(Debug, Clone, PartialEq)]
pub struct Monotone {
    points: Points,
    /// dy/dx at the points.
    slopes: Vec<f64>,
}

impl Monotone {
    /// Through the points (x_i, y_i), x strictly ascending.
    pub fn new(x: Vec<f64>, y: Vec<f64>) -> Result<Self, TableError> {
        let points = Points::new(x, y)?;
        let slopes = points.monotone_slopes();
        Ok(Self { points, slopes })
    }

    /// y(x); beyond the table what it is at its end.
    pub fn value(&self, x: f64) -> f64 {
        let (i, t) = self.points.locate(x);
        let [before, after] = self.points.ends(i);
        let [linear, square, cube] = self.coefficients(i);
        let rise = self.points.step(i) * t * (linear + t * (square + t * cube));
        within(before, after, if t >= 1.0 { after } else { before + rise })
    }

    /// dy/dx at x; 0 beyond the table.
    pub fn slope(&self, x: f64) -> f64 {
        if self.points.lies_beyond(x) {
            return 0.0;
        }
        let (i, t) = self.points.locate(x);
        let [linear, square, cube] = self.coefficients(i);
        linear + t * (2.0 * square + 3.0 * t * cube)
    }

    /// First and last x.
    pub fn range(&self) -> (f64, f64) {
        self.points.range()
    }

    /// The smallest value anywhere.
    pub fn minimum(&self) -> f64 {
        self.points.minimum()
    }

    /// The largest value anywhere.
    pub fn maximum(&self) -> f64 {
        self.points.maximum()
    }

    /// The values at the points.
    pub fn y(&self) -> &[f64] {
        &self.points.y
    }

    /// Of t, t², t³ in (y − y_i)/h for t = (x − x_i)/h.
    fn coefficients(&self, i: usize) -> [f64; 3] {
        let (before, after, secant) = (self.slopes[i], self.slopes[i + 1], self.points.secant(i));
        [before, 3.0 * secant - 2.0 * before - after, before + after - 2.0 * secant]
    }
}

/// Straight from point to point.
#[derive(Debug, Clone, PartialEq)]
pub struct Linear {
    points: Points,
}

impl Linear {
    /// Through the points (x_i, y_i), x strictly ascending.
    pub fn new(x: Vec<f64>, y: Vec<f64>) -> Result<Self, TableError> {
        Ok(Self { points: Points::new(x, y)? })
    }

    /// y(x); beyond the table what it is at its end.
    pub fn value(&self, x: f64) -> f64 {
        let (i, t) = self.points.locate(x);
        let [before, after] = self.points.ends(i);
        between(before, after, t)
    }

    /// dy/dx at x, at a point that of the piece after it; 0 beyond the table.
    pub fn slope(&self, x: f64) -> f64 {
        if self.points.lies_beyond(x) {
            return 0.0;
        }
        self.points.secant(self.points.locate(x).0)
    }

    /// Mean of y over the table's range: ∫ y dx / ∫ dx, exact.
    pub fn mean(&self) -> f64 {
        let (first, last) = self.range();
        let area = |i| {
            let [before, after] = self.points.ends(i);
            0.5 * (before + after) * (self.points.step(i) / (last - first))
        };
        (0..self.points.pieces()).map(area).sum()
    }

    /// First and last x.
    pub fn range(&self) -> (f64, f64) {
        self.points.range()
    }

    /// The smallest value anywhere.
    pub fn minimum(&self) -> f64 {
        self.points.minimum()
    }

    /// The largest value anywhere.
    pub fn maximum(&self) -> f64 {
        self.points.maximum()
    }

    /// The places, where the curve has its kinks.
    pub fn x(&self) -> &[f64] {
        &self.points.x
    }

    /// The values at the places.
    pub fn y(&self) -> &[f64] {
        &self.points.y
    }
}

/// From a (t = 0) straight to b (t = 1), both exact.
pub(crate) fn between(a: f64, b: f64, t: f64) -> f64 {
    within(a, b, if t >= 1.0 { b } else { a + (b - a) * t })
}

/// A value known to lie between a and b, without the rounding that could take it past them.
fn within(a: f64, b: f64, value: f64) -> f64 {
    let (low, high) = (a.min(b), a.max(b));
    if value < low {
        low
    } else if value > high {
        high
    } else {
        value
    }
}

/// A checked table: at least two points, finite, x strictly ascending.
#[derive(Debug, Clone, PartialEq)]
struct Points {
    x: Vec<f64>,
    y: Vec<f64>,
}

impl Points {
    fn new(x: Vec<f64>, y: Vec<f64>) -> Result<Self, TableError> {
        if x.len() != y.len() {
            return Err(TableError::LengthsDiffer { x: x.len(), y: y.len() });
        }
        if x.len() < 2 {
            return Err(TableError::TooFewPoints { points: x.len() });
        }
        for (axis, values) in [(Axis::X, &x), (Axis::Y, &y)] {
            if let Some(index) = values.iter().position(|v| !v.is_finite()) {
                return Err(TableError::NotFinite { axis, index, value: values[index] });
            }
        }
        if let Some(i) = x.windows(2).position(|pair| pair[1] <= pair[0]) {
            return Err(TableError::NotAscending { index: i + 1, value: x[i + 1], previous: x[i] });
        }
        let points = Self { x, y };
        let is_fit = |i| points.step(i) < LARGEST && points.secant(i).abs() < LARGEST;
        if let Some(i) = (0..points.pieces()).find(|i| !is_fit(*i)) {
            return Err(TableError::TooSteep { index: i + 1, value: points.y[i + 1] });
        }
        Ok(points)
    }

    fn pieces(&self) -> usize {
        self.x.len() - 1
    }

    fn step(&self, i: usize) -> f64 {
        self.x[i + 1] - self.x[i]
    }

    fn ends(&self, i: usize) -> [f64; 2] {
        [self.y[i], self.y[i + 1]]
    }

    fn secant(&self, i: usize) -> f64 {
        (self.y[i + 1] - self.y[i]) / self.step(i)
    }

    /// The piece that x lies in and the share of it before x, in [0, 1]: beyond the table its end.
    fn locate(&self, x: f64) -> (usize, f64) {
        let i = self.x.partition_point(|p| *p <= x).clamp(1, self.pieces()) - 1;
        (i, ((x - self.x[i]) / self.step(i)).clamp(0.0, 1.0))
    }

    fn lies_beyond(&self, x: f64) -> bool {
        let (first, last) = self.range();
        x < first || x > last
    }

    fn range(&self) -> (f64, f64) {
        (self.x[0], self.x[self.pieces()])
    }

    fn minimum(&self) -> f64 {
        self.y.iter().copied().fold(f64::INFINITY, f64::min)
    }

    fn maximum(&self) -> f64 {
        self.y.iter().copied().fold(f64::NEG_INFINITY, f64::max)
    }

    /// dy/dx at every point. Inside, the weighted harmonic mean of the two secants,
    /// 1/m = α/s₋ + (1 − α)/s₊ with α = (1 + h₊/(h₋ + h₊))/3 (Fritsch & Butland), or 0 at a turning
    /// point; for the ends see [`end_slope`].
    fn monotone_slopes(&self) -> Vec<f64> {
        let last = self.pieces() - 1;
        if last == 0 {
            return vec![self.secant(0); 2];
        }
        let end = |i: usize, inner: usize| {
            let share = self.step(i) / (self.step(i) + self.step(inner));
            end_slope(self.secant(i), self.secant(inner), share)
        };
        let inside = (1..=last).map(|i| {
            let (before, after) = (self.secant(i - 1), self.secant(i));
            if before.min(after) <= 0.0 && before.max(after) >= 0.0 {
                return 0.0;
            }
            let weight = (1.0 + self.step(i) / (self.step(i - 1) + self.step(i))) / 3.0;
            1.0 / (weight / before + (1.0 - weight) / after)
        });
        std::iter::once(end(0, 1)).chain(inside).chain([end(last, last - 1)]).collect()
    }
}

/// Slope at an end: of the parabola through the last three points, kept between 0 and three times the
/// last piece's secant, where that piece is monotone. `share` is the last piece's share of the last two.
fn end_slope(secant: f64, inner: f64, share: f64) -> f64 {
    within(0.0, 3.0 * secant, secant + (secant - inner) * share)
}
