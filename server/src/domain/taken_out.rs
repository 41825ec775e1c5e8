//! Results that leave the catalogue so that their runs are done again.

use super::status::Status;
use std::ops::Range;

/// Results of a sweep that were taken out.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct TakenOut {
    /// Indices of their runs, in stretches without gaps: whoever does a stretch again does just these runs.
    pub stretches: Vec<Range<i64>>,
    /// How many there were of each status.
    pub statuses: Vec<(Status, i64)>,
    /// Those that had been taken over from another chunk.
    pub adopted: i64,
}

/// Most runs of a stretch, as of a chunk.
const MOST_RUNS: i64 = 1_000;

impl TakenOut {
    /// Adds a result. Results of neighbouring runs that are added in order are one stretch.
    pub fn add(&mut self, run_index: i64, status: Option<Status>, is_adopted: bool) {
        match self.stretches.last_mut() {
            Some(last) if last.end == run_index && last.end - last.start < MOST_RUNS => {
                last.end += 1;
            }
            _ => self.stretches.push(run_index..run_index + 1),
        }
        self.adopted += i64::from(is_adopted);
        let Some(status) = status else { return };
        match self.statuses.iter_mut().find(|(s, _)| *s == status) {
            Some((_, runs)) => *runs += 1,
            None => self.statuses.push((status, 1)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stretches_have_no_gaps() {
        let mut taken = TakenOut::default();
        for i in [3, 4, 7, 8, 9] {
            taken.add(i, Some(Status::Failed), i == 7);
        }
        assert_eq!(taken.stretches, [3..5, 7..10]);
        assert_eq!((taken.statuses, taken.adopted), (vec![(Status::Failed, 5)], 1));
    }
}
