//! What can be observed of a steady mélange, what the model predicts there, and how the prediction
//! changes with a parameter. Knows neither how a state was found nor what the comparison is for.

use super::CalibrationError;
use crate::Model;
use crate::control::{Control, Setting};
use crate::sensitivity::Quantity;
use crate::state::State;
use crate::transect::{Transect, transect};

/// A quantity that is observed, and where. x is from the terminus, y from either wall, both in metres and
/// both fixed while the mélange's length, and with it χ = x/L, varies.
///
/// Beyond the mélange's end a prediction goes on along the straight line through its last two values, so
/// that it stays continuous as L passes the place; [`Observed::is_beyond`] tells, and a fit counts them.
/// There is no ice to be observed there, so a good fit has none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Observed {
    /// H at x, m: straight between the cells' centres, and beyond the outermost as in Eq. 22 and C1.
    Thickness {
        /// Distance from the terminus, m.
        x_m: f64,
    },
    /// U at x, m a⁻¹, mean over the width, in the frame that moves with the terminus: straight between nodes.
    Velocity {
        /// Distance from the terminus, m.
        x_m: f64,
    },
    /// u at (x, y), m a⁻¹, relative to the walls (Eq. 26): straight between the points of [`transect()`].
    VelocityAcross {
        /// Distance from the terminus, m.
        x_m: f64,
        /// Distance from either wall, m; 0 beyond the other one.
        y_m: f64,
    },
    /// A number of the mélange as a whole: its length, the force on the terminus, …
    Whole(Quantity),
}

/// An observed number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation {
    /// Of what.
    pub observed: Observed,
    /// The number, in the unit of the quantity's name.
    pub value: f64,
    /// Its standard error, in the same unit.
    pub standard_error: f64,
}

const THICKNESS: &str = "thickness_m";
const VELOCITY: &str = "velocity_m_per_a";
const VELOCITY_ACROSS: &str = "velocity_across_m_per_a";

/// Names of all quantities, those of a place first.
pub fn names() -> Vec<&'static str> {
    let whole = Quantity::ALL.map(Quantity::name);
    [THICKNESS, VELOCITY, VELOCITY_ACROSS].into_iter().chain(whole).collect()
}

impl Observed {
    /// The quantity of a name, at the place it needs and no other.
    pub fn named(name: &str, x_m: Option<f64>, y_m: Option<f64>) -> Result<Self, CalibrationError> {
        let needed = |field, given: Option<f64>| {
            given.ok_or_else(|| CalibrationError::MissingPlace { field, quantity: name.to_owned() })
        };
        let superfluous = |field, given: Option<f64>| match given {
            Some(_) => Err(CalibrationError::SuperfluousPlace { field, quantity: name.to_owned() }),
            None => Ok(()),
        };
        let observed = match name {
            THICKNESS => Self::Thickness { x_m: needed("x_m", x_m)? },
            VELOCITY => Self::Velocity { x_m: needed("x_m", x_m)? },
            VELOCITY_ACROSS => {
                let (x_m, y_m) = (needed("x_m", x_m)?, needed("y_m", y_m)?);
                return Ok(Self::VelocityAcross { x_m, y_m });
            }
            _ => {
                let whole = Quantity::ALL.into_iter().find(|quantity| quantity.name() == name);
                let unknown = || CalibrationError::UnknownQuantity { name: name.to_owned() };
                let whole = whole.ok_or_else(unknown)?;
                superfluous("x_m", x_m)?;
                Self::Whole(whole)
            }
        };
        superfluous("y_m", y_m)?;
        Ok(observed)
    }

    /// Its name at every boundary, which tells the unit.
    pub fn name(self) -> &'static str {
        match self {
            Self::Thickness { .. } => THICKNESS,
            Self::Velocity { .. } => VELOCITY,
            Self::VelocityAcross { .. } => VELOCITY_ACROSS,
            Self::Whole(quantity) => quantity.name(),
        }
    }

    /// Distance from the terminus, m, of what has a place.
    pub fn x_m(self) -> Option<f64> {
        match self {
            Self::Thickness { x_m } | Self::Velocity { x_m } | Self::VelocityAcross { x_m, .. } => {
                Some(x_m)
            }
            Self::Whole(_) => None,
        }
    }

    /// Distance from the wall, m, of what has one.
    pub fn y_m(self) -> Option<f64> {
        match self {
            Self::VelocityAcross { y_m, .. } => Some(y_m),
            _ => None,
        }
    }

    /// Whether its place lies beyond a mélange's end.
    pub fn is_beyond(self, s: &State) -> bool {
        self.x_m().is_some_and(|x_m| x_m > s.length_m)
    }

    /// What the model says, at a steady state of a setting.
    pub fn prediction(self, setting: &Setting, s: &State) -> f64 {
        let n = s.n_cells() as f64;
        match self {
            Self::Thickness { x_m } => straight(&s.thickness_m, n * (x_m / s.length_m) - 0.5),
            Self::Velocity { x_m } => straight(&s.velocity_m_per_a, n * (x_m / s.length_m)),
            Self::VelocityAcross { x_m, y_m } => {
                let chi = x_m / s.length_m;
                let at = |chi| speed_at(&transect(&setting.model, s, 0.0, chi), y_m);
                match chi > 1.0 {
                    true => straight(&[at(1.0 - 1.0 / n), at(1.0)], 1.0 + n * (chi - 1.0)),
                    false => at(chi),
                }
            }
            Self::Whole(quantity) => quantity.value(setting, s),
        }
    }
}

/// The value at a place, counted in points, on the straight line through the two points about it; outside,
/// through the outermost two.
fn straight(values: &[f64], place: f64) -> f64 {
    let left = (place.max(0.0) as usize).min(values.len() - 2);
    values[left] + (place - left as f64) * (values[left + 1] - values[left])
}

/// Speed at a distance from a wall, the transect being mirrored at the centre.
fn speed_at(across: &Transect, y_m: f64) -> f64 {
    let from_wall_m = y_m.min(across.width_m - y_m).max(0.0);
    let intervals = (across.y_m.len() - 1) as f64;
    straight(&across.velocity_m_per_a, intervals * from_wall_m / (0.5 * across.width_m))
}

/// Half the step in ln p over which predictions are differenced along a tangent: their curvature then
/// adds about 1e-9 of themselves, and rounding as much.
const HALF_STEP_LN: f64 = 1e-6;

/// dQ/d(ln p) of predictions along a control, given the steady state's tangent d(state)/dp.
///
/// The predictions are differenced, state and parameter moving together along the tangent, which costs no
/// solve and follows whatever a prediction reads: H, U, L by χ = x/L, W, and p itself.
pub fn slopes_by_ln(
    observations: &[Observation],
    setting: &Setting,
    s: &State,
    control: Control,
    tangent: &State,
) -> Vec<f64> {
    let value = control.value(setting);
    let [ahead, behind] = [HALF_STEP_LN, -HALF_STEP_LN].map(|step| {
        let moved = State::combined([s, tangent], |[number, by]| number + step * value * by);
        let mut setting = setting.clone();
        control.set(&mut setting, value * (1.0 + step));
        (setting, moved)
    });
    let at = |(setting, s): &(Setting, State), observed: Observed| observed.prediction(setting, s);
    observations
        .iter()
        .map(|o| (at(&ahead, o.observed) - at(&behind, o.observed)) / (2.0 * HALF_STEP_LN))
        .collect()
}

impl Observation {
    /// (prediction − value)/standard error.
    pub fn residual(&self, prediction: f64) -> f64 {
        (prediction - self.value) / self.standard_error
    }

    /// Refuses numbers that make no sense; `field` is what the observation is called in the error.
    pub fn check(&self, field: &str, model: &Model) -> Result<(), CalibrationError> {
        let ensure = |ok: bool, name: &str, value: f64, permitted: String| {
            let field = || format!("{field}.{name}");
            let wrong = || CalibrationError::OutOfRange { field: field(), value, permitted };
            if ok { Ok(()) } else { Err(wrong()) }
        };
        let Self { observed, value, standard_error } = *self;
        ensure(value.is_finite(), "value", value, "a finite number".into())?;
        let is_positive = standard_error.is_finite() && standard_error > 0.0;
        let permitted = "a finite number above 0";
        ensure(is_positive, "standard_error", standard_error, permitted.into())?;
        let Some(x_m) = observed.x_m() else { return Ok(()) };
        let permitted = "a finite number from 0 m, the terminus, on";
        ensure(x_m.is_finite() && x_m >= 0.0, "x_m", x_m, permitted.into())?;
        let Some(y_m) = observed.y_m() else { return Ok(()) };
        let width_m = model.fjord().width(x_m);
        let permitted = format!("from 0 m to the fjord's width at x = {x_m} m, {width_m} m");
        ensure((0.0..=width_m).contains(&y_m), "y_m", y_m, permitted)
    }
}
