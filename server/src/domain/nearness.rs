//! How far runs are from given parameters. Numbers that are positive by nature are compared by their logarithms,
//! those that can be 0 or negative by their difference in units of a typical size; what is not given does
//! not count.

use super::refusal::Refusal;
use melange_solver::params::{self, PARAMETERS, ParameterInfo};

/// Parameters to be near to.
#[derive(Debug, Clone, PartialEq)]
pub struct Nearness {
    wanted: Vec<Wanted>,
}

/// A parameter with the value to be near to.
#[derive(Debug, Clone, Copy)]
pub struct Wanted {
    /// The parameter.
    pub parameter: &'static ParameterInfo,
    /// Its value.
    pub value: f64,
}

impl PartialEq for Wanted {
    fn eq(&self, other: &Self) -> bool {
        (self.parameter.name, self.value) == (other.parameter.name, other.value)
    }
}

/// How values of a parameter are compared.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Scale {
    /// By the difference of their logarithms.
    Logarithm,
    /// By their difference in this unit.
    Unit(f64),
}

/// What rounding may do to a distance, relatively: more than it does.
const ROUNDING: f64 = 1e-12;

/// How values of a parameter are compared: by logarithms if they are always positive; else in units of the
/// default, or of the largest permitted value where the default is 0.
pub fn scale(parameter: &ParameterInfo) -> Scale {
    match parameter {
        p if p.min > 0.0 => Scale::Logarithm,
        p if p.default != 0.0 => Scale::Unit(p.default.abs()),
        p => Scale::Unit(p.max),
    }
}

impl Nearness {
    /// To these values, at least one.
    pub fn new<'a>(given: impl IntoIterator<Item = (&'a str, f64)>) -> Result<Self, Refusal> {
        let mut wanted: Vec<Wanted> = Vec::new();
        for (name, value) in given {
            let Some(parameter) = PARAMETERS.iter().find(|p| p.name == name) else {
                let names: Vec<&str> = PARAMETERS.iter().map(|p| p.name).collect();
                return Err(Refusal::number(name, value, format!("one of {}", names.join(", "))));
            };
            if wanted.iter().any(|w| w.parameter.name == name) {
                return Err(Refusal::number(name, value, "each parameter once"));
            }
            if !(parameter.min..=parameter.max).contains(&value) {
                return Err(Refusal::number(name, value, params::permitted(name)));
            }
            wanted.push(Wanted { parameter, value });
        }
        if wanted.is_empty() {
            let why = "the value of a parameter, such as melt_rate_m_per_day = 0.7";
            return Err(Refusal::missing("parameter", why));
        }
        Ok(Self { wanted })
    }

    /// The parameters and their values.
    pub fn wanted(&self) -> &[Wanted] {
        &self.wanted
    }

    /// The distance of a run with these values, in the order of [`Nearness::wanted`].
    pub fn distance(&self, values: &[f64]) -> f64 {
        let square = |(wanted, value): (&Wanted, &f64)| wanted.offset(*value).powi(2);
        self.wanted.iter().zip(values).map(square).sum::<f64>().sqrt()
    }

    /// A distance that no run is nearer than whose values lie in these ranges; those that are not known are none.
    pub fn least(&self, range_of: impl Fn(&str) -> Option<(f64, f64)>) -> f64 {
        let square = |wanted: &Wanted| {
            let Some((low, high)) = range_of(wanted.parameter.name) else { return 0.0 };
            let nearest = wanted.value.clamp(low, high.max(low));
            wanted.offset(nearest).powi(2)
        };
        self.wanted.iter().map(square).sum::<f64>().sqrt() * (1.0 - ROUNDING)
    }
}

impl Wanted {
    /// How far a value is away in this parameter alone.
    pub fn offset(&self, value: f64) -> f64 {
        match scale(self.parameter) {
            Scale::Logarithm => libm::log(value) - libm::log(self.value),
            Scale::Unit(unit) => (value - self.value) / unit,
        }
    }

    /// All values that are no farther away than a distance in this parameter alone, and hardly any others.
    pub fn within(&self, distance: f64) -> (f64, f64) {
        let wide = distance * (1.0 + ROUNDING) + ROUNDING;
        match scale(self.parameter) {
            Scale::Logarithm => (self.value * libm::exp(-wide), self.value * libm::exp(wide)),
            Scale::Unit(unit) => (self.value - wide * unit, self.value + wide * unit),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn logarithms_where_numbers_are_positive_and_units_where_they_are_not() {
        let of =
            |name: &str| scale(PARAMETERS.iter().find(|p| p.name == name).expect("a parameter"));
        for name in ["terminus_thickness_m", "width_m", "d_m", "b", "A", "mu_s", "n_cells"] {
            assert_eq!(of(name), Scale::Logarithm, "{name}");
        }
        assert_eq!(of("strain_rate_regularisation_per_a"), Scale::Logarithm);
        assert_eq!(of("melt_rate_m_per_day"), Scale::Unit(0.6));
        assert_eq!(of("terminus_velocity_m_per_a"), Scale::Unit(6000.0));
        assert_eq!(of("calving_rate_m_per_a"), Scale::Unit(6000.0));
        assert_eq!(of("width_gradient"), Scale::Unit(1.0));
        assert_eq!(of("water_drag_n_per_m"), Scale::Unit(1e6));
    }

    #[test]
    fn only_known_parameters_in_their_range_are_taken() {
        assert!(Nearness::new([]).is_err());
        for (name, value) in [("force", 1.0), ("width_m", -1.0), ("width_m", f64::NAN)] {
            let refusal = Nearness::new([(name, value)]).expect_err(name);
            assert_eq!(refusal.field.as_deref(), Some(name));
        }
        assert!(Nearness::new([("d_m", 1.0), ("d_m", 2.0)]).is_err());
    }

    proptest! {
        #[test]
        fn no_value_of_a_range_is_nearer_than_the_range(
            wanted in (0.01..100.0, 10.0..1e6), low in (0.0..100.0, 10.0..1e6),
            wide in (0.0..10.0, 0.0..1e5), at in (0.0..=1.0, 0.0..=1.0),
        ) {
            let near = Nearness::new([("melt_rate_m_per_day", wanted.0), ("width_m", wanted.1)])
                .expect("they are parameters");
            let high = (low.0 + wide.0, low.1 + wide.1);
            let inside = |low: f64, high: f64, at: f64| (low + (high - low) * at).clamp(low, high);
            let values = [inside(low.0, high.0, at.0), inside(low.1, high.1, at.1)];
            let distance = near.distance(&values);
            let least = near.least(|name| Some(if name == "width_m" {
                (low.1, high.1)
            } else {
                (low.0, high.0)
            }));
            prop_assert!(least <= distance, "{least} > {distance}");
            for (wanted, value) in near.wanted().iter().zip(values) {
                let (from, to) = wanted.within(distance);
                prop_assert!((from..=to).contains(&value), "{value} is not from {from} to {to}");
            }
        }
    }
}
