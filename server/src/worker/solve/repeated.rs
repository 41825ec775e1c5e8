//! What a solve began from, so that it can be told and done again from the same.

use super::attempts::{Found, Way};
use super::{Halt, Walker};
use crate::domain::provenance::STARTS;
use crate::domain::run::RunSpec;
use melange_solver::Solver;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// What the search for a steady state began from.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Began {
    /// A start of its own.
    #[default]
    Own,
    /// The way of another solve of the walker, counted from 0.
    Beside(usize),
    /// The state that another solve found, after its own start had led nowhere.
    From(usize),
}

impl Began {
    /// Its name, and the solve it began from.
    pub fn told(self) -> (&'static str, Option<usize>) {
        let [own, neighbour, continuation] = STARTS;
        match self {
            Self::Own => (own, None),
            Self::Beside(solve) => (neighbour, Some(solve)),
            Self::From(solve) => (continuation, Some(solve)),
        }
    }
}

/// A way to a steady state that others begin from.
#[derive(Debug, Clone)]
pub struct Beginning(Way);

impl Walker {
    /// What the last solve began from.
    pub fn began(&self) -> Began {
        self.began
    }

    /// A walker whose first solve begins as another did: beside a way, or from its own start and then, where that
    /// leads nowhere, by continuation from the way's end.
    pub fn beginning(from: &Beginning, is_beside: bool) -> Self {
        let mut found = Found::default();
        found.remember(Way { solve: 0, ..from.0.clone() });
        Self { found, is_near: is_beside, solves: 1, ..Self::default() }
    }

    /// The way to the steady state of the last solve, if it found one.
    pub fn way(&self) -> Option<Beginning> {
        let newest = self.found.newest()?;
        (newest.solve + 1 == self.solves).then(|| Beginning(newest.clone()))
    }

    /// Finds the way to a run's steady state and leaves out the rest of the run.
    pub fn find_way(&mut self, run: &RunSpec, stop: &dyn Fn() -> bool) {
        self.solver = Some(Solver::new(run.model.clone()));
        let found = catch_unwind(AssertUnwindSafe(|| match self.steady(run, stop) {
            Ok(_) | Err(Halt::Ended(_) | Halt::Stopped) => {}
        }));
        self.solves += 1;
        if found.is_err() {
            *self = Self { solves: self.solves, ..Self::default() };
        }
    }
}
