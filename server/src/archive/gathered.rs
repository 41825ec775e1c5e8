//! Files made for downloads, kept for a while for whoever reads them piece by piece. Knows no table and no
//! transport.

use std::fs::File;
use std::future::Future;
use std::io;
use std::os::unix::fs::FileExt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::OnceCell;
use tokio::time::Instant;

/// Most files kept at once.
const MOST_FILES: usize = 16;
/// Most bytes kept at once; a file that is larger by itself is kept alone. They lie on the archive's disk.
const MOST_BYTES: u64 = 2 << 30;
/// How long a file is kept after it was asked for last.
const KEPT: Duration = Duration::from_secs(300);

/// An open file that any number of readers share.
#[derive(Debug)]
pub struct Gathered {
    file: File,
    length: u64,
}

impl Gathered {
    /// Of an open file and its length.
    pub fn new((file, length): (File, u64)) -> Self {
        Self { file, length }
    }

    /// Its bytes.
    pub fn length(&self) -> u64 {
        self.length
    }

    /// At most so many bytes from a place on; blocks.
    pub fn read_at(&self, offset: u64, most: usize) -> io::Result<Vec<u8>> {
        let left = self.length.saturating_sub(offset);
        let mut bytes = vec![0; most.min(usize::try_from(left).unwrap_or(usize::MAX))];
        self.file.read_exact_at(&mut bytes, offset)?;
        Ok(bytes)
    }
}

/// A file that is there or being made, by the name of its contents.
#[derive(Debug)]
struct Kept {
    mark: String,
    file: Arc<OnceCell<Arc<Gathered>>>,
    asked: Instant,
}

/// The files kept, shared by all who hold a copy of this.
#[derive(Debug, Clone, Default)]
pub struct Shelf(Arc<Mutex<Vec<Kept>>>);

impl Shelf {
    /// The file of a mark, which stands for its bytes; made unless it is kept or being made already.
    pub async fn get<E>(
        &self,
        mark: &str,
        make: impl Future<Output = Result<Gathered, E>>,
    ) -> Result<Arc<Gathered>, E> {
        let cell = self.cell(mark);
        let made = cell.get_or_try_init(async || make.await.map(Arc::new)).await.cloned();
        self.clear();
        made
    }

    fn cell(&self, mark: &str) -> Arc<OnceCell<Arc<Gathered>>> {
        let mut kept = self.lock();
        // Last asked, last in line.
        let place = kept.iter().position(|file| file.mark == mark);
        let mut found = place.map_or_else(
            || Kept { mark: mark.to_owned(), file: Arc::default(), asked: Instant::now() },
            |place| kept.remove(place),
        );
        found.asked = Instant::now();
        let cell = found.file.clone();
        if kept.is_empty() {
            tokio::spawn(self.clone().forget());
        }
        kept.push(found);
        cell
    }

    /// Lets go of files that were not asked for lately, and of more than are kept, the oldest first.
    fn clear(&self) {
        let mut kept = self.lock();
        kept.retain(|file| file.asked.elapsed() < KEPT);
        let bytes = |kept: &[Kept]| -> u64 {
            kept.iter().filter_map(|file| file.file.get()).map(|file| file.length).sum()
        };
        while kept.len() > 1 && (kept.len() > MOST_FILES || bytes(&kept) > MOST_BYTES) {
            kept.remove(0);
        }
    }

    /// Clears now and then, until nothing is kept.
    async fn forget(self) {
        loop {
            tokio::time::sleep(KEPT / 10).await;
            self.clear();
            if self.lock().is_empty() {
                return;
            }
        }
    }

    fn lock(&self) -> MutexGuard<'_, Vec<Kept>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;
    use std::sync::atomic::{AtomicUsize, Ordering};

    fn file(bytes: &[u8]) -> Gathered {
        let mut file = tempfile::tempfile().expect("a file");
        file.write_all(bytes).expect("written");
        Gathered::new((file, bytes.len() as u64))
    }

    async fn ask(shelf: &Shelf, mark: &str, made: &AtomicUsize) -> Arc<Gathered> {
        let make = async {
            tokio::task::yield_now().await;
            made.fetch_add(1, Ordering::Relaxed);
            Ok::<_, ()>(file(mark.as_bytes()))
        };
        shelf.get(mark, make).await.expect("a file")
    }

    #[tokio::test]
    async fn a_file_is_made_once_whoever_asks() {
        let (shelf, made) = (Shelf::default(), AtomicUsize::new(0));
        let (a, b) = tokio::join!(ask(&shelf, "one", &made), ask(&shelf, "one", &made));
        assert_eq!(made.load(Ordering::Relaxed), 1);
        assert_eq!(a.read_at(1, 10).expect("read"), b"ne");
        assert_eq!(b.read_at(0, 2).expect("read"), b"on");
        assert!(b.read_at(3, 1).expect("read").is_empty());
    }

    #[tokio::test]
    async fn a_failure_is_not_kept() {
        let shelf = Shelf::default();
        assert_eq!(shelf.get("one", async { Err("full") }).await.err(), Some("full"));
        ask(&shelf, "one", &AtomicUsize::new(0)).await;
    }

    #[tokio::test]
    async fn the_oldest_go_first() {
        let (shelf, made) = (Shelf::default(), AtomicUsize::new(0));
        for i in 0..MOST_FILES {
            ask(&shelf, &format!("{i}"), &made).await;
        }
        ask(&shelf, "0", &made).await;
        ask(&shelf, "new", &made).await;
        assert_eq!(made.load(Ordering::Relaxed), MOST_FILES + 1);
        ask(&shelf, "0", &made).await;
        assert_eq!(made.load(Ordering::Relaxed), MOST_FILES + 1, "it was asked for again");
        ask(&shelf, "1", &made).await;
        assert_eq!(made.load(Ordering::Relaxed), MOST_FILES + 2, "it was the oldest");
    }
}
