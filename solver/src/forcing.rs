//! Parameters as functions of time. Knows no equation and no state; times are in years.

use crate::interpolate::{Linear, between};
use crate::params::{self, ParameterInfo, Parameters};
use std::f64::consts::{PI, TAU};

/// A value as a function of time t in years.
#[derive(Debug, Clone, PartialEq)]
pub enum Course {
    /// mean + amplitude·sin 2π(t − phase)/period.
    Sinusoid {
        /// Value about which it swings.
        mean: f64,
        /// Swing to either side.
        amplitude: f64,
        /// Time from swing to swing, a.
        period_a: f64,
        /// When it passes the mean, a.
        phase_a: f64,
    },
    /// `from` until the start, `to` after the end, straight between.
    Ramp {
        /// Value before.
        from: f64,
        /// Value after.
        to: f64,
        /// When it leaves `from`, a.
        start_a: f64,
        /// When it arrives at `to`, a.
        end_a: f64,
    },
    /// A season that recurs: with s = (t − phase) mod period, base + (peak − base)·sin(πs/width) for
    /// s < width, base for the rest of the period.
    Pulse {
        /// Value out of season.
        base: f64,
        /// Value in mid-season.
        peak: f64,
        /// Time from season to season, a.
        period_a: f64,
        /// Length of a season, a.
        width_a: f64,
        /// When a season starts, a.
        phase_a: f64,
    },
    /// Values over t, straight from point to point, constant before and after.
    Table(Linear),
}

/// A number that makes a course none.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("`{field}` = {value} is out of range: {permitted}")]
pub struct CourseError {
    /// The field, with the course's kind: `sinusoid.period_a`.
    pub field: String,
    /// Value given.
    pub value: f64,
    /// What is permitted.
    pub permitted: String,
}

impl Course {
    /// Its kind's name.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Sinusoid { .. } => "sinusoid",
            Self::Ramp { .. } => "ramp",
            Self::Pulse { .. } => "pulse",
            Self::Table(_) => "table",
        }
    }

    /// Checks that its numbers are finite and its times in order.
    pub fn check(&self) -> Result<(), CourseError> {
        let ensure = |ok: bool, field: &str, value: f64, permitted: String| {
            let field = || format!("{}.{field}", self.kind());
            if ok { Ok(()) } else { Err(CourseError { field: field(), value, permitted }) }
        };
        let finite = |fields: &[(&str, f64)]| {
            fields.iter().try_for_each(|(field, value)| {
                ensure(value.is_finite(), field, *value, "a finite number".into())
            })
        };
        match *self {
            Self::Sinusoid { mean, amplitude, period_a, phase_a } => {
                finite(&[
                    ("mean", mean),
                    ("amplitude", amplitude),
                    ("period_a", period_a),
                    ("phase_a", phase_a),
                ])?;
                ensure(period_a > 0.0, "period_a", period_a, "above 0 a".into())
            }
            Self::Ramp { from, to, start_a, end_a } => {
                finite(&[("from", from), ("to", to), ("start_a", start_a), ("end_a", end_a)])?;
                ensure(end_a > start_a, "end_a", end_a, format!("after the start, {start_a} a"))
            }
            Self::Pulse { base, peak, period_a, width_a, phase_a } => {
                finite(&[
                    ("base", base),
                    ("peak", peak),
                    ("period_a", period_a),
                    ("width_a", width_a),
                    ("phase_a", phase_a),
                ])?;
                ensure(period_a > 0.0, "period_a", period_a, "above 0 a".into())?;
                let permitted = format!("above 0 a and up to the period, {period_a} a");
                ensure(width_a > 0.0 && width_a <= period_a, "width_a", width_a, permitted)
            }
            Self::Table(_) => Ok(()),
        }
    }

    /// Value at t.
    pub fn value(&self, t_a: f64) -> f64 {
        match *self {
            Self::Sinusoid { mean, amplitude, period_a, phase_a } => {
                mean + amplitude * (TAU * (t_a - phase_a) / period_a).sin()
            }
            Self::Ramp { from, to, start_a, end_a } => {
                between(from, to, ((t_a - start_a) / (end_a - start_a)).clamp(0.0, 1.0))
            }
            Self::Pulse { base, peak, period_a, width_a, phase_a } => {
                let s = (t_a - phase_a).rem_euclid(period_a);
                if s < width_a { between(base, peak, (PI * s / width_a).sin()) } else { base }
            }
            Self::Table(ref table) => table.value(t_a),
        }
    }

    /// The smallest and the largest value of all time.
    pub fn extremes(&self) -> (f64, f64) {
        match *self {
            Self::Sinusoid { mean, amplitude, .. } => {
                (mean - amplitude.abs(), mean + amplitude.abs())
            }
            Self::Ramp { from: a, to: b, .. } | Self::Pulse { base: a, peak: b, .. } => {
                (a.min(b), a.max(b))
            }
            Self::Table(ref table) => (table.minimum(), table.maximum()),
        }
    }

    /// The next time with a kink: later than t by more than rounding, so that who has stepped to a
    /// kink is not sent there again.
    pub fn next_break_after(&self, t_a: f64) -> Option<f64> {
        /// What counts as rounding: of t, and of a year for t near 0.
        const ROUNDING: f64 = 1e-12;
        let passed_a = t_a + ROUNDING * t_a.abs().max(1.0);
        let next = |breaks: &[f64]| {
            breaks.iter().copied().filter(|b| *b > passed_a).min_by(f64::total_cmp)
        };
        match *self {
            Self::Sinusoid { .. } => None,
            Self::Ramp { start_a, end_a, .. } => next(&[start_a, end_a]),
            Self::Pulse { period_a, width_a, phase_a, .. } => {
                let running = ((passed_a - phase_a) / period_a).floor();
                // One more on either side, as `running` is rounded.
                let starts = [-1.0, 0.0, 1.0, 2.0].map(|k| phase_a + (running + k) * period_a);
                next(starts.map(|start| [start, start + width_a]).as_flattened())
            }
            Self::Table(ref table) => next(table.x()),
        }
    }
}

/// Parameters that do not vary in time: the fjord's, and the grid's.
const FIXED: [&str; 3] = ["width_m", "width_gradient", "n_cells"];

/// The parameters that vary in time, each with its course.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Forcing(Vec<(&'static str, Course)>);

/// A forcing that cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ForcingError {
    /// No parameter has this name.
    #[error("there is no parameter to force in `{}`; {}", self.field(), self.permitted())]
    Unknown {
        /// The name given.
        name: String,
    },
    /// A parameter with two courses.
    #[error("`{}` is given twice; {}", self.field(), self.permitted())]
    Twice {
        /// Parameter's name.
        name: &'static str,
    },
    /// A parameter that stays what it is.
    #[error("`{}` cannot vary in time; {}", self.field(), self.permitted())]
    Fixed {
        /// Parameter's name.
        name: &'static str,
    },
    /// A course that is none.
    #[error("`{}` = {} is out of range: {}", self.field(), error.value, error.permitted)]
    Course {
        /// Parameter's name.
        name: &'static str,
        /// What is wrong with the course.
        error: CourseError,
    },
    /// A course that leaves the parameter's range.
    #[error("`{}` gets to {value}, which is out of range: {}", self.field(), self.permitted())]
    OutOfRange {
        /// Parameter's name.
        name: &'static str,
        /// The course's extreme.
        value: f64,
    },
    /// A course that another parameter excludes.
    #[error("`{}` gets to {value}, which is out of range: {permitted}", self.field())]
    Contradiction {
        /// Parameter's name.
        name: &'static str,
        /// The course's extreme.
        value: f64,
        /// What the other parameter leaves room for.
        permitted: String,
    },
}

impl ForcingError {
    /// The field to blame, as in `forcing.melt_rate_m_per_day`.
    pub fn field(&self) -> String {
        match self {
            Self::Unknown { name } => format!("forcing.{name}"),
            Self::Course { name, error } => format!("forcing.{name}.{}", error.field),
            Self::Twice { name }
            | Self::Fixed { name }
            | Self::OutOfRange { name, .. }
            | Self::Contradiction { name, .. } => format!("forcing.{name}"),
        }
    }

    /// The value to blame, where there is one.
    pub fn value(&self) -> Option<f64> {
        match self {
            Self::Unknown { .. } | Self::Twice { .. } | Self::Fixed { .. } => None,
            Self::Course { error, .. } => Some(error.value),
            Self::OutOfRange { value, .. } | Self::Contradiction { value, .. } => Some(*value),
        }
    }

    /// What is permitted.
    pub fn permitted(&self) -> String {
        match self {
            Self::Unknown { .. } | Self::Fixed { .. } => {
                let names = params::PARAMETERS.map(|p| p.name).into_iter();
                let names: Vec<_> = names.filter(|name| !FIXED.contains(name)).collect();
                format!("what can vary in time is {}", names.join(", "))
            }
            Self::Twice { .. } => "one course for each parameter".into(),
            Self::Course { error, .. } => error.permitted.clone(),
            Self::OutOfRange { name, .. } => params::permitted(name),
            Self::Contradiction { permitted, .. } => permitted.clone(),
        }
    }
}

impl Forcing {
    /// Courses by parameters' names, each within its parameter's range at all times.
    pub fn new(courses: Vec<(String, Course)>) -> Result<Self, ForcingError> {
        let mut forcing = Self::default();
        for (name, course) in courses {
            let Some(info) = params::info(&name) else {
                return Err(ForcingError::Unknown { name });
            };
            forcing.check_course(info, &course)?;
            forcing.0.push((info.name, course));
        }
        Ok(forcing)
    }

    fn check_course(&self, info: &ParameterInfo, course: &Course) -> Result<(), ForcingError> {
        let name = info.name;
        if FIXED.contains(&name) {
            return Err(ForcingError::Fixed { name });
        }
        if self.course(name).is_some() {
            return Err(ForcingError::Twice { name });
        }
        course.check().map_err(|error| ForcingError::Course { name, error })?;
        let (min, max) = course.extremes();
        for value in [min, max] {
            info.check(value).map_err(|_| ForcingError::OutOfRange { name, value })?;
        }
        Ok(())
    }

    /// Checks that icebergs stay smaller than the terminus is thick, whenever each has its extreme.
    /// What is not forced has its value in `base`, which is checked on its own.
    pub fn check_against(&self, base: &Parameters) -> Result<(), ForcingError> {
        let extremes = |name, value| self.course(name).map_or((value, value), Course::extremes);
        let (_, d_m) = extremes("d_m", base.d_m);
        let (thickness_m, _) = extremes("terminus_thickness_m", base.terminus_thickness_m);
        let refuse =
            |name, value, permitted| Err(ForcingError::Contradiction { name, value, permitted });
        if d_m < thickness_m {
            return Ok(());
        }
        if self.course("d_m").is_some() {
            let permitted = format!(
                "icebergs must stay smaller than the terminus is thick (terminus_thickness_m gets \
                 down to {thickness_m})"
            );
            refuse("d_m", d_m, permitted)
        } else if self.course("terminus_thickness_m").is_some() {
            let permitted =
                format!("the terminus must stay thicker than icebergs are (d_m = {d_m})");
            refuse("terminus_thickness_m", thickness_m, permitted)
        } else {
            Ok(())
        }
    }

    /// The parameters at t, which must be finite: those of `base`, but for what is forced.
    pub fn at(&self, base: &Parameters, t_a: f64) -> Parameters {
        let mut parameters = *base;
        for (name, course) in &self.0 {
            let set = parameters.set(name, course.value(t_a));
            set.expect("a course lies between its extremes, and those within the range");
        }
        parameters
    }

    /// The next time at which any course has a kink; see [`Course::next_break_after`].
    pub fn next_break_after(&self, t_a: f64) -> Option<f64> {
        let breaks = self.0.iter().filter_map(|(_, course)| course.next_break_after(t_a));
        breaks.min_by(f64::total_cmp)
    }

    /// Whether nothing varies.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The names of what varies, in the order given.
    pub fn names(&self) -> impl Iterator<Item = &'static str> {
        self.0.iter().map(|(name, _)| *name)
    }

    /// A parameter's course, if it has one.
    pub fn course(&self, name: &str) -> Option<&Course> {
        self.0.iter().find_map(|(n, course)| (*n == name).then_some(course))
    }
}
