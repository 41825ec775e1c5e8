//! What varies along the fjord, as it is written: its width, and where the ice melts.

use super::refusal::Refusal;
use melange_solver::fjord::Fjord;
use melange_solver::interpolate::{self, Axis, Linear, Monotone, TableError};
use melange_solver::melt::{self, MeltShape};
use melange_solver::params;
use serde::de::{Deserializer, Error, MapAccess, Visitor, value::MapAccessDeserializer};
use serde::{Deserialize, Serialize, Serializer};
use std::fmt;
use utoipa::ToSchema;

/// Most points of a table.
const MAX_POINTS: usize = 100_000;
/// Walls steeper than 45° leave nothing of a model along the fjord.
const STEEPEST: f64 = 1.0;

/// Widths over the distance down-fjord from the terminus' position at t = 0.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct FjordTable {
    /// x, m, ascending; it must reach from 0 or before to past the mélange's end.
    pub x_m: Vec<f64>,
    /// W(x), m.
    pub width_m: Vec<f64>,
    /// What lies beyond the table.
    #[serde(default, skip_serializing_if = "Beyond::is_default")]
    pub beyond: Beyond,
}

/// What lies beyond a table's ends.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Beyond {
    /// Nothing is known: a mélange that reaches there is an error.
    #[default]
    Refused,
    /// What is true at the end.
    Constant,
}

impl Beyond {
    fn is_default(&self) -> bool {
        *self == Self::default()
    }

    fn name(self) -> &'static str {
        match self {
            Self::Refused => "refused",
            Self::Constant => "constant",
        }
    }

    fn meant(self) -> interpolate::Beyond {
        match self {
            Self::Refused => interpolate::Beyond::Refused,
            Self::Constant => interpolate::Beyond::Constant,
        }
    }
}

impl FjordTable {
    /// The fjord, checked.
    pub fn fjord(&self) -> Result<Fjord, Refusal> {
        let names = ["fjord.x_m", "fjord.width_m"];
        check_points(names[0], self.x_m.len())?;
        let info = params::info("width_m").expect("the width is a parameter");
        if let Some(i) = self.width_m.iter().position(|w| info.check(*w).is_err()) {
            let field = format!("fjord.width_m[{i}]");
            return Err(Refusal::number(field, self.width_m[i], params::permitted("width_m")));
        }
        let refused = |e| table(names, &e);
        let widths = Monotone::new(self.x_m.clone(), self.width_m.clone()).map_err(refused)?;
        let steps = self.x_m.windows(2).zip(self.width_m.windows(2));
        for (i, (x, w)) in steps.enumerate() {
            if ((w[1] - w[0]) / (x[1] - x[0])).abs() > STEEPEST {
                let field = format!("fjord.width_m[{}]", i + 1);
                let permitted = "widths that change by no more than the distance between them";
                return Err(Refusal::number(field, w[1], permitted));
            }
        }
        let (first, last) = widths.range();
        if self.beyond == Beyond::Refused && !(first <= 0.0 && last > 0.0) {
            let permitted = "from 0 or before to beyond 0, where the terminus stands at t = 0";
            return Err(Refusal::value(names[0], vec![first, last], permitted));
        }
        Fjord::table(widths, self.beyond.meant()).map_err(refused)
    }

    /// Everything it says, for its identity.
    pub fn parts(&self) -> (&'static str, [&[f64]; 2]) {
        (self.beyond.name(), [&self.x_m, &self.width_m])
    }
}

/// How the melt rate is spread along the mélange.
#[derive(Debug, Clone, PartialEq)]
pub enum MeltForm {
    /// One of the named shapes.
    Named(String),
    /// Factors over χ, scaled to a mean of 1.
    Chi {
        /// χ, from 0 to 1.
        chi: Vec<f64>,
        /// Factors, none negative.
        factor: Vec<f64>,
    },
    /// Factors over x, as they are.
    X {
        /// x, m.
        x_m: Vec<f64>,
        /// Factors, none negative.
        factor: Vec<f64>,
        /// What x is counted from.
        frame: Frame,
        /// What lies beyond.
        beyond: Beyond,
    },
}

/// What a table's x is counted from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Frame {
    /// The terminus, wherever it is.
    Terminus,
    /// The terminus' position at t = 0.
    Bedrock,
}

impl Frame {
    fn name(self) -> &'static str {
        match self {
            Self::Terminus => "terminus",
            Self::Bedrock => "bedrock",
        }
    }
}

impl MeltForm {
    /// The shape, checked.
    pub fn shape(&self) -> Result<MeltShape, Refusal> {
        match self {
            Self::Named(name) => MeltShape::named(name).ok_or_else(|| {
                Refusal::value("melt_shape", name.as_str(), format!("one of {}", forms()))
            }),
            Self::Chi { chi, factor } => {
                let names = ["melt_shape.chi", "melt_shape.factor"];
                check_points(names[0], chi.len())?;
                check_factors(factor)?;
                Linear::new(chi.clone(), factor.clone())
                    .and_then(MeltShape::over_chi)
                    .map_err(|e| table(names, &e))
            }
            Self::X { x_m, factor, frame, beyond } => {
                let names = ["melt_shape.x_m", "melt_shape.factor"];
                check_points(names[0], x_m.len())?;
                check_factors(factor)?;
                let frame = match frame {
                    Frame::Terminus => melt::Frame::Terminus,
                    Frame::Bedrock => melt::Frame::Bedrock,
                };
                Linear::new(x_m.clone(), factor.clone())
                    .and_then(|factors| MeltShape::over_x(factors, frame, beyond.meant()))
                    .map_err(|e| table(names, &e))
            }
        }
    }

    /// Everything it says, for its identity.
    pub fn parts(&self) -> (String, [&[f64]; 2]) {
        match self {
            Self::Named(name) => (name.clone(), [&[], &[]]),
            Self::Chi { chi, factor } => ("chi".into(), [chi, factor]),
            Self::X { x_m, factor, frame, beyond } => {
                (format!("x {} {}", frame.name(), beyond.name()), [x_m, factor])
            }
        }
    }
}

/// Most that a factor of the melt rate may be.
const LARGEST_FACTOR: f64 = 1e3;

fn check_factors(factors: &[f64]) -> Result<(), Refusal> {
    match factors.iter().position(|f| *f > LARGEST_FACTOR) {
        Some(i) => {
            let permitted = format!("a finite number from 0 to {LARGEST_FACTOR}");
            Err(Refusal::number(format!("melt_shape.factor[{i}]"), factors[i], permitted))
        }
        None => Ok(()),
    }
}

fn check_points(field: &str, points: usize) -> Result<(), Refusal> {
    if points > MAX_POINTS {
        return Err(Refusal::value(field, points, format!("at most {MAX_POINTS} points")));
    }
    Ok(())
}

/// A table's error, said of the fields that hold its two arrays.
pub fn table(names: [&str; 2], error: &TableError) -> Refusal {
    let (axis, index, value) = error.place();
    let name = names[usize::from(axis == Axis::Y)];
    let field = index.map_or_else(|| name.to_owned(), |i| format!("{name}[{i}]"));
    let permitted = error.permitted();
    match value {
        Some(value) => Refusal::number(field, value, permitted),
        None => Refusal {
            detail: format!("`{field}` is refused: {error}"),
            field: Some(field),
            value: None,
            permitted: Some(permitted),
            character: None,
        },
    }
}

fn forms() -> String {
    let names = MeltShape::names().map(|name| format!("\"{name}\""));
    format!(
        r#"{}, {{"chi": […], "factor": […]}}, {{"x_m": […], "factor": […], "frame": "terminus" or "bedrock"}}"#,
        names.join(", ")
    )
}

impl Serialize for MeltForm {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Chi<'a> {
            chi: &'a [f64],
            factor: &'a [f64],
        }
        #[derive(Serialize)]
        struct X<'a> {
            x_m: &'a [f64],
            factor: &'a [f64],
            frame: Frame,
            #[serde(skip_serializing_if = "Beyond::is_default")]
            beyond: Beyond,
        }
        match self {
            Self::Named(name) => serializer.serialize_str(name),
            Self::Chi { chi, factor } => Chi { chi, factor }.serialize(serializer),
            Self::X { x_m, factor, frame, beyond } => {
                X { x_m, factor, frame: *frame, beyond: *beyond }.serialize(serializer)
            }
        }
    }
}

impl<'de> Deserialize<'de> for MeltForm {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Members {
            chi: Option<Vec<f64>>,
            x_m: Option<Vec<f64>>,
            factor: Option<Vec<f64>>,
            frame: Option<Frame>,
            beyond: Option<Beyond>,
        }
        struct Forms;
        impl<'de> Visitor<'de> for Forms {
            type Value = MeltForm;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(&forms())
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<MeltForm, E> {
                Ok(MeltForm::Named(text.to_owned()))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<MeltForm, A::Error> {
                let m = Members::deserialize(MapAccessDeserializer::new(map))?;
                match (m.chi, m.x_m, m.factor, m.frame, m.beyond) {
                    (Some(chi), None, Some(factor), None, None) => {
                        Ok(MeltForm::Chi { chi, factor })
                    }
                    (None, Some(x_m), Some(factor), Some(frame), beyond) => {
                        let beyond = beyond.unwrap_or_default();
                        Ok(MeltForm::X { x_m, factor, frame, beyond })
                    }
                    _ => Err(A::Error::custom(format!("permitted are {}", forms()))),
                }
            }
        }
        deserializer.deserialize_any(Forms)
    }
}
