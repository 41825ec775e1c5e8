//! Fault points: the steps of a commit at which a process can be told to stop, so that whoever soaks the
//! service can kill it there. Nobody else sets one; without one, nothing happens here.

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

/// A step of storing a chunk.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Step {
    /// The chunk is solved, nothing is written.
    BeforeWrite,
    /// A temporary file is written, not synced.
    AfterWrite,
    /// It is synced, not renamed.
    AfterFsync,
    /// It has its final name, the catalogue does not know it.
    AfterRename,
    /// All statements of the transaction are done, it is not committed.
    InTransaction,
    /// The chunk is stored; its worker does not know yet.
    AfterCommit,
}

impl Step {
    /// All steps, in the order they are taken.
    pub const ALL: [Step; 6] = [
        Step::BeforeWrite,
        Step::AfterWrite,
        Step::AfterFsync,
        Step::AfterRename,
        Step::InTransaction,
        Step::AfterCommit,
    ];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Step::BeforeWrite => "before_write",
            Step::AfterWrite => "after_write",
            Step::AfterFsync => "after_fsync",
            Step::AfterRename => "after_rename",
            Step::InTransaction => "in_transaction",
            Step::AfterCommit => "after_commit",
        }
    }
}

/// Where to stop: at which step, and at which passing of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FaultPoint {
    /// The step.
    pub step: Step,
    /// 1 for the first time it is passed.
    pub passing: u32,
}

impl FromStr for FaultPoint {
    type Err = String;

    /// Reads `after_fsync:3`.
    fn from_str(text: &str) -> Result<Self, String> {
        let names = Step::ALL.map(Step::name).join(", ");
        let (step, passing) = text.split_once(':').unwrap_or((text, "1"));
        let step = Step::ALL.into_iter().find(|s| s.name() == step);
        let passing = passing.parse().ok().filter(|n| *n > 0);
        match (step, passing) {
            (Some(step), Some(passing)) => Ok(Self { step, passing }),
            _ => Err(format!("a fault point is one of {names}, with `:2` for the second passing")),
        }
    }
}

impl fmt::Display for FaultPoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.step.name(), self.passing)
    }
}

/// The fault point of a process, if it has one.
#[derive(Debug, Clone, Default)]
pub struct Faults(Option<Arc<(FaultPoint, AtomicU32)>>);

/// What a process says when it has stopped at its fault point.
pub const STOPPED_AT: &str = "stopped at fault point";

impl Faults {
    /// With a point to stop at.
    pub fn at(point: FaultPoint) -> Self {
        Self(Some(Arc::new((point, AtomicU32::new(0)))))
    }

    /// Passes a step. At the fault point it says so on standard output, and this thread goes no further.
    pub fn pass(&self, step: Step) {
        let Some((point, passed)) = self.0.as_deref() else { return };
        if point.step != step || passed.fetch_add(1, Ordering::SeqCst) + 1 != point.passing {
            return;
        }
        println!("{STOPPED_AT} {point}");
        loop {
            std::thread::park();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_read_as_they_are_written() {
        for step in Step::ALL {
            let point = FaultPoint { step, passing: 3 };
            assert_eq!(point.to_string().parse(), Ok(point));
        }
        assert_eq!("after_write".parse(), Ok(FaultPoint { step: Step::AfterWrite, passing: 1 }));
        for wrong in ["after_write:0", "later", "", "after_write:x"] {
            assert!(wrong.parse::<FaultPoint>().is_err(), "{wrong}");
        }
    }
}
