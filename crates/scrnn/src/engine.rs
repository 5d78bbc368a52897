//! The machine that the calculus runs on: an instruction set, and threads.
//!
//! This is the only place that names rayon. Work comes as a list of independent items whose results are written into
//! the items themselves, so nothing depends on who did what: any number of threads gives the same bits.

use std::fmt;
use std::str::FromStr;
#[cfg(feature = "rayon")]
use std::sync::Arc;

use pulp::{Simd, WithSimd};
#[cfg(feature = "rayon")]
use rayon::prelude::*;

use crate::error::{Error, Result};

/// A set of vector instructions, chosen when the program runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InstructionSet {
    /// x86-64 with AVX-512 (F, DQ, BW, VL, CD): eight f64 at a time.
    Avx512,
    /// x86-64 with AVX2 and FMA: four f64 at a time.
    Avx2,
    /// aarch64: two f64 at a time.
    Neon,
    /// No particular instructions: correct anywhere, and slow, because fused multiply-adds are emulated.
    Portable,
}

/// Runs SIMD code.
pub(crate) trait Run {
    /// Runs `work` compiled for the instruction set.
    fn run<W: WithSimd>(&self, work: W) -> W::Output;
}

impl InstructionSet {
    const ALL: [Self; 4] = [Self::Avx512, Self::Avx2, Self::Neon, Self::Portable];

    /// Those that this processor has, fastest first; never empty.
    #[must_use]
    pub fn available() -> Vec<Self> {
        Self::ALL.into_iter().filter(|set| set.is_available()).collect()
    }

    /// The fastest that this processor has.
    #[must_use]
    pub fn best() -> Self {
        Self::available()[0]
    }

    fn not_available(name: &str) -> Error {
        let names: Vec<_> = Self::available().iter().map(ToString::to_string).collect();
        Error::InstructionSet(name.to_owned(), names.join(", "))
    }

    fn is_available(self) -> bool {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => pulp::x86::V4::is_available(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => pulp::x86::V3::is_available(),
            #[cfg(target_arch = "aarch64")]
            Self::Neon => pulp::aarch64::Neon::is_available(),
            Self::Portable => true,
            #[allow(unreachable_patterns, reason = "which sets are left over depends on the target")]
            _ => false,
        }
    }
}

impl Run for InstructionSet {
    #[inline]
    fn run<W: WithSimd>(&self, work: W) -> W::Output {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 if let Some(simd) = pulp::x86::V4::try_new() => Simd::vectorize(simd, work),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 if let Some(simd) = pulp::x86::V3::try_new() => Simd::vectorize(simd, work),
            #[cfg(target_arch = "aarch64")]
            Self::Neon if let Some(simd) = pulp::aarch64::Neon::try_new() => Simd::vectorize(simd, work),
            _ => Simd::vectorize(pulp::Scalar512b, work),
        }
    }
}

impl fmt::Display for InstructionSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Avx512 => "avx512",
            Self::Avx2 => "avx2",
            Self::Neon => "neon",
            Self::Portable => "portable",
        })
    }
}

impl FromStr for InstructionSet {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        let mut available = Self::available().into_iter();
        available.find(|set| set.to_string() == name).ok_or_else(|| Self::not_available(name))
    }
}

/// An instruction set and a number of threads; clones share the threads.
#[derive(Debug, Clone)]
pub struct Engine {
    instruction_set: InstructionSet,
    #[cfg(feature = "rayon")]
    pool: Option<Arc<rayon::ThreadPool>>,
}

impl Engine {
    /// Starts `threads` threads; 0 takes one for each core, 1 starts none. Without the feature `rayon` none are started.
    ///
    /// # Errors
    /// [`Error::InstructionSet`] for one that this processor lacks, [`Error::Setting`] if threads cannot be started.
    pub fn new(threads: usize, instruction_set: InstructionSet) -> Result<Self> {
        if !instruction_set.is_available() {
            return Err(InstructionSet::not_available(&instruction_set.to_string()));
        }
        let threads = match threads {
            0 => std::thread::available_parallelism().map_or(1, usize::from),
            given => given,
        };
        Self::start(threads, instruction_set)
    }

    #[cfg(feature = "rayon")]
    fn start(threads: usize, instruction_set: InstructionSet) -> Result<Self> {
        if threads == 1 {
            return Ok(Self { instruction_set, pool: None });
        }
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let pool = pool.map_err(|_| Error::Setting {
            what: "number of threads",
            found: threads.to_string(),
            needed: "a number that the system can start",
        })?;
        Ok(Self { instruction_set, pool: Some(Arc::new(pool)) })
    }

    /// Without the feature `rayon` there is one thread, whatever is asked for.
    #[cfg(not(feature = "rayon"))]
    fn start(_threads: usize, instruction_set: InstructionSet) -> Result<Self> {
        Ok(Self { instruction_set })
    }

    /// Works in threads that the caller already has.
    ///
    /// # Errors
    /// [`Error::InstructionSet`] for one that this processor lacks.
    #[cfg(feature = "rayon")]
    pub fn with_pool(pool: Arc<rayon::ThreadPool>, instruction_set: InstructionSet) -> Result<Self> {
        if !instruction_set.is_available() {
            return Err(InstructionSet::not_available(&instruction_set.to_string()));
        }
        Ok(Self { instruction_set, pool: Some(pool) })
    }

    /// One thread, the best instruction set.
    #[must_use]
    pub fn serial() -> Self {
        Self {
            instruction_set: InstructionSet::best(),
            #[cfg(feature = "rayon")]
            pool: None,
        }
    }

    /// The instruction set in use.
    #[must_use]
    pub fn instruction_set(&self) -> InstructionSet {
        self.instruction_set
    }

    /// The number of threads.
    #[must_use]
    pub fn threads(&self) -> usize {
        #[cfg(feature = "rayon")]
        return self.pool.as_ref().map_or(1, |pool| pool.current_num_threads());
        #[cfg(not(feature = "rayon"))]
        return 1;
    }

    /// Runs `work` on one of the threads, and what it shares out later is shared out from there. A training should be run so: a caller
    /// that stays outside sleeps while each evaluation wakes the threads anew, and is asked to wait for them each time. No bit
    /// depends on it.
    pub fn enter<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        #[cfg(feature = "rayon")]
        if let Some(pool) = &self.pool {
            return pool.install(work);
        }
        work()
    }

    /// Calls `work` on every item, on any thread. Each item must carry its own result.
    pub(crate) fn for_each<T: Send>(&self, items: &mut [T], work: impl Fn(&mut T) + Sync + Send) {
        #[cfg(feature = "rayon")]
        if let Some(pool) = self.pool.as_ref().filter(|_| items.len() > 1) {
            return pool.install(|| items.par_iter_mut().with_max_len(1).for_each(work));
        }
        items.iter_mut().for_each(work);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_read_back_and_unknown_ones_list_what_there_is() {
        for set in InstructionSet::available() {
            assert_eq!(set.to_string().parse::<InstructionSet>().unwrap(), set);
        }
        let message = "mmx".parse::<InstructionSet>().unwrap_err().to_string();
        assert!(message.contains("mmx") && message.contains("portable"), "{message}");
    }

    #[cfg(feature = "rayon")]
    #[test]
    fn threads_that_the_caller_has_are_taken_as_they_are() {
        let pool = Arc::new(rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap());
        let engine = Engine::with_pool(Arc::clone(&pool), InstructionSet::best()).unwrap();
        assert_eq!(engine.threads(), 3);
        let mut found = vec![None; 50];
        engine.for_each(&mut found, |index| *index = pool.current_thread_index());
        assert!(found.iter().all(|index| index.is_some_and(|index| index < 3)), "{found:?}");
    }

    #[cfg(feature = "rayon")]
    #[test]
    fn whoever_has_entered_is_one_of_the_threads() {
        use std::collections::HashSet;
        use std::thread::{ThreadId, current};

        let engine = Engine::new(3, InstructionSet::best()).unwrap();
        let outside = current().id();
        let (inside, met) = engine.enter(|| {
            let mut met: Vec<Option<ThreadId>> = vec![None; 60];
            engine.for_each(&mut met, |id| *id = Some(current().id()));
            (current().id(), met)
        });
        let ids: HashSet<ThreadId> = met.into_iter().flatten().collect();
        assert!(inside != outside && !ids.contains(&outside) && ids.len() <= 3, "{ids:?}");
        // Once more from within, and where there is but one thread.
        assert_eq!(engine.enter(|| engine.enter(|| 7)), 7);
        assert_eq!(Engine::serial().enter(|| current().id()), outside);
    }

    #[test]
    fn every_item_is_worked_on_once() {
        for threads in [1, 2, 5] {
            let engine = Engine::new(threads, InstructionSet::best()).unwrap();
            let mut items: Vec<u32> = (0..100).collect();
            engine.for_each(&mut items, |item| *item += 1);
            assert_eq!(items, (1..101).collect::<Vec<_>>());
        }
    }
}
