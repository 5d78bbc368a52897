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
    taken: Durations,
    last: Duration,
    missed: usize,
}

impl Deadline {
    /// `limit` for each sample; without one, steps are only timed.
    pub fn new(limit: Option<Duration>) -> Self {
        Self { limit, iteration: Duration::ZERO, taken: Durations::default(), last: Duration::ZERO, missed: 0 }
    }

    /// Calls `work` for one sample. What it gets says whether there is time for one more iteration.
    pub fn sample<T>(&mut self, work: impl FnOnce(&mut dyn FnMut() -> bool) -> T) -> T {
        let begun = Instant::now();
        self.sample_by(&|| begun.elapsed(), work)
    }

    /// As [`Deadline::sample`], by a clock that counts from the sample's arrival.
    fn sample_by<T>(&mut self, clock: &dyn Fn() -> Duration, work: impl FnOnce(&mut dyn FnMut() -> bool) -> T) -> T {
        // Whoever shares the processor may hold up one iteration for long: that is forgotten soon.
        let (mut longest, mut before) = (self.iteration / 2, None);
        let limit = self.limit;
        let mut go_on = || {
            let now = clock();
            if let Some(before) = before.replace(now) {
                longest = longest.max(now - before);
            }
            limit.is_none_or(|limit| now + longest.mul_f64(RESERVE) <= limit)
        };
        let result = work(&mut go_on);
        self.iteration = longest;
        self.took(clock());
        result
    }

    fn took(&mut self, taken: Duration) {
        self.last = taken;
        self.missed += usize::from(self.limit.is_some_and(|limit| taken > limit));
        self.taken.add(taken);
    }

    /// Of the last sample.
    pub fn last(&self) -> Duration {
        self.last
    }

    /// Of all samples; none without any.
    pub fn latency(&self) -> Option<Latency> {
        let milliseconds = |taken: Duration| 1e3 * taken.as_secs_f64();
        let [median, p99] = [0.5, 0.99].map(|share| milliseconds(self.taken.at(share)));
        let [shortest, longest] = [self.taken.shortest, self.taken.longest].map(milliseconds);
        let missed = self.limit.map(|_| self.missed);
        (self.taken.count > 0).then_some(Latency { median, p99, shortest, longest, missed })
    }
}

/// Durations of any number in a fixed size: how many fell between bounds that lie 1/32 apart.
#[derive(Debug)]
struct Durations {
    counts: Box<[u64; BUCKETS]>,
    count: u64,
    shortest: Duration,
    longest: Duration,
}

/// Parts of each doubling, as a power of two.
const PARTS: u32 = 5;
/// Enough for 2^64 - 1 nanoseconds.
const BUCKETS: usize = (65 - PARTS as usize) << PARTS;

impl Default for Durations {
    fn default() -> Self {
        let counts = Box::new([0; BUCKETS]);
        Self { counts, count: 0, shortest: Duration::MAX, longest: Duration::ZERO }
    }
}

impl Durations {
    fn add(&mut self, taken: Duration) {
        self.counts[bucket(u64::try_from(taken.as_nanos()).unwrap_or(u64::MAX))] += 1;
        self.count += 1;
        self.shortest = self.shortest.min(taken);
        self.longest = self.longest.max(taken);
    }

    /// What `share` of them did not exceed, up to 1/32 too long and never beyond the longest.
    fn at(&self, share: f64) -> Duration {
        let rank = (self.count.saturating_sub(1) as f64 * share).round() as u64;
        let mut seen = 0;
        let whose = self.counts.iter().position(|count| {
            seen += count;
            seen > rank
        });
        let longest = whose.map_or(self.longest, |bucket| Duration::from_nanos(last_of(bucket)));
        longest.max(self.shortest).min(self.longest)
    }
}

/// Where so many nanoseconds are counted.
fn bucket(nanoseconds: u64) -> usize {
    let doubling = nanoseconds.checked_ilog2().unwrap_or(0);
    if doubling < PARTS {
        return nanoseconds as usize;
    }
    let part = (nanoseconds >> (doubling - PARTS)) as usize & ((1 << PARTS) - 1);
    ((doubling - PARTS + 1) as usize) << PARTS | part
}

/// The largest number of nanoseconds that is counted there.
fn last_of(bucket: usize) -> u64 {
    let (doubling, part) = (bucket >> PARTS, (bucket & ((1 << PARTS) - 1)) as u64);
    match doubling.checked_sub(1) {
        None => part,
        Some(shift) => ((1_u64 << PARTS | part) << shift) + ((1_u64 << shift) - 1),
    }
}

/// Milliseconds that samples took.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Latency {
    /// Half of them took less; to 1/32.
    pub median: f64,
    /// 99 of 100 took less; to 1/32.
    pub p99: f64,
    /// The quickest, exactly.
    pub shortest: f64,
    /// The slowest, exactly.
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
    fn no_sample_is_late_where_iterations_take_what_they_took_before() {
        let limit = Duration::from_millis(40);
        let mut deadline = Deadline::new(Some(limit));
        for _ in 0..100 {
            let now = std::cell::Cell::new(Duration::from_millis(1));
            let iterations = deadline.sample_by(&|| now.get(), |go_on| {
                let mut iterations = 0;
                while go_on() {
                    now.set(now.get() + Duration::from_millis(2));
                    iterations += 1;
                }
                // The pass that ends a regression.
                now.set(now.get() + Duration::from_millis(2));
                iterations
            });
            // It begins the last one while twice its time is left, and no sooner stops.
            assert_eq!((iterations, deadline.last()), (18, Duration::from_millis(39)));
        }
        assert_eq!(deadline.latency().unwrap().missed, Some(0));
    }

    #[test]
    fn percentiles_are_those_of_the_list_to_a_part_in_32_and_counts_are_exact() {
        let mut deadline = Deadline::new(Some(Duration::from_millis(99)));
        (1..=101).map(Duration::from_millis).for_each(|taken| deadline.took(taken));
        let latency = deadline.latency().unwrap();
        assert_eq!((latency.shortest, latency.longest, latency.missed), (1.0, 101.0, Some(2)));
        let near = |found: f64, exact: f64| (exact..=exact * (1.0 + 1.0 / 32.0)).contains(&found);
        assert!(near(latency.median, 51.0) && near(latency.p99, 100.0), "{latency:?}");
        assert_eq!(Deadline::new(None).latency(), None);
    }

    #[test]
    fn every_duration_has_a_place_and_places_are_in_order() {
        let mut before = 0;
        for shift in 0..64 {
            for nanoseconds in [1_u64 << shift, (1 << shift) + (1 << shift) / 2, u64::MAX >> (63 - shift)] {
                let place = bucket(nanoseconds);
                assert!(place >= before && place < BUCKETS && last_of(place) >= nanoseconds, "{nanoseconds}");
                assert!(last_of(place) - nanoseconds <= nanoseconds / 32, "{nanoseconds}");
                before = place;
            }
        }
        assert_eq!((bucket(0), last_of(BUCKETS - 1)), (0, u64::MAX));
    }
}
