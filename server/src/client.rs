//! A running service, asked over REST.

use anyhow::{Context, anyhow, bail};
use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::time::Duration;
use ureq::http::Response;
use ureq::{Agent, Body};

/// A running service.
#[derive(Debug, Clone)]
pub struct Client {
    agent: Agent,
    address: String,
}

/// Pause before a broken stream of events is asked for again.
const BEFORE_AGAIN: Duration = Duration::from_secs(1);
/// Broken streams in a row after which the service is given up.
const TRIES: usize = 30;

/// Largest table taken.
const MOST_BYTES: u64 = 1 << 34;

/// A refusal, told as the service told it.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct Refused(pub String);

impl Client {
    /// Of the service at an address.
    pub fn new(address: String) -> Self {
        let agent = Agent::config_builder().http_status_as_error(false).build().into();
        Self { agent, address }
    }

    /// Of the service at an address, which is to answer within a time.
    pub fn impatient(address: String, longest: Duration) -> Self {
        let config = Agent::config_builder().http_status_as_error(false);
        Self { agent: config.timeout_global(Some(longest)).build().into(), address }
    }

    fn url(&self, path: &str) -> String {
        format!("{}/api/v1{path}", self.address)
    }

    /// The document at a path.
    pub fn get(&self, path: &str) -> anyhow::Result<Value> {
        answer(self.agent.get(self.url(path)).call().context("the service does not answer")?)
    }

    /// Whether the service is up, told by its database.
    pub fn health(&self) -> anyhow::Result<Value> {
        let sent = self.agent.get(format!("{}/health", self.address)).call();
        answer(sent.context("the service does not answer")?)
    }

    /// The bytes at a path, such as a bulk table.
    pub fn download(&self, path: &str) -> anyhow::Result<Vec<u8>> {
        let sent = self.agent.get(self.url(path)).call();
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
        let sent = self.agent.post(self.url(path)).send(body);
        answer(sent.context("the service does not answer")?)
    }

    /// Deletes what is at a path.
    pub fn delete(&self, path: &str) -> anyhow::Result<Value> {
        let sent = self.agent.delete(self.url(path)).call();
        answer(sent.context("the service does not answer")?)
    }

    /// Hands over each event of a sweep until its end; a stream that breaks is taken up where it broke.
    pub fn follow(&self, id: &str, mut each: impl FnMut(&Value)) -> anyhow::Result<Value> {
        let mut last = (String::new(), Value::Null);
        let mut broken = 0;
        loop {
            let url = self.url(&format!("/sweeps/{id}/events"));
            let request = self.agent.get(url).header("Last-Event-ID", &last.0);
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
        Some(detail) => Err(anyhow!("the service says: {detail}")),
        None => Err(anyhow!("the service answers {status}")),
    }
}
