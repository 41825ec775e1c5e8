//! What runs say of why they have no result, put together: sentences that differ in their numbers alone are one
//! reason. Knows no statuses' meaning.

use serde::Serialize;
use std::collections::HashMap;
use utoipa::ToSchema;

/// Runs without a result, by why.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, ToSchema)]
pub struct Failures {
    /// All ended runs that are neither converged nor completed.
    pub total: u64,
    /// The groups, the largest first; at most 100.
    pub groups: Vec<FailureGroup>,
    /// Runs of smaller groups than those.
    pub others: u64,
}

/// Runs that ended in the same way for the same reason.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct FailureGroup {
    /// How they ended.
    pub status: String,
    /// What they say of it, with … in place of numbers; empty if they say nothing.
    pub reason: String,
    /// How many they are.
    pub count: u64,
    /// The first three of them.
    pub examples: Vec<FailedRun>,
}

/// A run without a result.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct FailedRun {
    /// Its index in the sweep.
    pub run_index: i64,
    /// Its id.
    pub run_id: String,
    /// What it says.
    pub detail: String,
}

/// Most groups that are told.
const MOST_GROUPS: usize = 100;
/// Most runs of a group that are told.
const MOST_EXAMPLES: usize = 3;
/// Most groups that are told apart; what comes on top counts among the others.
const MOST_KNOWN: usize = 10_000;

/// Groups while they are gathered.
#[derive(Debug, Default)]
pub struct Gathering {
    groups: HashMap<(String, String), FailureGroup>,
    total: u64,
    others: u64,
}

impl Gathering {
    /// Adds a run by its status and what it says.
    pub fn add(&mut self, status: &str, run_index: i64, run_id: &str, detail: &str) {
        self.total += 1;
        let key = (status.to_owned(), without_numbers(detail));
        if !self.groups.contains_key(&key) {
            if self.groups.len() == MOST_KNOWN {
                self.others += 1;
                return;
            }
            let (status, reason) = key.clone();
            let group = FailureGroup { status, reason, count: 0, examples: Vec::new() };
            self.groups.insert(key.clone(), group);
        }
        let Some(group) = self.groups.get_mut(&key) else { return };
        group.count += 1;
        if group.examples.len() < MOST_EXAMPLES {
            let (run_id, detail) = (run_id.to_owned(), detail.to_owned());
            group.examples.push(FailedRun { run_index, run_id, detail });
        }
    }

    /// The groups, the largest first; equally large ones by status and reason.
    pub fn told(self) -> Failures {
        let mut groups: Vec<FailureGroup> = self.groups.into_values().collect();
        groups.sort_by(|a, b| {
            let by_name = || (&a.status, &a.reason).cmp(&(&b.status, &b.reason));
            b.count.cmp(&a.count).then_with(by_name)
        });
        let rest = groups.split_off(groups.len().min(MOST_GROUPS));
        let others = self.others + rest.iter().map(|group| group.count).sum::<u64>();
        Failures { total: self.total, groups, others }
    }
}

/// A sentence with … in place of its numbers, and one … for a list of them. Digits of names, as in `thickness_0_m`
/// or H2, stay.
pub fn without_numbers(sentence: &str) -> String {
    let mut told = String::with_capacity(sentence.len());
    let mut rest = sentence;
    let mut before = None;
    while let Some(c) = rest.chars().next() {
        let is_in_name = before.is_some_and(|b: char| b.is_alphanumeric() || b == '_');
        let length = if is_in_name { 0 } else { number(rest) };
        if length == 0 {
            told.push(c);
            rest = &rest[c.len_utf8()..];
            before = Some(c);
        } else {
            // Lists are as long as it happens, so a list is one number.
            let list = told.strip_suffix(", ").filter(|list| list.ends_with('…')).map(str::len);
            match list {
                Some(length) => told.truncate(length),
                None => told.push('…'),
            }
            rest = &rest[length..];
            before = Some('…');
        }
    }
    told
}

/// Length of the number that a text begins with; 0 if it begins with none, or with a name that begins with digits.
fn number(text: &str) -> usize {
    let digits =
        |from: &str| from.len() - from.trim_start_matches(|c: char| c.is_ascii_digit()).len();
    let sign = |from: &str| match from.chars().next() {
        Some(c @ ('-' | '+' | '−')) => c.len_utf8(),
        _ => 0,
    };
    let mut end = sign(text);
    let whole = digits(&text[end..]);
    if whole == 0 {
        return 0;
    }
    end += whole;
    if let Some(after) = text[end..].strip_prefix('.') {
        let part = digits(after);
        end += if part > 0 { 1 + part } else { 0 };
    }
    if let Some(after) = text[end..].strip_prefix(['e', 'E']) {
        let signed = sign(after);
        let power = digits(&after[signed..]);
        end += if power > 0 { 1 + signed + power } else { 0 };
    }
    let is_name = text[end..].starts_with(|c: char| c.is_alphanumeric() || c == '_');
    if is_name { 0 } else { end }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_left_out_and_names_stay() {
        for (sentence, told) in [
            (
                "the only steady state found is 267 m long and 25.52 m thick, no longer a mélange",
                "the only steady state found is … m long and … m thick, no longer a mélange",
            ),
            ("at t = 1.5e-3 a", "at t = … a"),
            ("between -0.5 and +2E+7, or −3", "between … and …, or …"),
            ("last residual norms 1.20e-3, 4.0e-4, 3", "last residual norms …"),
            ("thickness_0_m beside H2 and axis_1", "thickness_0_m beside H2 and axis_1"),
            ("found at the 2nd attempt", "found at the 2nd attempt"),
            ("the end is 5.", "the end is …."),
            ("melt_rate_m_per_day[3] = 7: x=8", "melt_rate_m_per_day[…] = …: x=…"),
            ("", ""),
            ("–—…é", "–—…é"),
        ] {
            assert_eq!(without_numbers(sentence), told);
        }
    }

    #[test]
    fn groups_come_largest_first_and_add_up() {
        let mut gathering = Gathering::default();
        for index in 0..10 {
            gathering.add("overthick", index, "a", &format!("it is {index} m thick"));
        }
        gathering.add("failed", 10, "b", "it is 3 m thick");
        for index in 0..150 {
            let letters = |n: i64| char::from(b'a' + (n % 26) as u8);
            let detail = format!("reason {}{}", letters(index), letters(index / 26));
            gathering.add("failed", 11 + index, "c", &detail);
        }
        let told = gathering.told();
        assert_eq!((told.total, told.groups.len(), told.others), (161, 100, 52));
        let counted: u64 = told.groups.iter().map(|group| group.count).sum();
        assert_eq!(counted + told.others, told.total);
        let first = &told.groups[0];
        assert_eq!(
            (first.status.as_str(), first.reason.as_str()),
            ("overthick", "it is … m thick")
        );
        let examples: Vec<_> = first.examples.iter().map(|run| run.run_index).collect();
        assert_eq!((first.count, examples), (10, vec![0, 1, 2]));
        assert_eq!(first.examples[1].detail, "it is 1 m thick");
        assert_eq!(told.groups[1].reason, "it is … m thick", "equally large ones by reason");
    }
}
