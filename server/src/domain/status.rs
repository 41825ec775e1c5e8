//! The states of a run, and the counts of a sweep, which always add up.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// How a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// A steady state, a diagnostic solution, a branch or a curve of folds was found.
    Converged,
    /// A transient reached its end.
    Completed,
    /// A transient ran away to the size of its icebergs.
    Collapsed,
    /// No steady state exists.
    NoSteadyState,
    /// A branch of steady states has no such fold as is to be followed.
    NoFold,
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
    pub const STORED: [Status; 8] = [
        Self::Converged,
        Self::Completed,
        Self::Collapsed,
        Self::NoSteadyState,
        Self::NoFold,
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
            Self::NoFold => "no_fold",
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
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
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
    /// See [`Status::NoFold`].
    pub no_fold: i64,
    /// See [`Status::Overthick`].
    pub overthick: i64,
    /// See [`Status::FjordClosed`].
    pub fjord_closed: i64,
    /// See [`Status::Failed`].
    pub failed: i64,
    /// Given up by a user.
    pub cancelled: i64,
}

/// What a run is before it has a result.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pending {
    /// Waiting for a worker.
    Queued,
    /// In a chunk that a worker holds.
    Running,
    /// Given up by a user.
    Cancelled,
}

impl Pending {
    /// All of them.
    pub const ALL: [Pending; 3] = [Self::Queued, Self::Running, Self::Cancelled];

    /// Name at every boundary.
    pub fn name(self) -> &'static str {
        match self {
            Self::Queued => "queued",
            Self::Running => "running",
            Self::Cancelled => "cancelled",
        }
    }
}

impl Counts {
    /// Adds runs that ended with a status.
    pub fn add(&mut self, status: Status, count: i64) {
        *match status {
            Status::Converged => &mut self.converged,
            Status::Completed => &mut self.completed,
            Status::Collapsed => &mut self.collapsed,
            Status::NoSteadyState => &mut self.no_steady_state,
            Status::NoFold => &mut self.no_fold,
            Status::Overthick => &mut self.overthick,
            Status::FjordClosed => &mut self.fjord_closed,
            Status::Failed | Status::Refused => &mut self.failed,
        } += count;
    }

    /// Adds runs by the name of their state; an unknown name is told by `false`.
    pub fn add_named(&mut self, name: &str, count: i64) -> bool {
        if let Some(status) = Status::from_name(name) {
            self.add(status, count);
            return true;
        }
        let Some(pending) = Pending::ALL.into_iter().find(|p| p.name() == name) else {
            return false;
        };
        *match pending {
            Pending::Queued => &mut self.queued,
            Pending::Running => &mut self.running,
            Pending::Cancelled => &mut self.cancelled,
        } += count;
        true
    }

    /// The number of a name, as in the interface.
    pub fn named(&self, name: &str) -> Option<i64> {
        Some(match name {
            "total" => self.total,
            "queued" => self.queued,
            "running" => self.running,
            "converged" => self.converged,
            "completed" => self.completed,
            "collapsed" => self.collapsed,
            "no_steady_state" => self.no_steady_state,
            "no_fold" => self.no_fold,
            "overthick" => self.overthick,
            "fjord_closed" => self.fjord_closed,
            "failed" => self.failed,
            "cancelled" => self.cancelled,
            _ => return None,
        })
    }

    /// The total, if no count is negative and all but it add up to it.
    pub fn check(&self) -> Option<i64> {
        let pending = [self.queued, self.running, self.cancelled];
        let mut sum = 0_i64;
        for n in pending.into_iter().chain(Status::STORED.map(|status| self.of(status))) {
            sum = sum.checked_add(Some(n).filter(|n| *n >= 0)?)?;
        }
        Some(sum).filter(|sum| *sum == self.total)
    }

    /// Runs that ended with a status.
    pub fn of(&self, status: Status) -> i64 {
        match status {
            Status::Converged => self.converged,
            Status::Completed => self.completed,
            Status::Collapsed => self.collapsed,
            Status::NoSteadyState => self.no_steady_state,
            Status::NoFold => self.no_fold,
            Status::Overthick => self.overthick,
            Status::FjordClosed => self.fjord_closed,
            Status::Failed | Status::Refused => self.failed,
        }
    }

    /// Runs that ended, one way or another.
    pub fn ended(&self) -> i64 {
        self.total - self.queued - self.running
    }
}

/// What a sweep waits for, as it is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// For a worker to take its chunks, and for those under way.
    Open,
    /// For its user to resume it.
    Paused,
    /// For the chunks under way only.
    Stopping,
    /// For nothing.
    Ended,
    /// To be cleared away; nobody sees it any more.
    Deleted,
}

impl Phase {
    /// Name in the database.
    pub fn name(self) -> &'static str {
        match self {
            Self::Open => "open",
            Self::Paused => "paused",
            Self::Stopping => "stopping",
            Self::Ended => "ended",
            Self::Deleted => "deleted",
        }
    }

    /// The phase of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        [Self::Open, Self::Paused, Self::Stopping, Self::Ended, Self::Deleted]
            .into_iter()
            .find(|p| p.name() == name)
    }

    /// The state that users see.
    pub fn state(self, counts: &Counts) -> SweepState {
        match self {
            Self::Paused => SweepState::Paused,
            Self::Stopping => SweepState::Stopping,
            Self::Ended | Self::Deleted if counts.cancelled > 0 => SweepState::Cancelled,
            Self::Ended | Self::Deleted => SweepState::Complete,
            Self::Open if counts.running > 0 || counts.ended() > 0 => SweepState::Running,
            Self::Open => SweepState::Queued,
        }
    }
}

/// State of a sweep.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum SweepState {
    /// No run was started yet.
    Queued,
    /// Some runs are under way or have ended.
    Running,
    /// No chunk is started until it is resumed; those under way end.
    Paused,
    /// The chunks under way end, and no others start.
    Stopping,
    /// Every run has a result.
    Complete,
    /// It was stopped or cancelled with runs left.
    Cancelled,
}

impl SweepState {
    /// All states.
    pub const ALL: [SweepState; 6] = [
        Self::Queued,
        Self::Running,
        Self::Paused,
        Self::Stopping,
        Self::Complete,
        Self::Cancelled,
    ];

    /// Name at every boundary.
    pub fn name(self) -> &'static str {
        match self {
            Self::Queued => "queued",
            Self::Running => "running",
            Self::Paused => "paused",
            Self::Stopping => "stopping",
            Self::Complete => "complete",
            Self::Cancelled => "cancelled",
        }
    }
}

/// What a user asks of a sweep.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Verb {
    /// Start no more chunks until resumed.
    Pause,
    /// Go on, after a pause, a stop or a cancellation.
    Resume,
    /// Finish what is under way and cancel the rest.
    Stop,
    /// Cancel what has no result yet, also what is under way.
    Cancel,
    /// Queue the failed runs again.
    Retry,
    /// Take it out of the trash.
    Recover,
}

impl Verb {
    /// All verbs.
    pub const ALL: [Verb; 6] =
        [Verb::Pause, Verb::Resume, Verb::Stop, Verb::Cancel, Verb::Retry, Verb::Recover];

    /// Name at every boundary.
    pub fn name(self) -> &'static str {
        match self {
            Verb::Pause => "pause",
            Verb::Resume => "resume",
            Verb::Stop => "stop",
            Verb::Cancel => "cancel",
            Verb::Retry => "retry",
            Verb::Recover => "recover",
        }
    }

    /// The verb of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|v| v.name() == name)
    }
}
