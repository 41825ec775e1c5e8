//! A page of panels as SVG: axes with ticks, curves, dots, labels, legends. Knows nothing of what is drawn.
//!
//! Lengths are quarters of a millimetre. Text is text, in a font of the reader's; numbers are rounded, so that
//! the same curves have the same bytes.

use super::ticks::ticks;
use super::words::words;
use svg::node::element::{Circle, Description, Element, Group, Line as Rule, Path, SVG, Title};
use svg::{Document, Node};

/// Width of a printed page, quarters of a millimetre.
pub const WIDTH: f64 = 696.0;
/// Size of the letters.
const FONT: f64 = 11.0;
/// Letters that every system with a screen has something like.
const FONTS: &str = "Helvetica, Arial, 'Liberation Sans', 'DejaVu Sans', sans-serif";
/// Axes, ticks and text.
pub const INK: &str = "#262626";
/// What stands behind.
pub const FAINT: &str = "#b8b8b8";
/// Lengths of dashes and of the gaps between.
const DASHES: &str = "5 3";
/// Length of a tick.
const TICK: f64 = 4.0;

/// How a curve is drawn.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    colour: String,
    width: f64,
    dashes: &'static str,
    has_dots: bool,
}

impl Line {
    /// A solid line.
    pub fn solid(colour: impl Into<String>) -> Self {
        Self { colour: colour.into(), width: 1.4, dashes: "", has_dots: false }
    }

    /// A dashed line.
    pub fn dashed(colour: impl Into<String>) -> Self {
        Self::solid(colour).dash()
    }

    /// A dotted line.
    pub fn dotted(colour: impl Into<String>) -> Self {
        Self { dashes: "1.2 2.6", ..Self::solid(colour) }
    }

    /// With another width.
    pub fn wide(self, width: f64) -> Self {
        Self { width, ..self }
    }

    /// With a dot at each point.
    pub fn with_dots(self) -> Self {
        Self { has_dots: true, ..self }
    }

    /// The same, dashed.
    pub fn dash(self) -> Self {
        Self { dashes: DASHES, ..self }
    }

    /// Its colour.
    pub fn colour(&self) -> &str {
        &self.colour
    }

    fn on(&self, path: Path) -> Path {
        let path = path
            .set("fill", "none")
            .set("stroke", self.colour.as_str())
            .set("stroke-width", number(self.width))
            .set("stroke-linejoin", "round");
        if self.dashes.is_empty() { path } else { path.set("stroke-dasharray", self.dashes) }
    }
}

/// An axis: what it shows and how far.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    title: &'static str,
    low: f64,
    high: f64,
    /// Between these there are ticks.
    marked: (f64, f64),
}

impl Axis {
    /// An axis with ticks all along.
    pub fn new(title: &'static str, low: f64, high: f64) -> Self {
        Self { title, low, high, marked: (low, high) }
    }

    /// With ticks only from one value to another, where two axes share a panel.
    pub fn marked(self, low: f64, high: f64) -> Self {
        Self { marked: (low, high), ..self }
    }

    /// Share of the way along the axis.
    fn share(&self, value: f64) -> f64 {
        (value - self.low) / (self.high - self.low)
    }
}

/// Where a panel's axes stand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// Left edge.
    pub x: f64,
    /// Upper edge.
    pub y: f64,
    /// Width.
    pub width: f64,
    /// Height.
    pub height: f64,
}

/// A page that panels are put on.
#[derive(Debug)]
pub struct Page {
    document: SVG,
}

impl Page {
    /// An empty page with a title, and a description for whoever does not see it.
    pub fn new(height: f64, title: &str, description: &str) -> Self {
        let document = Document::new()
            .set("viewBox", format!("0 0 {} {}", number(WIDTH), number(height)))
            .set("width", format!("{}mm", number(WIDTH / 4.0)))
            .set("height", format!("{}mm", number(height / 4.0)))
            .set("role", "img")
            .set("font-family", FONTS)
            .set("font-size", number(FONT))
            .set("fill", INK)
            .add(Title::new(title))
            .add(Description::new().add(svg::node::Text::new(description)))
            .add(rectangle(0.0, 0.0, WIDTH, height).set("fill", "#ffffff"));
        Self { document }
    }

    /// Puts a panel on it.
    pub fn add(&mut self, panel: Panel) {
        self.document.append(panel.into_group());
    }

    /// A legend: its entries below each other, or beside each other so far apart.
    pub fn legend(
        &mut self,
        at: (f64, f64),
        beside: Option<f64>,
        title: &str,
        all: &[(Line, String)],
    ) {
        self.document.append(legend(at, beside, title, all));
    }

    /// The page as a file.
    pub fn into_svg(self) -> String {
        format!("{}\n", self.document)
    }
}

/// Axes with what is drawn between them.
#[derive(Debug)]
pub struct Panel {
    frame: Frame,
    x: Axis,
    y: Axis,
    plot: Element,
    around: Group,
}

impl Panel {
    /// Axes without anything between them; `letter` is what the caption calls the panel.
    pub fn new(letter: &str, frame: Frame, x: Axis, y: Axis) -> Self {
        let Frame { width, height, .. } = frame;
        let mut plot = Element::new("svg");
        plot.assign("x", number(frame.x));
        plot.assign("y", number(frame.y));
        plot.assign("width", number(width));
        plot.assign("height", number(height));
        let mut name = text(frame.x, frame.y - 6.0, "start", &format!("({letter})"));
        name.assign("font-weight", "bold");
        let around = Group::new().add(name);
        let mut panel = Self { frame, x, y, plot, around };
        panel.draw_axes();
        panel
    }

    fn draw_axes(&mut self) {
        let Frame { x, y, width, height } = self.frame;
        let (left, bottom) = (x, y + height);
        let mut lines = Group::new().set("stroke", INK).set("stroke-width", "0.8");
        lines = lines.add(rectangle(x, y, width, height).set("fill", "none"));
        let mut labels = Group::new();
        for (value, label) in ticks(self.x.marked, 6) {
            let at = x + self.x.share(value) * width;
            lines = lines.add(rule((at, bottom), (at, bottom + TICK)));
            labels = labels.add(text(at, bottom + TICK + 10.5, "middle", &label));
        }
        for (value, label) in ticks(self.y.marked, 5) {
            let at = bottom - self.y.share(value) * height;
            lines = lines.add(rule((left, at), (left - TICK, at)));
            labels = labels.add(text(left - TICK - 3.0, at + 3.8, "end", &label));
        }
        let below = text(x + 0.5 * width, bottom + TICK + 25.0, "middle", self.x.title);
        let beside = self.upright(left - 42.0);
        let around = std::mem::take(&mut self.around);
        self.around = around.add(lines).add(labels).add(below).add(beside);
    }

    /// The title of the axis on the left, upright beside its ticks.
    fn upright(&self, at: f64) -> Element {
        let axis = &self.y;
        let middle = axis.share(0.5 * (axis.marked.0 + axis.marked.1));
        let height = self.frame.y + self.frame.height * (1.0 - middle);
        let mut title = text(at, height, "middle", axis.title);
        title.assign("transform", format!("rotate(-90 {} {})", number(at), number(height)));
        title
    }

    /// A second axis on the right, and the panel of its curves, which [`Panel::lay`] puts over this one.
    pub fn with_right(&mut self, axis: Axis) -> Panel {
        let Frame { x, y, width, height } = self.frame;
        let mut lines = Group::new().set("stroke", INK).set("stroke-width", "0.8");
        let mut labels = Group::new();
        for (value, label) in ticks(axis.marked, 4) {
            let at = y + height * (1.0 - axis.share(value));
            lines = lines.add(rule((x + width, at), (x + width + TICK, at)));
            labels = labels.add(text(x + width + TICK + 3.0, at + 3.8, "start", &label));
        }
        // Read downwards, from the upper end.
        let at = x + width + 36.0;
        let mut title = text(at, y, "start", axis.title);
        title.assign("transform", format!("rotate(90 {} {})", number(at), number(y)));
        let around = std::mem::take(&mut self.around);
        self.around = around.add(lines).add(labels).add(title);
        let plot = Element::new("g");
        Panel { frame: self.frame, x: self.x.clone(), y: axis, plot, around: Group::new() }
    }

    /// Puts the curves of an axis on the right over those that are there.
    pub fn lay(&mut self, right: Panel) {
        self.plot.append(right.plot);
    }

    fn place(&self, (x, y): (f64, f64)) -> (f64, f64) {
        let Frame { width, height, .. } = self.frame;
        (self.x.share(x) * width, (1.0 - self.y.share(y)) * height)
    }

    /// A path through points; it is broken where a number is none.
    fn path(&self, points: impl IntoIterator<Item = (f64, f64)>) -> String {
        let mut path = String::new();
        let mut is_broken = true;
        let mut last = String::new();
        for point in points {
            let (x, y) = self.place(point);
            if !x.is_finite() || !y.is_finite() {
                is_broken = true;
                continue;
            }
            let step = format!("{} {}", number(x), number(y));
            if step == last && !is_broken {
                continue;
            }
            path += match (is_broken, path.is_empty()) {
                (true, _) => "M",
                (false, _) => " ",
            };
            path += &step;
            (last, is_broken) = (step, false);
        }
        path
    }

    /// A curve.
    pub fn curve(&mut self, line: &Line, points: impl IntoIterator<Item = (f64, f64)>) {
        let points: Vec<(f64, f64)> = points.into_iter().collect();
        let path = Path::new().set("class", "curve").set("d", self.path(points.iter().copied()));
        self.plot.append(line.on(path));
        if line.has_dots {
            self.dots(&line.colour, 2.2, points);
        }
    }

    /// A line that is no result, but stands there to be compared with.
    pub fn guide(&mut self, line: &Line, points: impl IntoIterator<Item = (f64, f64)>) {
        let path = Path::new().set("class", "guide").set("d", self.path(points));
        self.plot.append(line.on(path));
    }

    /// Dots.
    pub fn dots(
        &mut self,
        colour: &str,
        radius: f64,
        points: impl IntoIterator<Item = (f64, f64)>,
    ) {
        for point in points {
            let (x, y) = self.place(point);
            if x.is_finite() && y.is_finite() {
                let dot = Circle::new().set("cx", number(x)).set("cy", number(y));
                self.plot.append(dot.set("r", number(radius)).set("fill", colour));
            }
        }
    }

    /// A filled shape.
    pub fn area(&mut self, fill: &str, points: impl IntoIterator<Item = (f64, f64)>) {
        let path = self.path(points) + "Z";
        let path = Path::new().set("class", "area").set("d", path).set("fill", fill);
        self.plot.append(path.set("stroke", "#8a8a8a").set("stroke-width", "0.6"));
    }

    /// A legend, by shares of the panel's width and height from its upper left corner.
    pub fn legend(
        &mut self,
        (across, down): (f64, f64),
        beside: Option<f64>,
        title: &str,
        all: &[(Line, String)],
    ) {
        let Frame { x, y, width, height } = self.frame;
        let drawn = legend((x + across * width, y + down * height), beside, title, all);
        let around = std::mem::take(&mut self.around);
        self.around = around.add(drawn);
    }

    fn into_group(self) -> Group {
        Group::new().set("class", "panel").add(self.plot).add(self.around)
    }
}

/// Lines with their names.
fn legend(at: (f64, f64), beside: Option<f64>, title: &str, all: &[(Line, String)]) -> Group {
    /// From one entry to the next below it.
    const DOWN: f64 = 13.5;
    /// Length of a sample of the line.
    const SAMPLE: f64 = 22.0;
    let (x, y) = at;
    let mut group = Group::new().set("class", "legend");
    let mut down = y;
    let mut across = x;
    if !title.is_empty() {
        group = group.add(text(x, y, "start", title));
        match beside {
            // A title of one letter takes less room than an entry.
            Some(step) => across += if title.contains(' ') { step } else { 0.25 * step },
            None => down += DOWN,
        }
    }
    for (line, name) in all {
        let from = format!("M{} {}h{}", number(across), number(down - 3.6), number(SAMPLE));
        group = group.add(line.on(Path::new().set("d", from)));
        if line.has_dots {
            let dot = Circle::new().set("cx", number(across + 0.5 * SAMPLE));
            let dot = dot.set("cy", number(down - 3.6)).set("r", "2.2");
            group = group.add(dot.set("fill", line.colour.as_str()));
        }
        group = group.add(text(across + SAMPLE + 4.0, down, "start", name));
        match beside {
            Some(step) => across += step,
            None => down += DOWN,
        }
    }
    group
}

/// A number of a path or a place: a fortieth of a millimetre decides.
fn number(value: f64) -> String {
    let tenths = (value * 10.0).round();
    // No minus sign in front of nothing.
    let tenths = if tenths == 0.0 { 0.0 } else { tenths };
    format!("{}", tenths / 10.0)
}

fn rectangle(x: f64, y: f64, width: f64, height: f64) -> svg::node::element::Rectangle {
    svg::node::element::Rectangle::new()
        .set("x", number(x))
        .set("y", number(y))
        .set("width", number(width))
        .set("height", number(height))
}

fn rule((x1, y1): (f64, f64), (x2, y2): (f64, f64)) -> Rule {
    Rule::new()
        .set("x1", number(x1))
        .set("y1", number(y1))
        .set("x2", number(x2))
        .set("y2", number(y2))
}

fn text(x: f64, y: f64, anchor: &str, content: &str) -> Element {
    let mut text = words(content);
    text.assign("x", number(x));
    text.assign("y", number(y));
    text.assign("text-anchor", anchor);
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn panel() -> Panel {
        let frame = Frame { x: 100.0, y: 50.0, width: 200.0, height: 100.0 };
        Panel::new("a", frame, Axis::new("x", 0.0, 2.0), Axis::new("y", 0.0, 1.0))
    }

    #[test]
    fn a_curve_is_broken_where_there_is_no_number() {
        let points = [(0.0, 0.0), (1.0, 0.5), (1.5, f64::NAN), (f64::INFINITY, 1.0), (2.0, 1.0)];
        assert_eq!(panel().path(points), "M0 100 100 50M200 0");
        assert_eq!(panel().path([(0.0, 0.0), (1e-6, 0.0), (1.0, 0.0)]), "M0 100 100 100");
        assert_eq!(panel().path([(f64::NAN, 0.0)]), "");
    }

    #[test]
    fn numbers_are_short() {
        let all = [0.04, -0.04, 12.0, 1.25, -7.14].map(number);
        assert_eq!(all, ["0", "0", "12", "1.3", "-7.1"]);
    }

    #[test]
    fn a_page_says_what_it_shows_and_escapes_it() {
        let mut page = Page::new(100.0, "a < b", "c & d");
        page.add(panel());
        page.legend((0.0, 0.0), None, "", &[(Line::dashed("#000000"), "p > q".to_owned())]);
        let svg = page.into_svg();
        assert!(
            svg.contains("a &lt; b") && svg.contains("c &amp; d") && svg.contains("p &gt; q"),
            "{svg}"
        );
        assert!(svg.contains("stroke-dasharray"), "{svg}");
    }
}
