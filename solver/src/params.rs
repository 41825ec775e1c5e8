//! The model's scalar parameters: name, unit, meaning, default and permitted range of each, in one
//! table that validation, axes, stored columns and documentation all read. Knows no equation.

/// Density of ice, kg m⁻³.
pub const ICE_DENSITY: f64 = 917.0;
/// Density of sea water, kg m⁻³.
pub const WATER_DENSITY: f64 = 1028.0;
/// Gravitational acceleration, m s⁻².
pub const GRAVITY: f64 = 9.81;
/// Days in a year of 365.25 days.
pub const DAYS_PER_YEAR: f64 = 365.25;
/// Seconds in a year of 365.25 days.
pub const SECONDS_PER_YEAR: f64 = DAYS_PER_YEAR * 86_400.0;

/// All scalar parameters, with units in their names. Defaults are the base case of Fig. 2.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(non_snake_case, reason = "A is the field's symbol and the interface's name")]
pub struct Parameters {
    /// Glacier terminus velocity U_t.
    pub terminus_velocity_m_per_a: f64,
    /// Calving rate U_c.
    pub calving_rate_m_per_a: f64,
    /// Terminus thickness H_t.
    pub terminus_thickness_m: f64,
    /// Surface plus basal melt rate −Ḃ, positive.
    pub melt_rate_m_per_day: f64,
    /// Fjord width W at the terminus.
    pub width_m: f64,
    /// dW/dx along the fjord.
    pub width_gradient: f64,
    /// Characteristic iceberg size d.
    pub d_m: f64,
    /// Rheology's b.
    pub b: f64,
    /// Rheology's A.
    pub A: f64,
    /// Static yield coefficient μ_s.
    pub mu_s: f64,
    /// Finite strain rate δε̇ in μ = (|ε̇_xx| + δε̇)/g^x.
    pub strain_rate_regularisation_per_a: f64,
    /// Drag of the water below, per metre of width.
    pub water_drag_n_per_m: f64,
    /// Number of cells N.
    pub n_cells: usize,
}

/// One row of the parameter table.
#[derive(Debug, Clone, Copy)]
pub struct ParameterInfo {
    /// Name at every boundary.
    pub name: &'static str,
    /// Unit, "1" for dimensionless.
    pub unit: &'static str,
    /// Meaning, with the paper's symbol.
    pub meaning: &'static str,
    /// Default value: the base case of Fig. 2.
    pub default: f64,
    /// Smallest permitted value.
    pub min: f64,
    /// Largest permitted value.
    pub max: f64,
    /// Whether only whole numbers are permitted.
    pub whole: bool,
    /// Reads the parameter.
    pub get: fn(&Parameters) -> f64,
    set: fn(&mut Parameters, f64),
}

macro_rules! parameter {
    ($field:ident, $unit:literal, $default:expr, $min:expr, $max:expr, $meaning:literal) => {
        ParameterInfo {
            name: stringify!($field),
            unit: $unit,
            meaning: $meaning,
            default: $default,
            min: $min,
            max: $max,
            whole: false,
            get: |p| p.$field,
            set: |p, v| p.$field = v,
        }
    };
}

/// The parameter table. Ranges bound what can be meant by the name, not what has a steady state.
pub const PARAMETERS: [ParameterInfo; 13] = [
    parameter!(
        terminus_velocity_m_per_a,
        "m a-1",
        6000.0,
        0.0,
        1e5,
        "glacier terminus velocity U_t"
    ),
    parameter!(calving_rate_m_per_a, "m a-1", 6000.0, 0.0, 1e5, "calving rate U_c"),
    parameter!(terminus_thickness_m, "m", 600.0, 1.0, 5000.0, "terminus thickness H_t"),
    parameter!(
        melt_rate_m_per_day,
        "m d-1",
        0.6,
        0.0,
        100.0,
        "surface plus basal melt rate, positive"
    ),
    parameter!(width_m, "m", 4000.0, 10.0, 1e6, "fjord width W at the terminus"),
    parameter!(width_gradient, "1", 0.0, -1.0, 1.0, "gradient of the fjord width dW/dx"),
    parameter!(d_m, "m", 25.0, 0.01, 1000.0, "characteristic iceberg size d"),
    parameter!(b, "1", 1e4, 1.0, 1e12, "rheology constant b of Eq. 17"),
    parameter!(A, "1", 0.5, 1e-3, 1e3, "cooperativity constant A of Eq. 18"),
    parameter!(mu_s, "1", 0.3, 1e-3, 10.0, "static yield coefficient mu_s"),
    parameter!(
        strain_rate_regularisation_per_a,
        "a-1",
        1.0,
        1e-6,
        1e4,
        "finite strain rate added to |du/dx| in mu = (|du/dx| + this)/g"
    ),
    parameter!(water_drag_n_per_m, "N m-1", 0.0, 0.0, 1e6, "water drag per metre of width"),
    ParameterInfo {
        name: "n_cells",
        unit: "1",
        meaning: "number of cells N along the mélange",
        default: 50.0,
        min: 8.0,
        max: 4000.0,
        whole: true,
        get: |p| p.n_cells as f64,
        set: |p, v| p.n_cells = v as usize,
    },
];

/// A parameter that cannot be used, with what would be permitted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ParameterError {
    /// No parameter has this name.
    #[error("there is no parameter `{name}`; known are {}", names())]
    Unknown {
        /// The name given.
        name: String,
    },
    /// Not a finite number, out of range, or not whole where it must be.
    #[error("`{name}` = {value} is out of range: {}", permitted(name))]
    OutOfRange {
        /// Parameter's name.
        name: &'static str,
        /// Value given.
        value: f64,
    },
    /// Two parameters that exclude each other.
    #[error("`{name}` = {value} is out of range: {permitted}")]
    Contradiction {
        /// Parameter's name.
        name: &'static str,
        /// Value given.
        value: f64,
        /// What the other parameters leave room for.
        permitted: String,
    },
}

/// The permitted range of a parameter, as a sentence; empty for an unknown name.
pub fn permitted(name: &str) -> String {
    info(name).map_or_else(String::new, |p| {
        let kind = if p.whole { "a whole number" } else { "a finite number" };
        let unit = if p.unit == "1" { String::new() } else { format!(" {}", p.unit) };
        format!("{kind} from {} to {}{unit}", p.min, p.max)
    })
}

/// The table's row of a name.
pub fn info(name: &str) -> Option<&'static ParameterInfo> {
    PARAMETERS.iter().find(|p| p.name == name)
}

fn names() -> String {
    PARAMETERS.map(|p| p.name).join(", ")
}

impl ParameterInfo {
    /// Sets it without a look at the table.
    pub(crate) fn set_unchecked(&self, p: &mut Parameters, value: f64) {
        (self.set)(p, value);
    }

    /// Checks a single value against the table.
    pub fn check(&self, value: f64) -> Result<(), ParameterError> {
        let ok = value.is_finite()
            && (self.min..=self.max).contains(&value)
            && (!self.whole || value.fract() == 0.0);
        if ok { Ok(()) } else { Err(ParameterError::OutOfRange { name: self.name, value }) }
    }
}

impl Default for Parameters {
    fn default() -> Self {
        let mut p = Parameters {
            terminus_velocity_m_per_a: 0.0,
            calving_rate_m_per_a: 0.0,
            terminus_thickness_m: 0.0,
            melt_rate_m_per_day: 0.0,
            width_m: 0.0,
            width_gradient: 0.0,
            d_m: 0.0,
            b: 0.0,
            A: 0.0,
            mu_s: 0.0,
            strain_rate_regularisation_per_a: 0.0,
            water_drag_n_per_m: 0.0,
            n_cells: 0,
        };
        for info in &PARAMETERS {
            (info.set)(&mut p, info.default);
        }
        p
    }
}

impl Parameters {
    /// Sets a parameter by name after checking it against the table.
    pub fn set(&mut self, name: &str, value: f64) -> Result<(), ParameterError> {
        let info = info(name).ok_or_else(|| ParameterError::Unknown { name: name.to_owned() })?;
        info.check(value)?;
        (info.set)(self, value);
        Ok(())
    }

    /// Checks every value against the table, and those that bound each other.
    pub fn check(&self) -> Result<(), ParameterError> {
        for info in &PARAMETERS {
            info.check((info.get)(self))?;
        }
        if self.d_m >= self.terminus_thickness_m {
            return Err(ParameterError::Contradiction {
                name: "d_m",
                value: self.d_m,
                permitted: format!(
                    "icebergs must be smaller than the terminus is thick (terminus_thickness_m = {})",
                    self.terminus_thickness_m
                ),
            });
        }
        Ok(())
    }

    /// Melt rate in m a⁻¹.
    pub fn melt_rate_m_per_a(&self) -> f64 {
        self.melt_rate_m_per_day * DAYS_PER_YEAR
    }

    /// Ice flux through the terminus U_c H_t, m² a⁻¹ (numerator of Eq. 22).
    pub fn calving_flux_m2_per_a(&self) -> f64 {
        self.calving_rate_m_per_a * self.terminus_thickness_m
    }
}
