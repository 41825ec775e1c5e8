//! A running service, asked over REST.

use anyhow::{Context, anyhow, bail};
use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::time::Duration;
use ureq::config::ConfigBuilder;
use ureq::http::Response;
use ureq::typestate::AgentScope;
use ureq::{Agent, Body, RequestBuilder};

/// A running service.
#[derive(Debug, Clone)]
pub struct Client {
    agent: Agent,
    address: String,
    /// Shows who asks; empty if nothing does.
    token: String,
}

/// Pause before a broken stream of events is asked for again.
const BEFORE_AGAIN: Duration = Duration::from_secs(1);
/// Broken streams in a row after which the service is given up.
const TRIES: usize = 30;

/// Largest table taken.
const MOST_BYTES: u64 = 1 << 34;

/// Services are asked directly: they are on this machine, and what a proxy is told everybody may know.
fn config() -> ConfigBuilder<AgentScope> {
    Agent::config_builder().http_status_as_error(false).proxy(None)
}

/// A refusal, told as the service told it.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct Refused(pub String);

impl Client {
    /// Of the service at an address.
    pub fn new(address: String) -> Self {
        let agent = config().build().into();
        Self { agent, address, token: String::new() }
    }

    /// Of the service at an address, which is to answer within a time.
    pub fn impatient(address: String, longest: Duration) -> Self {
        let agent = config().timeout_global(Some(longest)).build().into();
        Self { agent, address, token: String::new() }
    }

    /// The same, with a token that shows who asks.
    pub fn with_token(self, token: String) -> Self {
        Self { token, ..self }
    }

    /// A request with what shows who asks.
    fn shown<B>(&self, request: RequestBuilder<B>) -> RequestBuilder<B> {
        if self.token.is_empty() {
            return request;
        }
        request.header("Authorization", format!("Bearer {}", self.token))
    }

    fn url(&self, path: &str) -> String {
        format!("{}/api/v1{path}", self.address)
    }

    /// The document at a path.
    pub fn get(&self, path: &str) -> anyhow::Result<Value> {
        let sent = self.shown(self.agent.get(self.url(path))).call();
        answer(sent.context("the service does not answer")?)
    }

    /// Whether the service is up, told by its database.
    pub fn health(&self) -> anyhow::Result<Value> {
        let sent = self.agent.get(format!("{}/health", self.address)).call();
        answer(sent.context("the service does not answer")?)
    }

    /// The bytes at a path, such as a bulk table.
    pub fn download(&self, path: &str) -> anyhow::Result<Vec<u8>> {
        let sent = self.shown(self.agent.get(self.url(path))).call();
        let mut response = sent.context("the service does not answer")?;
        if !response.status().is_success() {
            answer(response)?;
            bail!("the service answers without a table");
        }
        let body = response.body_mut().with_config().limit(MOST_BYTES);
        body.read_to_vec().context("the answer broke off")
    }

    /// Sends a body to a path.
    pub fn post(&self, path: &str, body: &[u8]) -> anyhow::Result<Value> {
        let sent = self.shown(self.agent.post(self.url(path))).send(body);
        answer(sent.context("the service does not answer")?)
    }

    /// Sends changes of what is at a path.
    pub fn patch(&self, path: &str, body: &[u8]) -> anyhow::Result<Value> {
        let sent = self.shown(self.agent.patch(self.url(path))).send(body);
        answer(sent.context("the service does not answer")?)
    }

    /// Sends a form to a path.
    pub fn post_form(&self, path: &str, parts: &[(&str, &[u8])]) -> anyhow::Result<Value> {
        let mut hasher = blake3::Hasher::new();
        for (_, bytes) in parts {
            hasher.update(bytes);
        }
        // What the parts' hash begins with does not stand in them.
        let boundary = hasher.finalize().to_hex()[..40].to_owned();
        let mut body = Vec::new();
        for (name, bytes) in parts {
            let head =
                format!("--{boundary}\r\nContent-Disposition: form-data; name=\"{name}\"\r\n\r\n");
            body.extend_from_slice(head.as_bytes());
            body.extend_from_slice(bytes);
            body.extend_from_slice(b"\r\n");
        }
        body.extend_from_slice(format!("--{boundary}--\r\n").as_bytes());
        let request = self.shown(self.agent.post(self.url(path)));
        let form = format!("multipart/form-data; boundary={boundary}");
        let sent = request.header("Content-Type", form).send(&body);
        answer(sent.context("the service does not answer")?)
    }

    /// Sends a file to a path, as it is read.
    pub fn post_file(&self, path: &str, file: std::fs::File) -> anyhow::Result<Value> {
        let sent = self.shown(self.agent.post(self.url(path))).send(file);
        answer(sent.context("the service does not answer")?)
    }

    /// Deletes what is at a path.
    pub fn delete(&self, path: &str) -> anyhow::Result<Value> {
        let sent = self.shown(self.agent.delete(self.url(path))).call();
        answer(sent.context("the service does not answer")?)
    }

    /// Hands over each event of a sweep until its end; a stream that breaks is taken up where it broke.
    pub fn follow(&self, id: &str, mut each: impl FnMut(&Value)) -> anyhow::Result<Value> {
        let mut last = (String::new(), Value::Null);
        let mut broken = 0;
        loop {
            let url = self.url(&format!("/sweeps/{id}/events"));
            let request = self.shown(self.agent.get(url)).header("Last-Event-ID", &last.0);
            match request.call() {
                Ok(response) if response.status() == 204 => return Ok(last.1),
                Ok(response) if response.status() == 200 => {
                    broken = 0;
                    if read_events(response, &mut last, &mut each) {
                        return Ok(last.1);
                    }
                }
                Ok(response) => return answer(response),
                Err(error) if broken >= TRIES => return Err(error).context("the service is gone"),
                Err(_) => broken += 1,
            }
            std::thread::sleep(BEFORE_AGAIN);
        }
    }
}

/// Reads events until the stream ends; whether the last one was the end of the sweep.
fn read_events(
    response: Response<Body>,
    last: &mut (String, Value),
    each: &mut impl FnMut(&Value),
) -> bool {
    let (mut name, mut id) = (String::new(), String::new());
    for line in BufReader::new(response.into_body().into_reader()).lines() {
        let Ok(line) = line else { return false };
        match line.split_once(": ") {
            Some(("event", text)) => name = text.to_owned(),
            Some(("id", text)) => id = text.to_owned(),
            Some(("data", text)) => {
                if let Ok(value) = serde_json::from_str::<Value>(text) {
                    each(&value);
                    *last = (id.clone(), value);
                }
            }
            _ if line.is_empty() && name == "end" && !last.1.is_null() => return true,
            _ => {}
        }
    }
    false
}

fn answer(mut response: Response<Body>) -> anyhow::Result<Value> {
    let status = response.status();
    let text = response.body_mut().read_to_string().context("the answer broke off")?;
    if status.is_success() {
        return Ok(serde_json::from_str(&text).unwrap_or_default());
    }
    let problem: Value = serde_json::from_str(&text).unwrap_or_default();
    match problem["detail"].as_str() {
        Some(detail) if status.is_client_error() => bail!(Refused(detail.to_owned())),
        Some(detail) => {
            // What its log knows the failure by.
            let id = problem["request_id"].as_str().map(|id| format!(" (request {id})"));
            Err(anyhow!("the service says: {detail}{}", id.unwrap_or_default()))
        }
        None => Err(anyhow!("the service answers {status}")),
    }
}
