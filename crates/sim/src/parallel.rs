//! Worlds side by side: each piece of work has a world of its own, so threads change the time and never a bit.

use std::sync::atomic::{AtomicUsize, Ordering};

/// Does the pieces 0 to `count` on `threads` threads, and gives their results in order, or the failure of the first piece
/// that failed. Pieces after one that has failed are not begun, so that work can be ended from within.
///
/// # Errors
/// The work's own.
pub fn in_parallel<T: Send, E: Send>(
    count: usize,
    threads: usize,
    work: impl Fn(usize) -> Result<T, E> + Sync,
) -> Result<Vec<T>, E> {
    let failed = AtomicUsize::new(usize::MAX);
    let mut pieces: Vec<(usize, Option<Result<T, E>>)> = (0..count).map(|piece| (piece, None)).collect();
    for_each(threads, &mut pieces, |(piece, result)| {
        // All pieces before the first failure are done in any case: which failure is given does not depend on threads.
        if *piece < failed.load(Ordering::Relaxed) {
            let done = work(*piece);
            if done.is_err() {
                failed.fetch_min(*piece, Ordering::Relaxed);
            }
            *result = Some(done);
        }
    });
    pieces.into_iter().filter_map(|(_, result)| result).collect()
}

/// Calls `work` on every item. This is the one place that starts threads here.
fn for_each<T: Send>(threads: usize, items: &mut [T], work: impl Fn(&mut T) + Sync) {
    let threads = threads.min(items.len());
    if threads <= 1 {
        return items.iter_mut().for_each(work);
    }
    let waiting = std::sync::Mutex::new(items.iter_mut());
    let next = || waiting.lock().unwrap_or_else(std::sync::PoisonError::into_inner).next();
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                while let Some(item) = next() {
                    work(item);
                }
            });
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_come_in_order_and_so_do_failures() {
        let squares = in_parallel(20, 3, |piece| Ok::<_, usize>(piece * piece)).unwrap();
        assert_eq!(squares, (0..20).map(|piece| piece * piece).collect::<Vec<_>>());
        assert_eq!(in_parallel(20, 4, |piece| if piece % 7 == 5 { Err(piece) } else { Ok(()) }), Err(5));
        assert_eq!(in_parallel(0, 4, |_| Ok::<(), ()>(())), Ok(Vec::new()));
    }

    #[test]
    fn a_failure_keeps_later_pieces_from_being_begun() {
        let begun = AtomicUsize::new(0);
        let work = |piece| {
            begun.fetch_add(1, Ordering::Relaxed);
            if piece == 1 { Err(piece) } else { Ok(()) }
        };
        assert_eq!(in_parallel(1000, 1, work), Err(1));
        assert_eq!(begun.load(Ordering::Relaxed), 2);
    }
}
