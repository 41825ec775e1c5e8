//! Patience with those who show tokens that nobody has: answers come later and later, and from a number of
//! failures in a minute on they come no more than to say so. Who shows what is good is let in all the same, so
//! that nobody is shut out by failures of others at the same address: with 256 random bits there is no more to
//! be found by trying than by not.

use super::error::Problem;
use std::collections::HashMap;
use std::net::IpAddr;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Failures of an address within [`PERIOD`] that are answered as such.
const MOST_FAILURES: u32 = 10;
/// How long failures count.
const PERIOD: Duration = Duration::from_secs(60);
/// How much later the answer to each further failure comes, and the longest that one takes.
const LATER: Duration = Duration::from_millis(100);
const LATEST: Duration = Duration::from_secs(1);
/// Addresses kept in mind; when there are more, those of the last minute, or none.
const MOST_KEPT: usize = 10_000;

/// Who failed lately.
#[derive(Debug, Default)]
pub struct Patience(Mutex<HashMap<IpAddr, (u32, Instant)>>);

impl Patience {
    /// What an address showed is nobody's: waits, or refuses where that was too often.
    pub async fn bad(&self, address: IpAddr) -> Result<(), Problem> {
        let (failures, since) = self.count(address);
        if failures > MOST_FAILURES {
            return Err(Problem::too_many_failures(PERIOD.saturating_sub(since.elapsed())));
        }
        tokio::time::sleep((LATER * failures).min(LATEST)).await;
        Ok(())
    }

    /// Counts one more failure of an address; how many there are, and since when.
    fn count(&self, address: IpAddr) -> (u32, Instant) {
        let mut seen = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if seen.len() >= MOST_KEPT {
            seen.retain(|_, (_, since)| since.elapsed() < PERIOD);
            if seen.len() >= MOST_KEPT {
                seen.clear();
            }
        }
        let counted = seen.entry(address).or_insert((0, Instant::now()));
        if counted.1.elapsed() >= PERIOD {
            *counted = (0, Instant::now());
        }
        counted.0 = counted.0.saturating_add(1);
        *counted
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn failures_of_an_address_are_counted_and_then_refused() {
        let (patience, here) = (Patience::default(), IpAddr::from([10, 0, 0, 1]));
        for n in 1..=MOST_FAILURES {
            assert_eq!(patience.count(here).0, n);
        }
        assert!(patience.bad(here).await.is_err());
        let begin = Instant::now();
        assert!(patience.bad(IpAddr::from([10, 0, 0, 2])).await.is_ok(), "another address");
        assert!(begin.elapsed() >= LATER);
    }
}
