//! The interface's description, as far as it is the same for all calls: who is let in, and what any of them may
//! answer when it cannot.

use super::error::PROBLEM_TYPE;
use utoipa::openapi::path::{Operation, PathItem};
use utoipa::openapi::security::{ApiKey, ApiKeyValue, HttpAuthScheme, HttpBuilder, SecurityScheme};
use utoipa::openapi::{
    Content, OpenApi, Ref, RefOr, Response, ResponseBuilder, SecurityRequirement,
};

/// What any call may answer, beside what its handler says.
const BY_ALL: [(&str, &str); 3] = [
    ("403", "A page of another site sent it, or it may not be done"),
    ("500", "A defect, or a damaged archive; the service's log says more"),
    ("503", "The database is busy; nothing was changed"),
];
/// What calls may answer that are for people only.
const BY_GUARDED: [(&str, &str); 2] = [
    ("401", "There are people, and the request shows no token of theirs"),
    ("429", "Too many wrong tokens came from this address"),
];

/// Adds to a description what holds for all calls below `/api/v1`.
pub fn complete(mut api: OpenApi, is_guarded: impl Fn(&str) -> bool) -> OpenApi {
    let components = api.components.get_or_insert_default();
    let bearer = HttpBuilder::new().scheme(HttpAuthScheme::Bearer).build();
    components.security_schemes.insert("token".into(), SecurityScheme::Http(bearer).into());
    let cookie = ApiKey::Cookie(ApiKeyValue::new(super::access::SESSION_COOKIE));
    components.security_schemes.insert("session".into(), SecurityScheme::ApiKey(cookie).into());
    for (path, item) in &mut api.paths.paths {
        let guarded = is_guarded(path);
        for (method, operation) in operations(item) {
            operation.operation_id = Some(name_of(method, path));
            problems_as_such(operation);
            let more = BY_GUARDED.iter().filter(|_| guarded || path.ends_with("/session"));
            for (status, description) in BY_ALL.iter().chain(more) {
                let responses = &mut operation.responses.responses;
                responses.entry((*status).into()).or_insert_with(|| problem(description));
            }
            if guarded {
                // The empty one: a service without people asks for nothing.
                let scopes: [&str; 0] = [];
                operation.security = Some(vec![
                    SecurityRequirement::new("token", scopes),
                    SecurityRequirement::new("session", scopes),
                    SecurityRequirement::default(),
                ]);
            }
        }
    }
    api
}

/// What says what went wrong has a media type of its own.
fn problems_as_such(operation: &mut Operation) {
    for (status, response) in &mut operation.responses.responses {
        if let RefOr::T(response) = response
            && status.as_str() >= "400"
            && let Some(content) = response.content.shift_remove("application/json")
        {
            response.content.insert(PROBLEM_TYPE.into(), content);
        }
    }
}

fn operations(item: &mut PathItem) -> impl Iterator<Item = (&'static str, &mut Operation)> {
    [
        ("get", &mut item.get),
        ("head", &mut item.head),
        ("post", &mut item.post),
        ("put", &mut item.put),
        ("patch", &mut item.patch),
        ("delete", &mut item.delete),
    ]
    .into_iter()
    .filter_map(|(method, operation)| Some((method, operation.as_mut()?)))
}

/// Name of a call, which clients made from the description go by: `get_sweeps_id_runs_csv`. Names of handlers alone
/// would stand several times.
fn name_of(method: &str, path: &str) -> String {
    let path = path.trim_start_matches("/api/v1");
    let words = path.split(|c: char| !c.is_ascii_alphanumeric() && c != '_');
    std::iter::once(method)
        .chain(words.filter(|word| !word.is_empty()))
        .collect::<Vec<_>>()
        .join("_")
}

fn problem(description: &str) -> RefOr<Response> {
    let schema = Ref::from_schema_name("Problem");
    let content = Content::new(Some(schema));
    let response = ResponseBuilder::new().description(description);
    response.content(PROBLEM_TYPE, content).build().into()
}
