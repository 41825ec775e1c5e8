//! One law fitted to runs by least squares, with intervals. Knows no groups of runs.

use crate::domain::same::same;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, StudentsT};
use utoipa::ToSchema;

/// The law that is fitted, by least squares in the coordinates in which it is a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Law {
    /// y = prefactor · x^exponent: a line of ln y over ln x.
    #[default]
    #[serde(rename = "power_law")]
    Power,
    /// y = prefactor · e^(exponent·x): a line of ln y over x.
    Exponential,
    /// y = prefactor + exponent · x.
    Linear,
}

impl Law {
    /// The place of a run in the coordinates in which the law is a line, or why it has none.
    fn coordinates(self, x: f64, y: f64) -> Result<(f64, f64), &'static str> {
        let positive = |v: f64, reason| if v > 0.0 { Ok(v.ln()) } else { Err(reason) };
        let x = if self == Law::Power { positive(x, "x is not positive")? } else { x };
        let y = if self == Law::Linear { y } else { positive(y, "y is not positive")? };
        Ok((x, y))
    }

    /// The x of an abscissa of the line.
    pub(super) fn x_back(self, x: f64) -> f64 {
        if self == Law::Power { x.exp() } else { x }
    }

    /// The y of an ordinate of the line.
    pub(super) fn y_back(self, y: f64) -> f64 {
        if self == Law::Linear { y } else { y.exp() }
    }

    /// What the distance of a run from the line means.
    pub(super) fn residual_meaning(self) -> &'static str {
        match self {
            Self::Power | Self::Exponential => {
                "ln y minus ln of the law's y: 0.01 means that y is about 1 % above the law"
            }
            Self::Linear => "y minus the law's y, in the unit of y",
        }
    }
}

/// A number estimated from an ensemble.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct Estimate {
    /// Least-squares estimate.
    pub estimate: f64,
    /// Standard error; of the logarithm for a prefactor of a power law or an exponential.
    pub standard_error: f64,
    /// 95 % interval, Student's t with n − 2 degrees of freedom.
    pub ci95: [f64; 2],
}

/// Runs that a fit leaves out.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct LeftOut {
    /// Why.
    pub reason: String,
    /// How many.
    pub count: usize,
}

/// The fitted curve and the 95 % band of its mean.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Band {
    /// Abscissae.
    pub x: Vec<f64>,
    /// The curve.
    pub y: Vec<f64>,
    /// Lower edge.
    pub lower: Vec<f64>,
    /// Upper edge.
    pub upper: Vec<f64>,
}

/// A fitted law.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Fit {
    /// Which law.
    pub model: Law,
    /// Exponent of a power law, rate of an exponential, slope of a line.
    pub exponent: Estimate,
    /// Prefactor; intercept of a line.
    pub prefactor: Estimate,
    /// Share of the variance explained, in the coordinates in which the law is a line.
    pub r_squared: f64,
    /// Runs used.
    pub n_used: usize,
    /// Runs left out, by reason.
    pub left_out: Vec<LeftOut>,
    /// The curve with its band.
    pub band: Band,
    /// What the intervals mean.
    pub interval_meaning: &'static str,
}

/// Why there is no fit.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NoFit {
    /// Too few runs.
    #[error("a fit with intervals needs at least 3 runs with both numbers, and there are {n_used}")]
    TooFew {
        /// Runs that could be used.
        n_used: usize,
        /// Runs left out, by reason.
        left_out: Vec<LeftOut>,
    },
    /// All runs have the same x.
    #[error("all runs have the same x, so that no slope is determined")]
    SameX,
    /// All runs have the same y.
    #[error("y does not vary: all runs have the same, and there is nothing for a law to explain")]
    SameY,
}

const INTERVAL_MEANING: &str =
    "misfit of the law: runs carry no noise, so the interval is no sampling error";
/// Points of the band.
const BAND_POINTS: usize = 60;

/// Fits a law to runs, each given by its status, x and y.
pub fn fit<S: AsRef<str>>(law: Law, runs: &[(S, Option<f64>, Option<f64>)]) -> Result<Fit, NoFit> {
    let mut points = Vec::new();
    let mut left_out = Vec::new();
    for (status, x, y) in runs {
        match usable(law, status.as_ref(), *x, *y) {
            Ok(point) => points.push(point),
            Err(reason) => leave_out(&mut left_out, reason),
        }
    }
    Ok(line(law, &points, left_out)?.1)
}

/// Where a run stands in the coordinates of a law, or why it is left out.
pub(super) fn usable(
    law: Law,
    status: &str,
    x: Option<f64>,
    y: Option<f64>,
) -> Result<(f64, f64), &str> {
    match (status, x, y) {
        ("converged" | "completed", Some(x), Some(y)) => law.coordinates(x, y),
        ("converged" | "completed", _, _) => Err("x or y does not exist"),
        (status, _, _) => Err(status),
    }
}

/// Counts a run that is left out.
pub(super) fn leave_out(left_out: &mut Vec<LeftOut>, reason: &str) {
    match left_out.iter_mut().find(|l| l.reason == reason) {
        Some(group) => group.count += 1,
        None => left_out.push(LeftOut { reason: reason.to_owned(), count: 1 }),
    }
}

/// A fitted line, in the coordinates of its law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Line {
    slope: f64,
    intercept: f64,
}

impl Line {
    /// Its ordinate.
    pub(super) fn at(self, x: f64) -> f64 {
        self.intercept + self.slope * x
    }
}

/// The line through points in the coordinates of a law, and what it says of the law.
pub(super) fn line(
    law: Law,
    points: &[(f64, f64)],
    left_out: Vec<LeftOut>,
) -> Result<(Line, Fit), NoFit> {
    let n_used = points.len();
    if n_used < 3 {
        return Err(NoFit::TooFew { n_used, left_out });
    }
    let ends = |of: &dyn Fn(&(f64, f64)) -> f64| {
        let fold = |(low, high): (f64, f64), v: f64| (low.min(v), high.max(v));
        points.iter().map(of).fold((f64::INFINITY, f64::NEG_INFINITY), fold)
    };
    let (ends_x, ends_y) = (ends(&|p| p.0), ends(&|p| p.1));
    if same(law.x_back(ends_x.0), law.x_back(ends_x.1)) {
        return Err(NoFit::SameX);
    }
    // What is left of a y that does not vary is rounding, and shares of that mean nothing.
    if same(law.y_back(ends_y.0), law.y_back(ends_y.1)) {
        return Err(NoFit::SameY);
    }
    let n = n_used as f64;
    let mean_x = points.iter().map(|p| p.0).sum::<f64>() / n;
    let mean_y = points.iter().map(|p| p.1).sum::<f64>() / n;
    let sum = |f: &dyn Fn(f64, f64) -> f64| -> f64 {
        points.iter().map(|(x, y)| f(x - mean_x, y - mean_y)).sum()
    };
    let (sxx, sxy, syy) = (sum(&|x, _| x * x), sum(&|x, y| x * y), sum(&|_, y| y * y));
    let slope = sxy / sxx;
    let intercept = mean_y - slope * mean_x;
    let residual2 = sum(&|x, y| (y - slope * x).powi(2));
    let variance = residual2 / (n - 2.0);
    let slope_error = (variance / sxx).sqrt();
    let intercept_error = (variance * (1.0 / n + mean_x * mean_x / sxx)).sqrt();
    let t = StudentsT::new(0.0, 1.0, n - 2.0).expect("n is at least 3").inverse_cdf(0.975);

    let interval = |centre: f64, error: f64| [centre - t * error, centre + t * error];
    let exponent = Estimate {
        estimate: slope,
        standard_error: slope_error,
        ci95: interval(slope, slope_error),
    };
    let prefactor = Estimate {
        estimate: law.y_back(intercept),
        standard_error: intercept_error,
        ci95: interval(intercept, intercept_error).map(|v| law.y_back(v)),
    };
    let mut band = Band { x: vec![], y: vec![], lower: vec![], upper: vec![] };
    for i in 0..BAND_POINTS {
        let x = ends_x.0 + (ends_x.1 - ends_x.0) * i as f64 / (BAND_POINTS - 1) as f64;
        let y = intercept + slope * x;
        let half = t * (variance * (1.0 / n + (x - mean_x).powi(2) / sxx)).sqrt();
        band.x.push(law.x_back(x));
        band.y.push(law.y_back(y));
        band.lower.push(law.y_back(y - half));
        band.upper.push(law.y_back(y + half));
    }
    let r_squared = 1.0 - residual2 / syy;
    let fit = Fit {
        model: law,
        exponent,
        prefactor,
        r_squared,
        n_used,
        left_out,
        band,
        interval_meaning: INTERVAL_MEANING,
    };
    Ok((Line { slope, intercept }, fit))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn runs(points: &[(f64, f64)]) -> Vec<(String, Option<f64>, Option<f64>)> {
        points.iter().map(|(x, y)| ("converged".to_owned(), Some(*x), Some(*y))).collect()
    }

    /// Norris, a linear least-squares data set of NIST's Statistical Reference Datasets (StRD), with
    /// its certified values.
    #[test]
    fn a_line_equals_the_certified_values_of_norris() {
        let data = [
            (0.2, 0.1),
            (337.4, 338.8),
            (118.2, 118.1),
            (884.6, 888.0),
            (10.1, 9.2),
            (226.5, 228.1),
            (666.3, 668.5),
            (996.3, 998.5),
            (448.6, 449.1),
            (777.0, 778.9),
            (558.2, 559.2),
            (0.4, 0.3),
            (0.6, 0.1),
            (775.5, 778.1),
            (666.9, 668.8),
            (338.0, 339.3),
            (447.5, 448.9),
            (11.6, 10.8),
            (556.0, 557.7),
            (228.1, 228.3),
            (995.8, 998.0),
            (887.6, 888.8),
            (120.2, 119.6),
            (0.3, 0.3),
            (0.3, 0.6),
            (556.8, 557.6),
            (339.1, 339.3),
            (887.2, 888.0),
            (999.0, 998.5),
            (779.0, 778.9),
            (11.1, 10.2),
            (118.3, 117.6),
            (229.2, 228.9),
            (669.1, 668.4),
            (448.9, 449.2),
            (0.5, 0.2),
        ];
        let fit = fit(Law::Linear, &runs(&data)).expect("36 points");
        let close = |got: f64, certified: f64| {
            assert!((got / certified - 1.0).abs() < 1e-10, "{got} is not {certified}");
        };
        close(fit.exponent.estimate, 1.00211681802045);
        close(fit.exponent.standard_error, 0.429796848199937e-3);
        close(fit.prefactor.estimate, -0.262323073774029);
        close(fit.prefactor.standard_error, 0.232818234301152);
        close(fit.r_squared, 0.999993745883712);
    }

    #[test]
    fn a_power_law_without_misfit_is_found_exactly() {
        let data: Vec<_> = (1..20).map(|i| (f64::from(i), 7.0 * f64::from(i).powf(-3.1))).collect();
        let fit = fit(Law::Power, &runs(&data)).expect("19 points");
        assert!((fit.exponent.estimate + 3.1).abs() < 1e-12);
        assert!((fit.prefactor.estimate - 7.0).abs() < 1e-11);
        assert!(fit.band.x.iter().all(|x| (1.0 - 1e-9..=19.0 + 1e-9).contains(x)));
    }

    #[test]
    fn what_is_left_out_is_counted_by_reason() {
        let mut data = runs(&[(1.0, 2.0), (2.0, 3.0), (3.0, 5.0), (4.0, -1.0)]);
        data.push(("collapsed".into(), Some(5.0), Some(1.0)));
        data.push(("no_steady_state".into(), Some(6.0), None));
        data.push(("no_steady_state".into(), Some(7.0), None));
        let fit = fit(Law::Power, &data).expect("three points are left");
        assert_eq!(fit.n_used, 3);
        let counts: Vec<_> = fit.left_out.iter().map(|l| (l.reason.as_str(), l.count)).collect();
        assert_eq!(counts, [("y is not positive", 1), ("collapsed", 1), ("no_steady_state", 2)]);
    }

    #[test]
    fn too_few_points_and_equal_ones_give_no_fit() {
        assert!(matches!(
            fit(Law::Linear, &runs(&[(1.0, 2.0)])),
            Err(NoFit::TooFew { n_used: 1, .. })
        ));
        let same = runs(&[(2.0, 1.0), (2.0, 2.0), (2.0, 3.0)]);
        assert_eq!(fit(Law::Linear, &same), Err(NoFit::SameX));
        let rounded = runs(&[(9010.0, 1.0), (9009.999999999998, 2.0), (9010.0, 3.0)]);
        for law in [Law::Linear, Law::Power, Law::Exponential] {
            assert_eq!(fit(law, &rounded), Err(NoFit::SameX));
        }
    }

    /// A tenth has no end in binary: its sums differ from it in the last digits.
    #[test]
    fn a_y_that_does_not_vary_has_no_law() {
        for y in [0.1, 0.0, -7.3, 1e9] {
            let flat: Vec<_> = (1..40).map(|i| (0.3 * f64::from(i), y)).collect();
            assert_eq!(fit(Law::Linear, &runs(&flat)), Err(NoFit::SameY));
        }
        let nearly: Vec<_> =
            (1..40).map(|i| (f64::from(i), 0.1 * (1.0 + 2e-16 * f64::from(i % 2)))).collect();
        for law in [Law::Power, Law::Exponential] {
            assert_eq!(fit(law, &runs(&nearly)), Err(NoFit::SameY));
        }
        let hardly: Vec<_> = (1..40).map(|i| (f64::from(i), 1.0 + 1e-9 * f64::from(i))).collect();
        let fit = fit(Law::Linear, &runs(&hardly)).expect("it varies");
        assert!((fit.exponent.estimate / 1e-9 - 1.0).abs() < 1e-5 && fit.r_squared > 0.999);
    }
}
