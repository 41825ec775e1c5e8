//! A group's way, over REST and in a browser: an admin invites two people, one submits, the other finds, tags
//! and compares, may not cancel, seals their own, exports it; a second, empty service imports it, and the
//! numbers are identical.

use super::number;
use super::people::{At, add};
use melange_tests::{Server, folder, python, root};
use serde_json::{Value, json};
use std::fs;
use std::process::Command;

/// A sweep over melt with n points.
fn melt(name: &str, n: usize) -> Value {
    json!({
        "name": name,
        "regime": "steady",
        "axes": [{"parameter": "melt_rate_m_per_day", "linspace": [0.6, 1.0, n]}],
    })
}

#[test]
fn a_group_works_together_over_rest_and_another_lab_takes_over() {
    let (lab, other_lab) = (folder(), folder());
    let ada = add(lab.path(), "ada", "admin");
    let server = Server::start("serve", lab.path(), &[]);
    let ada = At::new(&server, &ada);
    let invited = ["bo", "cy"].map(|name| {
        let answer = ada.send("POST", "/people", &json!({"name": name, "role": "contributor"}));
        assert_eq!(answer.status, 201);
        answer.json()["token"].as_str().expect("a token").to_owned()
    });
    let [bo, cy] = invited.each_ref().map(|token| At::new(&server, token));

    let first = bo.solve(&melt("melt of bo", 5));
    let found =
        cy.json("/runs?filter=owner%20%3D%20%22bo%22%20and%20melt_rate_m_per_day%20%3C%200.75");
    assert_eq!((&found["total"], &found["items"][0]["sweep_id"]), (&json!(2), &json!(first)));
    let nearest = cy.json("/runs/nearest?melt_rate_m_per_day=0.71&limit=1");
    assert_eq!(nearest["items"][0]["melt_rate_m_per_day"], json!(0.7));

    // Python reads with a token, and with no other.
    let script = "import sys, pandas as pd\n\
                  url, token = sys.argv[1:]\n\
                  runs = pd.read_parquet(url, storage_options={'Authorization': 'Bearer ' + token})\n\
                  print(len(runs), repr(float(runs.force_n_per_m[0])))";
    let url = format!("{}/api/v1/sweeps/{first}/runs.parquet", server.address);
    let told = python(script, &[&url, &invited[1]], lab.path());
    let listed = cy.json(&format!("/sweeps/{first}/runs?limit=1"));
    assert_eq!(told.trim(), format!("5 {:?}", number(&listed["items"][0]["force_n_per_m"])));

    // Others add tags and do nothing else.
    let path = format!("/sweeps/{first}");
    assert_eq!(cy.send("PATCH", &path, &json!({"tags": ["paper"]})).status, 200);
    assert_eq!(cy.send("PATCH", &path, &json!({"tags": []})).status, 403, "they take none away");
    assert_eq!(cy.send("PATCH", &path, &json!({"name": "mine"})).status, 403);
    assert_eq!(cy.send("PATCH", &path, &json!({"tags": ["paper"], "note": "x"})).status, 403);
    assert_eq!(cy.json("/sweeps?filter=tag%20%3D%20%22paper%22")["total"], 1);
    for verb in ["cancel", "pause", "stop", "retry", "seal"] {
        let body = json!({"title": "t", "authors": [{"name": "C D"}], "licence": "CC0-1.0"});
        let body = if verb == "seal" { body } else { Value::Null };
        assert_eq!(cy.send("POST", &format!("{path}/{verb}"), &body).status, 403, "{verb}");
    }
    assert_eq!(cy.send("DELETE", &path, &Value::Null).status, 403);

    // What was computed is not computed again, and compares equal.
    let taken = cy.send("POST", "/sweeps", &melt("melt of cy", 9));
    let (taken, own) = (taken.json(), taken.json()["id"].as_str().expect("an id").to_owned());
    assert_eq!(taken["reused"], 5);
    let own = {
        cy.solve(&melt("melt of cy again", 9));
        own
    };
    let force = |sweep: &str, melt: f64| {
        let runs =
            cy.json(&format!("/sweeps/{sweep}/runs?filter=melt_rate_m_per_day%20%3D%20{melt}"));
        number(&runs["items"][0]["force_n_per_m"])
    };
    assert_eq!(force(&first, 0.7).to_bits(), force(&own, 0.7).to_bits());
    let exponent = |sweep: &str| {
        let fit = cy.json(&format!("/sweeps/{sweep}/fit?x=melt_rate_m_per_day&y=force_n_per_m"));
        number(&fit["exponent"]["estimate"])
    };
    assert!((exponent(&first) - exponent(&own)).abs() < 0.1);

    let form = json!({
        "title": "Melt and force",
        "authors": [{"name": "Cy Tester", "orcid": "0000-0002-1825-0097"}],
        "licence": "CC-BY-4.0",
    });
    let sealed = cy.send("POST", &format!("/sweeps/{own}/seal"), &form);
    assert_eq!(sealed.status, 200, "{}", String::from_utf8_lossy(&sealed.body));
    let hash = sealed.json()["sealed"]["content_hash"].clone();
    assert_eq!(ada.send("POST", &format!("/sweeps/{own}/cancel"), &Value::Null).status, 409);
    assert_eq!(ada.send("DELETE", &format!("/sweeps/{own}"), &Value::Null).status, 409);
    assert_eq!(ada.send("PATCH", &format!("/sweeps/{own}"), &json!({"name": "x"})).status, 409);
    let archive = cy.send("GET", &format!("/sweeps/{own}/export.tar.zst"), &Value::Null).body;

    let di = add(other_lab.path(), "di", "admin");
    let there = Server::start("serve", other_lab.path(), &[]);
    let headers = [("Authorization", format!("Bearer {di}"))];
    let headers = headers.each_ref().map(|(n, v)| (*n, v.as_str()));
    let imported = there.send("POST", "/api/v1/import", &headers, &archive);
    assert_eq!(imported.status, 200, "{}", String::from_utf8_lossy(&imported.body));
    let di = At::new(&there, &di);
    let sweep = di.json(&format!("/sweeps/{own}"));
    assert_eq!((&sweep["owner"], &sweep["sealed"]["content_hash"]), (&json!("di"), &hash));
    for table in ["runs.parquet", "profiles.parquet", "runs.csv", "ensemble.nc"] {
        let path = format!("/sweeps/{own}/{table}");
        let (here, there) =
            (cy.send("GET", &path, &Value::Null), di.send("GET", &path, &Value::Null));
        assert_eq!((here.status, there.status), (200, 200), "{table}");
        assert!(here.body == there.body, "{table} is not the same");
    }
    assert!(there.terminate());
    assert!(server.terminate());
}

/// The exported crate, unpacked, read by pandas and xarray and held against its own manifest.
#[test]
fn an_exported_crate_is_read_without_us() {
    let place = folder();
    let server = Server::start("serve", &place.path().join("data"), &[]);
    let id = server.submit(&melt("crate", 6));
    server.wait(&id);
    let form = json!({
        "title": "A crate", "authors": [{"name": "Cy Tester"}], "licence": "CC0-1.0",
    });
    let sealed = server.post(&format!("/api/v1/sweeps/{id}/seal"), &form.to_string());
    assert_eq!(sealed.status, 200);
    let archive = server.get(&format!("/api/v1/sweeps/{id}/export.tar.zst")).body;
    let tar = zstd::stream::read::Decoder::new(archive.as_slice()).expect("it is zstd");
    tar::Archive::new(tar).unpack(place.path()).expect("it is a tar");
    let folder = place.path().join(format!("melange-{id}"));
    let script = fs::read_to_string(root().join("tests/python/check_crate.py")).expect("a script");
    let told = python(&script, &[folder.to_str().expect("UTF-8")], place.path());
    assert!(told.contains("everything is as it should be"), "{told}");
}

#[test]
fn a_group_works_together_in_the_browser() {
    let (lab, empty, place) = (folder(), folder(), folder());
    let ada = add(lab.path(), "ada", "admin");
    let server = Server::start("serve", lab.path(), &[]);
    let other = Server::start("serve", empty.path(), &[]);
    let output = Command::new("node")
        .arg(root().join("web/e2e/journey.mjs"))
        .args([&server.address, &ada, &other.address])
        .arg(place.path())
        .output()
        .expect("node can be run");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let seen: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let comparison = seen["comparison"].as_str().expect("a comparison");
    assert!(comparison.contains("5, of which 5 are the same run"), "{comparison}");
    assert!(seen["citation"].as_str().is_some_and(|c| c.contains("Tester")), "{seen}");

    let ada = At::new(&server, &ada);
    let sweeps = ada.json("/sweeps?filter=owner%20%3D%20%22cy%22");
    let id = sweeps["items"][0]["id"].as_str().expect("an id");
    let here = ada.send("GET", &format!("/sweeps/{id}/runs.parquet"), &Value::Null).body;
    assert!(here == other.get(&format!("/api/v1/sweeps/{id}/runs.parquet")).body);
}
