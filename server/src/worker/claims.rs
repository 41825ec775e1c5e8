//! Runs under way in this process, by id: the same run is not solved twice at the same time.

use std::collections::HashSet;
use std::sync::{Arc, Mutex, PoisonError};
use tokio::sync::watch;

/// The ids under way.
#[derive(Debug, Clone, Default)]
pub struct Claims {
    ids: Arc<Mutex<HashSet<String>>>,
    released: watch::Sender<u64>,
}

/// Ids that nobody else solves while this is held.
#[derive(Debug)]
pub struct Claim {
    claims: Claims,
    ids: Vec<String>,
}

impl Claims {
    /// Waits until none of the ids is under way elsewhere, and claims them all at once: who waits holds
    /// nothing that another might wait for.
    pub async fn claim(&self, ids: Vec<String>) -> Claim {
        let mut released = self.released.subscribe();
        loop {
            released.mark_unchanged();
            {
                let mut held = self.ids.lock().unwrap_or_else(PoisonError::into_inner);
                if ids.iter().all(|id| !held.contains(id)) {
                    held.extend(ids.iter().cloned());
                    return Claim { claims: self.clone(), ids };
                }
            }
            // The sender lives as long as `self`.
            released.changed().await.ok();
        }
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        let mut held = self.claims.ids.lock().unwrap_or_else(PoisonError::into_inner);
        for id in &self.ids {
            held.remove(id);
        }
        drop(held);
        self.claims.released.send_modify(|n| *n += 1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    fn ids(names: &[&str]) -> Vec<String> {
        names.iter().map(|n| (*n).to_owned()).collect()
    }

    #[tokio::test]
    async fn who_wants_a_claimed_id_waits_until_it_is_released() {
        let claims = Claims::default();
        let first = claims.claim(ids(&["a", "b"])).await;
        let other = claims.claim(ids(&["c"])).await;
        let waiting = tokio::spawn({
            let claims = claims.clone();
            async move { claims.claim(ids(&["b", "d"])).await }
        });
        tokio::time::sleep(Duration::from_millis(20)).await;
        assert!(!waiting.is_finished());
        // The one that waits holds nothing.
        drop(claims.claim(ids(&["d"])).await);
        drop(other);
        drop(first);
        drop(waiting.await.expect("it gets its turn"));
        drop(claims.claim(ids(&["a", "b", "c", "d"])).await);
    }
}
