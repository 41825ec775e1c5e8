//! Control parameters: the scalars along which steady states are followed and differentiated, by name, with
//! what the equations are given as they change. Knows no equation.

use crate::force::force_n_per_m;
use crate::params::ParameterError;
use crate::physics::given::{Given, Rates};
use crate::physics::terminus::{Advance, CalvingLaw};
use crate::state::State;
use crate::{Model, fjord::Fjord};

/// A steady problem as control parameters see it.
#[derive(Debug, Clone, PartialEq)]
pub struct Setting {
    /// The mélange.
    pub model: Model,
    /// The law that sets the calving rate, if one does; the terminus stands at X₀ = 0.
    pub law: Option<CalvingLaw>,
}

/// A scalar that is varied.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Control {
    /// One of the model's parameters.
    Parameter(Given),
    /// U_c H_t with U_c = U_t, the flux of a glacier whose terminus stands still; m² a⁻¹.
    CalvingFlux,
    /// α₀ of the calving law, m a⁻¹.
    LawRate,
    /// α of the calving law, m² a⁻¹ N⁻¹.
    LawPerForce,
}

/// Names and units of the controls that are no parameters, with the ranges they may be followed through.
const OTHERS: [(Control, &str, &str, (f64, f64)); 3] = [
    (Control::CalvingFlux, "calving_flux_m2_per_a", "m2 a-1", (0.0, 5e8)),
    (Control::LawRate, "rate_m_per_a", "m a-1", (-1e9, 1e9)),
    (Control::LawPerForce, "per_force_m2_per_a_n", "m2 a-1 N-1", (-1e3, 1e3)),
];

impl Control {
    /// The control of a name.
    pub fn named(name: &str) -> Option<Self> {
        let parameter = Given::ALL.into_iter().find(|given| given.info().name == name);
        let other = || OTHERS.into_iter().find(|(_, known, ..)| *known == name);
        parameter.map(Self::Parameter).or_else(|| other().map(|(control, ..)| control))
    }

    /// All names.
    pub fn names() -> Vec<&'static str> {
        let others = OTHERS.map(|(_, name, ..)| name);
        Given::ALL.into_iter().map(|given| given.info().name).chain(others).collect()
    }

    fn other(self) -> Option<(&'static str, &'static str, (f64, f64))> {
        let row = OTHERS.into_iter().find(|(control, ..)| *control == self)?;
        Some((row.1, row.2, row.3))
    }

    /// Its name at every boundary.
    pub fn name(self) -> &'static str {
        match self {
            Self::Parameter(given) => given.info().name,
            _ => self.other().expect("every control but a parameter is listed").0,
        }
    }

    /// Its unit.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Parameter(given) => given.info().unit,
            _ => self.other().expect("every control but a parameter is listed").1,
        }
    }

    /// Smallest and largest value.
    pub fn range(self) -> (f64, f64) {
        match self {
            Self::Parameter(given) => (given.info().min, given.info().max),
            _ => self.other().expect("every control but a parameter is listed").2,
        }
    }

    /// Refuses what cannot be varied in a setting: a width that a table gives, a calving rate that a law
    /// sets, a law that there is not, and what would make the terminus move through a fjord that varies.
    pub fn check(self, setting: &Setting) -> Result<(), ParameterError> {
        let contradiction = |permitted: &str| {
            Err(ParameterError::Contradiction {
                name: self.name(),
                value: self.value(setting),
                permitted: permitted.to_owned(),
            })
        };
        setting.check()?;
        let model = &setting.model;
        let is_straight = model.fjord.is_straight();
        let p = model.parameters();
        let stands_still = p.terminus_velocity_m_per_a == p.calving_rate_m_per_a;
        match (self, &setting.law) {
            (Self::Parameter(Given::CalvingRate | Given::TerminusVelocity), _)
                if model.depends_on_place() =>
            {
                contradiction(
                    "no control where width or melt vary along the bedrock: a terminus that moves has no \
                     steady state there (calving_flux_m2_per_a varies both rates together)",
                )
            }
            (Self::Parameter(Given::WidthGradient), law) if law.is_some() || !stands_still => {
                contradiction("no control where the terminus may move: it has no steady state then")
            }
            (Self::CalvingFlux, _) if !stands_still => contradiction(
                "no control where the terminus velocity is not the calving rate, which it sets both",
            ),
            (Self::Parameter(Given::Width | Given::WidthGradient), _) if !is_straight => {
                contradiction("no control where a table gives the fjord's width")
            }
            (Self::Parameter(Given::CalvingRate) | Self::CalvingFlux, Some(_)) => {
                contradiction("no control where a calving law sets the calving rate")
            }
            (Self::LawRate | Self::LawPerForce, None) => {
                contradiction("a control only where a calving law sets the calving rate")
            }
            _ => Ok(()),
        }
    }

    /// Whether it can be varied beside another one: neither sets the other, and together they move no terminus
    /// through a fjord that varies.
    pub fn is_independent_of(self, other: Self) -> bool {
        const RATES: [Control; 2] =
            [Control::Parameter(Given::CalvingRate), Control::Parameter(Given::TerminusVelocity)];
        let excludes = |a: Self, b: Self| match a {
            Self::CalvingFlux => {
                RATES.contains(&b) || b == Self::Parameter(Given::TerminusThickness)
            }
            Self::Parameter(Given::WidthGradient) => RATES.contains(&b),
            _ => false,
        };
        self != other && !excludes(self, other) && !excludes(other, self)
    }

    /// Its value.
    pub fn value(self, setting: &Setting) -> f64 {
        let p = setting.model.parameters();
        let law = |get: fn(&CalvingLaw) -> f64| setting.law.as_ref().map_or(0.0, get);
        match self {
            Self::Parameter(given) => (given.info().get)(p),
            Self::CalvingFlux => p.calving_flux_m2_per_a(),
            Self::LawRate => law(|law| law.rate_m_per_a),
            Self::LawPerForce => law(|law| law.per_force_m2_per_a_n),
        }
    }

    /// Sets it; what is out of range is the caller's to refuse.
    pub fn set(self, setting: &mut Setting, value: f64) {
        let Setting { model, law } = setting;
        let p = &mut model.parameters;
        match self {
            Self::Parameter(given) => {
                given.info().set_unchecked(p, value);
                if matches!(given, Given::Width | Given::WidthGradient) {
                    model.fjord = Fjord::straight(p.width_m, p.width_gradient);
                }
            }
            Self::CalvingFlux => {
                p.calving_rate_m_per_a = value / p.terminus_thickness_m;
                p.terminus_velocity_m_per_a = p.calving_rate_m_per_a;
            }
            Self::LawRate => law.iter_mut().for_each(|law| law.rate_m_per_a = value),
            Self::LawPerForce => law.iter_mut().for_each(|law| law.per_force_m2_per_a_n = value),
        }
    }

    /// How fast what the equations are given changes with it, at a state.
    pub fn rates(self, setting: &Setting, s: &State) -> Rates {
        let mut rates = [0.0; Given::ALL.len()];
        // A law that asks for less than no calving gets none, whatever its numbers are.
        let acts = |law: &CalvingLaw| law.rate_m_per_a(force_n_per_m(s), 0.0) > 0.0;
        let is_law = matches!(self, Self::LawRate | Self::LawPerForce);
        if is_law && !setting.law.as_ref().is_some_and(acts) {
            return rates;
        }
        match self {
            // A law sets it.
            Self::Parameter(Given::CalvingRate) if setting.law.is_some() => {}
            Self::Parameter(given) => rates[given as usize] = 1.0,
            Self::CalvingFlux => {
                let per_flux = 1.0 / setting.model.parameters().terminus_thickness_m;
                rates[Given::CalvingRate as usize] = per_flux;
                rates[Given::TerminusVelocity as usize] = per_flux;
            }
            Self::LawRate => rates[Given::CalvingRate as usize] = 1.0,
            Self::LawPerForce => rates[Given::CalvingRate as usize] = -force_n_per_m(s),
        }
        rates
    }
}

impl Setting {
    /// Refuses laws that know where the terminus stands, and a law where width or melt vary along the bedrock:
    /// a steady state holds the terminus at X₀ = 0 while the rate that the law sets may move it.
    pub fn check(&self) -> Result<(), ParameterError> {
        let Some(law) = &self.law else { return Ok(()) };
        let refuse = |name: &'static str, value: f64, permitted: &str| {
            Err(ParameterError::Contradiction { name, value, permitted: permitted.to_owned() })
        };
        if law.per_advance_per_a != 0.0 {
            return refuse("per_advance_per_a", law.per_advance_per_a, "0 in a steady problem");
        }
        if law.thickness_per_advance != 0.0 {
            let value = law.thickness_per_advance;
            return refuse("thickness_per_advance", value, "0 in a steady problem");
        }
        if self.model.depends_on_place() {
            let permitted =
                "a calving law only where neither width nor melt vary along the bedrock";
            return refuse("rate_m_per_a", law.rate_m_per_a, permitted);
        }
        Ok(())
    }

    /// The terminus: at rest, calving by the law or as the parameters say.
    pub(crate) fn advance(&self) -> Advance {
        Advance { law: self.law, ..Advance::fixed(0.0) }
    }
}
