//! The only place with threads: parallel maps whose results come back in input order, and threads for work that may
//! never end.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

use super::Seed;

/// Does `work` on a thread of its own, whose end nobody waits for. For reading and writing pipes, which may block for ever.
pub fn beside(work: impl FnOnce() + Send + 'static) -> std::io::Result<()> {
    std::thread::Builder::new().spawn(work).map(drop)
}

/// Work of a turn, given its number.
type Turn<'a> = &'a (dyn Fn(usize) + Sync);

/// Stack of a worker. Memory is taken as it is touched.
const STACK_BYTES: usize = 16 << 20;

/// Worker threads. Results depend neither on their number nor on which of them is done first.
pub struct Threads {
    /// `None`: the caller's own thread.
    pool: Option<rayon::ThreadPool>,
    /// Seed of the order in which a map begins its items; `None` for their own order.
    order: Option<Seed>,
}

/// Most workers: no machine of today has more cores, and each takes a stack.
pub const THREADS_MAX: usize = 1024;

/// Worker threads could not be started.
#[derive(Debug, thiserror::Error)]
pub enum ThreadsError {
    /// More than any machine can use.
    #[error(
        "expected at most {THREADS_MAX} worker threads, found {0}; 0 gives one a core, and no number changes a result"
    )]
    TooMany(usize),
    /// The system does not give that many.
    #[error("cannot start {threads} worker threads: {source}; ask for fewer (--jobs 1)")]
    Unstarted {
        /// Number of threads that was asked for.
        threads: usize,
        /// Error of the system.
        source: rayon::ThreadPoolBuildError,
    },
}

impl Threads {
    /// `threads` workers; 0 means one per core.
    ///
    /// # Errors
    /// More than [`THREADS_MAX`], or more than the system gives.
    pub fn new(threads: usize) -> Result<Threads, ThreadsError> {
        if threads > THREADS_MAX {
            return Err(ThreadsError::TooMany(threads));
        }
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            // With a map within a map, a worker that waits for its end may begin another item of the outer one on the same stack.
            .stack_size(STACK_BYTES)
            .build()
            .map(|pool| Threads { pool: Some(pool), order: None })
            .map_err(|source| ThreadsError::Unstarted { threads, source })
    }

    /// No worker: a map runs on its caller's thread, one item after the other. For maps within long items of another map, whose
    /// thread would otherwise take up another long item while it waits.
    pub const fn none() -> Threads {
        Threads { pool: None, order: None }
    }

    /// Workers whose maps begin their items in an order drawn from a seed. Results come back in item order all the same. For
    /// tests: a result that depends on the order of the work comes out differently.
    pub fn shuffled(threads: usize, seed: Seed) -> Result<Threads, ThreadsError> {
        Ok(Threads { order: Some(seed), ..Threads::new(threads)? })
    }

    /// Returns the number of threads that work.
    pub fn count(&self) -> usize {
        self.pool.as_ref().map_or(1, rayon::ThreadPool::current_num_threads)
    }

    /// Returns `f` of every item, in item order. `f` is given the index too, as a name for its random stream.
    pub fn map<T: Sync, R: Send>(&self, items: &[T], f: impl Fn(usize, &T) -> R + Sync + Send) -> Vec<R> {
        let Some(pool) = &self.pool else { return items.iter().enumerate().map(|(i, item)| f(i, item)).collect() };
        self.gather(items, f, &|work| each(pool, items.len(), work))
    }

    /// Maps items that mostly wait for something outside: at most `at_once` of them, and [`THREADS_MAX`], are under way together,
    /// each on a thread of its own. The workers do what the items compute in a [`Threads::map`]. With one at once: the caller's thread alone.
    pub fn map_waiting<T: Sync, R: Send>(
        &self,
        items: &[T],
        at_once: usize,
        f: impl Fn(usize, &T) -> R + Sync + Send,
    ) -> Vec<R> {
        match at_once.min(items.len()).min(THREADS_MAX) {
            0 | 1 => items.iter().enumerate().map(|(i, item)| f(i, item)).collect(),
            at_once => self.gather(items, f, &|work| each_waiting(at_once, items.len(), work)),
        }
    }

    /// Returns results in item order, whichever thread does the work of a turn.
    fn gather<T: Sync, R: Send>(
        &self,
        items: &[T],
        f: impl Fn(usize, &T) -> R + Sync + Send,
        each: &dyn Fn(Turn<'_>),
    ) -> Vec<R> {
        let order = self.order.map(|seed| {
            let mut order: Vec<usize> = (0..items.len()).collect();
            seed.stream(&["kernel", "threads", &items.len().to_string()]).shuffle(&mut order);
            order
        });
        let results: Vec<Mutex<Option<R>>> = items.iter().map(|_| Mutex::new(None)).collect();
        each(&|turn| {
            let i = order.as_ref().map_or(turn, |order| order[turn]);
            let result = f(i, &items[i]);
            *results[i].lock().unwrap_or_else(PoisonError::into_inner) = Some(result);
        });
        let result = |slot: Mutex<Option<R>>| slot.into_inner().unwrap_or_else(PoisonError::into_inner);
        results
            .into_iter()
            .map(|slot| result(slot).unwrap_or_else(|| unreachable!("`each` takes every item")))
            .collect()
    }
}

/// Does `work` of 0 to `count` - 1 on `at_once` threads, the caller's among them. Where the system gives fewer, fewer wait together.
fn each_waiting(at_once: usize, count: usize, work: Turn<'_>) {
    let next = AtomicUsize::new(0);
    let take_turns = || {
        loop {
            match next.fetch_add(1, Ordering::Relaxed) {
                turn if turn < count => work(turn),
                _ => return,
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 1..at_once {
            if std::thread::Builder::new().stack_size(STACK_BYTES).spawn_scoped(scope, take_turns).is_err() {
                break;
            }
        }
        take_turns();
    });
}

/// Does `work` of 0 to `count` - 1 on the pool. It knows no type of items and results, so that rayon's own code, which is long, is
/// compiled once and not for every map of the program.
fn each(pool: &rayon::ThreadPool, count: usize, work: Turn<'_>) {
    // An item is a search or a rollout, long enough to be a job of its own: in longer jobs one thread would be left with several
    // items while the others wait.
    pool.install(|| (0..count).into_par_iter().with_max_len(1).for_each(work));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn order_does_not_depend_on_the_number_of_threads() {
        let items: Vec<u64> = (0..500).collect();
        let one = Threads::new(1).unwrap().map(&items, |i, x| x * 3 + i as u64);
        let four = Threads::new(4).unwrap().map(&items, |i, x| x * 3 + i as u64);
        let none = Threads::none().map(&items, |i, x| x * 3 + i as u64);
        assert_eq!(one, four);
        assert_eq!(one, none);
    }

    #[test]
    fn more_workers_than_anybody_has_use_for_are_refused_before_one_is_started() {
        for threads in [THREADS_MAX + 1, 20_000, 10_usize.pow(12), usize::MAX] {
            let refused = Threads::new(threads).err().map(|error| error.to_string()).unwrap_or_default();
            assert!(refused.contains(&format!("found {threads}")) && refused.contains("1024"), "{threads}: {refused}");
        }
    }

    #[test]
    fn what_waits_is_under_way_together_and_what_it_computes_is_not_held_up() {
        let threads = Threads::new(1).unwrap();
        let items: Vec<u64> = (0..40).collect();
        // No thread goes on before all are here: with fewer threads this would never end.
        let all = std::sync::Barrier::new(40);
        let waited = threads.map_waiting(&items, 40, |i, x| {
            all.wait();
            threads.map(&items, |_, y| x * y).iter().sum::<u64>() + i as u64
        });
        assert_eq!(waited, items.iter().map(|x| x * 780 + x).collect::<Vec<u64>>());
        let most = std::sync::Mutex::new((0, 0));
        threads.map_waiting(&items, 3, |_, _| {
            let mut under_way = most.lock().unwrap();
            under_way.0 += 1;
            under_way.1 = under_way.1.max(under_way.0);
            drop(under_way);
            std::thread::yield_now();
            most.lock().unwrap().0 -= 1;
        });
        assert!((1..=3).contains(&most.lock().unwrap().1), "{:?} together", most.lock().unwrap());
    }

    #[test]
    fn a_shuffled_map_begins_in_another_order_and_ends_in_the_same() {
        let items: Vec<u64> = (0..500).collect();
        let begun = std::sync::Mutex::new(Vec::new());
        let mapped = Threads::shuffled(1, Seed(7)).unwrap().map(&items, |i, x| {
            begun.lock().unwrap().push(i);
            x * 3
        });
        assert_eq!(mapped, items.iter().map(|x| x * 3).collect::<Vec<u64>>());
        let begun = begun.into_inner().unwrap();
        let ordered = begun.windows(2).filter(|two| two[0] < two[1]).count();
        assert!((150..350).contains(&ordered), "{ordered} of 499 neighbours in order");
        assert_eq!(begun.iter().collect::<std::collections::BTreeSet<_>>().len(), 500, "each once");
    }
}
