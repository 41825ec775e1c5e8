//! People over REST: who one is, logging in and out, and, for admins, who the people are and what was
//! changed.

use super::Service;
use super::access::{self, session_cookie};
use super::error::Problem;
use super::extract::{Asked, Body, NothingAsked, Place};
use super::sweeps::page_limit;
use crate::domain::person::{Actor, Role};
use crate::domain::refusal::Refusal;
use crate::people::{self, Change, Person, Quota, Unfit};
use axum::Json;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use cookie::time;
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};

/// Who asks.
#[derive(Debug, Serialize, ToSchema)]
pub struct Me {
    #[serde(flatten)]
    actor: Actor,
    /// Whether the service has no people, so that whoever reaches it may do everything.
    is_open: bool,
}

/// Who one is.
#[utoipa::path(get, path = "/me", responses((status = 200, body = Me), (status = 400, body = Problem)))]
pub async fn me(
    State(service): State<Service>,
    actor: Actor,
    _: NothingAsked,
) -> Result<Json<Me>, Problem> {
    Ok(Json(Me { actor, is_open: !service.has_people().await? }))
}

/// What a browser logs in with.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Login {
    token: String,
}

/// Log a browser in: it gets a cookie that its pages cannot read and other sites' pages cannot use.
#[utoipa::path(
    post, path = "/session", request_body = Login,
    responses((status = 200, body = Actor, description = "The cookie is set"), (status = 400, body = Problem))
)]
pub async fn login(
    State(service): State<Service>,
    _: NothingAsked,
    request: Request,
) -> Result<Response, Problem> {
    let from = access::address(&request);
    let Body(login): Body<Login> = Body::of(request).await?;
    let hash = people::hash(login.token.trim());
    let mut tx = service.store.write().await?;
    let Some(actor) = people::of_token(&mut tx, &hash).await? else {
        drop(tx);
        service.patience.bad(from).await?;
        return Err(Problem::unauthorized("this token is nobody's; was it revoked?"));
    };
    let secret = people::open_session(&mut tx, &actor.name).await?;
    people::audit(&mut tx, &actor.name, "log in", &actor.name, None).await?;
    tx.commit().await?;
    let seconds = i64::try_from(people::SESSION.as_secs()).unwrap_or(i64::MAX);
    let cookie = session_cookie(&service, secret, time::Duration::seconds(seconds));
    Ok(([(header::SET_COOKIE, cookie)], Json(actor)).into_response())
}

/// Log a browser out.
#[utoipa::path(
    delete, path = "/session",
    responses((status = 204, description = "The cookie is taken away"), (status = 400, body = Problem))
)]
pub async fn logout(
    State(service): State<Service>,
    headers: HeaderMap,
    _: NothingAsked,
) -> Result<Response, Problem> {
    if let Some(secret) = access::session(&headers) {
        let mut tx = service.store.write().await?;
        if let Some(name) = people::close_session(&mut tx, &people::hash(&secret)).await? {
            people::audit(&mut tx, &name, "log out", &name, None).await?;
        }
        tx.commit().await?;
    }
    let cookie = session_cookie(&service, String::new(), time::Duration::ZERO);
    Ok((StatusCode::NO_CONTENT, [(header::SET_COOKIE, cookie)]).into_response())
}

/// A person to be added.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NewPerson {
    name: String,
    role: Role,
    #[serde(default)]
    most_runs: Option<i64>,
    #[serde(default)]
    most_pending_runs: Option<i64>,
}

/// A person's token, told once.
#[derive(Debug, Serialize, ToSchema)]
pub struct Token {
    name: String,
    /// What shows who they are: as `Authorization: Bearer …`, or to log a browser in. It is not kept.
    token: String,
}

/// All people. For admins.
#[utoipa::path(
    get, path = "/people",
    responses((status = 200, body = Vec<Person>), (status = 400, body = Problem), (status = 403, body = Problem))
)]
pub async fn list(
    State(service): State<Service>,
    actor: Actor,
    _: NothingAsked,
) -> Result<Json<Vec<Person>>, Problem> {
    actor.may_manage()?;
    Ok(Json(people::all(&mut *service.store.read().await?).await?))
}

/// Add a person. For admins; the first one must be an admin, and from then on nobody is let in without a
/// token.
#[utoipa::path(
    post, path = "/people", request_body = NewPerson,
    responses(
        (status = 201, body = Token), (status = 400, body = Problem), (status = 403, body = Problem),
        (status = 409, body = Problem, description = "There is a person of this name"), (status = 413, body = Problem),
        (status = 422, body = Problem), (status = 507, body = Problem, description = "The disk is full"),
    )
)]
pub async fn add(
    State(service): State<Service>,
    actor: Actor,
    _: NothingAsked,
    Body(new): Body<NewPerson>,
) -> Result<(StatusCode, Json<Token>), Problem> {
    actor.may_manage()?;
    let quota = Quota { most_runs: new.most_runs, most_pending_runs: new.most_pending_runs };
    let mut tx = service.store.write().await?;
    let token = people::add(&mut tx, &new.name, new.role, quota).await?;
    let detail = people::detail(new.role, quota);
    people::audit(&mut tx, &actor.name, "add person", &new.name, Some(&detail)).await?;
    tx.commit().await?;
    service.people_changed.send_modify(|n| *n += 1);
    Ok((StatusCode::CREATED, Json(Token { name: new.name, token })))
}

/// What is said anew of a person; what is not given stays.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Changed {
    #[serde(default)]
    role: Option<Role>,
    /// Null for no limit.
    #[serde(default, with = "given")]
    #[schema(value_type = Option<i64>)]
    most_runs: Option<Option<i64>>,
    /// Null for no limit.
    #[serde(default, with = "given")]
    #[schema(value_type = Option<i64>)]
    most_pending_runs: Option<Option<i64>>,
}

/// Tells a member that is null from one that is not there.
mod given {
    use serde::{Deserialize, Deserializer};

    pub fn deserialize<'de, D: Deserializer<'de>>(d: D) -> Result<Option<Option<i64>>, D::Error> {
        Option::deserialize(d).map(Some)
    }
}

/// Change a person's role and quota. For admins.
#[utoipa::path(
    patch, path = "/people/{name}", params(("name" = String, Path,)), request_body = Changed,
    responses(
        (status = 200, body = Person), (status = 400, body = Problem), (status = 403, body = Problem),
        (status = 404, body = Problem), (status = 413, body = Problem), (status = 422, body = Problem),
        (status = 507, body = Problem, description = "The disk is full"),
    )
)]
pub async fn change(
    State(service): State<Service>,
    actor: Actor,
    Place(name): Place<String>,
    _: NothingAsked,
    Body(changed): Body<Changed>,
) -> Result<Json<Person>, Problem> {
    actor.may_manage()?;
    let mut tx = service.store.write().await?;
    let was = people::one(&mut tx, &name).await?.ok_or_else(|| Unfit::Nobody(name.clone()))?;
    let role = changed.role.unwrap_or(was.role);
    let quota = Quota {
        most_runs: changed.most_runs.unwrap_or(was.quota.most_runs),
        most_pending_runs: changed.most_pending_runs.unwrap_or(was.quota.most_pending_runs),
    };
    people::set(&mut tx, &name, role, quota).await?;
    let detail = people::detail(role, quota);
    people::audit(&mut tx, &actor.name, "change person", &name, Some(&detail)).await?;
    tx.commit().await?;
    service.people_changed.send_modify(|n| *n += 1);
    Ok(Json(Person { role, quota, ..was }))
}

/// Give a person a new token in the place of the old one, also after it was revoked. For admins, and for
/// oneself.
#[utoipa::path(
    post, path = "/people/{name}/token", params(("name" = String, Path,)),
    responses(
        (status = 200, body = Token), (status = 400, body = Problem), (status = 403, body = Problem),
        (status = 404, body = Problem), (status = 507, body = Problem, description = "The disk is full"),
    )
)]
pub async fn renew(
    State(service): State<Service>,
    actor: Actor,
    Place(name): Place<String>,
    _: NothingAsked,
) -> Result<Json<Token>, Problem> {
    if actor.name != name {
        actor.may_manage()?;
    }
    let mut tx = service.store.write().await?;
    let token = people::renew(&mut tx, &name).await?;
    people::audit(&mut tx, &actor.name, "new token", &name, None).await?;
    tx.commit().await?;
    service.people_changed.send_modify(|n| *n += 1);
    Ok(Json(Token { name, token }))
}

/// Revoke a person's token and log their browsers out. What they own stays theirs. For admins.
#[utoipa::path(
    delete, path = "/people/{name}", params(("name" = String, Path,)),
    responses(
        (status = 204, description = "Revoked"), (status = 400, body = Problem), (status = 403, body = Problem),
        (status = 404, body = Problem), (status = 507, body = Problem, description = "The disk is full"),
    )
)]
pub async fn revoke(
    State(service): State<Service>,
    actor: Actor,
    Place(name): Place<String>,
    _: NothingAsked,
) -> Result<StatusCode, Problem> {
    actor.may_manage()?;
    let mut tx = service.store.write().await?;
    people::revoke(&mut tx, &name).await?;
    people::audit(&mut tx, &actor.name, "revoke", &name, None).await?;
    tx.commit().await?;
    service.people_changed.send_modify(|n| *n += 1);
    Ok(StatusCode::NO_CONTENT)
}

/// Which changes.
#[derive(Debug, Default, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct Trail {
    /// Changes of the page, from 1 to 1000; 100 if not given.
    limit: Option<i64>,
    /// The `next` of the page before.
    cursor: Option<String>,
    /// Only changes of this: a sweep's id, a person's name.
    subject: Option<String>,
    /// Only changes by this person.
    who: Option<String>,
}

/// A page of the audit trail.
#[derive(Debug, Serialize, ToSchema)]
pub struct Changes {
    items: Vec<Change>,
    /// Cursor of the next page; null at the end.
    next: Option<String>,
}

/// What was changed, by whom and when, the newest first. For admins.
#[utoipa::path(
    get, path = "/audit", params(Trail),
    responses(
        (status = 200, body = Changes), (status = 400, body = Problem), (status = 403, body = Problem),
        (status = 422, body = Problem),
    )
)]
pub async fn audit(
    State(service): State<Service>,
    actor: Actor,
    Asked(asked): Asked<Trail>,
) -> Result<Json<Changes>, Problem> {
    actor.may_manage()?;
    let limit = page_limit(asked.limit)?;
    let cursor = asked.cursor.as_deref().map(|text| {
        let entry = text.parse().ok().filter(|entry| *entry > 0);
        entry.ok_or_else(|| Refusal::value("cursor", text, "the `next` of the page before"))
    });
    let which = people::Which {
        subject: asked.subject.as_deref(),
        who: asked.who.as_deref(),
        before: cursor.transpose()?,
        limit,
    };
    let items = people::changes(&mut *service.store.read().await?, which).await?;
    let is_full = items.len() as i64 == limit;
    let next = items.last().filter(|c| is_full && c.entry > 1).map(|c| c.entry.to_string());
    Ok(Json(Changes { items, next }))
}
