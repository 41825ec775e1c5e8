//! What sweeps are found by: their own columns beside the ranges of their runs' parameters, in the words of
//! the filter language. Knows not where sweeps and runs are kept.

use super::filter::{ColumnKind, Known};
use super::status::{Counts, Status, SweepState};
use melange_solver::params::PARAMETERS;

/// What there is to know of a sweep without looking at its runs.
#[derive(Debug, Clone, PartialEq)]
pub struct SweepFacts {
    /// Number, for other tables; newer sweeps have greater ones.
    pub number: i64,
    /// Id.
    pub id: String,
    /// Name, for people.
    pub name: String,
    /// Who submitted it; none if that was before there were owners.
    pub owner: Option<String>,
    /// Its note, as it was written.
    pub note: Option<String>,
    /// Words to find it by.
    pub tags: Vec<String>,
    /// When it was submitted, RFC 3339 in UTC.
    pub created_at: String,
    /// What it solves for; none where nothing tells.
    pub regime: Option<String>,
    /// The state that users see.
    pub state: SweepState,
    /// Higher ones go first.
    pub priority: i64,
    /// Runs taken over from other sweeps so far.
    pub reused: i64,
    /// Its runs by state.
    pub counts: Counts,
    /// Parameters that vary.
    pub axes: Vec<String>,
    /// Least and greatest value of parameters among its runs.
    pub ranges: Vec<(String, f64, f64)>,
}

/// A sweep's columns that its runs have too, under their names there.
const OF_BOTH: [(&str, ColumnKind); 6] = [
    ("sweep_id", ColumnKind::Text),
    ("sweep_name", ColumnKind::Text),
    ("owner", ColumnKind::Text),
    ("tag", ColumnKind::Words),
    ("note", ColumnKind::Text),
    ("created_at", ColumnKind::Time),
];
/// Those that only lists of sweeps have.
const OF_SWEEPS: [(&str, ColumnKind); 4] = [
    ("id", ColumnKind::Text),
    ("name", ColumnKind::Text),
    ("state", ColumnKind::Text),
    ("regime", ColumnKind::Text),
];
const NUMBERS_OF_SWEEPS: [&str; 2] = ["priority", "reused"];

/// The kind of a column that runs have from their sweep.
pub fn kind_of_sweeps_column(name: &str) -> Option<ColumnKind> {
    OF_BOTH.iter().find(|(column, _)| *column == name).map(|(_, kind)| *kind)
}

/// The kind of a column by which sweeps are chosen.
pub fn kind_in_sweeps(name: &str) -> Option<ColumnKind> {
    let own = OF_SWEEPS.iter().find(|(column, _)| *column == name).map(|(_, kind)| *kind);
    let is_number = || {
        NUMBERS_OF_SWEEPS.contains(&name)
            || Counts::default().named(name).is_some()
            || PARAMETERS.iter().any(|p| p.name == name)
    };
    own.or_else(|| kind_of_sweeps_column(name))
        .or_else(|| is_number().then_some(ColumnKind::Number))
}

impl SweepFacts {
    /// The range of a parameter, if it is known.
    pub fn range(&self, parameter: &str) -> Option<(f64, f64)> {
        let range = self.ranges.iter().find(|(name, ..)| name == parameter);
        range.map(|(_, low, high)| (*low, *high))
    }

    /// Runs that have a result.
    pub fn stored(&self) -> i64 {
        Status::STORED.iter().filter_map(|status| self.counts.named(status.name())).sum()
    }

    /// What is known of a column of its runs.
    pub fn of_runs(&self, column: &str) -> Known<'_> {
        match column {
            "sweep_id" => Known::Text(Some(&self.id)),
            "sweep_name" => Known::Text(Some(&self.name)),
            "owner" => Known::Text(self.owner.as_deref()),
            "tag" => Known::Words(&self.tags),
            "note" => Known::Text(self.note.as_deref()),
            "created_at" => Known::Time(&self.created_at),
            "regime" => self.regime.as_deref().map_or(Known::Nothing, |r| Known::Text(Some(r))),
            "status" => {
                let names = Status::STORED.iter().map(|status| status.name());
                Known::OneOf(names.filter(|name| self.counts.named(name) != Some(0)).collect())
            }
            column => self.range(column).map_or(Known::Nothing, |(l, h)| Known::Between(l, h)),
        }
    }

    /// What is known of a column by which sweeps are chosen.
    pub fn of_sweep(&self, column: &str) -> Known<'_> {
        match column {
            "id" => Known::Text(Some(&self.id)),
            "name" => Known::Text(Some(&self.name)),
            "state" => Known::Text(Some(self.state.name())),
            "priority" => Known::Number(self.priority as f64),
            "reused" => Known::Number(self.reused as f64),
            column => match self.counts.named(column) {
                Some(runs) => Known::Number(runs as f64),
                None => self.of_runs(column),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::filter::{Filter, Resolved};
    use super::*;

    fn facts() -> SweepFacts {
        SweepFacts {
            number: 1,
            id: "a1".into(),
            name: "Melt by width".into(),
            owner: None,
            note: Some("Für Grönland".into()),
            tags: vec!["good".into(), "paper:2".into()],
            created_at: "2026-11-22T13:57:00.123Z".into(),
            regime: Some("steady".into()),
            state: SweepState::Complete,
            priority: -1,
            reused: 0,
            counts: Counts { total: 12, converged: 10, failed: 2, ..Counts::default() },
            axes: vec!["melt_rate_m_per_day".into()],
            ranges: vec![
                ("melt_rate_m_per_day".into(), 0.5, 1.0),
                ("width_m".into(), 4000.0, 4000.0),
            ],
        }
    }

    #[test]
    fn a_sweep_is_found_by_what_it_is_and_by_what_its_runs_could_be() {
        let facts = facts();
        for (text, is_found) in [
            ("failed > 0 and total = 12 and state = 'complete'", true),
            ("melt_rate_m_per_day = 0.7", true),
            ("not melt_rate_m_per_day < 0.6", true),
            ("melt_rate_m_per_day > 1", false),
            ("width_m != 4000", false),
            ("d_m = 3", true),
            ("regime != 'steady'", false),
            ("owner is null and priority < 0 and reused = 0", true),
            ("tag = 'good' and tag != 'bad'", true),
            ("tag != 'good'", false),
            ("tag ~ 'PAPER'", true),
            ("note ~ 'grön' and name ~ 'WIDTH'", true),
            ("created_at >= '2026-11-22' and created_at = '2026-11'", true),
            ("created_at > '2026-11-22T13:57'", false),
            ("sweep_name = name", false),
        ] {
            let Ok(filter) = Filter::parse(text, &kind_in_sweeps) else {
                assert_eq!(text, "sweep_name = name", "columns are not compared");
                continue;
            };
            let found = filter.resolve(&|column| facts.of_sweep(column)) != Resolved::Never;
            assert_eq!(found, is_found, "{text}");
        }
    }

    #[test]
    fn statuses_that_no_run_has_rule_a_sweep_out() {
        let facts = facts();
        let kind = |name: &str| (name == "status").then_some(ColumnKind::Text);
        let left = |text: &str| {
            let filter = Filter::parse(text, &kind).expect("it is a filter");
            filter.resolve(&|column| facts.of_runs(column))
        };
        assert_eq!(left("status = 'overthick'"), Resolved::Never);
        assert_eq!(left("status in ('failed', 'converged')"), Resolved::Always);
        assert_ne!(left("status = 'failed'"), Resolved::Never);
        assert_eq!(left("status != 'collapsed'"), Resolved::Always);
        assert_eq!(facts.stored(), 12);
    }
}
