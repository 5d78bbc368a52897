//! Seeds side by side on the cores. Threads change the time a seed takes, never its bits.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use scrnn_run::failure::Result;

/// How many seeds run at a time, and with how many threads each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Wave {
    /// Seeds.
    pub seeds: usize,
    /// Threads for each of them.
    pub threads: usize,
}

/// One seed for each core while there are enough of them; the last ones share the cores.
pub fn waves(mut seeds: usize, cores: usize) -> Vec<Wave> {
    let mut waves = Vec::new();
    while seeds > 0 {
        let now = seeds.min(cores.max(1));
        waves.push(Wave { seeds: now, threads: (cores / now).max(1) });
        seeds -= now;
    }
    waves
}

/// Calls `work` with each seed and its number of threads; results come in the order of the seeds. `None` says that the
/// work was interrupted, and no further wave begins.
pub fn side_by_side<T: Send>(
    seeds: &[u64],
    cores: usize,
    work: impl Fn(u64, usize) -> Result<Option<T>> + Sync,
) -> Result<Option<Vec<T>>> {
    let mut results = Vec::with_capacity(seeds.len());
    let mut rest = seeds;
    for wave in waves(seeds.len(), cores) {
        let (now, later) = rest.split_at(wave.seeds);
        rest = later;
        let done: Vec<Result<Option<T>>> = std::thread::scope(|scope| {
            let work = &work;
            let running: Vec<_> = now.iter().map(|&seed| scope.spawn(move || work(seed, wave.threads))).collect();
            running
                .into_iter()
                .map(|thread| thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
                .collect()
        });
        for result in done {
            match result? {
                Some(result) => results.push(result),
                None => return Ok(None),
            }
        }
    }
    Ok(Some(results))
}

/// Calls `work` with each number below `count`, one at a time on each core, the next one whenever a core comes free; results
/// come in the order of the numbers. `None` says that the work was interrupted, and nothing further begins; nor does it
/// after a failure.
pub fn one_by_one<T: Send>(
    count: usize,
    cores: usize,
    work: impl Fn(usize) -> Result<Option<T>> + Sync,
) -> Result<Option<Vec<T>>> {
    let (next, over) = (AtomicUsize::new(0), AtomicBool::new(false));
    let mut done: Vec<(usize, Result<Option<T>>)> = std::thread::scope(|scope| {
        let (work, next, over) = (&work, &next, &over);
        let worker = move || {
            let mut own = Vec::new();
            loop {
                let number = next.fetch_add(1, Ordering::Relaxed);
                if number >= count || over.load(Ordering::Relaxed) {
                    return own;
                }
                let result = work(number);
                if !matches!(result, Ok(Some(_))) {
                    over.store(true, Ordering::Relaxed);
                }
                own.push((number, result));
            }
        };
        let running: Vec<_> = (0..cores.clamp(1, count.max(1))).map(|_| scope.spawn(worker)).collect();
        let join = |thread: std::thread::ScopedJoinHandle<'_, _>| thread.join();
        running
            .into_iter()
            .flat_map(|thread| join(thread).unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
            .collect()
    });
    done.sort_by_key(|(number, _)| *number);
    let results: Result<Vec<Option<T>>> = done.into_iter().map(|(_, result)| result).collect();
    let results: Option<Vec<T>> = results?.into_iter().collect();
    Ok(results.filter(|results| results.len() == count))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cores_are_shared_out_among_the_seeds() {
        let shape = |seeds, cores| waves(seeds, cores).iter().map(|w| (w.seeds, w.threads)).collect::<Vec<_>>();
        assert_eq!(shape(1, 2), [(1, 2)]);
        assert_eq!(shape(5, 2), [(2, 1), (2, 1), (1, 2)]);
        assert_eq!(shape(3, 8), [(3, 2)]);
        assert_eq!(shape(2, 1), [(1, 1), (1, 1)]);
    }

    #[test]
    fn results_come_in_order_and_an_interruption_ends_all() {
        let twice = |seed: u64, _| Ok(Some(2 * seed));
        assert_eq!(side_by_side(&[3, 1, 2], 2, twice).unwrap(), Some(vec![6, 2, 4]));
        let stop = |seed: u64, _| Ok(Some(seed).filter(|&seed| seed != 1));
        assert_eq!(side_by_side(&[3, 1, 2], 2, stop).unwrap(), None);
    }

    #[test]
    fn free_cores_take_what_is_next_and_a_failure_ends_all() {
        let square = |number: usize| Ok(Some(number * number));
        assert_eq!(one_by_one(5, 2, square).unwrap(), Some(vec![0, 1, 4, 9, 16]));
        assert_eq!(one_by_one(0, 3, square).unwrap(), Some(vec![]));
        assert_eq!(one_by_one(4, 1, |number| Ok(Some(number).filter(|&number| number != 2))).unwrap(), None);
        let begun = AtomicUsize::new(0);
        let fails = |number: usize| {
            begun.fetch_add(1, Ordering::Relaxed);
            if number == 1 { Err(scrnn_run::failure::Failure::input("no", "")) } else { Ok(Some(number)) }
        };
        assert!(one_by_one(9, 1, fails).is_err());
        assert_eq!(begun.into_inner(), 2);
    }
}
