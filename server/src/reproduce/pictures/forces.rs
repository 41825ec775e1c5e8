//! Figs. 5, 6 and 8: what the force depends on.

use super::super::case::{self, Case, fit, largest};
use super::super::geometry;
use super::page::{Axis, FAINT, Frame, Line, Page, Panel};
use super::profiles::outlines;
use super::seasons::Seasons;
use super::{Figure, colours};
use crate::analysis::{Fit, Law};
use melange_solver::force::static_force_n_per_m;

/// MN in N.
const MEGA: f64 = 1e6;
/// Panels of a row.
const PANELS: [(f64, f64); 2] = [(54.0, 300.0), (424.0, 258.0)];
const HEIGHT: f64 = 190.0;
const TOP: f64 = 24.0;
/// From a row to the next.
const ROW: f64 = 246.0;

fn frame(row: usize, column: usize) -> Frame {
    let (x, width) = PANELS[column];
    Frame { x, y: TOP + ROW * row as f64, width, height: HEIGHT }
}

fn number(parameter: &str, case: &Case) -> f64 {
    let info = melange_solver::params::info(parameter).expect("a parameter's name");
    (info.get)(case.model.parameters())
}

/// Both estimates of the force over a parameter, with the law that fits the one with stretching.
fn forces(letter: &str, frame: Frame, cases: &[Case], x: Over, law: Law) -> (Panel, Fit) {
    let Over { parameter, title, unit } = x;
    let values = cases.iter().map(|c| number(parameter, c) / unit);
    let (low, high) = (case::least(values.clone()), largest(values));
    let margin = 0.05 * (high - low);
    let strongest = largest(cases.iter().map(Case::force_quasi_static_n_per_m)) / MEGA;
    let x = Axis::new(title, low - margin, high + margin);
    let y = Axis::new("Force *F*/*W* (MN m^\u{2212}1^)", 0.0, 1.06 * strongest);
    let mut panel = Panel::new(letter, frame, x, y);
    let fitted = geometry::over(law, cases, parameter, Case::force_n_per_m);
    let grey = Line::solid(FAINT).wide(3.0);
    let band = fitted.band.x.iter().zip(&fitted.band.y);
    panel.guide(&grey, band.map(|(x, y)| (x / unit, y / MEGA)));
    let (with, without) =
        (Line::dashed(colours::BLACK).with_dots(), Line::dotted(colours::BLACK).with_dots());
    let at = |force: fn(&Case) -> f64| {
        cases.iter().map(move |c| (number(parameter, c) / unit, force(c) / MEGA))
    };
    panel.curve(&without, at(Case::force_quasi_static_n_per_m));
    panel.curve(&with, at(Case::force_n_per_m));
    let e = &fitted.exponent;
    let what = match law {
        Law::Power => format!("power law, exponent {}", rounded(e.estimate)),
        _ => format!("exponential, *R*^2^ = {:.3}", fitted.r_squared),
    };
    let legend = [
        (without, "without stretching".to_owned()),
        (with, "with stretching".to_owned()),
        (grey, what),
    ];
    panel.legend((0.36, 0.10), None, "", &legend);
    (panel, fitted)
}

/// A number in two decimals, with a minus sign that is one.
fn rounded(value: f64) -> String {
    format!("{value:.2}").replace('-', "\u{2212}")
}

/// A parameter, how its axis is called, and its unit there by its own.
#[derive(Clone, Copy)]
struct Over {
    parameter: &'static str,
    title: &'static str,
    unit: f64,
}

/// Fig. 5.
pub fn melts(figure: &Figure, cases: &[Case]) -> Page {
    let mut page = Page::new(TOP + HEIGHT + 38.0, figure.title, figure.caption);
    let melt = "melt_rate_m_per_day";
    let names: Vec<String> = cases.iter().map(|c| format!("{:.1}", number(melt, c))).collect();
    page.add(outlines("a", frame(0, 0), cases, "melt (m d^\u{2212}1^)", &names));
    let over = Over { parameter: melt, title: "Melt rate (m d^\u{2212}1^)", unit: 1.0 };
    page.add(forces("b", frame(0, 1), cases, over, Law::Power).0);
    page
}

/// Fig. 6.
pub fn walls(figure: &Figure, widths: &[Case], gradients: &[Case]) -> Page {
    let mut page = Page::new(TOP + ROW + HEIGHT + 38.0, figure.title, figure.caption);
    let width = Over { parameter: "width_m", title: "Width *W* (km)", unit: 1e3 };
    let names: Vec<String> =
        widths.iter().map(|c| format!("{}", number("width_m", c) / 1e3)).collect();
    page.add(outlines("a", frame(0, 0), widths, "width (km)", &names));
    page.add(forces("b", frame(0, 1), widths, width, Law::Exponential).0);
    let gradient =
        Over { parameter: "width_gradient", title: "Gradient of the width d*W*/d*x*", unit: 1.0 };
    let names: Vec<String> =
        gradients.iter().map(|c| rounded(number("width_gradient", c))).collect();
    page.add(outlines("c", frame(1, 0), gradients, "d*W*/d*x*", &names));
    page.add(forces("d", frame(1, 1), gradients, gradient, Law::Exponential).0);
    page
}

/// Fig. 8.
pub fn over_thickness(figure: &Figure, melts: &[Case], seasons: &Seasons<'_>) -> Page {
    let mut page = Page::new(TOP + HEIGHT + 58.0, figure.title, figure.caption);
    let tall = |column| Frame { height: HEIGHT + 20.0, ..frame(0, column) };
    let thickest = 1.05 * largest(melts.iter().map(Case::thickness_0_m));
    let steady = fit(Law::Power, melts.iter().map(|c| (c.thickness_0_m(), c.force_n_per_m())));
    let by_law = |h: f64| steady.prefactor.estimate * h.powf(steady.exponent.estimate);
    let thickness = |count: usize| (0..=count).map(move |k| thickest * k as f64 / count as f64);

    let title = "Thickness at the terminus *H*_0_ (m)";
    let most = static_force_n_per_m(thickest) / MEGA;
    let y = Axis::new("Force *F*/*W* (MN m^\u{2212}1^)", 0.0, most);
    let mut panel = Panel::new("a", tall(0), Axis::new(title, 0.0, thickest), y);
    let (at_rest, dashed) = (Line::solid(colours::BLACK), Line::dashed(colours::BLACK));
    for (line, run) in seasons.lines() {
        let line = line.wide(1.2);
        panel.curve(&line, run.series.iter().map(|s| (s.thickness_0_m, s.force_n_per_m / MEGA)));
    }
    panel.curve(&at_rest, thickness(80).map(|h| (h, static_force_n_per_m(h) / MEGA)));
    panel.guide(&dashed, thickness(80).map(|h| (h, by_law(h) / MEGA)));
    let states = || melts.iter().map(|c| (c.thickness_0_m(), c.force_n_per_m()));
    panel.dots(colours::BLACK, 2.2, states().map(|(h, f)| (h, f / MEGA)));
    let exponent = rounded(steady.exponent.estimate);
    let mut legend = vec![
        (at_rest.clone(), "quasi-static, \u{221d} *H*_0_^2^".to_owned()),
        (dashed.clone().with_dots(), format!("steady, \u{221d} *H*_0_^{exponent}^")),
    ];
    legend.extend(seasons.names());
    panel.legend((0.05, 0.08), None, "", &legend);
    page.add(panel);

    let moments = seasons.lines().flat_map(|(_, run)| run.series.iter());
    let moments = moments.map(|s| (s.thickness_0_m, s.force_n_per_m));
    let shown: Vec<(f64, f64)> = moments.chain(states()).map(|(h, f)| (h, f / by_law(h))).collect();
    let (heights, ratios) = (|| shown.iter().map(|p| p.0), || shown.iter().map(|p| p.1));
    let (low, high) = (case::least(ratios()), largest(ratios()));
    let across = (case::least(heights()) - 5.0, largest(heights()) + 5.0);
    let margin = 0.08 * (high - low);
    let x = Axis::new(title, across.0, across.1);
    let y = Axis::new("Force / law of steady states", low - margin, high + margin);
    let mut panel = Panel::new("b", tall(1), x, y);
    panel.guide(&dashed, [(across.0, 1.0), (across.1, 1.0)]);
    for (line, run) in seasons.lines() {
        let points = run.series.iter().map(|s| (s.thickness_0_m, s.force_n_per_m));
        panel.curve(&line.wide(1.0), points.map(|(h, f)| (h, f / by_law(h))));
    }
    panel.dots(colours::BLACK, 2.2, states().map(|(h, f)| (h, f / by_law(h))));
    page.add(panel);
    page
}
