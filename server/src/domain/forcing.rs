//! What varies in time, as it is written: courses of parameters, and laws that set the calving rate.

use super::along::table;
use super::entries::Entries;
use super::refusal::Refusal;
use melange_solver::forcing::{Course, Forcing};
use melange_solver::interpolate::Linear;
use melange_solver::params;
use melange_solver::physics::terminus::CalvingLaw;
use serde::de::{Deserializer, Error, MapAccess, Visitor, value::MapAccessDeserializer};
use serde::{Deserialize, Serialize, Serializer};
use std::fmt;
use utoipa::ToSchema;

/// A parameter's course in time; times in a.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum CourseForm {
    /// mean + amplitude·sin 2π(t − phase)/period.
    Sinusoid {
        /// Mean.
        mean: f64,
        /// Amplitude.
        amplitude: f64,
        /// Period, a.
        period_a: f64,
        /// Phase, a.
        #[serde(default)]
        phase_a: f64,
    },
    /// From one value to another, constant before and after.
    Ramp {
        /// Value before.
        from: f64,
        /// Value after.
        to: f64,
        /// Start, a.
        start_a: f64,
        /// End, a.
        end_a: f64,
    },
    /// base + (peak − base)·sin(πs/width) where s = (t − phase) mod period is below the width, else base.
    Pulse {
        /// Value out of season.
        base: f64,
        /// Value in mid-season.
        peak: f64,
        /// Period, a.
        period_a: f64,
        /// Length of a season, a.
        width_a: f64,
        /// When a season starts, a.
        #[serde(default)]
        phase_a: f64,
    },
    /// Values over time, straight between them, constant before and after.
    Table {
        /// Times, a, ascending.
        time_a: Vec<f64>,
        /// Values.
        value: Vec<f64>,
    },
}

/// Shortest period, a: controlled steps land on every kink.
const SHORTEST_PERIOD_A: f64 = 1e-3;
/// Most times of a table, for the same reason.
const MAX_TIMES: usize = 20_000;

impl CourseForm {
    fn course(&self, field: &str) -> Result<Course, Refusal> {
        match self {
            Self::Sinusoid { period_a, .. } | Self::Pulse { period_a, .. }
                if *period_a > 0.0 && *period_a < SHORTEST_PERIOD_A =>
            {
                let field = format!("{field}.{}.period_a", self.parts().0);
                let permitted = format!("a finite number from {SHORTEST_PERIOD_A} a");
                return Err(Refusal::number(field, *period_a, permitted));
            }
            Self::Table { time_a, .. } if time_a.len() > MAX_TIMES => {
                let field = format!("{field}.table.time_a");
                let permitted = format!("at most {MAX_TIMES} times");
                return Err(Refusal::value(field, time_a.len(), permitted));
            }
            _ => {}
        }
        Ok(match self.clone() {
            Self::Sinusoid { mean, amplitude, period_a, phase_a } => {
                Course::Sinusoid { mean, amplitude, period_a, phase_a }
            }
            Self::Ramp { from, to, start_a, end_a } => Course::Ramp { from, to, start_a, end_a },
            Self::Pulse { base, peak, period_a, width_a, phase_a } => {
                Course::Pulse { base, peak, period_a, width_a, phase_a }
            }
            Self::Table { time_a, value } => {
                let names = ["time_a", "value"].map(|n| format!("{field}.table.{n}"));
                let curve = Linear::new(time_a, value);
                Course::Table(curve.map_err(|e| table([&names[0], &names[1]], &e))?)
            }
        })
    }

    /// Its kind and its numbers, for its identity.
    pub fn parts(&self) -> (&'static str, Vec<f64>) {
        match self {
            Self::Sinusoid { mean, amplitude, period_a, phase_a } => {
                ("sinusoid", vec![*mean, *amplitude, *period_a, *phase_a])
            }
            Self::Ramp { from, to, start_a, end_a } => ("ramp", vec![*from, *to, *start_a, *end_a]),
            Self::Pulse { base, peak, period_a, width_a, phase_a } => {
                ("pulse", vec![*base, *peak, *period_a, *width_a, *phase_a])
            }
            Self::Table { time_a, value } => ("table", [&time_a[..], value].concat()),
        }
    }
}

/// The courses of a document, checked.
pub fn forcing(written: &Entries<CourseForm>) -> Result<Forcing, Refusal> {
    let courses = written
        .0
        .iter()
        .map(|(name, form)| Ok((name.clone(), form.course(&format!("forcing.{name}"))?)));
    Forcing::new(courses.collect::<Result<_, Refusal>>()?).map_err(|e| refusal(&e))
}

/// The refusal of a forcing that cannot be used.
pub fn refusal(e: &melange_solver::forcing::ForcingError) -> Refusal {
    match e.value() {
        Some(value) => Refusal::number(e.field(), value, e.permitted()),
        None => Refusal {
            detail: e.to_string(),
            field: Some(e.field()),
            value: None,
            permitted: Some(e.permitted()),
            character: None,
        },
    }
}

/// What sets the calving rate of a transient.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CalvingForm {
    /// Eq. 31, with calving rate and force of the steady state of the run's parameters.
    SteadyFeedback,
    /// U_c = α₀ − αF − βX₀, H_t = H_t0 − β_H X₀.
    Law(CalvingLaw),
}

impl CalvingForm {
    /// Refuses numbers no law is meant to have.
    pub fn check(&self) -> Result<(), Refusal> {
        let Self::Law(law) = self else { return Ok(()) };
        let rate = params::info("calving_rate_m_per_a").expect("the rate is a parameter");
        for (name, value, (min, max)) in [
            ("rate_m_per_a", law.rate_m_per_a, (rate.min, rate.max)),
            ("per_force_m2_per_a_n", law.per_force_m2_per_a_n, (-1.0, 1.0)),
            ("per_advance_per_a", law.per_advance_per_a, (-100.0, 100.0)),
            ("thickness_per_advance", law.thickness_per_advance, (-1.0, 1.0)),
        ] {
            if !(min..=max).contains(&value) {
                let permitted = format!("a finite number from {min} to {max}");
                return Err(Refusal::number(format!("calving_law.{name}"), value, permitted));
            }
        }
        Ok(())
    }
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct LawMembers {
    rate_m_per_a: f64,
    #[serde(default)]
    per_force_m2_per_a_n: f64,
    #[serde(default)]
    per_advance_per_a: f64,
    #[serde(default)]
    thickness_per_advance: f64,
}

impl Serialize for CalvingForm {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match *self {
            Self::SteadyFeedback => serializer.serialize_str("steady_feedback"),
            Self::Law(law) => LawMembers {
                rate_m_per_a: law.rate_m_per_a,
                per_force_m2_per_a_n: law.per_force_m2_per_a_n,
                per_advance_per_a: law.per_advance_per_a,
                thickness_per_advance: law.thickness_per_advance,
            }
            .serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for CalvingForm {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        const FORMS: &str = r#""steady_feedback" or {"rate_m_per_a": …, "per_force_m2_per_a_n": …, "per_advance_per_a": …, "thickness_per_advance": …}"#;
        struct Forms;
        impl<'de> Visitor<'de> for Forms {
            type Value = CalvingForm;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(FORMS)
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<CalvingForm, E> {
                if text == "steady_feedback" {
                    Ok(CalvingForm::SteadyFeedback)
                } else {
                    Err(E::custom(format!("\"{text}\" is no calving law; expected {FORMS}")))
                }
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<CalvingForm, A::Error> {
                let m = LawMembers::deserialize(MapAccessDeserializer::new(map))?;
                Ok(CalvingForm::Law(CalvingLaw {
                    rate_m_per_a: m.rate_m_per_a,
                    per_force_m2_per_a_n: m.per_force_m2_per_a_n,
                    per_advance_per_a: m.per_advance_per_a,
                    thickness_per_advance: m.thickness_per_advance,
                }))
            }
        }
        deserializer.deserialize_any(Forms)
    }
}
