//! Fig. 7: seasons, over time and as loops.

use super::super::case::{largest, least};
use super::super::experiments::{Instant, Solved};
use super::page::{Axis, Frame, Line, Page, Panel};
use super::{Figure, colours};

/// MN in N, km in m.
const MEGA: f64 = 1e6;
const KILO: f64 = 1e3;
/// Left edge and width of the panels over time, and of the loops.
const OVER_TIME: (f64, f64) = (54.0, 308.0);
const LOOPS: (f64, f64) = (474.0, 208.0);
const HEIGHT: f64 = 190.0;
const TOP: f64 = 44.0;
/// From a row to the next.
const ROW: f64 = 246.0;
/// The line of a forcing that all runs share, and of the coupled run where black is taken.
const SHARED: &str = "#7a7a7a";
/// The forcing stands above this share of a panel over time, the force below.
const FORCE_BELOW: f64 = 0.62;

/// The transients, largest mélange first.
pub struct Seasons<'a> {
    /// Melt swings.
    pub by_melt: Vec<&'a Solved>,
    /// Calving swings.
    pub by_calving: Vec<&'a Solved>,
    /// Melt swings, calving follows the force.
    pub coupled: &'a Solved,
}

/// What swings: its name, and its number.
type Forcing = (&'static str, fn(&Instant) -> f64);

impl Seasons<'_> {
    fn colour(&self, index: usize) -> String {
        colours::of(index, self.by_melt.len())
    }

    /// All runs with their lines, dashed where calving swings; the coupled one is grey, black being taken.
    pub fn lines(&self) -> impl Iterator<Item = (Line, &Solved)> {
        let melt = self.by_melt.iter().enumerate();
        let melt = melt.map(|(i, run)| (Line::solid(self.colour(i)), *run));
        let calving = self.by_calving.iter().enumerate();
        let calving = calving.map(|(i, run)| (Line::dashed(self.colour(i)), *run));
        melt.chain(calving).chain([(Line::solid(SHARED), self.coupled)])
    }

    /// The names of their colours.
    pub fn names(&self) -> Vec<(Line, String)> {
        let name = |(i, run): (usize, &&Solved)| {
            let melt = run.parameters.melt_rate_m_per_day;
            (Line::solid(self.colour(i)), format!("Fig. 7, {melt} m d^\u{2212}1^"))
        };
        let mut names: Vec<_> = self.by_melt.iter().enumerate().map(name).collect();
        names.push((Line::solid(SHARED), "Fig. 7, coupled".to_owned()));
        names
    }

    /// Draws the figure.
    pub fn draw(&self, figure: &Figure) -> Page {
        let mut page = Page::new(TOP + ROW + HEIGHT + 42.0, figure.title, figure.caption);
        let mut legend: Vec<_> = self
            .by_melt
            .iter()
            .enumerate()
            .map(|(i, run)| {
                let melt = run.parameters.melt_rate_m_per_day;
                (Line::solid(self.colour(i)), format!("{melt} m d^\u{2212}1^"))
            })
            .collect();
        legend.push((Line::solid(colours::BLACK), "calving follows the force".to_owned()));
        page.legend((OVER_TIME.0, 16.0), Some(95.0), "mean melt rate", &legend);

        let coloured = |runs: &[&Solved]| -> Vec<(Line, Vec<Instant>)> {
            let line = |i: usize| Line::solid(self.colour(i));
            runs.iter().enumerate().map(|(i, run)| (line(i), run.series.clone())).collect()
        };
        let mut by_melt = coloured(&self.by_melt);
        by_melt.push((Line::solid(colours::BLACK), self.coupled.series.clone()));
        let melt: Forcing = ("Melt rate (m d^\u{2212}1^)", |s| s.melt_m_per_day);
        let calving: Forcing = ("Calving rate (km a^\u{2212}1^)", |s| s.calving_m_per_a / KILO);
        for (row, letters, forcing, runs) in
            [(0, ["a", "b"], melt, by_melt), (1, ["c", "d"], calving, coloured(&self.by_calving))]
        {
            let frame = |(x, width): (f64, f64)| Frame {
                x,
                y: TOP + ROW * row as f64,
                width,
                height: HEIGHT,
            };
            page.add(over_time(letters[0], frame(OVER_TIME), forcing, &runs));
            page.add(loops(letters[1], frame(LOOPS), forcing, &runs));
        }
        page
    }
}

/// Least and largest of a number over all runs.
fn range(runs: &[(Line, Vec<Instant>)], number: impl Fn(&Instant) -> f64) -> (f64, f64) {
    let all = || runs.iter().flat_map(|(_, series)| series.iter().map(&number));
    (least(all()), largest(all()))
}

/// Force of an instant, as its axis shows it.
fn force(s: &Instant) -> f64 {
    s.force_n_per_m / MEGA
}

fn force_axis(end: f64) -> Axis {
    Axis::new("Force *F*/*W* (MN m^\u{2212}1^)", 0.0, end)
}

fn over_time(
    letter: &str,
    frame: Frame,
    (title, forcing): Forcing,
    runs: &[(Line, Vec<Instant>)],
) -> Panel {
    let (_, end_a) = range(runs, |s| s.time_a);
    let (_, strongest) = range(runs, force);
    let (low, high) = range(runs, forcing);
    let x = Axis::new("Time (a)", 0.0, end_a);
    let y = force_axis(strongest / FORCE_BELOW);
    let mut panel = Panel::new(letter, frame, x, y.marked(0.0, 1.02 * strongest));
    for (line, series) in runs {
        panel.curve(line, series.iter().map(|s| (s.time_a, force(s))));
    }
    // The forcing in the space above.
    let step = (high - low) / (0.96 - FORCE_BELOW - 0.06);
    let right = Axis::new(title, low - step * (FORCE_BELOW + 0.06), high + 0.04 * step);
    let mut right = panel.with_right(right.marked(low, high));
    // What is drawn already would hide its like, and what all runs share has no run's colour.
    let mut drawn: Vec<(&Line, Vec<f64>)> = Vec::new();
    for (line, series) in runs {
        let swing: Vec<f64> = series.iter().map(forcing).collect();
        if drawn.iter().all(|(_, other)| *other != swing) {
            drawn.push((line, swing));
        }
    }
    let shared = Line::solid(SHARED);
    for (line, swing) in &drawn {
        let line = if drawn.len() == 1 { &shared } else { *line };
        let times = runs[0].1.iter().map(|s| s.time_a);
        right.curve(&line.clone().dash(), times.zip(swing.iter().copied()));
    }
    panel.lay(right);
    panel
}

fn loops(
    letter: &str,
    frame: Frame,
    (title, forcing): Forcing,
    runs: &[(Line, Vec<Instant>)],
) -> Panel {
    let (low, high) = range(runs, forcing);
    let margin = 0.05 * (high - low);
    let (_, strongest) = range(runs, force);
    let x = Axis::new(title, low - margin, high + margin);
    let y = force_axis(1.06 * strongest);
    let mut panel = Panel::new(letter, frame, x, y);
    for (line, series) in runs {
        panel.curve(line, series.iter().map(|s| (forcing(s), force(s))));
    }
    for (line, series) in runs {
        panel.dots(line.colour(), 3.0, series.iter().take(1).map(|s| (forcing(s), force(s))));
    }
    panel
}
