//! The parameters of a run: defaults, overlaid with what the document gives and then with a point of the
//! sweep. What depends on names only is checked once, what depends on values at each point.

use super::entries::Entries;
use super::refusal::Refusal;
use super::run::FLUX;
use melange_solver::params::{self, ParameterError, Parameters};

/// What the runs of a document have in common of their parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct Effective {
    base: Parameters,
    flux: Option<f64>,
    names: Vec<String>,
    is_at_rest: bool,
    has_fjord: bool,
}

/// What the flux sets.
/// What a calving flux sets.
pub const VELOCITIES: [&str; 2] = ["calving_rate_m_per_a", "terminus_velocity_m_per_a"];
/// What a table of widths sets.
pub const WIDTHS: [&str; 2] = ["width_m", "width_gradient"];
/// Parameters that are 0 where nothing calves or melts.
const NOT_AT_REST: [&str; 2] = ["calving_rate_m_per_a", "melt_rate_m_per_day"];

impl Effective {
    /// Defaults, overlaid with what is written; no name twice.
    pub fn new(written: &Entries<f64>, is_at_rest: bool, has_fjord: bool) -> Result<Self, Refusal> {
        let mut base = Parameters::default();
        if is_at_rest {
            for name in NOT_AT_REST {
                base.set(name, 0.0).map_err(|e| Refusal::parameter("parameters", &e))?;
            }
        }
        let mut effective = Self { base, flux: None, names: Vec::new(), is_at_rest, has_fjord };
        for (name, value) in &written.0 {
            effective.take_name(name, *value)?;
            let (mut base, mut flux) = (effective.base, effective.flux);
            effective.put(&mut base, &mut flux, name, *value)?;
            (effective.base, effective.flux) = (base, flux);
        }
        effective.check_flux(effective.flux)?;
        Ok(effective)
    }

    /// The same with parameters that every point sets, each given with its first value; no name twice.
    pub fn varied(
        mut self,
        columns: impl Iterator<Item = (&'static str, f64)>,
    ) -> Result<Self, Refusal> {
        let mut flux = self.flux;
        for (name, value) in columns {
            self.take_name(name, value)?;
            if name == FLUX {
                flux = Some(value);
            }
        }
        self.check_flux(flux)?;
        Ok(self)
    }

    /// The parameters at a point.
    pub fn at(
        &self,
        point: impl Iterator<Item = (&'static str, f64)>,
    ) -> Result<Parameters, Refusal> {
        let (mut parameters, mut flux) = (self.base, self.flux);
        for (name, value) in point {
            self.put(&mut parameters, &mut flux, name, value)?;
        }
        if let Some(flux) = flux.filter(|_| !self.is_at_rest) {
            set_velocities(&mut parameters, flux)?;
        }
        Ok(parameters)
    }

    fn take_name(&mut self, name: &str, value: f64) -> Result<(), Refusal> {
        let refuse =
            |permitted| Err(Refusal::number(format!("parameters.{name}"), value, permitted));
        if self.names.iter().any(|taken| taken == name) {
            return refuse("this parameter is given more than once");
        }
        if self.has_fjord && WIDTHS.contains(&name) {
            return refuse("not together with `fjord`, which gives the width");
        }
        self.names.push(name.to_owned());
        Ok(())
    }

    fn put(
        &self,
        parameters: &mut Parameters,
        flux: &mut Option<f64>,
        name: &str,
        value: f64,
    ) -> Result<(), Refusal> {
        if self.is_at_rest && value != 0.0 && (name == FLUX || NOT_AT_REST.contains(&name)) {
            let permitted = "0: in the quasi_static regime nothing calves and nothing melts";
            return Err(Refusal::number(format!("parameters.{name}"), value, permitted));
        }
        if name == FLUX {
            *flux = Some(value);
            return Ok(());
        }
        parameters.set(name, value).map_err(|e| match e {
            ParameterError::Unknown { .. } => Refusal::unknown_parameter("parameters", name, value),
            e => Refusal::parameter("parameters", &e),
        })
    }

    fn check_flux(&self, flux: Option<f64>) -> Result<(), Refusal> {
        let Some(flux) = flux.filter(|_| !self.is_at_rest) else { return Ok(()) };
        let taken = |name: &&&str| self.names.iter().any(|taken| taken == **name);
        match VELOCITIES.iter().find(taken) {
            Some(name) => {
                let permitted = format!("not together with {name}: the flux sets both velocities");
                Err(Refusal::number(format!("parameters.{FLUX}"), flux, permitted))
            }
            None => Ok(()),
        }
    }
}

fn set_velocities(parameters: &mut Parameters, flux: f64) -> Result<(), Refusal> {
    let speed = flux / parameters.terminus_thickness_m;
    for name in VELOCITIES {
        parameters.set(name, speed).map_err(|_| {
            let permitted = format!(
                "a finite number whose quotient by terminus_thickness_m = {} is {}",
                parameters.terminus_thickness_m,
                params::permitted(name)
            );
            Refusal::number(format!("parameters.{FLUX}"), flux, permitted)
        })?;
    }
    Ok(())
}
