//! Exports that come back, or arrive and are solved again: what was deleted is not taken for here, and the bits
//! are those that were sealed.

use crate::melt_sweep;
use crate::sealing::seal;
use crate::travelling::{import, said, text};
use melange_tests::{Server, folder, melange};
use serde_json::{Value, json};

#[test]
fn what_was_deleted_can_be_imported_again() {
    let data = folder();
    let server = Server::start("serve", data.path(), &[]);
    let id = server.submit(&melt_sweep(4));
    server.wait(&id);
    let archive = data.path().join("e.tar.zst");
    let told = melange(&["export", &id, "--to", text(&archive), "--data", text(data.path())], "");
    assert!(told.status.success(), "{}", said(&told));
    assert!(said(&import(&archive, data.path(), &[])).contains("already here"));
    assert_eq!(server.delete(&format!("/api/v1/sweeps/{id}")).status, 204);
    let told = import(&archive, data.path(), &[]);
    assert!(said(&told).contains(&format!("{id} imported as")), "{}", said(&told));
    let page = server.json("/api/v1/sweeps");
    let copy = page["items"][0]["id"].as_str().expect("an id").to_owned();
    assert_eq!((&page["total"], copy == id), (&json!(1), false));
    assert!(said(&import(&archive, data.path(), &[])).contains("already here"));
    // Deleted for good, it comes back under its own id when it is cleared away.
    for id in [&id, &copy] {
        let gone = server.delete(&format!("/api/v1/sweeps/{id}?for_good=true"));
        assert_eq!(gone.status, 204);
    }
    let told = import(&archive, data.path(), &[]);
    assert!(said(&told).contains("imported"), "{}", said(&told));
    let back = server.json("/api/v1/sweeps");
    let back = back["items"][0]["id"].as_str().expect("an id");
    std::thread::sleep(std::time::Duration::from_millis(1500));
    assert_eq!(server.json(&format!("/api/v1/sweeps/{back}/runs"))["total"], 4);
    assert!(server.terminate());
    let verified = melange(&["verify", "--data", text(data.path())], "");
    assert!(verified.status.success(), "{}", said(&verified));
}

#[test]
fn what_was_sealed_and_taken_elsewhere_comes_out_again_bit_by_bit() {
    let (here, there) = (folder(), folder());
    let server = Server::start("serve", here.path(), &["--workers", "2"]);
    let axis = |from: f64, to: f64, n: usize| json!({"parameter": "melt_rate_m_per_day", "linspace": [from, to, n]});
    let first = server.submit(&json!({"regime": "steady", "axes": [axis(0.5, 0.8, 4)]}));
    server.wait(&first);
    // Takes some over; a point stands in it twice; and in so many chunks that some begin in others.
    let rows: Vec<Value> = [0.5, 0.72, 0.5, 0.9, 0.72, 0.6]
        .into_iter()
        .chain((0..30).map(|i| 0.55 + 0.01 * f64::from(i)))
        .map(|melt| json!([melt]))
        .collect();
    let table = json!({"columns": ["melt_rate_m_per_day"], "rows": rows});
    let id = server.submit(&json!({"regime": "steady", "table": table}));
    server.wait(&id);
    seal(&server, &id);
    assert!(server.terminate());
    let archive = here.path().join("e.tar.zst");
    let told = melange(&["export", &id, "--to", text(&archive), "--data", text(here.path())], "");
    assert!(told.status.success(), "{}", said(&told));
    assert!(import(&archive, there.path(), &[]).status.success());
    for (data, own) in [(&here, false), (&there, true)] {
        let told = melange(
            &["rerun", &id, "--check", "--format", "json", "--data", text(data.path())],
            "",
        );
        assert!(told.status.success(), "{}", said(&told));
        let told: Value = serde_json::from_slice(&told.stdout).expect("JSON");
        let runs = told["runs"].as_array().expect("runs");
        assert_eq!(runs.len(), 36);
        let bitwise = told["bitwise"].as_u64().expect("a number");
        assert_eq!(bitwise, 36, "elsewhere: {own}");
    }
}
