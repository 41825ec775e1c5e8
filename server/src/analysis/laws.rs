//! A law for each group of an ensemble's runs, with the runs it was fitted to and what it leaves unexplained of
//! each. Every run is counted in one group, as used or as left out.

use super::alike::{differs, sets};
use super::exponent::{LocalExponent, Placed, local_exponent};
use super::groups;
use super::law::{Fit, Law, LeftOut, leave_out, line, usable};
use crate::domain::same::{same, same_if_any};
use serde::Serialize;
use utoipa::ToSchema;

/// Runs, column by column, all of one length.
#[derive(Debug, Clone, Copy)]
pub struct Table<'a> {
    /// Index of the run.
    pub run_index: &'a [i64],
    /// How it ended.
    pub status: &'a [&'a str],
    /// Abscissa.
    pub x: &'a [Option<f64>],
    /// Ordinate.
    pub y: &'a [Option<f64>],
    /// What they are grouped by.
    pub group_by: Option<&'a [Option<f64>]>,
    /// What else may vary within a group, by name: parameters but `x` and `y`, what they are grouped by included;
    /// texts as a number for each.
    pub others: &'a [(&'a str, &'a [Option<f64>])],
    /// Ids, by whose order points are chosen; needed only where there are more runs than are told one by one.
    pub ids: Option<&'a [String]>,
}

/// Laws of groups of runs.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Laws {
    /// The groups, ascending; last, if there are any, the runs that have no value of `group_by`.
    pub groups: Vec<Group>,
    /// What a residual is.
    pub residual_meaning: &'static str,
    /// `one group`; `each value` where `group_by` has at most 12; else `bins of about equally many runs`: at most six,
    /// with equally many of the runs used as nearly as runs of equal value, which stay together, permit. Values that
    /// differ by no more than rounding are the same.
    pub grouping: &'static str,
    /// Points in all groups together. They are fewer than the runs used only where these are more than `most`.
    pub shown: usize,
    /// Runs in all groups together, also those left out.
    pub total: usize,
}

/// The law of a group.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Group {
    /// Least value of `group_by` in it; null without `group_by`, and for runs that have no value of it.
    pub from: Option<f64>,
    /// Greatest one.
    pub to: Option<f64>,
    /// Its runs: those used and those left out.
    pub n_runs: usize,
    /// The law; null if there is none.
    pub fit: Option<Fit>,
    /// Why there is none.
    pub no_fit: Option<String>,
    /// Runs left out, by reason.
    pub left_out: Vec<LeftOut>,
    /// Parameters other than `x`, and `upstream_closure`, that differ among the runs used: the law lumps them. What the
    /// runs are grouped by is one of them where groups are bins.
    pub also_varies: Vec<String>,
    /// The runs used.
    pub points: Points,
    /// The slope from place to place, between runs of neighbouring x that agree in all of `also_varies` (but for one
    /// that equals x in every run, and so moves with it). More than 1000 places are put together to at most 200.
    pub local_exponent: LocalExponent,
    /// Why there is none at all; null if there is one.
    pub no_local_exponent: Option<String>,
}

/// Runs that a law is fitted to, in the order of their indices.
#[derive(Debug, Clone, Default, PartialEq, Serialize, ToSchema)]
pub struct Points {
    /// Index of the run.
    pub run_index: Vec<i64>,
    /// Abscissa.
    pub x: Vec<f64>,
    /// Ordinate.
    pub y: Vec<f64>,
    /// What the law says in its place; empty without one.
    pub fitted: Vec<f64>,
    /// What the law does not explain, see `residual_meaning`; empty without one.
    pub residual: Vec<f64>,
}

/// A run in the coordinates of a law, or why it is left out.
type Point<'a> = Result<(f64, f64), &'a str>;

/// Fits a law to each group of runs. All runs count for the fits; of those used at most `most` are told one by
/// one: the ones of least id, which is a choice by chance that is always the same.
pub fn laws(law: Law, runs: &Table<'_>, most: usize) -> Laws {
    let point = |i: usize| usable(law, runs.status[i], runs.x[i], runs.y[i]);
    let all: Vec<Point<'_>> = (0..runs.run_index.len()).map(point).collect();
    let (grouping, members) = match runs.group_by {
        None => groups::one(all.len()),
        Some(values) => {
            let is_used: Vec<bool> = all.iter().map(Result::is_ok).collect();
            groups::by_value(values, &is_used)
        }
    };
    let sorted_out: Vec<(Vec<usize>, Vec<LeftOut>)> =
        members.iter().map(|members| sort_out(&all, &members.places)).collect();
    let all_used = sorted_out.iter().flat_map(|(used, _)| used.iter().copied());
    let is_shown = chosen(runs, all_used.collect(), most);
    let fitted = members.iter().zip(sorted_out).map(|(members, (used, left_out))| {
        let coordinates: Vec<(f64, f64)> = used.iter().filter_map(|i| all[*i].ok()).collect();
        let (line, fit, no_fit) = match line(law, &coordinates, left_out.clone()) {
            Ok((line, fit)) => (Some(line), Some(fit), None),
            Err(e) => (None, None, Some(e.to_string())),
        };
        let mut points = Points::default();
        let shown = used.iter().zip(&coordinates).filter(|(place, _)| is_shown[**place]);
        for (&place, &(x, y)) in shown {
            points.run_index.push(runs.run_index[place]);
            points.x.push(runs.x[place].unwrap_or_default());
            points.y.push(runs.y[place].unwrap_or_default());
            if let Some(line) = line {
                points.fitted.push(law.y_back(line.at(x)));
                points.residual.push(y - line.at(x));
            }
        }
        let others: Vec<_> =
            runs.others.iter().filter(|(_, values)| differs(&used, values)).collect();
        let also_varies = others.iter().map(|(name, _)| (*name).to_owned()).collect();
        let (local_exponent, no_local_exponent) = local(law, runs, &used, &coordinates, &others);
        Group {
            from: members.range.map(|range| range.0),
            to: members.range.map(|range| range.1),
            n_runs: members.places.len(),
            fit,
            no_fit,
            left_out,
            also_varies,
            points,
            local_exponent,
            no_local_exponent,
        }
    });
    let groups: Vec<Group> = fitted.collect();
    Laws {
        residual_meaning: law.residual_meaning(),
        grouping: grouping.name(),
        shown: groups.iter().map(|group| group.points.run_index.len()).sum(),
        total: groups.iter().map(|group| group.n_runs).sum(),
        groups,
    }
}

/// The runs of a group that can be used, and the others by reason.
fn sort_out(all: &[Point<'_>], places: &[usize]) -> (Vec<usize>, Vec<LeftOut>) {
    let mut used = Vec::with_capacity(places.len());
    let mut left_out = Vec::new();
    for &place in places {
        match all[place] {
            Ok(_) => used.push(place),
            Err(reason) => leave_out(&mut left_out, reason),
        }
    }
    (used, left_out)
}

/// Which places of the table are told one by one.
fn chosen(runs: &Table<'_>, mut used: Vec<usize>, most: usize) -> Vec<bool> {
    if let (true, Some(ids)) = (used.len() > most, runs.ids) {
        let by_id = |a: &usize, b: &usize| {
            ids[*a].cmp(&ids[*b]).then_with(|| runs.run_index[*a].cmp(&runs.run_index[*b]))
        };
        used.select_nth_unstable_by(most, by_id);
    }
    used.truncate(most);
    let mut is_shown = vec![false; runs.run_index.len()];
    used.into_iter().for_each(|place| is_shown[place] = true);
    is_shown
}

/// The local exponent of the runs used, in which also the others vary, or why there is none.
fn local(
    law: Law,
    runs: &Table<'_>,
    used: &[usize],
    coordinates: &[(f64, f64)],
    others: &[&(&str, &[Option<f64>])],
) -> (LocalExponent, Option<String>) {
    // What is x by another name does not tell runs of different x apart.
    let is_x = |values: &[Option<f64>]| used.iter().all(|i| same_if_any(values[*i], runs.x[*i]));
    let (names, columns): (Vec<&str>, Vec<&[Option<f64>]>) =
        others.iter().map(|other| **other).filter(|(_, values)| !is_x(values)).unzip();
    let x = |place: usize| runs.x[place].unwrap_or_default();
    let placed = used.iter().zip(coordinates).zip(sets(used, &columns));
    let placed = placed.map(|((place, at), set)| Placed { x: x(*place), at: *at, set });
    let found = local_exponent(law, placed.collect());
    if !found.x.is_empty() {
        return (found, None);
    }
    let is_one = used.iter().all(|place| same(x(*place), x(used[0])));
    let why = if is_one {
        "there are no two runs of different x".to_owned()
    } else {
        format!(
            "no two runs of neighbouring x agree in {}, so that a slope between them would not be that over x alone",
            names.join(", ")
        )
    };
    (found, Some(why))
}

#[cfg(test)]
mod tests;
