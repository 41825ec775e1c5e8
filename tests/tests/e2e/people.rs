//! People: tokens, roles, owners, sessions of browsers, quotas, the audit trail, and who is refused before
//! anything is read.

use super::melt_sweep;
use melange_tests::{Answer, Server, folder, melange};
use serde_json::{Value, json};
use std::path::Path;

/// Adds a person on the machine of the data directory and returns their token.
pub fn add(data: &Path, name: &str, role: &str) -> String {
    let data = data.to_str().expect("UTF-8");
    let told = melange(&["user", "add", name, "--role", role, "--data", data], "");
    assert!(told.status.success(), "{}", String::from_utf8_lossy(&told.stderr));
    String::from_utf8(told.stdout).expect("UTF-8").trim().to_owned()
}

/// A person at a service.
pub struct At<'a> {
    server: &'a Server,
    bearer: String,
}

impl<'a> At<'a> {
    /// Whoever has a token.
    pub fn new(server: &'a Server, token: &str) -> Self {
        Self { server, bearer: format!("Bearer {token}") }
    }

    /// Sends a request below `/api/v1`.
    pub fn send(&self, method: &str, path: &str, body: &Value) -> Answer {
        let body = if body.is_null() { String::new() } else { body.to_string() };
        let path = format!("/api/v1{path}");
        self.server.send(method, &path, &[("Authorization", &self.bearer)], body.as_bytes())
    }

    /// What a path answers, which must be there.
    pub fn json(&self, path: &str) -> Value {
        let answer = self.send("GET", path, &Value::Null);
        assert_eq!(answer.status, 200, "{path}: {}", String::from_utf8_lossy(&answer.body));
        answer.json()
    }

    /// Submits a sweep, which must be taken, and waits for its end; returns its id.
    pub fn solve(&self, spec: &Value) -> String {
        let answer = self.send("POST", "/sweeps", spec);
        assert_eq!(answer.status, 202, "{}", String::from_utf8_lossy(&answer.body));
        let id = answer.json()["id"].as_str().expect("an id").to_owned();
        self.wait(&id);
        id
    }

    /// Waits until a sweep is complete.
    pub fn wait(&self, id: &str) {
        for _ in 0..2000 {
            let sweep = self.json(&format!("/sweeps/{id}"));
            if sweep["state"] == "complete" {
                return;
            }
            std::thread::sleep(std::time::Duration::from_millis(30));
        }
        panic!("{id} does not end");
    }
}

#[test]
fn without_people_loopback_is_open_and_nothing_else_is() {
    let folder = folder();
    let data = folder.path().to_str().expect("UTF-8");
    let beyond = melange(&["serve", "--data", data, "--listen", "0.0.0.0:0"], "");
    let said = String::from_utf8_lossy(&beyond.stderr).into_owned();
    assert!(!beyond.status.success() && said.contains("melange user add"), "{said}");

    let server = Server::start("serve", folder.path(), &[]);
    let me = server.json("/api/v1/me");
    assert_eq!(me, json!({"name": "local", "role": "admin", "is_open": true}));
    let id = server.submit(&melt_sweep(2));
    assert_eq!(server.wait(&id)["owner"], "local");

    // A page that lets a name of its own point to this machine reaches nothing, nor does one of another site.
    let rebound = [("Host", "evil.example:8080")];
    assert_eq!(server.get_with("/api/v1/sweeps", &rebound).status, 403);
    for (name, value) in [
        ("Origin", "http://evil.example"),
        ("Origin", "null"),
        ("Sec-Fetch-Site", "cross-site"),
        ("Sec-Fetch-Site", "same-site"),
    ] {
        let forged = server.post_with("/api/v1/sweeps", &[(name, value)], b"{}");
        assert_eq!(forged.status, 403, "{name}: {value}");
    }
    // What a browser has of other schemes says nothing, also where there are no people.
    for header in ["Basic eDp5", "Bearer x"] {
        let sent = [("Authorization", header), ("Sec-Fetch-Site", "cross-site")];
        assert_eq!(server.post_with("/api/v1/sweeps", &sent, b"{}").status, 403, "{header}");
    }
    let own = [("Sec-Fetch-Site", "same-origin")];
    let body = melt_sweep(2).to_string();
    assert_eq!(server.post_with("/api/v1/sweeps", &own, body.as_bytes()).status, 202);

    // The first person must be an admin, and closes the door behind them.
    let add = |body: Value| server.post("/api/v1/people", &body.to_string());
    let reader = add(json!({"name": "bo", "role": "reader"}));
    assert_eq!((reader.status, reader.json()["field"].clone()), (422, json!("role")));
    assert_eq!(add(json!({"name": "a b", "role": "admin"})).json()["field"], "name");
    let ada = add(json!({"name": "ada", "role": "admin"}));
    assert_eq!(ada.status, 201);
    let token = ada.json()["token"].as_str().expect("a token").to_owned();
    assert_eq!(server.get("/api/v1/sweeps").status, 401);
    assert_eq!(server.get("/health").status, 200);
    assert_eq!(At::new(&server, &token).json("/me")["is_open"], false);
    // Nothing in the directory holds the token.
    for entry in std::fs::read_dir(folder.path()).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_file() {
            let bytes = std::fs::read(&path).expect("a file");
            let found = bytes.windows(token.len()).any(|w| w == token.as_bytes());
            assert!(!found, "{} holds the token", path.display());
        }
    }
    assert!(server.terminate());

    // Beyond loopback is permitted now.
    let server = Server::start_at("0.0.0.0:0", folder.path());
    assert_eq!(server.get("/api/v1/sweeps").status, 401);
    assert_eq!(At::new(&server, &token).json("/sweeps")["total"], 2);
}

#[test]
fn roles_and_owners_say_who_may_do_what() {
    let folder = folder();
    let data = folder.path();
    let ada = add(data, "ada", "admin");
    let server = Server::start("serve", data, &[]);
    // While the service runs, commands go through it.
    let (bo, cy, di) =
        (add(data, "bo", "contributor"), add(data, "cy", "contributor"), add(data, "di", "reader"));
    let [ada, bo, cy, di] = [&ada, &bo, &cy, &di].map(|token| At::new(&server, token));
    let null = Value::Null;

    let id = bo.solve(&melt_sweep(3));
    assert_eq!(ada.json(&format!("/sweeps/{id}"))["owner"], "bo");
    for reader in [&cy, &di] {
        assert_eq!(reader.json(&format!("/sweeps/{id}/runs"))["total"], 3);
        for verb in ["pause", "cancel", "retry", "stop", "resume"] {
            let answer = reader.send("POST", &format!("/sweeps/{id}/{verb}"), &null);
            assert_eq!(answer.status, 403, "{verb}");
        }
        assert_eq!(reader.send("DELETE", &format!("/sweeps/{id}"), &null).status, 403);
        assert_eq!(reader.send("GET", "/people", &null).status, 403);
        assert_eq!(reader.send("GET", "/audit", &null).status, 403);
        let new = json!({"name": "eve", "role": "admin"});
        assert_eq!(reader.send("POST", "/people", &new).status, 403);
        assert_eq!(reader.send("PATCH", "/people/cy", &json!({"role": "admin"})).status, 403);
        assert_eq!(reader.send("DELETE", "/people/ada", &null).status, 403);
        assert_eq!(reader.send("POST", "/people/ada/token", &null).status, 403);
    }
    assert_eq!(di.send("POST", "/sweeps", &melt_sweep(2)).status, 403);
    assert_eq!(bo.send("DELETE", &format!("/sweeps/{id}"), &null).status, 204);
    assert_eq!(cy.send("POST", &format!("/sweeps/{id}/recover"), &null).status, 403);
    assert_eq!(ada.send("POST", &format!("/sweeps/{id}/recover"), &null).status, 200);
    assert_eq!(ada.send("POST", &format!("/sweeps/{id}/retry"), &null).status, 200);

    // A new token ends the old one; a revoked one ends at once, and so do their sessions.
    let session = server.post("/api/v1/session", &json!({"token": &cy.bearer[7..]}).to_string());
    let cookie = session.header("set-cookie").to_owned();
    let cookie = cookie.split(';').next().expect("a cookie").to_owned();
    assert_eq!(server.get_with("/api/v1/me", &[("Cookie", &cookie)]).json()["name"], "cy");
    assert_eq!(ada.send("DELETE", "/people/cy", &null).status, 204);
    assert_eq!(cy.send("GET", "/sweeps", &null).status, 401);
    assert_eq!(server.get_with("/api/v1/me", &[("Cookie", &cookie)]).status, 401);
    let again = ada.send("POST", "/people/cy/token", &null).json();
    let cy = At::new(&server, again["token"].as_str().expect("a token"));
    assert_eq!(cy.json("/me")["role"], "contributor");
    assert_eq!(
        ada.send("PATCH", "/people/cy", &json!({"role": "reader"})).json()["role"],
        "reader"
    );
    assert_eq!(cy.send("POST", "/sweeps", &melt_sweep(2)).status, 403);
    assert_eq!(ada.send("POST", "/people", &json!({"name": "cy", "role": "reader"})).status, 409);
    assert_eq!(ada.send("PATCH", "/people/nobody", &json!({"role": "reader"})).status, 404);

    let trail = ada.json("/audit?limit=100")["items"].clone();
    let trail = trail.as_array().expect("changes");
    let done: Vec<(String, String)> = trail
        .iter()
        .rev()
        .map(|c| (c["who"].as_str().unwrap().into(), c["action"].as_str().unwrap().into()))
        .collect();
    let expected = [
        ("operator", "add person"),
        ("operator", "add person"),
        ("operator", "add person"),
        ("operator", "add person"),
        ("bo", "submit"),
        ("bo", "delete"),
        ("ada", "recover"),
        ("ada", "retry"),
        ("cy", "log in"),
        ("ada", "revoke"),
        ("ada", "new token"),
        ("ada", "change person"),
    ];
    assert_eq!(done, expected.map(|(who, what)| (who.to_owned(), what.to_owned())));
    assert_eq!(
        ada.json(&format!("/audit?subject={id}"))["items"].as_array().map(Vec::len),
        Some(4)
    );
    let page = ada.json("/audit?who=bo&limit=1");
    let next = page["next"].as_str().expect("another page");
    assert_eq!(ada.json(&format!("/audit?who=bo&cursor={next}"))["items"][0]["action"], "submit");
    let printed = melange(&["audit", "--data", data.to_str().expect("UTF-8")], "");
    assert_eq!(String::from_utf8_lossy(&printed.stdout).lines().count(), expected.len());
}

#[test]
fn browsers_log_in_with_a_cookie_that_no_other_page_can_use() {
    let folder = folder();
    let token = add(folder.path(), "ada", "admin");
    let server = Server::start("serve", folder.path(), &["--https"]);
    let login = |token: &str| server.post("/api/v1/session", &json!({"token": token}).to_string());
    let answer = login(&token);
    assert_eq!((answer.status, answer.json()["name"].clone()), (200, json!("ada")));
    let cookie = answer.header("set-cookie").to_owned();
    for part in ["HttpOnly", "SameSite=Strict", "Secure", "Path=/", "Max-Age="] {
        assert!(cookie.contains(part), "{cookie}");
    }
    assert!(!cookie.contains(&token), "the token itself does not stay in the browser");
    let cookie = cookie.split(';').next().expect("a cookie").to_owned();
    let own = [("Cookie", cookie.as_str()), ("Sec-Fetch-Site", "same-origin")];
    let spec = melt_sweep(2).to_string();
    assert_eq!(server.send("POST", "/api/v1/sweeps", &own, spec.as_bytes()).status, 202);
    let host = server.address.trim_start_matches("http://");
    let (same, other) = (format!("http://{host}"), "http://evil.example".to_owned());
    for (origin, status) in [(&same, 202), (&other, 403)] {
        let sent = [("Cookie", cookie.as_str()), ("Origin", origin)];
        assert_eq!(server.send("POST", "/api/v1/sweeps", &sent, spec.as_bytes()).status, status);
    }
    // A page cannot add a token to a request to another site without asking first; programs may.
    let program = [("Authorization", format!("Bearer {token}")), ("Origin", other)];
    let program = program.each_ref().map(|(n, v)| (*n, v.as_str()));
    assert_eq!(server.send("POST", "/api/v1/sweeps", &program, spec.as_bytes()).status, 202);

    assert_eq!(server.send("DELETE", "/api/v1/session", &own, b"").status, 204);
    let ended = server.get_with("/api/v1/me", &own);
    assert_eq!(ended.status, 401);
    assert!(ended.header("set-cookie").contains("Max-Age=0"), "it is taken away");
    for forged in ["melange_session=", "melange_session=melange_00", "melange_session=%00%ff; x"] {
        assert_eq!(server.get_with("/api/v1/me", &[("Cookie", forged)]).status, 401, "{forged}");
    }

    // Guessing is answered later and later and then not at all, and shuts nobody out who was let in before.
    let bearer = format!("Bearer {token}");
    assert_eq!(server.get_with("/api/v1/me", &[("Authorization", &bearer)]).status, 200);
    let statuses: Vec<u16> = (0..12).map(|i| login(&format!("guess {i}")).status).collect();
    // Four cookies failed before.
    assert_eq!(statuses.iter().filter(|s| **s == 401).count(), 6, "{statuses:?}");
    let refused = login("guess");
    assert_eq!(refused.status, 429);
    let wait: u64 = refused.header("retry-after").parse().expect("a number");
    assert!((1..=61).contains(&wait), "{wait}");
    assert_eq!(server.get_with("/api/v1/me", &[("Authorization", &bearer)]).status, 200);
    assert_eq!(login(&token).status, 200, "who has a token is let in all the same");
}

#[test]
fn quotas_hold() {
    let folder = folder();
    let ada = add(folder.path(), "ada", "admin");
    let server = Server::start("serve", folder.path(), &[]);
    let ada = At::new(&server, &ada);
    let bo = json!({"name": "bo", "role": "contributor", "most_runs": 10});
    let bo = ada.send("POST", "/people", &bo).json();
    let bo = At::new(&server, bo["token"].as_str().expect("a token"));
    let first = bo.solve(&melt_sweep(6));
    let refused = bo.send("POST", "/sweeps", &melt_sweep(5));
    assert_eq!(refused.status, 403);
    let said = refused.json()["detail"].as_str().expect("a sentence").to_owned();
    assert_eq!(said, "bo may have 10 runs, and it would be 11");
    bo.solve(&melt_sweep(4));
    assert_eq!(bo.send("POST", "/sweeps", &melt_sweep(2)).status, 403);
    bo.send("DELETE", &format!("/sweeps/{first}"), &Value::Null);
    bo.solve(&melt_sweep(2));
    // What comes back counts again.
    let recovered = bo.send("POST", &format!("/sweeps/{first}/recover"), &Value::Null);
    assert_eq!(recovered.status, 403, "{}", String::from_utf8_lossy(&recovered.body));
    assert_eq!(bo.json("/sweeps?trash=true")["total"], 1);
    let changed =
        ada.send("PATCH", "/people/bo", &json!({"most_runs": null, "most_pending_runs": 3}));
    assert_eq!(changed.json()["most_runs"], Value::Null);
    let refused = bo.send("POST", "/sweeps", &melt_sweep(4)).json();
    let said = refused["detail"].as_str().expect("a sentence").to_owned();
    assert!(said.contains("3 runs waiting or under way"), "{said}");
    assert_eq!(ada.send("PATCH", "/people/bo", &json!({"most_runs": -1})).status, 422);
}

#[test]
fn what_people_do_at_the_same_time_does_not_undo_each_other() {
    let folder = folder();
    let ada = add(folder.path(), "ada", "admin");
    let server = Server::start("serve", folder.path(), &[]);
    let bo = add(folder.path(), "bo", "contributor");
    let [ada, bo] = [&ada, &bo].map(|token| At::new(&server, token));
    let id = ada.solve(&melt_sweep(2));
    let path = format!("/sweeps/{id}");
    std::thread::scope(|scope| {
        for (who, name) in [(&ada, "a"), (&bo, "b")] {
            let path = &path;
            scope.spawn(move || {
                for i in 0..6 {
                    let tags = json!({"add_tags": [format!("{name}{i}")]});
                    assert_eq!(who.send("PATCH", path, &tags).status, 200);
                }
            });
        }
    });
    assert_eq!(ada.json(&path)["tags"].as_array().map(Vec::len), Some(12));
    assert_eq!(bo.send("PATCH", &path, &json!({"remove_tags": ["a1"]})).status, 403);
    assert_eq!(bo.send("PATCH", &path, &json!({"tags": [], "add_tags": ["x"]})).status, 422);
    assert_eq!(ada.send("PATCH", &path, &json!({"name": "two\nlines"})).status, 422);

    // Everybody has idempotency keys of their own.
    let send = |who: &At<'_>| {
        let headers = [("Authorization", who.bearer.as_str()), ("Idempotency-Key", "monday")];
        let body = melt_sweep(2).to_string();
        server.post_with("/api/v1/sweeps", &headers, body.as_bytes()).json()["id"].clone()
    };
    assert_ne!(send(&ada), send(&bo));
    assert_eq!(send(&ada), send(&ada));

    // More lists at once than there are connections.
    let lists = format!("{path}/runs?filter=b%20%3E%200");
    std::thread::scope(|scope| {
        let ask = |path: &'static str, own: &str| {
            let path = if path.is_empty() { own.to_owned() } else { path.to_owned() };
            let (ada, path) = (&ada, path);
            scope.spawn(move || ada.send("GET", &path, &Value::Null).status)
        };
        let asked: Vec<_> =
            (0..40).map(|i| ask(if i % 2 == 0 { "" } else { "/runs?limit=1" }, &lists)).collect();
        for status in asked {
            assert_eq!(status.join().expect("an answer"), 200);
        }
    });
}

#[test]
fn a_stream_of_events_ends_with_the_token_that_opened_it() {
    use std::io::{BufRead, BufReader, Read, Write};
    let folder = folder();
    let ada = add(folder.path(), "ada", "admin");
    let server = Server::start("serve", folder.path(), &[]);
    let cy = add(folder.path(), "cy", "reader");
    let ada = At::new(&server, &ada);
    let spec = json!({
        "regime": "transient", "parameters": {"n_cells": 20}, "time": {"duration_a": 3, "fixed_dt_a": 0.01},
        "axes": [{"parameter": "melt_rate_m_per_day", "linspace": [0.5, 0.6, 40]}],
    });
    let id = ada.send("POST", "/sweeps", &spec).json()["id"].as_str().expect("an id").to_owned();
    ada.send("POST", &format!("/sweeps/{id}/pause"), &Value::Null);
    let host = server.address.trim_start_matches("http://");
    let mut stream = std::net::TcpStream::connect(host).expect("it listens");
    let head = format!(
        "GET /api/v1/sweeps/{id}/events HTTP/1.1\r\nHost: {host}\r\nAuthorization: Bearer {cy}\r\nConnection: close\r\n\r\n"
    );
    stream.write_all(head.as_bytes()).expect("it reads");
    stream.set_read_timeout(Some(std::time::Duration::from_secs(20))).expect("a time");
    let mut stream = BufReader::new(stream);
    let mut line = String::new();
    while !line.starts_with("event: ") {
        line.clear();
        assert!(stream.read_line(&mut line).expect("a line") > 0, "it ended before its time");
    }
    assert_eq!(ada.send("DELETE", "/people/cy", &Value::Null).status, 204);
    // A stream that went on would not come to its end, and this would not end well.
    let mut rest = String::new();
    stream.read_to_string(&mut rest).expect("the stream ends");
    assert!(!rest.contains("event: end"), "the sweep has not ended: {rest}");
}
