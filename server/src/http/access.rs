//! Who asks: found out once for each request, before any handler, and handed to the handlers. Here stands what
//! is refused before it reaches them: requests without a token where there are people, requests that another
//! site's page made a browser send, and requests for another host's name.

use super::Service;
use super::error::Problem;
use crate::domain::person::Actor;
use crate::people;
use axum::extract::{ConnectInfo, FromRequestParts, Request, State};
use axum::http::header::{AUTHORIZATION, COOKIE, HOST, ORIGIN, SET_COOKIE};
use axum::http::request::Parts;
use axum::http::{HeaderMap, Method, StatusCode};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use cookie::time::Duration;
use cookie::{Cookie, SameSite};
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::sync::atomic::Ordering;

/// Name of the cookie of a browser that is logged in.
pub const SESSION_COOKIE: &str = "melange_session";

/// What a request shows.
enum Shown {
    /// A token.
    Token(String),
    /// A session's secret.
    Session(String),
    /// Nothing.
    Nothing,
}

/// Finds out who asks and tells the handlers, or refuses.
pub async fn know(State(service): State<Service>, request: Request, next: Next) -> Response {
    let has_session = session(request.headers()).is_some();
    match admit(&service, request).await {
        Ok(request) => next.run(request).await,
        Err(problem) => {
            let mut response = problem.into_response();
            // A session that is no more is not to be shown again and again.
            if has_session && response.status() == StatusCode::UNAUTHORIZED {
                let taken_away = session_cookie(&service, String::new(), Duration::ZERO);
                response.headers_mut().extend(taken_away.parse().map(|c| (SET_COOKIE, c)));
            }
            response
        }
    }
}

async fn admit(service: &Service, mut request: Request) -> Result<Request, Problem> {
    let headers = request.headers();
    let shown = shown(headers);
    let is_safe = matches!(*request.method(), Method::GET | Method::HEAD | Method::OPTIONS);
    let is_operator = match &shown {
        Shown::Token(token) => service.is_operator(&people::hash(token)),
        _ => false,
    };
    // A page cannot make a browser send a bearer's token, as it can cookies; but where there are no people any
    // token is as good as none.
    let is_guarded = is_guarded(request.uri().path());
    if is_safe && !is_guarded {
        return Ok(request);
    }
    let is_peopled = service.has_people().await?;
    let has_token = is_operator || (is_peopled && matches!(shown, Shown::Token(_)));
    if !is_safe && !has_token {
        same_site(headers)?;
    }
    if !is_guarded {
        return Ok(request);
    }
    let actor = match (is_operator, is_peopled) {
        (true, _) => Actor::operator(),
        (false, true) => identify(service, &shown, address(&request)).await?,
        (false, false) => {
            own_host(service, headers)?;
            Actor::local()
        }
    };
    request.extensions_mut().insert(actor);
    Ok(request)
}

/// Whether a path is for people only: not the page's files, the description of the interface, whether the
/// service is up, and logging in.
pub fn is_guarded(path: &str) -> bool {
    const FREE: [&str; 2] = ["/api/v1/openapi.json", "/api/v1/session"];
    if path == "/metrics" {
        return true;
    }
    path.starts_with("/api/") && !FREE.contains(&path) && !path.starts_with("/api/v1/docs")
}

fn shown(headers: &HeaderMap) -> Shown {
    // Browsers send what they have of other schemes of their own accord; it says nothing here.
    let text = headers.get(AUTHORIZATION).and_then(|value| value.to_str().ok());
    let bearer = text.and_then(|text| text.split_once(' '));
    if let Some((_, token)) = bearer.filter(|(scheme, _)| scheme.eq_ignore_ascii_case("bearer")) {
        return Shown::Token(token.trim().to_owned());
    }
    session(headers).map_or(Shown::Nothing, Shown::Session)
}

/// The secret of a browser's session.
pub fn session(headers: &HeaderMap) -> Option<String> {
    let mut cookies = headers.get_all(COOKIE).iter().filter_map(|value| value.to_str().ok());
    cookies.find_map(|text| {
        let mut cookies = Cookie::split_parse(text.to_owned()).filter_map(Result::ok);
        cookies.find(|c| c.name() == SESSION_COOKIE).map(|c| c.value().to_owned())
    })
}

/// The cookie of a session of a certain age; of none, it takes it away.
pub fn session_cookie(service: &Service, secret: String, age: Duration) -> String {
    Cookie::build((SESSION_COOKIE, secret))
        .http_only(true)
        .same_site(SameSite::Strict)
        .secure(service.is_https)
        .path("/")
        .max_age(age)
        .build()
        .to_string()
}

/// The address a request comes from.
pub fn address(request: &Request) -> IpAddr {
    let from = request.extensions().get::<ConnectInfo<SocketAddr>>();
    from.map_or(IpAddr::V4(Ipv4Addr::UNSPECIFIED), |info| info.0.ip())
}

async fn identify(service: &Service, shown: &Shown, from: IpAddr) -> Result<Actor, Problem> {
    let hash = match shown {
        Shown::Nothing => return Err(Problem::unauthorized("there is no token with this request")),
        Shown::Token(secret) | Shown::Session(secret) => people::hash(secret),
    };
    let mut tx = service.store.read().await?;
    let actor = match shown {
        Shown::Session(_) => people::of_session(&mut tx, &hash).await?,
        _ => people::of_token(&mut tx, &hash).await?,
    };
    drop(tx);
    match actor {
        Some(actor) => Ok(actor),
        None => {
            service.patience.bad(from).await?;
            let what = match shown {
                Shown::Session(_) => "this browser is not logged in any more",
                _ => "this token is nobody's; was it revoked?",
            };
            Err(Problem::unauthorized(what))
        }
    }
}

/// Refuses what a page of another site made a browser send. Browsers say where a request comes from, and no
/// page can change what they say; programs that are no browsers say nothing.
fn same_site(headers: &HeaderMap) -> Result<(), Problem> {
    let text = |name: &str| headers.get(name).map(|value| value.to_str().unwrap_or("?"));
    let is_own = match (text("sec-fetch-site"), text(ORIGIN.as_str())) {
        (Some(site), _) => site == "same-origin" || site == "none",
        (None, Some(origin)) => {
            origin.split_once("://").is_some_and(|(_, host)| Some(host) == text(HOST.as_str()))
        }
        (None, None) => true,
    };
    if is_own {
        return Ok(());
    }
    Err(Problem::forbidden("this request was sent by a page of another site and is refused"))
}

/// Without people, whoever reaches the service may do everything; so a page must not reach it under a name
/// of its own that it lets point to this machine.
fn own_host(service: &Service, headers: &HeaderMap) -> Result<(), Problem> {
    let Some(host) = headers.get(HOST) else { return Ok(()) };
    let host = host.to_str().unwrap_or("?");
    let name = host.rsplit_once(':').filter(|(_, port)| port.parse::<u16>().is_ok());
    let name = name.map_or(host, |(name, _)| name).trim_matches(['[', ']']);
    let is_loopback = name.parse::<IpAddr>().is_ok_and(|ip| ip.is_loopback())
        || name.eq_ignore_ascii_case("localhost");
    if is_loopback || service.hosts.iter().any(|own| own.eq_ignore_ascii_case(name)) {
        return Ok(());
    }
    Err(Problem::forbidden(format!(
        "this service has no people and answers to localhost only, not to `{name}`; `--host {name}` permits it"
    )))
}

impl Service {
    /// Whether there are or were people. Once there are, there always will be.
    pub async fn has_people(&self) -> Result<bool, Problem> {
        if self.peopled.load(Ordering::Relaxed) {
            return Ok(true);
        }
        let there_are = people::exist(&mut *self.store.read().await?).await?;
        self.peopled.store(there_are, Ordering::Relaxed);
        Ok(there_are)
    }

    /// Whether a token is that of commands on this machine.
    fn is_operator(&self, hash: &str) -> bool {
        // Both are hashes of secrets, so that the time it takes tells nothing of them.
        self.operator.as_deref() == Some(hash)
    }
}

impl<S: Send + Sync> FromRequestParts<S> for Actor {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Problem> {
        parts.extensions.get::<Self>().cloned().ok_or_else(Problem::unknown_actor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(all: &[(&'static str, &str)]) -> HeaderMap {
        all.iter()
            .map(|(n, v)| ((*n).parse().expect("a name"), v.parse().expect("a value")))
            .collect()
    }

    #[test]
    fn pages_of_other_sites_are_told_from_our_own() {
        let host = ("host", "lab.example:8080");
        for own in [
            vec![host],
            vec![host, ("origin", "http://lab.example:8080")],
            vec![host, ("sec-fetch-site", "same-origin"), ("origin", "https://front.example")],
            vec![host, ("sec-fetch-site", "none")],
        ] {
            assert!(same_site(&headers(&own)).is_ok(), "{own:?}");
        }
        for other in [
            vec![host, ("origin", "http://evil.example")],
            vec![host, ("origin", "http://lab.example:9090")],
            vec![host, ("origin", "null")],
            vec![host, ("sec-fetch-site", "cross-site")],
            vec![host, ("sec-fetch-site", "same-site"), ("origin", "http://lab.example:8080")],
        ] {
            assert!(same_site(&headers(&other)).is_err(), "{other:?}");
        }
    }

    #[test]
    fn secrets_are_found_in_headers_and_cookies() {
        let token = |text| match shown(&headers(&[("authorization", text)])) {
            Shown::Token(token) => token,
            _ => panic!("no token in {text}"),
        };
        assert_eq!(token("Bearer abc"), "abc");
        assert_eq!(token("bearer  abc "), "abc");
        let basic = [("authorization", "Basic YTpi"), ("cookie", "melange_session=xyz")];
        assert!(matches!(shown(&headers(&basic)), Shown::Session(secret) if secret == "xyz"));
        let cookies = headers(&[("cookie", "other=1; melange_session=xyz; melange_sessions=no")]);
        assert_eq!(session(&cookies).as_deref(), Some("xyz"));
        assert_eq!(session(&headers(&[("cookie", "a=b")])), None);
    }

    #[test]
    fn the_page_and_the_way_in_are_free_and_the_rest_is_not() {
        for free in [
            "/",
            "/assets/x.js",
            "/health",
            "/api/v1/openapi.json",
            "/api/v1/session",
            "/api/v1/docs/",
        ] {
            assert!(!is_guarded(free), "{free}");
        }
        for guarded in
            ["/metrics", "/api/v1/sweeps", "/api/v1/sessions", "/api/v1/dictionary", "/api/v2/x"]
        {
            assert!(is_guarded(guarded), "{guarded}");
        }
    }
}
