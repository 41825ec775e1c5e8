//! Branches of steady states and curves of their folds: as they are written, and what they come to.

use super::forcing::CalvingForm;
use super::refusal::Refusal;
use super::run::{RunSpec, Shared};
use melange_solver::branch::BranchPlan;
use melange_solver::branch::fold_curve::FoldCurvePlan;
use melange_solver::control::{Control, Setting};
use melange_solver::params::ParameterError;
use melange_solver::physics::terminus::CalvingLaw;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A branch of steady states, as it is written. It begins at the control parameter's own value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct BranchForm {
    /// The parameter that varies: one of a run, `calving_flux_m2_per_a`, or `rate_m_per_a` or
    /// `per_force_m2_per_a_n` of the calving law.
    pub control: String,
    /// Smallest value: the branch ends there.
    pub from: f64,
    /// Largest value: the branch ends there.
    pub to: f64,
    /// Longest step, in arclength; 0.3 if not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub longest_step: Option<f64>,
    /// Most points, both ways together; 1000 if not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub most_points: Option<u64>,
    /// Whether growth rates are computed; true if not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stability: Option<bool>,
    /// Values of the control parameter at which every root of the branch is listed.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub roots_at: Vec<f64>,
}

/// A fold of a branch as a second parameter varies, as it is written.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct FoldCurveForm {
    /// The branch's parameter.
    pub control: String,
    /// Its smallest value on the branch whose fold is followed.
    pub from: f64,
    /// Its largest value there.
    pub to: f64,
    /// The second parameter.
    pub second: String,
    /// Its smallest value: the curve ends there.
    pub second_from: f64,
    /// Its largest value: the curve ends there.
    pub second_to: f64,
    /// Which fold of the branch, along the curve from 0; 0 if not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fold: Option<u64>,
}

/// What is followed, checked as far as it depends on no run.
#[derive(Debug, Clone, PartialEq)]
pub struct Following {
    /// What varies.
    pub control: Control,
    /// Between which values.
    pub bounds: (f64, f64),
    /// Longest step, in arclength.
    pub longest_step: f64,
    /// Most points.
    pub most_points: usize,
    /// Whether growth rates are computed.
    pub with_stability: bool,
    /// Values at which roots are listed, ascending.
    pub roots_at: Vec<f64>,
    /// What varies beside, of a curve of folds.
    pub second: Option<Second>,
}

/// The second parameter of a curve of folds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Second {
    /// What varies.
    pub control: Control,
    /// Between which values.
    pub bounds: (f64, f64),
    /// Which fold.
    pub fold: usize,
}

/// Permitted longest steps: shorter ones than that take long, longer ones miss folds.
const LONGEST_STEPS: (f64, f64) = (0.001, 2.0);
/// The one if none is given: some 40 points draw a smooth curve.
const LONGEST_STEP: f64 = 0.3;
/// Permitted numbers of points.
const MOST_POINTS: (u64, u64) = (3, 10_000);
/// The one if none is given.
const POINTS: u64 = 1_000;
/// Most values at which roots are listed.
const MOST_ROOTS: usize = 1_000;
/// Most folds of a branch to choose from.
const MOST_FOLDS: u64 = 1_000;
/// Points that a branch has as a rule.
const USUAL_POINTS: usize = 60;

impl BranchForm {
    /// What is followed.
    pub fn following(&self) -> Result<Following, Refusal> {
        let control = control("branch.control", &self.control)?;
        let bounds = bounds(["branch.from", "branch.to"], control, (self.from, self.to))?;
        let longest_step = self.longest_step.unwrap_or(LONGEST_STEP);
        if !(LONGEST_STEPS.0..=LONGEST_STEPS.1).contains(&longest_step) {
            let permitted = format!("a number from {} to {}", LONGEST_STEPS.0, LONGEST_STEPS.1);
            return Err(Refusal::number("branch.longest_step", longest_step, permitted));
        }
        let most_points = self.most_points.unwrap_or(POINTS);
        if !(MOST_POINTS.0..=MOST_POINTS.1).contains(&most_points) {
            let permitted = format!("a whole number from {} to {}", MOST_POINTS.0, MOST_POINTS.1);
            return Err(Refusal::value("branch.most_points", most_points, permitted));
        }
        if self.roots_at.len() > MOST_ROOTS {
            let permitted = format!("at most {MOST_ROOTS} values");
            return Err(Refusal::value("branch.roots_at", self.roots_at.len(), permitted));
        }
        for (i, value) in self.roots_at.iter().enumerate() {
            if !(bounds.0..=bounds.1).contains(value) {
                let permitted = format!("a number from {} to {}", bounds.0, bounds.1);
                return Err(Refusal::number(format!("branch.roots_at[{i}]"), *value, permitted));
            }
        }
        let mut roots_at = self.roots_at.clone();
        roots_at.sort_unstable_by(f64::total_cmp);
        roots_at.dedup();
        Ok(Following {
            control,
            bounds,
            longest_step,
            most_points: most_points as usize,
            with_stability: self.stability.unwrap_or(true),
            roots_at,
            second: None,
        })
    }
}

impl FoldCurveForm {
    /// What is followed.
    pub fn following(&self) -> Result<Following, Refusal> {
        let first = control("fold_curve.control", &self.control)?;
        let second = control("fold_curve.second", &self.second)?;
        if first == second {
            let permitted = "another parameter than fold_curve.control";
            return Err(Refusal::value("fold_curve.second", second.name(), permitted));
        }
        let fold = self.fold.unwrap_or(0);
        if fold >= MOST_FOLDS {
            let permitted = format!("a whole number below {MOST_FOLDS}");
            return Err(Refusal::value("fold_curve.fold", fold, permitted));
        }
        let fields = ["fold_curve.second_from", "fold_curve.second_to"];
        Ok(Following {
            control: first,
            bounds: bounds(["fold_curve.from", "fold_curve.to"], first, (self.from, self.to))?,
            longest_step: LONGEST_STEP,
            most_points: POINTS as usize,
            with_stability: false,
            roots_at: Vec::new(),
            second: Some(Second {
                control: second,
                bounds: bounds(fields, second, (self.second_from, self.second_to))?,
                fold: fold as usize,
            }),
        })
    }
}

fn control(field: &str, name: &str) -> Result<Control, Refusal> {
    let known = || format!("one of {}", Control::names().join(", "));
    Control::named(name).ok_or_else(|| Refusal::value(field, name, known()))
}

fn bounds(
    fields: [&str; 2],
    control: Control,
    (from, to): (f64, f64),
) -> Result<(f64, f64), Refusal> {
    let (low, high) = control.range();
    let unit = Some(control.unit()).filter(|unit| *unit != "1").unwrap_or_default();
    for (field, value) in fields.into_iter().zip([from, to]) {
        if !(low..=high).contains(&value) {
            let permitted = format!("a finite number from {low} to {high} {unit}");
            return Err(Refusal::number(field, value, permitted.trim_end()));
        }
    }
    if from >= to {
        let permitted = format!("above {} = {from}", fields[0]);
        return Err(Refusal::number(fields[1], to, permitted));
    }
    Ok((from, to))
}

impl Following {
    /// The document's member that it is written in.
    pub fn member(&self) -> &'static str {
        if self.second.is_some() { "fold_curve" } else { "branch" }
    }

    /// Rows that are stored as a rule.
    pub fn usual_rows(&self) -> usize {
        self.most_points.min(USUAL_POINTS) + self.roots_at.len()
    }

    /// Work of a run beside that of one steady state of so many cells.
    pub fn work(&self, n_cells: usize) -> f64 {
        /// Cells at which the growth rates of a point take as long as the point; with 100 they take four
        /// times as long.
        const EVEN: f64 = 25.0;
        let spectrum = n_cells as f64 / EVEN;
        let each = if self.with_stability { 1.0 + spectrum } else { 1.0 };
        self.usual_rows() as f64 * each
    }

    /// Refuses a calving law that a steady state has no place for.
    pub fn check_law(&self, law: Option<&CalvingForm>) -> Result<(), Refusal> {
        let place = "a branch is one of steady states, whose terminus stands at X0 = 0";
        match law {
            Some(CalvingForm::SteadyFeedback) => Err(Refusal::value(
                "calving_law",
                "steady_feedback",
                "a law by its numbers: Eq. 31 is written around one steady state, and a branch has many",
            )),
            Some(CalvingForm::Law(law)) => {
                for (field, value) in [
                    ("calving_law.per_advance_per_a", law.per_advance_per_a),
                    ("calving_law.thickness_per_advance", law.thickness_per_advance),
                ] {
                    if value != 0.0 {
                        return Err(Refusal::number(field, value, format!("0: {place}")));
                    }
                }
                Ok(())
            }
            None => Ok(()),
        }
    }
}

impl Shared {
    /// The law that sets the calving rate by the force, if there is one.
    pub fn law(&self) -> Option<CalvingLaw> {
        match self.calving {
            Some(CalvingForm::Law(law)) => Some(law),
            _ => None,
        }
    }
}

impl RunSpec {
    /// The plan of a branch; for a curve of folds, of the branch whose fold is followed.
    pub fn branch_plan(&self, following: &Following) -> BranchPlan {
        let setting = Setting { model: self.model.clone(), law: self.shared.law() };
        BranchPlan {
            longest_step: following.longest_step,
            most_points: following.most_points,
            with_stability: following.with_stability,
            roots_at: following.roots_at.clone(),
            ..BranchPlan::new(setting, following.control, following.bounds)
        }
    }

    /// The plan of a curve of folds.
    pub fn fold_curve_plan(&self, following: &Following, second: Second) -> FoldCurvePlan {
        FoldCurvePlan {
            branch: self.branch_plan(following),
            fold: second.fold,
            second: second.control,
            second_bounds: second.bounds,
        }
    }

    /// Refuses parameters that cannot be varied here, starts beyond the bounds, and bounds at which there is
    /// no model.
    pub(super) fn check_following(&self) -> Result<(), Refusal> {
        let Some(following) = &self.shared.following else { return Ok(()) };
        let setting = Setting { model: self.model.clone(), law: self.shared.law() };
        self.check_terminus(&setting)?;
        let member = following.member();
        let first = ("control", ["from", "to"], following.control, following.bounds);
        let second = following
            .second
            .map(|second| ("second", ["second_from", "second_to"], second.control, second.bounds));
        for (field, ends, control, bounds) in [Some(first), second].into_iter().flatten() {
            control.check(&setting).map_err(|e| match e {
                ParameterError::Contradiction { permitted, .. } => {
                    Refusal::value(format!("{member}.{field}"), control.name(), permitted)
                }
                e => Refusal::parameter("parameters", &e),
            })?;
            let start = control.value(&setting);
            if !(bounds.0..=bounds.1).contains(&start) {
                let of_law = matches!(control, Control::LawRate | Control::LawPerForce);
                let whose = if of_law { "calving_law" } else { "parameters" };
                let permitted = format!(
                    "from {} to {}, the bounds of {member}.{field}, between which it starts",
                    bounds.0, bounds.1
                );
                let field = format!("{whose}.{}", control.name());
                return Err(Refusal::number(field, start, permitted));
            }
            for (end, value) in ends.into_iter().zip([bounds.0, bounds.1]) {
                let mut there = setting.clone();
                control.set(&mut there, value);
                let checked = there.model.parameters().check();
                checked.and_then(|()| there.model.check_steady()).map_err(|e| {
                    Refusal::number(
                        format!("{member}.{end}"),
                        value,
                        format!("a value at which there is a model, and there {e}"),
                    )
                })?;
            }
        }
        Ok(())
    }

    /// Refuses a terminus that moves where that makes a difference, and a flux that is not the parameters'.
    fn check_terminus(&self, setting: &Setting) -> Result<(), Refusal> {
        let Some(following) = &self.shared.following else { return Ok(()) };
        let is_placed =
            !self.model.fjord().is_constant() || self.model.melt_shape().depends_on_bedrock();
        if setting.law.is_some() && is_placed {
            let why = "it lets the terminus move, and in a fjord of varying width, or past melt that is \
                       fixed to the bedrock, a terminus that moves has no steady state";
            return Err(Refusal::out_of_place("calving_law", why));
        }
        let p = self.parameters();
        let second = following.second.map(|second| second.control);
        let is_flux = [Some(following.control), second].contains(&Some(Control::CalvingFlux));
        if is_flux && p.calving_rate_m_per_a != p.terminus_velocity_m_per_a {
            let permitted = format!(
                "terminus_velocity_m_per_a = {}: a flux sets both",
                p.terminus_velocity_m_per_a
            );
            return Err(Refusal::number(
                "parameters.calving_rate_m_per_a",
                p.calving_rate_m_per_a,
                permitted,
            ));
        }
        Ok(())
    }
}
