//! Long reads in turn: who waits for one keeps nobody else waiting; and how many runs a law is made of.

use super::*;
use crate::http::extract::NothingAsked;
use crate::http::{columns, failures, indices};
use crate::store::Store;
use std::future::Future;
use std::pin::Pin;
use std::task::{Context, Poll, Waker};

type Waiting = Pin<Box<dyn Future<Output = Option<Problem>> + Send>>;

/// Whether it waits, asked several times.
fn is_waiting(asked: &mut Waiting) -> bool {
    let mut context = Context::from_waker(Waker::noop());
    (0..10).all(|_| matches!(asked.as_mut().poll(&mut context), Poll::Pending))
}

#[tokio::test]
async fn requests_that_read_all_runs_wait_for_a_turn_and_hold_no_connection() {
    let folder = tempfile::tempdir().expect("a folder");
    let store = Store::open(folder.path()).await.expect("a store");
    let service = Service::new(store.clone(), 1);
    let mut turns = Vec::new();
    while let Ok(turn) =
        tokio::time::timeout(std::time::Duration::from_millis(50), store.long_read()).await
    {
        turns.push(turn.expect("the store is open"));
        assert!(turns.len() < 8, "some connections are left for others");
    }
    // No sweep has this id, which those who wait cannot know yet.
    let id = || Place("none".to_owned());
    let state = || State(service.clone());
    fn asked<T: serde::de::DeserializeOwned>(name: &str) -> Asked<T> {
        let members: serde_json::Map<_, _> =
            name.split('&').map(|member| (member.to_owned(), "b".into())).collect();
        Asked(serde_json::from_value(members.into()).expect("a query"))
    }
    let mut all: Vec<Waiting> = Vec::new();
    for _ in 0..10 {
        let (s, i) = (state(), id());
        all.push(Box::pin(async { laws(s, i, asked("x&y")).await.err() }));
        let (s, i) = (state(), id());
        all.push(Box::pin(async { fit(s, i, asked("x&y")).await.err() }));
        let (s, i) = (state(), id());
        all.push(Box::pin(async { columns::columns(s, i, asked("names")).await.err() }));
        let (s, i) = (state(), id());
        all.push(Box::pin(async { failures::failures(s, i, NothingAsked).await.err() }));
        let (s, i) = (state(), id());
        all.push(Box::pin(async { indices::of_sweep(s, i, asked("y")).await.err() }));
    }
    assert!(all.iter_mut().all(is_waiting));
    // Meanwhile every connection is there for others.
    let mut others = Vec::new();
    for _ in 0..8 {
        others.push(store.read().await.expect("a connection"));
    }
    drop(others);
    drop(turns);
    let all: tokio::task::JoinSet<_> = all.into_iter().collect();
    for problem in all.join_all().await {
        let problem = problem.expect("there is no such sweep");
        assert_eq!(problem.sentence(), "there is no sweep `none`");
    }
}

#[test]
fn a_law_of_too_many_runs_is_refused_with_what_to_do() {
    assert_eq!(check_rows(MOST_RUNS), Ok(()));
    let refusal = check_rows(MOST_RUNS + 1).expect_err("too many");
    assert_eq!(refusal.field.as_deref(), Some("filter"));
    let permitted = refusal.permitted.expect("what is permitted");
    assert!(permitted.contains("at most 2000000 runs"), "{permitted}");
}
