//! Where a run starts, as it is written.

use serde::de::{Deserializer, Error, MapAccess, Visitor, value::MapAccessDeserializer};
use serde::{Deserialize, Serialize, Serializer};
use std::fmt;

/// Where a run starts.
#[derive(Debug, Clone, PartialEq)]
pub enum Start {
    /// The steady state of the run's parameters.
    Steady,
    /// H linear from `thickness_0_m` at x = 0 to d at x = L.
    Wedge(Wedge),
    /// The last state of a stored run.
    Run(String),
}

/// A wedge to start from.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Wedge {
    /// L, m.
    pub length_m: f64,
    /// H₀, m.
    pub thickness_0_m: f64,
}

impl Serialize for Start {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Start::Steady => serializer.serialize_str("steady"),
            Start::Wedge(wedge) => wedge.serialize(serializer),
            Start::Run(id) => serializer.collect_map([("run", id)]),
        }
    }
}

impl<'de> Deserialize<'de> for Start {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Members {
            length_m: Option<f64>,
            thickness_0_m: Option<f64>,
            run: Option<String>,
        }
        const FORMS: &str = r#""steady", {"length_m": …, "thickness_0_m": …} or {"run": "<id>"}"#;
        struct Forms;
        impl<'de> Visitor<'de> for Forms {
            type Value = Start;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(FORMS)
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<Start, E> {
                if text == "steady" {
                    Ok(Start::Steady)
                } else {
                    Err(E::custom(format!("\"{text}\" is no start; permitted are {FORMS}")))
                }
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Start, A::Error> {
                let members = Members::deserialize(MapAccessDeserializer::new(map))?;
                match (members.length_m, members.thickness_0_m, members.run) {
                    (Some(length_m), Some(thickness_0_m), None) => {
                        Ok(Start::Wedge(Wedge { length_m, thickness_0_m }))
                    }
                    (None, None, Some(id)) => Ok(Start::Run(id)),
                    _ => Err(A::Error::custom(format!("permitted are {FORMS}"))),
                }
            }
        }
        deserializer.deserialize_any(Forms)
    }
}
