//! Keeping a deadline, and how long steps took.

use std::time::{Duration, Instant};

use serde::Serialize;

/// How many times the longest iteration must still fit, with the pass that ends a regression, for another one to begin.
const RESERVE: f64 = 2.0;

/// The clock of a control loop.
#[derive(Debug)]
pub struct Deadline {
    limit: Option<Duration>,
    /// How long an iteration may take, going by the last samples.
    iteration: Duration,
    /// How long each sample took.
    taken: Vec<Duration>,
}

impl Deadline {
    /// `limit` for each sample; without one, steps are only timed.
    pub fn new(limit: Option<Duration>) -> Self {
        Self { limit, iteration: Duration::ZERO, taken: Vec::new() }
    }

    /// Calls `work` for one sample. What it gets says whether there is time for one more iteration.
    pub fn sample<T>(&mut self, work: impl FnOnce(&mut dyn FnMut() -> bool) -> T) -> T {
        let begun = Instant::now();
        // Whoever shares the processor may hold up one iteration for long: that is forgotten soon.
        let (mut longest, mut before) = (self.iteration / 2, None);
        let limit = self.limit;
        let mut go_on = || {
            let now = begun.elapsed();
            if let Some(before) = before.replace(now) {
                longest = longest.max(now - before);
            }
            limit.is_none_or(|limit| now + longest.mul_f64(RESERVE) <= limit)
        };
        let result = work(&mut go_on);
        self.iteration = longest;
        self.taken.push(begun.elapsed());
        result
    }

    /// Of the last sample.
    pub fn last(&self) -> Duration {
        self.taken.last().copied().unwrap_or_default()
    }

    /// Of all samples; none without any.
    pub fn latency(&self) -> Option<Latency> {
        let mut sorted = self.taken.clone();
        sorted.sort();
        let at = |share: f64| 1e3 * sorted[((sorted.len() - 1) as f64 * share).round() as usize].as_secs_f64();
        let missed = self.limit.map(|limit| self.taken.iter().filter(|taken| **taken > limit).count());
        (!sorted.is_empty()).then(|| Latency { median: at(0.5), p99: at(0.99), longest: at(1.0), missed })
    }
}

/// Milliseconds that samples took.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Latency {
    /// Half of them took less.
    pub median: f64,
    /// 99 of 100 took less.
    pub p99: f64,
    /// The slowest.
    pub longest: f64,
    /// How many took longer than allowed, if there is a deadline.
    pub missed: Option<usize>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn iterations_stop_in_time_whatever_was_asked_for() {
        let limit = Duration::from_millis(40);
        let mut deadline = Deadline::new(Some(limit));
        for _ in 0..3 {
            let done = deadline.sample(|go_on| {
                let mut done = 0;
                while done < 1000 && go_on() {
                    std::thread::sleep(Duration::from_millis(2));
                    done += 1;
                }
                done
            });
            assert!(done < 40, "{done}");
        }
        // One iteration that was held up does not end all others for good.
        deadline.iteration = Duration::from_secs(1);
        let work = |go_on: &mut dyn FnMut() -> bool| (0..3).filter(|_| go_on()).count();
        let done: Vec<usize> = (0..10).map(|_| deadline.sample(work)).collect();
        assert!(done[0] == 0 && done[9] == 3, "{done:?}");
        // Without a deadline nothing stops it, and nothing is missed.
        let mut free = Deadline::new(None);
        assert_eq!(free.sample(|go_on| (0..100).filter(|_| go_on()).count()), 100);
        assert_eq!(free.latency().unwrap().missed, None);
    }

    #[test]
    fn percentiles_and_misses_are_those_of_the_list() {
        let taken = (1..=101).map(Duration::from_millis).collect();
        let deadline = Deadline { limit: Some(Duration::from_millis(99)), iteration: Duration::ZERO, taken };
        let latency = deadline.latency().unwrap();
        assert_eq!(latency, Latency { median: 51.0, p99: 100.0, longest: 101.0, missed: Some(2) });
        assert_eq!(Deadline::new(None).latency(), None);
    }
}
