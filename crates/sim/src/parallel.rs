//! Worlds side by side: each piece of work has a world of its own, so threads change the time and never a bit.

use std::sync::atomic::{AtomicUsize, Ordering};

/// Does the pieces 0 to `count` on `threads` threads, and gives their results in order, or the first failure in order.
///
/// # Errors
/// The work's own.
pub fn in_parallel<T: Send, E: Send>(
    count: usize,
    threads: usize,
    work: impl Fn(usize) -> Result<T, E> + Sync,
) -> Result<Vec<T>, E> {
    let next = AtomicUsize::new(0);
    let take = || {
        let mut done = Vec::new();
        loop {
            let piece = next.fetch_add(1, Ordering::Relaxed);
            if piece >= count {
                return done;
            }
            done.push((piece, work(piece)));
        }
    };
    let mut all: Vec<(usize, Result<T, E>)> = std::thread::scope(|scope| {
        let running: Vec<_> = (0..threads.clamp(1, count.max(1))).map(|_| scope.spawn(take)).collect();
        let finished =
            running.into_iter().map(|one| one.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
        finished.flatten().collect()
    });
    all.sort_by_key(|(piece, _)| *piece);
    all.into_iter().map(|(_, result)| result).collect()
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
}
