//! The states of a run, and the counts of a sweep, which always add up.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// How a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// A steady state or a diagnostic solution was found.
    Converged,
    /// A transient reached its end.
    Completed,
    /// A transient ran away to the size of its icebergs.
    Collapsed,
    /// No steady state exists.
    NoSteadyState,
    /// The mélange is at least as thick as the glacier.
    Overthick,
    /// The walls meet within the mélange.
    FjordClosed,
    /// The solver gave up: a defect to report.
    Failed,
    /// Bad input; never stored.
    Refused,
}

impl Status {
    /// The states a stored run can have.
    pub const STORED: [Status; 7] = [
        Self::Converged,
        Self::Completed,
        Self::Collapsed,
        Self::NoSteadyState,
        Self::Overthick,
        Self::FjordClosed,
        Self::Failed,
    ];

    /// Name at every boundary.
    pub fn name(self) -> &'static str {
        match self {
            Self::Converged => "converged",
            Self::Completed => "completed",
            Self::Collapsed => "collapsed",
            Self::NoSteadyState => "no_steady_state",
            Self::Overthick => "overthick",
            Self::FjordClosed => "fjord_closed",
            Self::Failed => "failed",
            Self::Refused => "refused",
        }
    }

    /// The state of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::STORED.into_iter().find(|s| s.name() == name)
    }
}

/// Runs of a sweep by state; all but `total` add up to `total`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, ToSchema)]
pub struct Counts {
    /// All runs of the sweep.
    pub total: i64,
    /// Waiting for a worker.
    pub queued: i64,
    /// In a chunk that a worker holds.
    pub running: i64,
    /// See [`Status::Converged`].
    pub converged: i64,
    /// See [`Status::Completed`].
    pub completed: i64,
    /// See [`Status::Collapsed`].
    pub collapsed: i64,
    /// See [`Status::NoSteadyState`].
    pub no_steady_state: i64,
    /// See [`Status::Overthick`].
    pub overthick: i64,
    /// See [`Status::FjordClosed`].
    pub fjord_closed: i64,
    /// See [`Status::Failed`].
    pub failed: i64,
    /// Given up by a user; none until sweeps can be cancelled.
    pub cancelled: i64,
}

impl Counts {
    /// Adds runs that ended with a status.
    pub fn add(&mut self, status: Status, count: i64) {
        *match status {
            Status::Converged => &mut self.converged,
            Status::Completed => &mut self.completed,
            Status::Collapsed => &mut self.collapsed,
            Status::NoSteadyState => &mut self.no_steady_state,
            Status::Overthick => &mut self.overthick,
            Status::FjordClosed => &mut self.fjord_closed,
            Status::Failed | Status::Refused => &mut self.failed,
        } += count;
    }

    /// Runs that ended, one way or another.
    pub fn ended(&self) -> i64 {
        self.total - self.queued - self.running
    }

    /// The sweep's state, which follows from its counts.
    pub fn state(&self) -> SweepState {
        if self.ended() == self.total {
            SweepState::Complete
        } else if self.running > 0 || self.ended() > 0 {
            SweepState::Running
        } else {
            SweepState::Queued
        }
    }
}

/// State of a sweep. Pausing, stopping and cancelling are not there yet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum SweepState {
    /// No run was started yet.
    Queued,
    /// Some runs are under way or have ended.
    Running,
    /// Every run has ended.
    Complete,
}
