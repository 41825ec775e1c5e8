//! Figs. 2–4: profiles along the fjord and across it.

use super::super::case::{Case, largest, least};
use super::super::experiments::Solved;
use super::page::{Axis, Frame, Line, Page, Panel};
use super::{Figure, colours};
use melange_solver::params::{ICE_DENSITY, WATER_DENSITY};
use melange_solver::state::State;

/// Middle of the mélange, as a fraction χ of its length.
const MIDPOINT: f64 = 0.5;
/// Left edges of a page's two columns of panels, their width, and their height.
const LEFT: [f64; 2] = [54.0, 403.0];
const WIDTH: f64 = 279.0;
const HEIGHT: f64 = 118.0;
/// From a row of panels to the next.
const ROW: f64 = 172.0;
/// Upper edge of the first row, and where a legend stands above it.
const TOP: f64 = 24.0;
const TOP_BELOW_LEGEND: f64 = 54.0;
/// How much of the glacier is shown, km.
const GLACIER_KM: f64 = 0.7;

/// A curve of each panel (a–d): a state, its line, and its speed relative to the walls above that relative
/// to the terminus, m a⁻¹.
struct Along<'a> {
    state: &'a State,
    line: Line,
    terminus_m_per_a: f64,
}

impl<'a> Along<'a> {
    fn new(case: &'a Case, line: Line) -> Self {
        let p = case.model.parameters();
        let terminus_m_per_a = p.terminus_velocity_m_per_a - p.calving_rate_m_per_a;
        Self { state: &case.state, line, terminus_m_per_a }
    }
}

/// The outline of a mélange about sea level, from its base at the terminus round to its surface there:
/// x in km, height in m.
pub fn outline(s: &State) -> Vec<(f64, f64)> {
    let ends = |first, inner: &[f64], last| [&[first], inner, &[last]].concat();
    let x = ends(0.0, &s.cell_x_m(), s.length_m);
    let h = ends(s.thickness_0_m(), &s.thickness_m, s.thickness_end_m());
    let along = || x.iter().map(|x| x / 1e3).zip(&h);
    let base = along().map(|(x, h)| (x, -below(*h)));
    base.chain(along().rev().map(|(x, h)| (x, h - below(*h)))).collect()
}

/// How much of floating ice is below the sea, m.
fn below(thickness_m: f64) -> f64 {
    thickness_m * ICE_DENSITY / WATER_DENSITY
}

/// The sea, and a glacier's terminus in it.
pub fn sea_and_glacier(panel: &mut Panel, thickness_m: f64, low_m: f64, end_km: f64) {
    panel.guide(&Line::solid("#7fa8c9").wide(0.7), [(0.0, 0.0), (end_km, 0.0)]);
    let top = thickness_m - below(thickness_m);
    let corners = [(-2.0, low_m - 50.0), (0.0, low_m - 50.0), (0.0, top), (-2.0, top)];
    panel.area("#dcdcdc", corners);
}

/// The axis of heights that hold mélanges of a thickness and the front of a glacier.
pub fn heights(thickest_m: f64, glacier_m: f64) -> Axis {
    let top = glacier_m - below(glacier_m);
    Axis::new("Height above sea level (m)", -1.1 * below(thickest_m), 1.15 * top)
}

/// The places of a page's panels, in rows of two.
#[derive(Clone, Copy)]
struct Rows {
    top: f64,
}

impl Rows {
    fn frame(self, row: usize, column: usize) -> Frame {
        Frame { x: LEFT[column], y: self.top + ROW * row as f64, width: WIDTH, height: HEIGHT }
    }

    /// Height of a page with three of them.
    fn height(self) -> f64 {
        self.top + 2.0 * ROW + HEIGHT + 36.0
    }
}

/// The range of some numbers with a margin on both sides.
fn range(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let (low, high) = (least(values.clone()), largest(values));
    let margin = 0.06 * (high - low);
    (low - margin, high + margin)
}

/// The panels (a–d).
fn along_the_fjord(page: &mut Page, rows: Rows, glaciers_m: &[f64], all: &[Along<'_>]) {
    let end_km = 1.03 * largest(all.iter().map(|a| a.state.length_m)) / 1e3;
    let x = || Axis::new("Distance from the terminus (km)", -GLACIER_KM, end_km);
    let speeds = |a: &Along<'_>| -> Vec<f64> {
        a.state.velocity_m_per_a.iter().map(|u| (u + a.terminus_m_per_a) / 1e3).collect()
    };
    let fastest = largest(all.iter().flat_map(speeds));
    let km = |x_m: Vec<f64>| x_m.into_iter().map(|x| x / 1e3);

    let y = Axis::new("Speed (km a^\u{2212}1^)", 0.0, 1.06 * fastest);
    let mut panel = Panel::new("a", rows.frame(0, 0), x(), y);
    for a in all {
        panel.curve(&a.line, km(a.state.node_x_m()).zip(speeds(a)));
    }
    page.add(panel);

    let thickest = largest(all.iter().map(|a| a.state.thickness_0_m()));
    let largest_m = largest(glaciers_m.iter().copied());
    let y = heights(thickest, largest_m);
    let mut panel = Panel::new("b", rows.frame(0, 1), x(), y);
    let mut descending = glaciers_m.to_vec();
    descending.sort_by(|a, b| b.total_cmp(a));
    for glacier_m in descending {
        sea_and_glacier(&mut panel, glacier_m, -below(thickest), end_km);
    }
    for a in all {
        panel.curve(&a.line, outline(a.state));
    }
    page.add(panel);

    let most = largest(all.iter().flat_map(|a| a.state.fluidity_per_a.iter().copied()));
    let y = Axis::new("Fluidity *g*^x^ (a^\u{2212}1^)", 0.0, 1.06 * most);
    let mut panel = Panel::new("c", rows.frame(1, 0), x(), y);
    for a in all {
        let fluidity = a.state.fluidity_per_a.iter().copied();
        panel.curve(&a.line, km(a.state.cell_x_m()).zip(fluidity));
    }
    page.add(panel);

    let (low, high) = range(all.iter().flat_map(|a| a.state.mu_w.iter().copied()));
    let y = Axis::new("Friction at the walls *\u{3bc}*_w_", low, high);
    let mut panel = Panel::new("d", rows.frame(1, 1), x(), y);
    for a in all {
        panel.curve(&a.line, km(a.state.node_x_m()).zip(a.state.mu_w.iter().copied()));
    }
    page.add(panel);
}

/// u over y at χ: km from the wall, km a⁻¹.
fn transverse(case: &Case, chi: f64) -> Vec<(f64, f64)> {
    let t = case.transect(chi);
    t.y_m.iter().zip(&t.velocity_m_per_a).map(|(y, u)| (y / 1e3, u / 1e3)).collect()
}

/// A panel of speeds across the fjord.
fn across_the_fjord(letter: &str, frame: Frame, all: &[(Line, Vec<(f64, f64)>)]) -> Panel {
    let points = || all.iter().flat_map(|(_, points)| points);
    let fastest = largest(points().map(|p| p.1));
    let x = Axis::new("Distance from the wall (km)", 0.0, largest(points().map(|p| p.0)));
    let y = Axis::new("Speed (km a^\u{2212}1^)", 0.0, 1.06 * fastest);
    let mut panel = Panel::new(letter, frame, x, y);
    for (line, points) in all {
        panel.curve(line, points.iter().copied());
    }
    panel
}

/// Fig. 2: the steady base case, the states on its way to rest, and the limit.
pub struct Relaxing {
    steady: Case,
    /// Times in a, and states.
    way: Vec<(f64, Case)>,
    limit: Case,
    fractions: Vec<f64>,
}

impl Relaxing {
    /// The states stored on the way, without the start, which is the steady state.
    pub fn new(steady: &Case, relaxed: &Solved, limit: &Case, fractions: &[f64]) -> Self {
        let later = |(time_a, state): &(f64, State)| {
            let model = steady.model.at_rest();
            (*time_a, Case { name: String::new(), model, state: state.clone() })
        };
        Self {
            steady: steady.clone(),
            way: relaxed.states.iter().filter(|(time_a, _)| *time_a > 0.0).map(later).collect(),
            limit: limit.clone(),
            fractions: fractions.to_vec(),
        }
    }

    /// Draws it.
    pub fn draw(&self, figure: &Figure) -> Page {
        let rows = Rows { top: TOP_BELOW_LEGEND };
        let mut page = Page::new(rows.height(), figure.title, figure.caption);
        let count = 1 + self.way.len();
        let at_rest = Line::dashed(colours::BLACK);
        let line = |i: usize| Line::solid(colours::of(i, count));
        let mut legend = vec![(line(0), "steady".to_owned())];
        let mut all = vec![Along::new(&self.steady, line(0))];
        let mut middle = vec![(line(0), transverse(&self.steady, MIDPOINT))];
        for (i, (time_a, case)) in self.way.iter().enumerate() {
            legend.push((line(i + 1), format!("{time_a} a")));
            all.push(Along::new(case, line(i + 1)));
            middle.push((line(i + 1), transverse(case, MIDPOINT)));
        }
        legend.push((at_rest.clone(), "limit".to_owned()));
        all.push(Along::new(&self.limit, at_rest.clone()));
        middle.push((at_rest.clone(), transverse(&self.limit, MIDPOINT)));
        page.legend((LEFT[0], 20.0), Some(79.0), "", &legend);
        let glacier_m = self.steady.model.parameters().terminus_thickness_m;
        along_the_fjord(&mut page, rows, &[glacier_m], &all);

        let places = self.fractions.len();
        let mut across = Vec::new();
        for (i, chi) in self.fractions.iter().enumerate() {
            across.push((Line::solid(grey(i, places)), transverse(&self.steady, *chi)));
        }
        for (i, chi) in self.fractions.iter().enumerate() {
            across.push((Line::dashed(grey(i, places)), transverse(&self.limit, *chi)));
        }
        let mut panel = across_the_fjord("e", rows.frame(2, 0), &across);
        let names = self.fractions.iter().map(|chi| format!("{chi}"));
        let lines = (0..places).map(|i| Line::solid(grey(i, places)));
        let names: Vec<_> = lines.zip(names).collect();
        panel.legend((0.10, 0.74), Some(50.0), "*\u{3c7}*", &names);
        page.add(panel);
        page.add(across_the_fjord("f", rows.frame(2, 1), &middle));
        page
    }
}

/// A warm grey for places, which colours do not stand for: the darker the farther from the terminus.
fn grey(index: usize, count: usize) -> String {
    let light = 190.0 - 160.0 * index as f64 / (count.max(2) - 1) as f64;
    let part = |tint: f64| (light * tint).round() as u8;
    format!("#{:02x}{:02x}{:02x}", part(1.05), part(0.92), part(0.78))
}

/// Steady states on one page: panels (a–e), with a legend beside the last.
fn compared(figure: &Figure, glaciers_m: &[f64], all: &[(Line, String, &Case)]) -> Page {
    let rows = Rows { top: TOP };
    let mut page = Page::new(rows.height(), figure.title, figure.caption);
    let along: Vec<Along<'_>> =
        all.iter().map(|(l, _, case)| Along::new(case, l.clone())).collect();
    along_the_fjord(&mut page, rows, glaciers_m, &along);
    let middle: Vec<_> =
        all.iter().map(|(line, _, case)| (line.clone(), transverse(case, MIDPOINT))).collect();
    page.add(across_the_fjord("e", rows.frame(2, 0), &middle));
    let names: Vec<_> = all.iter().map(|(line, name, _)| (line.clone(), name.clone())).collect();
    page.legend((LEFT[1], rows.frame(2, 1).y + 20.0), None, "", &names);
    page
}

/// Fig. 3.
pub fn rheology(figure: &Figure, cases: &[Case]) -> Page {
    let base = &cases[0];
    let name = |i: usize, case: &Case| {
        let [p, q] = [case, base].map(|c| c.model.parameters());
        if i == 0 {
            return format!(
                "default: *d* = {} m, *b* = {}, *A* = {}, *\u{3bc}*_s_ = {}",
                p.d_m,
                scientific(p.b),
                p.A,
                p.mu_s
            );
        }
        let changed = [
            (p.d_m != q.d_m, format!("*d* = {} m", p.d_m)),
            (p.b != q.b, format!("*b* = {}", scientific(p.b))),
            (p.A != q.A, format!("*A* = {}", p.A)),
            (p.mu_s != q.mu_s, format!("*\u{3bc}*_s_ = {}", p.mu_s)),
        ];
        let told: Vec<String> =
            changed.into_iter().filter_map(|(is, text)| is.then_some(text)).collect();
        told.join(", ")
    };
    let line = |i: usize| match i {
        0 => Line::solid(colours::BLACK),
        // The darkest colour is too near to black.
        i => Line::solid(colours::of(i, cases.len())),
    };
    let all: Vec<_> =
        cases.iter().enumerate().map(|(i, case)| (line(i), name(i, case), case)).collect();
    compared(figure, &[base.model.parameters().terminus_thickness_m], &all)
}

/// A power of ten with what stands in front of it.
fn scientific(value: f64) -> String {
    let text = format!("{value:e}");
    match text.split_once('e') {
        Some((front, power)) => format!("{front} \u{d7} 10^{power}^"),
        None => text,
    }
}

/// Fig. 4.
pub fn glaciers(figure: &Figure, cases: &[Case]) -> Page {
    let lines = [Line::solid, Line::dashed, Line::dotted];
    let sizes = ["small", "medium", "large"];
    let all: Vec<_> = cases
        .iter()
        .enumerate()
        .map(|(i, case)| {
            let p = case.model.parameters();
            let name = format!(
                "{}: *U*_t_ = *U*_c_ = {} km a^\u{2212}1^, *H*_t_ = {} m, *W* = {} km",
                sizes[i],
                p.terminus_velocity_m_per_a / 1e3,
                p.terminus_thickness_m,
                p.width_m / 1e3
            );
            // The lightest colour is too light for dots.
            (lines[i](colours::of(i, cases.len() + 1)).wide(1.6), name, case)
        })
        .collect();
    let thicknesses: Vec<f64> =
        cases.iter().map(|c| c.model.parameters().terminus_thickness_m).collect();
    compared(figure, &thicknesses, &all)
}

/// Colours that the outlines of a panel are told apart by, and the panel of them.
pub fn outlines(
    letter: &str,
    frame: Frame,
    cases: &[Case],
    title: &str,
    names: &[String],
) -> Panel {
    let end_km = 1.03 * largest(cases.iter().map(Case::length_m)) / 1e3;
    let thickest = largest(cases.iter().map(Case::thickness_0_m));
    let glacier_m = largest(cases.iter().map(|c| c.model.parameters().terminus_thickness_m));
    let x = Axis::new("Distance from the terminus (km)", -GLACIER_KM, end_km);
    let mut panel = Panel::new(letter, frame, x, heights(thickest, glacier_m));
    sea_and_glacier(&mut panel, glacier_m, -below(thickest), end_km);
    let lines = (0..cases.len()).map(|i| Line::solid(colours::of(i, cases.len())));
    for (case, line) in cases.iter().zip(lines.clone()) {
        panel.curve(&line, outline(&case.state));
    }
    panel.legend((0.72, 0.5), None, title, &lines.zip(names.iter().cloned()).collect::<Vec<_>>());
    panel
}
