//! Drives the real binary: starts it in a temporary directory, speaks HTTP with it, kills it.

use serde_json::Value;
use std::fs::File;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// The binary, built into the folder of this test's own.
pub fn binary() -> PathBuf {
    let test = std::env::current_exe().expect("a test has a path");
    let folder = test.ancestors().nth(2).expect("tests lie in target/<profile>/deps");
    let binary = folder.join("melange");
    assert!(binary.exists(), "{} is not built: cargo build --workspace", binary.display());
    binary
}

/// Root of the repository.
pub fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}

/// Runs a Python script, given as text, with arguments, in a folder, by the interpreter that has the packages of
/// `tests/python/requirements.txt`; it must end well. Returns what it printed.
pub fn python(script: &str, arguments: &[&str], folder: &Path) -> String {
    let interpreter = root().join("target/python/bin/python");
    assert!(
        interpreter.exists(),
        "{} is not there: `tests/run` installs it, with the packages that tests need",
        interpreter.display()
    );
    let output = Command::new(&interpreter)
        .args(["-c", script])
        .args(arguments)
        .current_dir(folder)
        .output()
        .expect("Python starts");
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{script}\n{printed}\n{errors}");
    printed
}

/// Runs the binary with something on its standard input.
pub fn melange(arguments: &[&str], input: &str) -> Output {
    let mut child = Command::new(binary())
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the binary starts");
    let mut stdin = child.stdin.take().expect("its input is piped");
    stdin.write_all(input.as_bytes()).expect("it reads its input");
    drop(stdin);
    child.wait_with_output().expect("it ends")
}

/// Solves a scenario by `melange run -` and returns exit code and result.
pub fn run(scenario: &str) -> (i32, Value) {
    let output = melange(&["run", "-"], scenario);
    let text = String::from_utf8(output.stdout).expect("its output is UTF-8");
    let result = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{e}: {text}"));
    (output.status.code().expect("it exits"), result)
}

/// An answer over HTTP.
#[derive(Debug)]
pub struct Answer {
    /// Status code.
    pub status: u16,
    /// Value of the Content-Type header.
    pub content_type: String,
    /// Headers, their names in lower case.
    pub headers: Vec<(String, String)>,
    /// Value of the X-Request-Id header.
    pub request_id: String,
    /// Body.
    pub body: Vec<u8>,
}

impl Answer {
    /// Value of a header, by its name in lower case; empty if it is not there.
    pub fn header(&self, name: &str) -> &str {
        let found = self.headers.iter().find(|(known, _)| known == name);
        found.map(|(_, value)| value.as_str()).unwrap_or_default()
    }

    /// The body as JSON.
    pub fn json(&self) -> Value {
        serde_json::from_slice(&self.body)
            .unwrap_or_else(|e| panic!("{e}: {}", String::from_utf8_lossy(&self.body)))
    }
}

/// A running service.
#[derive(Debug)]
pub struct Server {
    child: Child,
    /// Its address, `http://127.0.0.1:…`.
    pub address: String,
}

impl Server {
    /// Starts `melange serve` (or another command that serves) on a data directory.
    pub fn start(command: &str, data: &Path, more: &[&str]) -> Self {
        Self::spawn(Command::new(binary()).arg(command), data, more)
    }

    /// Starts `melange serve` with its log in a file.
    pub fn start_logged(data: &Path, log: &Path, more: &[&str]) -> Self {
        let log = File::create(log).expect("a log");
        let mut command = Command::new(binary());
        Self::spawn(command.arg("serve").env("RUST_LOG", "info").stderr(log), data, more)
    }

    /// Starts `melange serve` at an address.
    pub fn start_at(address: &str, data: &Path) -> Self {
        Self::listening(Command::new(binary()).arg("serve"), address, data, &[])
    }

    fn spawn(command: &mut Command, data: &Path, more: &[&str]) -> Self {
        Self::listening(command, "127.0.0.1:0", data, more)
    }

    fn listening(command: &mut Command, at: &str, data: &Path, more: &[&str]) -> Self {
        if command.get_envs().all(|(name, _)| name != "RUST_LOG") {
            // A line for each request would drown what the tests tell.
            command.env("RUST_LOG", "warn");
        }
        let mut child = command
            .args(["--listen", at, "--data"])
            .arg(data)
            .args(more)
            .stdout(Stdio::piped())
            .spawn()
            .expect("the binary starts");
        let mut line = String::new();
        BufReader::new(child.stdout.take().expect("its output is piped"))
            .read_line(&mut line)
            .expect("it says where it listens");
        let address = line.trim().rsplit(' ').next().expect("an address").to_owned();
        assert!(address.starts_with("http://"), "it said {line:?}");
        Self { child, address }
    }

    /// Asks for a path.
    pub fn get(&self, path: &str) -> Answer {
        let agent = agent();
        answer(agent.get(format!("{}{path}", self.address)).call().expect("an answer"))
    }

    /// Sends a body to a path.
    pub fn post(&self, path: &str, body: &str) -> Answer {
        let agent = agent();
        answer(agent.post(format!("{}{path}", self.address)).send(body).expect("an answer"))
    }

    /// Changes what is at a path.
    pub fn patch(&self, path: &str, body: &str) -> Answer {
        let agent = agent();
        answer(agent.patch(format!("{}{path}", self.address)).send(body).expect("an answer"))
    }

    /// Sends a body to a path with headers.
    pub fn post_with(&self, path: &str, headers: &[(&str, &str)], body: &[u8]) -> Answer {
        let mut request = agent().post(format!("{}{path}", self.address));
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        answer(request.send(body).expect("an answer"))
    }

    /// Asks for a path with headers.
    pub fn get_with(&self, path: &str, headers: &[(&str, &str)]) -> Answer {
        let mut request = agent().get(format!("{}{path}", self.address));
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        answer(request.call().expect("an answer"))
    }

    /// Sends a request of any method, with headers and a body.
    pub fn send(&self, method: &str, path: &str, headers: &[(&str, &str)], body: &[u8]) -> Answer {
        let mut request =
            ureq::http::Request::builder().method(method).uri(format!("{}{path}", self.address));
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        let request = request.body(body.to_vec()).expect("a request");
        let config = agent().configure_request(request).allow_non_standard_methods(true);
        answer(agent().run(config.build()).expect("an answer"))
    }

    /// Asks for the headers of a path.
    pub fn head(&self, path: &str) -> Answer {
        let agent = agent();
        answer(agent.head(format!("{}{path}", self.address)).call().expect("an answer"))
    }

    /// Asks a verb of a sweep, which must be allowed; returns the sweep.
    pub fn ask(&self, id: &str, verb: &str) -> Value {
        let answer = self.post(&format!("/api/v1/sweeps/{id}/{verb}"), "");
        assert_eq!(answer.status, 200, "{verb}: {}", String::from_utf8_lossy(&answer.body));
        let sweep = answer.json();
        assert_counts_add_up(&sweep);
        sweep
    }

    /// Asks to delete a path.
    pub fn delete(&self, path: &str) -> Answer {
        let agent = agent();
        answer(agent.delete(format!("{}{path}", self.address)).call().expect("an answer"))
    }

    /// The JSON at a path, which must be there.
    pub fn json(&self, path: &str) -> Value {
        let answer = self.get(path);
        assert_eq!(answer.status, 200, "{path}: {}", String::from_utf8_lossy(&answer.body));
        answer.json()
    }

    /// Submits a sweep, which must be taken; returns its id.
    pub fn submit(&self, spec: &Value) -> String {
        let answer = self.post("/api/v1/sweeps", &spec.to_string());
        assert_eq!(answer.status, 202, "{}", String::from_utf8_lossy(&answer.body));
        answer.json()["id"].as_str().expect("an id").to_owned()
    }

    /// Waits until a sweep is complete; checks at each look that its counts add up.
    pub fn wait(&self, id: &str) -> Value {
        let begin = Instant::now();
        loop {
            let sweep = self.json(&format!("/api/v1/sweeps/{id}"));
            assert_counts_add_up(&sweep);
            if sweep["state"] == "complete" {
                return sweep;
            }
            assert!(begin.elapsed() < Duration::from_secs(300), "not complete: {sweep}");
            sleep(Duration::from_millis(30));
        }
    }

    /// Ends the process at once, as a power cut would (SIGKILL).
    pub fn kill(&mut self) {
        self.child.kill().expect("it runs");
        self.child.wait().expect("it ends");
    }

    /// Asks the process to end (SIGTERM) and returns whether it ended well.
    pub fn terminate(self) -> bool {
        self.ask_to_end();
        self.ended()
    }

    /// Asks the process to end (SIGTERM).
    pub fn ask_to_end(&self) {
        let id = self.child.id().to_string();
        Command::new("kill").args(["-TERM", &id]).status().expect("kill is there");
    }

    /// Waits until the process has ended, and tells whether it ended well.
    pub fn ended(mut self) -> bool {
        self.child.wait().expect("it ends").success()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.child.kill().ok();
        self.child.wait().ok();
    }
}

/// The counts of a sweep, all but the total, add up to the total.
pub fn assert_counts_add_up(sweep: &Value) {
    let counts = sweep["counts"].as_object().expect("counts");
    let parts: i64 =
        counts.iter().filter(|(name, _)| *name != "total").filter_map(|(_, n)| n.as_i64()).sum();
    assert_eq!(Some(parts), counts["total"].as_i64(), "{sweep}");
}

/// A small disk of its own (tmpfs), which goes with the test.
#[derive(Debug)]
pub struct Disk {
    folder: TempDir,
}

impl Disk {
    /// Mounts a disk of so many MiB.
    pub fn mount(mib: u32) -> Self {
        let folder = folder();
        let disk = Self { folder };
        let size = format!("size={mib}m");
        disk.call("mount", &["-t", "tmpfs", "-o", &size, "tmpfs"]);
        disk
    }

    /// Where it is mounted.
    pub fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Mounts it anew with other options, such as `ro`.
    pub fn remount(&self, options: &str) {
        self.call("mount", &["-o", &format!("remount,{options}")]);
    }

    /// Writes a file until nothing more fits.
    pub fn fill(&self, name: &str) {
        let mut file = File::create(self.path().join(name)).expect("a file");
        for bytes in [1 << 16, 1] {
            while file.write_all(&vec![0; bytes]).is_ok() {}
        }
    }

    fn call(&self, command: &str, arguments: &[&str]) {
        let done = Command::new(command).args(arguments).arg(self.path()).status();
        assert!(
            done.is_ok_and(|status| status.success()),
            "this test needs a small disk: run it as root, in a container with `--cap-add SYS_ADMIN`, so \
             that `{command} {}` is permitted",
            arguments.join(" ")
        );
    }
}

impl Drop for Disk {
    fn drop(&mut self) {
        Command::new("umount").arg("-l").arg(self.folder.path()).status().ok();
    }
}

/// A folder that goes with the test.
pub fn folder() -> TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

fn agent() -> ureq::Agent {
    ureq::Agent::config_builder()
        .http_status_as_error(false)
        .timeout_global(Some(Duration::from_secs(120)))
        .build()
        .into()
}

fn answer(mut response: ureq::http::Response<ureq::Body>) -> Answer {
    let text = |value: &ureq::http::HeaderValue| value.to_str().unwrap_or_default().to_owned();
    let headers = response.headers().iter();
    let headers: Vec<(String, String)> =
        headers.map(|(name, value)| (name.to_string(), text(value))).collect();
    let header = |name: &str| response.headers().get(name).map(text).unwrap_or_default();
    Answer {
        headers,
        status: response.status().as_u16(),
        content_type: header("content-type"),
        request_id: header("x-request-id"),
        body: response
            .body_mut()
            .with_config()
            .limit(1 << 30)
            .read_to_vec()
            .expect("the body arrives"),
    }
}
