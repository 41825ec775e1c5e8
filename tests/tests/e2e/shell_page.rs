//! The page itself, in a real browser: below another path, small to load, by keyboard, on a phone, with its view in
//! its address.

use super::number;
use melange_tests::{Server, folder, root};
use std::process::Command;

#[test]
fn the_page_works_below_a_path_by_keyboard_and_on_a_phone() {
    let (data, nothing) = (folder(), folder());
    let server = Server::start("demo", data.path(), &[]);
    let empty = Server::start("serve", nothing.path(), &[]);
    let id = server.json("/api/v1/sweeps")["items"][0]["id"].as_str().expect("an id").to_owned();
    server.wait(&id);
    let output = Command::new("node")
        .arg(root().join("web/e2e/shell.mjs"))
        .args([&server.address, &id, &empty.address])
        .output()
        .expect("node can be run");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let seen: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");

    let path = format!("/api/v1/sweeps/{id}/fit?x=melt_rate_m_per_day&y=force_n_per_m");
    let exponent = number(&server.json(&path)["exponent"]["estimate"]);
    let read = |text: &serde_json::Value| {
        // Such as −1.234 × 10⁷.
        let text = text.as_str().expect("a number").replace('−', "-");
        let (mantissa, order) = text.split_once(" × 10").unwrap_or((&text, "⁰"));
        let digit = |c: char| "⁰¹²³⁴⁵⁶⁷⁸⁹".chars().position(|d| d == c).expect("a digit") as i32;
        let order = order.chars().fold(0, |order, c| 10 * order + digit(c));
        mantissa.parse::<f64>().expect("a number") * 10_f64.powi(order)
    };
    assert!(
        (read(&seen["exponent"]) - exponent).abs() < 5e-4,
        "{} is not {exponent}",
        seen["exponent"]
    );
    // A slope by m d⁻¹ is 365.25 times the slope by m a⁻¹.
    let slope = number(&server.json(&format!("{path}&model=linear"))["exponent"]["estimate"]);
    let [per_day, per_a] = [&seen["slopes"][0], &seen["slopes"][1]].map(read);
    assert!((per_day / slope - 1.0).abs() < 1e-3, "{per_day} is not {slope}");
    assert!((per_a * 365.25 / slope - 1.0).abs() < 1e-3, "{per_a} is not {slope} / 365.25");
}
