//! Steady states on a line across a branch: the steady equations with the control parameter free, and L and
//! p bound to a line in their plane. Knows no equation and no branch.
//!
//! ```text
//!   L = L* + σ n_L,  p = p* + σ n_p          ┌ ▓ ▓ ▓         █ ┐ █ = n_L ∂F/∂L + n_p ∂F/∂p
//!                                            │ ▓ ▓ ▓ ▓       █ │
//!   unknown: σ in L's place                  └       ▓ ▓ ▓   █ ┘
//! ```
//!
//! With the line across the branch's tangent in that plane this is pseudo-arclength continuation (Keller
//! 1977) with arclength taken in (L, p). The bordered matrix keeps its shape, since L's column is dense
//! already, and is regular at folds, where ∂F/∂x alone is not; where it is not regular, L and p stand still
//! together while the state changes. That takes two conditions at once; near a fold of a single cell's fluidity,
//! which hardly moves either, it is nearly so, and the steps there are short.

use crate::control::{Control, Setting};
use crate::newton::{OutsideDomain, System};
use crate::physics::fluidity::Relaxation;
use crate::physics::jacobian::Jacobian;
use crate::physics::{Equations, Problem, Scratch};
use crate::sensitivity::steady_problem;
use crate::state::{State, Var, unknowns};

/// A place or a direction in the plane of L and p: L in units of \[L\], p in the branch's unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Plane {
    pub(super) length: f64,
    pub(super) control: f64,
}

impl Plane {
    /// The same, turned by a quarter.
    pub(super) fn across(self) -> Self {
        Self { length: -self.control, control: self.length }
    }

    pub(super) fn norm(self) -> f64 {
        self.length.hypot(self.control)
    }

    pub(super) fn moved(self, share: f64, along: Plane) -> Self {
        Self {
            length: self.length + share * along.length,
            control: self.control + share * along.control,
        }
    }

    pub(super) fn scaled(self, by: f64) -> Self {
        Self { length: self.length * by, control: self.control * by }
    }

    pub(super) fn minus(self, other: Plane) -> Self {
        self.moved(-1.0, other)
    }

    pub(super) fn dot(self, other: Plane) -> f64 {
        self.length * other.length + self.control * other.control
    }
}

/// Everything of a branch's problem but the line.
#[derive(Debug)]
pub(super) struct Course {
    pub(super) setting: Setting,
    pub(super) control: Control,
    /// Unit of p in the plane.
    pub(super) unit: f64,
    pub(super) smoothing: f64,
    scratch: Scratch,
    /// The packed unknowns with L in its place.
    x: Vec<f64>,
    state: State,
    /// ∂F/∂L and ∂F/∂p of the last linearisation, per unit of the plane.
    pub(super) by_length: Vec<f64>,
    pub(super) by_control: Vec<f64>,
}

impl Course {
    pub(super) fn new(setting: Setting, control: Control, unit: f64) -> Self {
        let n = setting.model.parameters().n_cells;
        let zeros = || vec![0.0; unknowns(n)];
        Self {
            setting,
            control,
            unit,
            smoothing: 0.0,
            scratch: Scratch::new(n),
            x: zeros(),
            state: State::zeros(n),
            by_length: zeros(),
            by_control: zeros(),
        }
    }

    /// Place of L, and of σ.
    pub(super) fn slot(&self) -> usize {
        let n = self.state.n_cells();
        Var::L.index(n).expect("the length is packed")
    }

    fn go_to(&mut self, x: &[f64], at: Plane) {
        let slot = self.slot();
        self.x.copy_from_slice(x);
        self.x[slot] = at.length;
        self.control.set(&mut self.setting, at.control * self.unit);
    }

    /// Residual and ∂F/∂x at a place of the plane, whatever stands in the slot of `x`.
    pub(super) fn linearise_at(
        &mut self,
        x: &[f64],
        at: Plane,
        relaxation: Option<Relaxation<'_>>,
        residual: &mut [f64],
        jacobian: &mut Jacobian,
    ) -> Result<(), OutsideDomain> {
        self.go_to(x, at);
        self.state.unpack(&self.x);
        if self.state.length_m <= 0.0 {
            return Err(OutsideDomain);
        }
        let rates = self.control.rates(&self.setting, &self.state);
        let problem = Problem { relaxation, ..steady_problem(&self.setting, self.smoothing) };
        let mut equations = Equations::new(problem, &mut self.scratch);
        equations.linearise_along(&self.x, residual, jacobian, &rates, &mut self.by_control)?;
        self.by_control.iter_mut().for_each(|entry| *entry *= self.unit);
        jacobian.length_column(&mut self.by_length);
        Ok(())
    }

    /// The state of a root.
    pub(super) fn state(&mut self, x: &[f64], at: Plane) -> State {
        self.go_to(x, at);
        self.state.unpack(&self.x);
        self.state.clone()
    }

    /// ∂F/∂(L, p) along a direction of the plane.
    pub(super) fn column_along(&self, along: Plane, out: &mut [f64]) {
        for ((out, l), p) in out.iter_mut().zip(&self.by_length).zip(&self.by_control) {
            *out = along.length * l + along.control * p;
        }
    }
}

/// The equations on one line.
pub(super) struct OnLine<'a> {
    pub(super) course: &'a mut Course,
    pub(super) through: Plane,
    pub(super) along: Plane,
    /// Pseudo-time; none in the model.
    pub(super) relaxation: Option<Relaxation<'a>>,
}

impl OnLine<'_> {
    pub(super) fn place(&self, x: &[f64]) -> Plane {
        self.through.moved(x[self.course.slot()], self.along)
    }
}

impl System for OnLine<'_> {
    type Jacobian = Jacobian;

    fn unknowns(&self) -> usize {
        self.course.x.len()
    }

    fn residual(&mut self, x: &[f64], residual: &mut [f64]) -> Result<(), OutsideDomain> {
        let at = self.place(x);
        let course = &mut *self.course;
        course.go_to(x, at);
        let steady = steady_problem(&course.setting, course.smoothing);
        let problem = Problem { relaxation: self.relaxation, ..steady };
        Equations::new(problem, &mut course.scratch).residual(&course.x, residual)
    }

    fn linearise(
        &mut self,
        x: &[f64],
        residual: &mut [f64],
        jacobian: &mut Jacobian,
    ) -> Result<(), OutsideDomain> {
        let at = self.place(x);
        self.course.linearise_at(x, at, self.relaxation, residual, jacobian)?;
        let mut column = std::mem::take(&mut self.course.x);
        self.course.column_along(self.along, &mut column);
        jacobian.replace_length(&column);
        self.course.x = column;
        Ok(())
    }

    fn longest_step(&self, x: &[f64], step: &[f64]) -> f64 {
        /// Share of the way to the end of the control's range that one step may go.
        const TOWARDS_BOUND: f64 = 0.9;
        let slot = self.course.slot();
        let (at, turn) = (self.place(x), self.along.scaled(step[slot]));
        let (mut x, mut step) = (x.to_vec(), step.to_vec());
        (x[slot], step[slot]) = (at.length, turn.length);
        let problem = steady_problem(&self.course.setting, self.course.smoothing);
        let inside = crate::physics::longest_step(&problem, &x, &step);
        let (low, high) = self.course.control.range();
        let bound = if turn.control > 0.0 { high } else { low } / self.course.unit;
        let way = (bound - at.control) / turn.control;
        // A place beyond the range is left by as much as it needs.
        if turn.control != 0.0 && way > 0.0 { inside.min(TOWARDS_BOUND * way) } else { inside }
    }
}
