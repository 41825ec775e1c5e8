//! The order in which the runs of a stretch are solved, so that each lies near the one before, from whose
//! answer it is solved. Answers do not depend on it, only the time does, and whether a solve that gives up by
//! itself has a neighbour to go on from.

use super::axes::{Column, Columns};
use melange_solver::physics::closure::UpstreamClosure;
use std::cmp::Ordering;
use std::ops::Range;

/// What is known of a sweep's points before a stretch is asked for.
#[derive(Debug, Clone, PartialEq)]
pub enum Order {
    /// A grid, by axis: how far apart in the index its points are, and each point's rank among them.
    Grid(Vec<(usize, Vec<u32>)>),
    /// Points without a grid, by column.
    Scattered(Vec<Scale>),
}

/// Range of a column over the sweep.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    first: f64,
    span: f64,
    is_log: bool,
}

/// A positive column that spans more than this factor is taken in logarithms.
const LOG_FROM: f64 = 30.0;
/// Most points among which the nearest is looked for; more are sorted along the first column.
const MOST_COMPARED: usize = 2_000;
/// Distance of one closure from the next, in units of a column's whole range: a closure is left once
/// all its points are solved.
const CLOSURES_APART: f64 = 10.0;

impl Order {
    /// Of a sweep's axes, each with how far apart in the index its points are.
    pub fn new(axes: &[(Columns, usize)]) -> Self {
        match axes {
            [(columns, _)] if columns.len() > 1 => {
                Self::Scattered(columns.iter().map(Scale::new).collect())
            }
            _ => Self::Grid(axes.iter().map(|(c, stride)| (*stride, ranks(c))).collect()),
        }
    }

    /// The indices of a stretch in the order in which they are solved.
    pub fn visit(&self, axes: &[(Columns, usize)], stretch: Range<usize>) -> Vec<usize> {
        match self {
            Self::Grid(grid) => back_and_forth(grid, stretch),
            Self::Scattered(_) if stretch.len() > MOST_COMPARED => {
                let mut order: Vec<usize> = stretch.collect();
                order.sort_by(|i, j| compare(&axes[0].0, *i, *j));
                order
            }
            Self::Scattered(scales) => nearest_first(&axes[0].0, scales, stretch),
        }
    }
}

/// Rank of each point of an axis among its points in ascending order.
fn ranks(columns: &Columns) -> Vec<u32> {
    let mut order: Vec<usize> = (0..columns[0].len()).collect();
    order.sort_by(|i, j| compare(columns, *i, *j));
    let mut ranks = vec![0; order.len()];
    for (rank, point) in order.into_iter().enumerate() {
        ranks[point] = rank as u32;
    }
    ranks
}

fn compare(columns: &Columns, i: usize, j: usize) -> Ordering {
    let by_column = columns.iter().map(|column| match column {
        Column::Parameter(_, values) => values[i].total_cmp(&values[j]),
        Column::Closure(closures) => place(closures[i]).cmp(&place(closures[j])),
    });
    by_column.fold(Ordering::Equal, Ordering::then)
}

fn place(closure: UpstreamClosure) -> usize {
    UpstreamClosure::ALL.iter().position(|c| *c == closure).unwrap_or_default()
}

/// Along the last axis forth, one step along the one before it, along the last one back, and so on.
fn back_and_forth(grid: &[(usize, Vec<u32>)], stretch: Range<usize>) -> Vec<usize> {
    let rank = |level: usize, index: usize| {
        let (stride, ranks) = &grid[level];
        ranks[index / stride % ranks.len()]
    };
    let mut sorted: Vec<usize> = stretch.collect();
    sorted.sort_by_cached_key(|i| (0..grid.len()).map(|level| rank(level, *i)).collect::<Vec<_>>());
    let mut order = Vec::with_capacity(sorted.len());
    let mut last = vec![None; grid.len()];
    walk(&rank, &sorted, 0, &mut last, &mut order);
    order
}

/// Walks through points that share their ranks before `level`, from the end that is nearer to where the
/// last walk along that axis ended.
fn walk(
    rank: &dyn Fn(usize, usize) -> u32,
    points: &[usize],
    level: usize,
    last: &mut [Option<u32>],
    order: &mut Vec<usize>,
) {
    let [first, .., end] = points else {
        for (level, last) in last.iter_mut().enumerate().skip(level) {
            *last = points.first().map(|point| rank(level, *point));
        }
        order.extend(points);
        return;
    };
    let ends = [*first, *end].map(|point| rank(level, point));
    let is_back = last[level].is_some_and(|last| last.abs_diff(ends[1]) < last.abs_diff(ends[0]));
    let mut groups: Vec<&[usize]> =
        points.chunk_by(|i, j| rank(level, *i) == rank(level, *j)).collect();
    if is_back {
        groups.reverse();
    }
    for group in groups {
        last[level] = Some(rank(level, group[0]));
        walk(rank, group, level + 1, last, order);
    }
}

/// From the corner of the smallest values always to the nearest point that is left.
fn nearest_first(columns: &Columns, scales: &[Scale], stretch: Range<usize>) -> Vec<usize> {
    let mut left: Vec<(usize, Vec<f64>)> = stretch
        .map(|index| {
            let coordinates = columns.iter().zip(scales).map(|(column, s)| s.at(column, index));
            (index, coordinates.collect())
        })
        .collect();
    let mut order = Vec::with_capacity(left.len());
    let mut here: Option<Vec<f64>> = None;
    while !left.is_empty() {
        let distance = |there: &[f64]| match &here {
            Some(here) => here.iter().zip(there).map(|(x, y)| (x - y).powi(2)).sum::<f64>(),
            None => there.iter().sum(),
        };
        let (mut nearest, mut least) = (0, f64::INFINITY);
        for (k, (_, there)) in left.iter().enumerate() {
            let distance = distance(there);
            if distance < least {
                (nearest, least) = (k, distance);
            }
        }
        let (index, coordinates) = left.swap_remove(nearest);
        order.push(index);
        here = Some(coordinates);
    }
    order
}

impl Scale {
    fn new(column: &Column) -> Self {
        let Column::Parameter(_, values) = column else {
            return Self { first: 0.0, span: 1.0 / CLOSURES_APART, is_log: false };
        };
        let least = values.iter().copied().fold(f64::INFINITY, f64::min);
        let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let is_log = least > 0.0 && most / least > LOG_FROM;
        let [first, last] = [least, most].map(|end| if is_log { end.ln() } else { end });
        Self { first, span: last - first, is_log }
    }

    /// The coordinate of a point, 0 to 1 over the sweep.
    fn at(&self, column: &Column, index: usize) -> f64 {
        let value = match column {
            Column::Parameter(_, values) => values[index],
            Column::Closure(closures) => place(closures[index]) as f64,
        };
        let value = if self.is_log { value.ln() } else { value };
        if self.span > 0.0 { (value - self.first) / self.span } else { 0.0 }
    }
}
