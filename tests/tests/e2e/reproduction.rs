//! `melange reproduce`: the paper's claims hold as they did, the document is what the command writes, and
//! the figures' data are complete.

use crate::assert_close;
use melange_tests::{folder, melange, root};
use serde_json::{Value, json};
use std::fs;

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
        let again = "melange reproduce --format markdown > docs/reproduction.md";
        assert_eq!(written, kept, "docs/reproduction.md:{}: is out of date: {again}", line + 1);
    }
    assert_eq!(written.len(), kept.len());
}
