//! Pieces of work side by side on the cores of a machine: trainings, evaluations, simulated worlds.
//!
//! Each piece has all that it needs for itself, so that who does what changes the time and never a bit.

use std::num::NonZero;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;

/// What is left to do, and the idle cores.
#[derive(Debug)]
struct Desk {
    next: usize,
    free: usize,
    failed: bool,
}

/// Does the pieces 0 to `count` on at most `cores` threads (0: as many as the machine has cores) and gives their results in
/// order.
///
/// `work` is called with the number of a piece, and with the number of threads that it may use itself: the cores are shared
/// out among the pieces that wait, so that a single piece has them all. The next piece begins whenever one is done. After a
/// failure nothing further begins, and the first failure in order is returned: an interruption is a failure of the caller's
/// own kind. One core means one thread, the caller's.
///
/// # Errors
/// The work's own.
///
/// ```
/// use scrnn::jobs::side_by_side;
///
/// let squares = side_by_side(5, 2, |piece, _threads| Ok::<_, String>(piece * piece));
/// assert_eq!(squares, Ok(vec![0, 1, 4, 9, 16]));
/// ```
pub fn side_by_side<T: Send, E: Send>(
    count: usize,
    cores: usize,
    work: impl Fn(usize, usize) -> Result<T, E> + Sync,
) -> Result<Vec<T>, E> {
    let cores = match cores {
        0 => thread::available_parallelism().map_or(1, NonZero::get),
        given => given,
    };
    let desk = Mutex::new(Desk { next: 0, free: cores, failed: false });
    // Nothing panics while it holds the lock.
    let lock = || -> MutexGuard<'_, Desk> { desk.lock().unwrap_or_else(PoisonError::into_inner) };
    let take = || {
        let mut desk = lock();
        if desk.failed || desk.next >= count {
            return None;
        }
        let piece = desk.next;
        let threads = (desk.free / (count - piece)).max(1);
        desk.next += 1;
        desk.free = desk.free.saturating_sub(threads);
        Some((piece, threads))
    };
    let worker = || {
        let mut done = Vec::new();
        while let Some((piece, threads)) = take() {
            let result = work(piece, threads);
            let mut desk = lock();
            desk.free += threads;
            desk.failed |= result.is_err();
            drop(desk);
            done.push((piece, result));
        }
        done
    };
    let mut all: Vec<(usize, Result<T, E>)> = thread::scope(|scope| {
        // A thread that the system refuses is one that does not help: the others do its part.
        let helper = |_| thread::Builder::new().spawn_scoped(scope, worker).ok();
        let others: Vec<_> = (1..cores.min(count)).filter_map(helper).collect();
        let mut all = worker();
        for other in others {
            all.extend(other.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
        }
        all
    });
    all.sort_by_key(|(piece, _)| *piece);
    all.into_iter().map(|(_, result)| result).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;
    use std::sync::Barrier;
    use std::sync::atomic::{AtomicUsize, Ordering};

    #[test]
    fn results_come_in_order_and_so_do_failures() {
        let squares = side_by_side(20, 3, |piece, _| Ok::<_, usize>(piece * piece)).unwrap();
        assert_eq!(squares, (0..20).map(|piece| piece * piece).collect::<Vec<_>>());
        assert_eq!(side_by_side(20, 4, |piece, _| if piece % 7 == 5 { Err(piece) } else { Ok(()) }), Err(5));
        assert_eq!(side_by_side(0, 4, |_, _| Ok::<(), ()>(())), Ok(Vec::new()));
    }

    #[test]
    fn after_a_failure_nothing_further_begins() {
        let begun = AtomicUsize::new(0);
        let fails = |piece: usize, _| {
            begun.fetch_add(1, Ordering::Relaxed);
            if piece == 1 { Err("no") } else { Ok(piece) }
        };
        assert_eq!(side_by_side(9, 1, fails), Err("no"));
        assert_eq!(begun.into_inner(), 2);
    }

    #[test]
    fn the_cores_are_shared_out_among_the_pieces() {
        // All pieces of these begin before one ends.
        let threads = |count: usize, cores: usize| {
            let together = Barrier::new(count);
            let share = |_, threads| {
                together.wait();
                Ok::<_, ()>(threads)
            };
            side_by_side(count, cores, share).unwrap()
        };
        assert_eq!(threads(1, 2), [2]);
        assert_eq!(threads(2, 2), [1, 1]);
        assert_eq!(threads(3, 8).iter().sum::<usize>(), 8);
        // And here they have to wait for each other.
        assert_eq!(side_by_side(5, 2, |_, threads| Ok::<_, ()>(threads)).unwrap()[..3], [1, 1, 1]);
    }

    #[test]
    fn one_core_is_one_thread_the_callers_own() {
        let threads = |cores| {
            let seen = Mutex::new(HashSet::new());
            let together = Barrier::new(cores);
            let look = |_, threads| {
                together.wait();
                seen.lock().unwrap().insert(thread::current().id());
                Ok::<_, ()>(threads)
            };
            assert!(side_by_side(6, cores, look).unwrap().iter().all(|&threads| threads <= cores));
            seen.into_inner().unwrap()
        };
        assert_eq!(threads(1), HashSet::from([thread::current().id()]));
        assert_eq!(threads(2).len(), 2);
    }
}
