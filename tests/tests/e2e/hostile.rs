//! Requests that mean harm, sent to a service with people, by a contributor where it takes one: each is refused
//! with the status that fits, and afterwards everything is as it was.

use super::melt_sweep;
use super::people::{At, add};
use arrow_array::{ArrayRef, Float64Array, RecordBatch};
use melange_tests::{Server, folder};
use parquet::arrow::ArrowWriter;
use parquet::basic::{Compression, ZstdLevel};
use parquet::file::properties::WriterProperties;
use serde_json::{Value, json};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::Arc;
use std::time::Duration;

/// Status of a request sent as it stands, as no library would send it.
fn raw(server: &Server, request: &str) -> u16 {
    let host = server.address.trim_start_matches("http://");
    let mut stream = TcpStream::connect(host).expect("it listens");
    let request = request.replace("HOST", host);
    stream.write_all(request.as_bytes()).expect("it reads");
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).ok();
    let text = String::from_utf8_lossy(&answer);
    text.split(' ').nth(1).and_then(|s| s.parse().ok()).unwrap_or_default()
}

/// A header that goes on piece by piece, each read before the next one comes, is refused once it is too long.
fn endless(server: &Server, head: &str) {
    const LIMIT: usize = 512 << 10;
    let host = server.address.trim_start_matches("http://");
    let mut stream = TcpStream::connect(host).expect("it listens");
    stream.set_nodelay(true).expect("a socket");
    stream.set_read_timeout(Some(Duration::from_millis(20))).expect("a socket");
    stream.write_all(head.replace("HOST", host).as_bytes()).expect("it reads");
    let piece = [b'x'; 16 << 10];
    let mut sent = 0;
    let mut answer = Vec::new();
    let mut bytes = [0; 1 << 10];
    while answer.is_empty() {
        assert!(sent <= LIMIT, "{sent} bytes of one header were taken");
        stream.write_all(&piece).expect("it reads");
        sent += piece.len();
        if let Ok(read) = stream.read(&mut bytes) {
            assert!(read > 0, "the connection was closed without an answer, after {sent} bytes");
            answer.extend(&bytes[..read]);
        }
    }
    let text = String::from_utf8_lossy(&answer);
    assert!(text.starts_with("HTTP/1.1 431 "), "after {sent} bytes: {text}");
}

/// A Parquet file that is small packed and large unpacked.
fn packed(names: &[String], rows: usize) -> Vec<u8> {
    let column: ArrayRef = Arc::new(Float64Array::from(vec![0.7; rows]));
    let batch = RecordBatch::try_from_iter(names.iter().map(|n| (n.as_str(), column.clone())));
    let batch = batch.expect("a batch");
    let zstd = Compression::ZSTD(ZstdLevel::default());
    let properties = WriterProperties::builder().set_compression(zstd).build();
    let mut bytes = Vec::new();
    let writer = ArrowWriter::try_new(&mut bytes, batch.schema(), Some(properties));
    let mut writer = writer.expect("a writer");
    writer.write(&batch).expect("a written batch");
    writer.close().expect("a closed file");
    bytes
}

/// A form with a sweep and a table beside it.
fn form(table: &[u8]) -> (&'static str, Vec<u8>) {
    let mut body = b"--x\r\nContent-Disposition: form-data; name=\"spec\"\r\n\r\n".to_vec();
    body.extend(br#"{"regime": "steady", "parameters": {"n_cells": 20}}"#);
    body.extend(b"\r\n--x\r\nContent-Disposition: form-data; name=\"table\"\r\n\r\n");
    body.extend(table);
    body.extend(b"\r\n--x--\r\n");
    ("multipart/form-data; boundary=x", body)
}

#[test]
fn requests_that_mean_harm_are_refused() {
    let folder = folder();
    let (ada, bo) = (add(folder.path(), "ada", "admin"), add(folder.path(), "bo", "contributor"));
    let few = ["--max-body-mib", "1", "--max-runs", "100000"];
    let server = Server::start("serve", folder.path(), &few);
    let admin = At::new(&server, &ada);
    let id = admin.solve(&melt_sweep(3));
    let run = admin.json(&format!("/sweeps/{id}/runs"))["items"][0]["run_id"].clone();
    let run = run.as_str().expect("an id").to_owned();
    let all = || {
        let mut sweeps = admin.json("/sweeps");
        for sweep in sweeps["items"].as_array_mut().expect("items") {
            // Files are put together of the service's own accord.
            sweep.as_object_mut().expect("a sweep").remove("bytes");
        }
        (sweeps, admin.json("/people"))
    };
    let before = all();
    let bearer = format!("Bearer {bo}");
    let mut sent = 0;

    // Paths that lead elsewhere, and requests that are none.
    let head =
        format!("HTTP/1.1\r\nHost: HOST\r\nAuthorization: {bearer}\r\nConnection: close\r\n");
    for (status, line) in [
        (404, "GET /../../etc/passwd"),
        (404, "GET /assets/../../../etc/passwd"),
        (404, "GET /%2e%2e/%2e%2e/etc/passwd"),
        (404, "GET /assets/%2e%2e%2fmelange.sqlite"),
        (404, "GET /melange.sqlite"),
        (404, "GET /operator-token"),
        (404, "GET /api/v1/sweeps/..%2f..%2fmelange.sqlite/runs.parquet"),
        (404, "GET /api/v1/sweeps/../../operator-token"),
        (404, "GET /api/v1/runs/%00"),
        (400, "GET /api/v1/runs/%ff%fe"),
        (404, "GET //api/v1/sweeps"),
        (404, "GET /api/v1/Sweeps"),
        (405, "TRACE /api/v1/sweeps"),
        (405, "PUT /api/v1/sweeps"),
        (405, "DELETE /api/v1/sweeps"),
        (400, "GET /api/v1/sweeps?limit=%ff"),
    ] {
        assert_eq!(raw(&server, &format!("{line} {head}\r\n")), status, "{line}");
        sent += 1;
    }
    let long = "x".repeat(70_000);
    for (statuses, request) in [
        (vec![400], "GARBAGE\r\n\r\n".to_owned()),
        (vec![400], "GET /api/v1/sweeps HTTP/9.9\r\n\r\n".to_owned()),
        (vec![414, 431], format!("GET /{long} {head}\r\n")),
        (vec![400], format!("POST /api/v1/sweeps {head}Content-Length: -5\r\n\r\n")),
        (
            vec![400],
            format!("POST /api/v1/sweeps {head}Transfer-Encoding: chunked\r\n\r\nzz\r\n\r\n"),
        ),
    ] {
        let status = raw(&server, &request);
        assert!(statuses.contains(&status), "{status}: {}", &request[..40.min(request.len())]);
        sent += 1;
    }
    endless(&server, &format!("GET /api/v1/me {head}X: "));
    sent += 1;

    // Who is nobody, who pretends, and who may not.
    let spec = melt_sweep(2).to_string();
    let spec = spec.as_bytes();
    let forged =
        "melange_session=melange_0000000000000000000000000000000000000000000000000000000000000000";
    let injected = "melange_session=' OR '1'='1";
    let sql = "Bearer ' OR name = 'ada' --";
    let evil = "http://evil.example";
    let people = "/api/v1/people";
    let own = format!("/api/v1/sweeps/{id}");
    let cancel = format!("{own}/cancel");
    let (auth, cookie) = ("Authorization", "Cookie");
    let eve = br#"{"name": "eve", "role": "admin"}"#.as_slice();
    let named_by_sql = br#"{"name": "x'); DROP TABLE people; --", "role": "reader"}"#.as_slice();
    let listed = br#"["eve", "admin"]"#.as_slice();
    for (status, method, path, headers, body) in [
        (401, "GET", "/api/v1/sweeps", vec![], b"".as_slice()),
        (401, "GET", "/metrics", vec![], b""),
        (401, "POST", "/api/v1/sweeps", vec![], spec),
        (401, "GET", "/api/v1/me", vec![(cookie, forged)], b""),
        (401, "GET", "/api/v1/me", vec![(cookie, injected)], b""),
        (401, "GET", "/api/v1/me", vec![(auth, sql)], b""),
        (401, "GET", "/api/v1/me", vec![(auth, "Basic YWRhOmFkYQ==")], b""),
        (403, "POST", "/api/v1/sweeps", vec![(cookie, forged), ("Origin", evil)], spec),
        (403, "POST", "/api/v1/session", vec![("Origin", evil)], b"{}"),
        (403, "POST", "/api/v1/session", vec![("Sec-Fetch-Site", "cross-site")], b"{}"),
        (403, "DELETE", own.as_str(), vec![(auth, &bearer)], b""),
        (403, "POST", cancel.as_str(), vec![(auth, &bearer)], b""),
        (403, "GET", people, vec![(auth, &bearer)], b""),
        (403, "POST", people, vec![(auth, &bearer)], eve),
        (403, "PATCH", "/api/v1/people/bo", vec![(auth, &bearer)], br#"{"role": "admin"}"#),
        (403, "POST", "/api/v1/people/ada/token", vec![(auth, &bearer)], b""),
        (422, "POST", people, vec![(auth, &format!("Bearer {ada}"))], named_by_sql),
        (400, "POST", people, vec![(auth, &format!("Bearer {ada}"))], listed),
        (400, "POST", people, vec![(auth, &format!("Bearer {ada}"))], b"{\"name\": 5}"),
    ] {
        let answer = server.send(method, path, &headers, body);
        let told = String::from_utf8_lossy(&answer.body).into_owned();
        assert_eq!(answer.status, status, "{method} {path} {headers:?}: {told}");
        sent += 1;
    }

    // SQL and the like in what is asked for.
    let bo = At::new(&server, &bo);
    for (status, path) in [
        (422, format!("/sweeps/{id}/runs?filter=1%20%3D%201%3B%20DROP%20TABLE%20runs")),
        (
            422,
            format!(
                "/sweeps/{id}/runs?filter=status%20%3D%20%22x%22%20UNION%20SELECT%20*%20FROM%20people"
            ),
        ),
        (422, format!("/sweeps/{id}/runs?filter=token_hash%20%3D%20%22x%22")),
        (200, format!("/sweeps/{id}/runs?filter=status%20%3D%20%22%27%20OR%201%3D1%20--%22")),
        (422, format!("/sweeps/{id}/runs?filter={}", "(".repeat(3_000))),
        (422, format!("/sweeps/{id}/runs?filter={}1%20%3D%201", "not%20".repeat(900))),
        (422, format!("/sweeps/{id}/runs?sort=run_index%3B%20DROP%20TABLE%20runs")),
        (422, format!("/sweeps/{id}/runs?limit=1000000000")),
        (400, format!("/sweeps/{id}/runs?limit=1e99")),
        (422, format!("/sweeps/{id}/runs?cursor=%5B%22x%22%2C%22y%22%5D")),
        (422, format!("/sweeps/{id}/fit?x=1%3B--&y=force_n_per_m")),
        (400, format!("/sweeps/{id}/fit?x=b&y=d_m&model=__proto__")),
        (404, "/runs/'%20OR%20'1'='1".to_owned()),
        (400, format!("/runs/{run}?unknown=1")),
    ] {
        let answer = bo.send("GET", &path, &Value::Null);
        let told = String::from_utf8_lossy(&answer.body).into_owned();
        assert_eq!(answer.status, status, "{path}: {told}");
        if status == 200 {
            assert_eq!(answer.json()["total"], 0, "a text is a text");
        }
        sent += 1;
    }

    // Documents and tables that are too much.
    let deep = format!("{}1{}", "[".repeat(100_000), "]".repeat(100_000));
    let columns: Vec<String> = (0..2_000).map(|i| format!("column_{i}")).collect();
    let mut lying = packed(&["b".into()], 10);
    let footer = lying.len() - 8;
    lying[footer..footer + 4].copy_from_slice(&u32::MAX.to_le_bytes());
    let bomb = packed(&["b".into()], 5_000_000);
    assert!(bomb.len() < 100_000, "it is small packed: {}", bomb.len());
    let melt = json!({"regime": "steady", "axes": [
        {"parameter": "melt_rate_m_per_day", "linspace": [0.5, 1, 4_000_000_000_u64]}]});
    let with_nan = r#"{"regime": "steady", "parameters": {"b": NaN}}"#;
    let huge = r#"{"regime": "steady", "parameters": {"b": 1e999}}"#;
    for (status, kind, body) in [
        (413, "application/json", "x".repeat(3 << 19).into_bytes()),
        (
            422,
            "application/json",
            format!(r#"{{"regime": "steady", "axes": {deep}}}"#).into_bytes(),
        ),
        (422, "application/json", melt.to_string().into_bytes()),
        (400, "application/json", with_nan.into()),
        (422, "application/json", huge.into()),
        (400, "application/json", vec![0xff, 0xfe, 0x00]),
        (400, "multipart/form-data; boundary=x", b"--x\r\nnothing".to_vec()),
        (422, form(&bomb).0, form(&bomb).1),
        (422, form(&lying).0, form(&lying).1),
        (422, form(&packed(&columns, 10)).0, form(&packed(&columns, 10)).1),
        (422, form(b"PAR1 and nothing more").0, form(b"PAR1 and nothing more").1),
        (422, form(b"b\n<script>").0, form(b"b\n<script>").1),
    ] {
        let headers = [(auth, bearer.as_str()), ("Content-Type", kind)];
        let answer = server.send("POST", "/api/v1/sweeps", &headers, &body);
        let told = String::from_utf8_lossy(&answer.body).into_owned();
        let first = String::from_utf8_lossy(&body[..60.min(body.len())]).into_owned();
        assert_eq!(answer.status, status, "{first}: {told}");
        assert_eq!(answer.content_type, "application/problem+json", "{first}");
        sent += 1;
    }

    assert!(sent >= 50, "only {sent} requests were sent");
    assert_eq!(all(), before, "nothing was changed");
    assert!(server.terminate());
}
