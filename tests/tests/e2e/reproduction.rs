//! `melange reproduce`: the paper's claims hold as they did, the document is what the command writes, the
//! figures' data are complete, and the figures are drawn from an archive that says the same as the claims.

use crate::assert_close;
use melange_tests::{Server, folder, melange, root};
use roxmltree::{Document, Node};
use serde_json::{Value, json};
use std::fs;
use std::path::Path;

/// Claims that do not hold, each with its reason in `docs/reproduction.md`.
const DIFFERING: [&str; 4] =
    ["fig2_friction_constant", "drag_is_small", "cooperativity_length", "fig7_melt_lag"];

/// Claim, number, value, relative error: the paper's headlines.
const NUMBERS: [(&str, &str, f64, f64); 14] = [
    ("fig2_spreads", "thickness_0_steady_m", 149.41536, 1e-6),
    ("fig2_spreads", "length_at_rest_m", 16_580.0, 1e-3),
    ("fig2_exponential_profile", "r_squared_of_ln_h_at_rest", 1.0, 1e-4),
    ("fig3_iceberg_size", "thickness_0_ratio", 0.605_36, 1e-4),
    ("fig3_similar_by_length", "b", 44_192.0, 1e-3),
    ("fig4_thickness", "thickness_0_ratio", 1.426_06, 1e-4),
    ("fig4_force_doubles", "force_ratio", 1.998_6, 1e-4),
    ("fig5_exponent", "exponent", -3.152_5, 1e-4),
    ("fig6_width", "r_squared", 0.980_1, 1e-3),
    ("fig7_melt_lag", "lag_at_0.8_m_per_day_months", 2.160, 2e-3),
    ("fig7_calving_lag", "lag_at_0.7_m_per_day_months", 2.318, 2e-3),
    ("fig7_coupled_lag", "lag_a", 0.0963, 5e-3),
    ("fig8_steady_square", "exponent", 1.997_0, 1e-4),
    ("fig8_never_compressional", "strain_rate_0_least_per_a", 0.574_8, 1e-3),
];

/// Files of the figures' data with columns that must be there.
const FILES: [(&str, &[&str]); 16] = [
    ("fig2.csv", &["case", "length_m", "thickness_0_m", "force_n_per_m"]),
    ("fig2_profiles_nodes.csv", &["node_x_m", "velocity_m_per_a", "mu_w"]),
    ("fig2_profiles_cells.csv", &["cell_x_m", "thickness_m", "fluidity_per_a"]),
    ("fig2_series.csv", &["time_a", "volume_m3"]),
    ("fig2_transverse.csv", &["chi", "y_m", "velocity_m_per_a"]),
    ("fig3_transverse.csv", &["y_m"]),
    ("fig4_transverse.csv", &["y_m"]),
    ("fig3.csv", &["mu_s", "d_m", "b", "A"]),
    ("fig4.csv", &["terminus_thickness_m", "calving_rate_m_per_a"]),
    ("fig5.csv", &["melt_rate_m_per_day", "force_quasi_static_n_per_m"]),
    ("fig5_profiles.csv", &["thickness_m"]),
    ("fig6.csv", &["width_m", "width_gradient"]),
    ("fig7.csv", &["force_n_per_m"]),
    ("fig7_series.csv", &["run", "time_a", "melt_rate_m_per_day", "calving_rate_m_per_a"]),
    ("fig8.csv", &["source", "thickness_0_m", "force_n_per_m"]),
    ("closures.csv", &["n_cells", "force_n_per_m"]),
];

fn rows<'a>(report: &'a Value, table: &str) -> Vec<&'a Value> {
    let tables = report["tables"].as_array().expect("tables");
    let table = tables.iter().find(|t| t["name"] == table).expect("the table is there");
    table["rows"].as_array().expect("rows").iter().collect()
}

#[test]
fn the_papers_claims_hold_as_they_did() {
    let folder = folder();
    let out = folder.path().to_str().expect("UTF-8");
    let output = melange(&["reproduce", "--format", "json", "--out", out], "");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: Value = serde_json::from_slice(&output.stdout).expect("JSON");

    let claims = report["claims"].as_array().expect("claims");
    assert_eq!(claims.len(), 40);
    for claim in claims {
        let id = claim["id"].as_str().expect("a name");
        let expected = if DIFFERING.contains(&id) { "differs" } else { "holds" };
        assert_eq!(claim["verdict"], expected, "{claim:#}");
        let is_explained = !claim["why"].as_str().expect("a sentence").is_empty();
        assert_eq!(is_explained, expected == "differs", "{claim:#}");
        let numbers = claim["numbers"].as_object().expect("numbers");
        assert!(numbers.values().all(Value::is_number), "{claim:#}");
    }
    for (id, name, value, relative) in NUMBERS {
        let claim = claims.iter().find(|c| c["id"] == id).expect("the claim is there");
        assert_close(&format!("{id}: {name}"), &claim["numbers"][name], &json!(value), relative);
    }

    // The closure moves the base case's force by a quarter; one closure converges, the other does not.
    let force = rows(&report, "closures_force_n_per_m")[0];
    assert_eq!(force[0], "base case");
    assert_close("published", &force[1], &json!(8.15631e6), 1e-5);
    assert_close("no_stretching", &force[6], &json!(6.104_69e6), 1e-5);
    assert_close("order", &force[10], &json!(1.0), 0.05);
    assert!(force[5].as_f64() < Some(0.0), "{force}");
    // C8 as printed remembers its start.
    let ends: Vec<_> = rows(&report, "closure_printed").iter().map(|r| r[4].as_f64()).collect();
    assert!(ends[0] < Some(5e6) && ends[3] > Some(8e6), "{ends:?}");

    for (file, columns) in FILES {
        let text = fs::read_to_string(folder.path().join(file)).expect(file);
        let mut lines = text.lines();
        let names: Vec<&str> = lines.next().expect("a header").split(',').collect();
        assert!(columns.iter().all(|c| names.contains(c)), "{file}: {names:?}");
        assert!(lines.count() > 2, "{file}");
        assert!(!text.contains("NaN") && !text.contains("inf"), "{file}");
    }

    let written = fs::read_to_string(folder.path().join("reproduction.md")).expect("written");
    let kept = fs::read_to_string(root().join("docs/reproduction.md")).expect("it is there");
    for (line, (written, kept)) in written.lines().zip(kept.lines()).enumerate() {
        assert_eq!(written, kept, "docs/reproduction.md:{}: is out of date: {AGAIN}", line + 1);
    }
    assert_eq!(written.len(), kept.len());
}

/// How the document and its pictures are brought up to date.
const AGAIN: &str =
    "melange reproduce --out target/reproduction && cp -r target/reproduction/reproduction* docs/";

/// Figures with the number of their curves.
const CURVES: [(&str, usize); 7] = [
    // Four panels and mid-length with 8 states each, and 5 places in 2 states.
    ("fig2.svg", 50),
    ("fig3.svg", 25),
    ("fig4.svg", 15),
    ("fig5.svg", 8),
    ("fig6.svg", 14),
    // 4 runs with 3 courses of the melt, 4 loops; 3 runs with one course, 3 loops.
    ("fig7.svg", 18),
    ("fig8.svg", 15),
];

/// Numbers of a path.
fn numbers(path: &str) -> Vec<f64> {
    let parts = path.split(|c: char| c.is_ascii_alphabetic() || c == ' ');
    parts.filter(|p| !p.is_empty()).map(|p| p.parse().expect("a number")).collect()
}

fn attribute(node: Node<'_, '_>, name: &str) -> f64 {
    node.attribute(name).and_then(|text| text.parse().ok()).expect("a number")
}

/// What of a figure is data: points of curves, and middles of dots.
#[derive(Debug, Clone, PartialEq)]
struct Drawn {
    curves: Vec<Vec<f64>>,
    dots: Vec<[f64; 2]>,
}

impl Drawn {
    /// What is drawn in panels lies within them, so that nothing is cut off; legends are beside.
    fn of(file: &str, svg: &str) -> Self {
        let document = Document::parse(svg).unwrap_or_else(|e| panic!("{file}: {e}"));
        let (mut curves, mut dots) = (Vec::new(), Vec::new());
        for node in document.descendants() {
            let mut plots = node.ancestors().filter(|n| n.has_tag_name("svg"));
            let Some(plot) = plots.next().filter(|_| plots.next().is_some()) else { continue };
            let points = if node.attribute("class") == Some("curve") {
                let points = numbers(node.attribute("d").expect("a path"));
                assert!(points.len() >= 4 && points.len().is_multiple_of(2), "{file}: {points:?}");
                curves.push(points.clone());
                points
            } else if node.has_tag_name("circle") {
                let middle = ["cx", "cy"].map(|name| attribute(node, name));
                dots.push(middle);
                middle.to_vec()
            } else {
                continue;
            };
            let (width, height) = (attribute(plot, "width"), attribute(plot, "height"));
            for point in points.chunks(2) {
                let is_within =
                    (0.0..=width).contains(&point[0]) && (0.0..=height).contains(&point[1]);
                assert!(is_within, "{file}: {point:?} is beyond {width} by {height}");
            }
        }
        Self { curves, dots }
    }

    /// Whether another drawing shows the same, but for what another machine rounds otherwise.
    fn is_like(&self, other: &Self) -> bool {
        let are_near = |(a, b): (&[f64; 2], &[f64; 2])| is_near(a, b);
        let are_alike = |(a, b): (&Vec<f64>, &Vec<f64>)| is_alike(a, b);
        self.curves.len() == other.curves.len()
            && self.dots.len() == other.dots.len()
            && self.curves.iter().zip(&other.curves).all(are_alike)
            && self.dots.iter().zip(&other.dots).all(are_near)
    }
}

/// Whether all numbers of two points, or of two curves, are.
fn is_near(a: &[f64], b: &[f64]) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() < 0.5)
}

/// Whether two curves are the same. A point more or less is one that was rounded onto its neighbour: then their
/// ends are, and each point lies on the other curve.
fn is_alike(a: &[f64], b: &[f64]) -> bool {
    if a.len() == b.len() {
        return is_near(a, b);
    }
    let lies_on = |a: &[f64], b: &[f64]| a.chunks(2).all(|point| distance(point, b) < 0.5);
    is_near(a, &b[..2])
        && is_near(&a[a.len() - 2..], &b[b.len() - 2..])
        && lies_on(a, b)
        && lies_on(b, a)
}

/// From a point to the nearest place of a curve.
fn distance(point: &[f64], curve: &[f64]) -> f64 {
    let to_piece = |from: &[f64], to: &[f64]| {
        let (x, y) = (to[0] - from[0], to[1] - from[1]);
        let (px, py) = (point[0] - from[0], point[1] - from[1]);
        let along = ((px * x + py * y) / (x * x + y * y).max(1e-12)).clamp(0.0, 1.0);
        (px - along * x).hypot(py - along * y)
    };
    let pieces = curve.windows(4).step_by(2).map(|piece| to_piece(&piece[..2], &piece[2..]));
    pieces.fold(f64::INFINITY, f64::min)
}

#[test]
fn a_figure_that_is_out_of_date_is_told() {
    let drawn = |d: &str, cx: f64| {
        let plot = format!(r#"<path class="curve" d="{d}"/><circle cx="{cx}" cy="5"/>"#);
        let legend = r#"<circle cx="900" cy="900"/>"#;
        let panel = format!(r#"<svg width="100" height="50">{plot}</svg>"#);
        Drawn::of("a figure", &format!(r#"<svg width="174mm" height="60mm">{panel}{legend}</svg>"#))
    };
    let kept = drawn("M0 0 10 10 20 0 30 5", 50.0);
    assert_eq!((kept.curves.len(), kept.dots.len()), (1, 1));
    for (d, cx, is_like) in [
        ("M0 0 10 10.1 20 0 30 5", 50.1, true),
        // A point more, on the way; and one less.
        ("M0 0 5 5 10 10 20 0 30 5", 50.0, true),
        ("M0 0 10 10 20 0.1 20.1 0 30 5", 50.0, true),
        // The interior of a curve, with as many points and with one more or less; its ends; a dot.
        ("M0 0 10 11 20 0 30 5", 50.0, false),
        ("M0 0 5 5 10 11 20 0 30 5", 50.0, false),
        ("M0 0 10 10 30 5", 50.0, false),
        ("M0 0 10 10 20 0 30 6", 50.0, false),
        ("M0 0 10 10 20 0 30 5", 51.0, false),
    ] {
        let other = drawn(d, cx);
        assert_eq!(other.is_like(&kept), is_like, "{d} {cx}");
        assert_eq!(kept.is_like(&other), is_like, "{d} {cx}");
    }
    for (d, cx) in [("M0 0 10 51", 5.0), ("M0 0 10 10", 101.0)] {
        assert!(std::panic::catch_unwind(|| drawn(d, cx)).is_err(), "{d} {cx} lies within");
    }
}

/// What is written on a figure.
fn words(svg: &str) -> Vec<String> {
    let document = Document::parse(svg).expect("XML");
    let texts = document.descendants().filter(|n| n.has_tag_name("text"));
    texts
        .map(|text| {
            let parts = text.descendants().filter(|n| n.is_text()).filter_map(|n| n.text());
            parts.collect::<String>().trim().to_owned()
        })
        .collect()
}

fn pictures(folder: &Path) -> Vec<(&'static str, String)> {
    let read = |file| fs::read_to_string(folder.join("reproduction").join(file)).expect(file);
    CURVES.map(|(file, _)| (file, read(file))).to_vec()
}

fn reproduce(arguments: &[&str]) -> Value {
    let output = melange(&[&["reproduce", "--format", "json"], arguments].concat(), "");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("JSON")
}

#[test]
fn the_figures_are_drawn_from_an_archive_that_agrees_with_the_claims() {
    let (folder, again) = (folder(), folder());
    let out = folder.path().to_str().expect("UTF-8");
    let report = reproduce(&["--out", out]);
    let claim = |id: &str, number: &str| {
        let claims = report["claims"].as_array().expect("claims");
        claims.iter().find(|c| c["id"] == id).expect("the claim is there")["numbers"][number]
            .clone()
    };

    let drawn = pictures(folder.path());
    for ((file, svg), (_, count)) in drawn.iter().zip(CURVES) {
        let data = Drawn::of(file, svg);
        assert_eq!(data.curves.len(), count, "{file}");
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{file}");
        // Those that are kept may differ in a last digit where another machine rounds otherwise.
        let kept = fs::read_to_string(root().join("docs/reproduction").join(file)).expect(file);
        assert_eq!(words(svg), words(&kept), "docs/reproduction/{file} is out of date: {AGAIN}");
        let is_like = data.is_like(&Drawn::of(file, &kept));
        assert!(is_like, "docs/reproduction/{file} is out of date: {AGAIN}");
    }
    let said = words(&drawn[3].1);
    assert!(said.iter().any(|text| text == "power law, exponent \u{2212}3.15"), "{said:?}");

    let data = folder.path().join("archive");
    let server = Server::start("serve", &data, &[]);
    let ask = |path: &str| server.json(&format!("/api/v1{path}"));
    let sweeps = ask("/sweeps?limit=100");
    let sweeps = sweeps["items"].as_array().expect("sweeps").clone();
    assert_eq!(sweeps.len(), 13);
    for sweep in &sweeps {
        let tags = sweep["tags"].as_array().expect("tags");
        assert!(tags.contains(&json!("reproduction")), "{sweep:#}");
        assert_eq!(sweep["state"], "complete", "{sweep:#}");
    }
    let runs = |name: &str| {
        let named = |s: &&Value| s["name"].as_str().is_some_and(|n| n.starts_with(name));
        let id = sweeps.iter().find(named).expect(name)["id"].as_str().expect("an id");
        let runs = ask(&format!("/sweeps/{id}/runs"));
        (id.to_owned(), runs["items"].as_array().expect("runs").clone())
    };
    let (melts, _) = runs("Fig. 5");
    let fit = "x=melt_rate_m_per_day&y=force_n_per_m&model=power_law";
    let fit = ask(&format!("/sweeps/{melts}/fit?{fit}"));
    let exponent = claim("fig5_exponent", "exponent");
    assert_close("exponent", &fit["exponent"]["estimate"], &exponent, 1e-9);
    let (_, glaciers) = runs("Fig. 4");
    for (run, number) in glaciers.iter().zip(["small", "medium", "large"]) {
        let thickness = claim("fig4_grows_with_flux", &format!("thickness_0_{number}_m"));
        assert_close(number, &run["thickness_0_m"], &thickness, 1e-9);
    }
    let (_, limit) = runs("Fig. 2: quasi-static limit");
    let length = claim("fig2_spreads", "length_at_rest_m");
    assert_close("limit", &limit[0]["length_m"], &length, 1e-6);
    let (_, season) = runs("Fig. 7a, b: melt through the year, 0.7 m/d");
    let run = ask(&format!("/runs/{}", season[0]["run_id"].as_str().expect("an id")));
    let column = |name: &str| -> Vec<f64> {
        let values = run["series"][name].as_array().expect(name);
        values.iter().map(|v| v.as_f64().expect("a number")).collect()
    };
    let (times, forces) = (column("time_a"), column("force_n_per_m"));
    let last = || times.iter().zip(&forces).filter(|(t, _)| **t > 2.0 - 1e-9).map(|(_, f)| *f);
    let variation = last().fold(f64::MIN, f64::max) - last().fold(f64::MAX, f64::min);
    let claimed = claim("fig7_melt_variation", "force_variation_at_0.7_m_per_day_n_per_m");
    assert_close("variation", &json!(variation), &claimed, 1e-6);

    // While a service holds the archive nothing is drawn, and that is said.
    let output = melange(&["reproduce", "--out", out], "");
    assert!(!output.status.success());
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("in use"), "{said}");
    drop(server);

    // What is solved is only drawn again: the same pictures, and no sweep more.
    let data = data.to_str().expect("UTF-8");
    reproduce(&["--data", data, "--out", again.path().to_str().expect("UTF-8")]);
    assert!(pictures(again.path()) == drawn, "the pictures differ");
    assert!(!again.path().join("archive").exists());
    let listed = melange(&["sweeps", "--data", data], "");
    let listed = String::from_utf8_lossy(&listed.stdout).into_owned();
    assert_eq!(listed.matches("Fig. ").count(), 13, "{listed}");
}
