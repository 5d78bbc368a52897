//! Blocks, and their finished segments on the way to the gradient of the weights: who works on what.
//!
//! The recurrence of a block cannot be shared out, but the gradient of the weights can follow it on another thread: it needs
//! the states and a segment's deltas, which nobody changes any more. Where there are more threads than blocks, a block hands
//! over each segment and goes on with the next in other memory. A block's segments are taken up one after the other, in the
//! order in which they were handed over, so the bits are those of one thread. Nobody waits for a thread that may never
//! come: a block that finds no free memory takes up a segment itself.

use std::collections::VecDeque;
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError, RwLock, RwLockReadGuard};

use aligned_vec::AVec;

use crate::kernels::element::Element;

/// Memory for deltas that each block has above that of its record.
const SPARE: usize = 2;
/// How often a thread looks for something to do before it falls asleep: some 0.2 ms, a segment or two. It takes as long to wake.
const LOOKS: usize = 4000;

/// A segment whose deltas are complete.
#[derive(Debug)]
pub(super) struct Segment<E> {
    /// Its products, and the start of their span.
    pub products: Range<usize>,
    pub span_start: usize,
    pub deltas: AVec<E>,
}

/// What a block and its helpers share.
#[derive(Debug)]
struct Slot<E> {
    states: RwLock<AVec<E>>,
    total: Mutex<Total<E>>,
}

/// The gradient of a block.
#[derive(Debug)]
pub(super) struct Total<E> {
    pub sum: AVec<f64>,
    /// That of one segment, where it is not float64.
    segment: AVec<E>,
}

impl<E: Element> Total<E> {
    /// Makes room.
    pub fn resize(&mut self, len: usize) {
        self.sum.resize(len, 0.0);
        if E::own(&mut self.sum).is_none() {
            self.segment.resize(len, E::ZERO);
        }
    }

    /// Adds what `gather` adds to a gradient.
    pub fn add(&mut self, gather: impl FnOnce(&mut [E])) {
        let Self { sum, segment } = self;
        if let Some(sum) = E::own(sum) {
            return gather(sum);
        }
        segment.fill(E::ZERO);
        gather(segment);
        sum.iter_mut().zip(segment.iter()).for_each(|(sum, own)| *sum += own.to_f64());
    }
}

/// Segments of a block.
#[derive(Debug)]
struct Queue<E> {
    waiting: VecDeque<Segment<E>>,
    free: Vec<AVec<E>>,
    /// Whether somebody works on one.
    busy: bool,
}

impl<E> Queue<E> {
    /// The next segment, unless the one before it is still worked on.
    fn take(&mut self) -> Option<Segment<E>> {
        let next = if self.busy { None } else { self.waiting.pop_front() };
        self.busy |= next.is_some();
        next
    }
}

#[derive(Debug)]
struct State<E> {
    /// The next block that nobody has begun, and how many there are.
    next: usize,
    blocks: usize,
    /// Blocks that are not done.
    open: usize,
    queues: Vec<Queue<E>>,
}

/// Blocks to work on and segments to take up.
#[derive(Debug)]
pub(super) struct Relay<E> {
    state: Mutex<State<E>>,
    changed: Condvar,
    /// Counts changes of the state that somebody may wait for.
    changes: AtomicUsize,
    slots: Vec<Slot<E>>,
    /// Whether segments are handed over.
    follows: bool,
}

/// Takes a segment of a block up into its gradient: block, segment, states, gradient.
pub(super) trait Gather<E>: Fn(usize, &Segment<E>, &[E], &mut Total<E>) {}
impl<E, F: Fn(usize, &Segment<E>, &[E], &mut Total<E>)> Gather<E> for F {}

impl<E: Element> Relay<E> {
    pub fn new() -> Self {
        let state = State { next: 0, blocks: 0, open: 0, queues: Vec::new() };
        let (changed, changes) = (Condvar::new(), AtomicUsize::new(0));
        Self { state: Mutex::new(state), changed, changes, slots: Vec::new(), follows: false }
    }

    /// Gets ready for `blocks` blocks. With `deltas`, the values that the largest of them needs, segments are handed over. (Memory goes
    /// round between blocks and records: all of it is as large.)
    pub fn prepare(&mut self, blocks: usize, deltas: Option<usize>) {
        let state = self.state.get_mut().unwrap_or_else(PoisonError::into_inner);
        (state.next, state.blocks, state.open) = (0, blocks, blocks);
        self.follows = deltas.is_some();
        while self.slots.len() < blocks {
            let total = Total { sum: AVec::new(64), segment: AVec::new(64) };
            self.slots.push(Slot { states: RwLock::new(AVec::new(64)), total: Mutex::new(total) });
            state.queues.push(Queue { waiting: VecDeque::with_capacity(SPARE), free: Vec::new(), busy: false });
        }
        let Some(deltas) = deltas else { return };
        for queue in state.queues.iter_mut().take(blocks) {
            queue.free.resize_with(SPARE, || AVec::new(64));
            for free in queue.free.iter_mut().filter(|free| free.len() < deltas) {
                free.reserve_exact(deltas - free.len());
                free.resize(deltas, E::ZERO);
            }
        }
    }

    /// The gradient of a block.
    pub fn total(&mut self, block: usize) -> &mut Total<E> {
        self.slots[block].total.get_mut().unwrap_or_else(PoisonError::into_inner)
    }

    /// Starts the gradient of a block at 0.
    pub fn clear(&self, block: usize) {
        self.slots[block].total.lock().unwrap_or_else(PoisonError::into_inner).sum.fill(0.0);
    }

    fn lock(&self) -> MutexGuard<'_, State<E>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for a change.
    fn wait<'a>(&'a self, state: MutexGuard<'a, State<E>>) -> MutexGuard<'a, State<E>> {
        // Changes are counted by whoever holds the state: none is missed between a look and sleep.
        let seen = self.changes.load(Ordering::Acquire);
        drop(state);
        for _ in 0..LOOKS {
            if self.changes.load(Ordering::Acquire) != seen {
                return self.lock();
            }
            std::hint::spin_loop();
        }
        let state = self.lock();
        if self.changes.load(Ordering::Acquire) != seen {
            return state;
        }
        self.changed.wait(state).unwrap_or_else(PoisonError::into_inner)
    }

    /// Says that the state, which the caller holds, is another now.
    fn tell(&self, _: &mut State<E>) {
        self.changes.fetch_add(1, Ordering::Release);
        self.changed.notify_all();
    }

    /// What each thread does: blocks that nobody has begun, then segments of those that are not done, until there are none.
    pub fn work(&self, run: impl Fn(usize), gather: impl Gather<E>) {
        let mut state = self.lock();
        loop {
            if state.next < state.blocks {
                state.next += 1;
                let block = state.next - 1;
                drop(state);
                let open = Open(self);
                run(block);
                drop(open);
                state = self.lock();
                continue;
            }
            let blocks = state.blocks;
            let mut queues = state.queues.iter_mut().take(blocks).enumerate();
            if let Some((block, segment)) = queues.find_map(|(block, queue)| Some((block, queue.take()?))) {
                drop(state);
                state = self.take_up(block, segment, &gather);
            } else if state.open == 0 {
                return;
            } else {
                state = self.wait(state);
            }
        }
    }

    /// Takes a segment up, and frees its memory.
    fn take_up(&self, block: usize, segment: Segment<E>, gather: &impl Gather<E>) -> MutexGuard<'_, State<E>> {
        let taken = Taken { relay: self, block, segment };
        {
            let mut total = self.slots[block].total.lock().unwrap_or_else(PoisonError::into_inner);
            gather(block, &taken.segment, &self.states(block), &mut total);
        }
        drop(taken);
        self.lock()
    }

    /// Wakes those that are to follow, before there is something to follow.
    pub fn rouse(&self) {
        if self.follows {
            self.tell(&mut self.lock());
        }
    }

    /// Exchanges the states that a block shares with those of its record: lends them, or takes them back.
    pub fn exchange(&self, block: usize, states: &mut AVec<E>) {
        let mut shared = self.slots[block].states.write().unwrap_or_else(PoisonError::into_inner);
        std::mem::swap(&mut *shared, states);
    }

    /// The states that a block shares.
    pub fn states(&self, block: usize) -> RwLockReadGuard<'_, AVec<E>> {
        self.slots[block].states.read().unwrap_or_else(PoisonError::into_inner)
    }

    /// Hands a segment over, or takes it up at once. The first `row` values of its deltas, which the segment before it goes on from,
    /// are put at `next` of the deltas that are there afterwards.
    pub fn hand_over(
        &self,
        block: usize,
        products: Range<usize>,
        span_start: usize,
        deltas: &mut AVec<E>,
        (row, next): (usize, usize),
        gather: &impl Gather<E>,
    ) {
        if !self.follows {
            let own = std::mem::replace(deltas, AVec::new(64));
            let segment = Segment { products, span_start, deltas: own };
            let mut total = self.slots[block].total.lock().unwrap_or_else(PoisonError::into_inner);
            gather(block, &segment, &self.states(block), &mut total);
            *deltas = segment.deltas;
            deltas.copy_within(..row, next);
            return;
        }
        let mut state = self.lock();
        let mut free = loop {
            if let Some(free) = state.queues[block].free.pop() {
                break free;
            }
            state = self.help(block, state, gather);
        };
        drop(state);
        free[next..next + row].copy_from_slice(&deltas[..row]);
        std::mem::swap(deltas, &mut free);
        let mut state = self.lock();
        state.queues[block].waiting.push_back(Segment { products, span_start, deltas: free });
        self.tell(&mut state);
    }

    /// Takes up a segment of the block's own, or waits for whoever does.
    fn help<'a>(
        &'a self,
        block: usize,
        mut state: MutexGuard<'a, State<E>>,
        gather: &impl Gather<E>,
    ) -> MutexGuard<'a, State<E>> {
        match state.queues[block].take() {
            Some(segment) => {
                drop(state);
                self.take_up(block, segment, gather)
            }
            None => self.wait(state),
        }
    }

    /// Comes back when all segments of a block are taken up.
    pub fn finish(&self, block: usize, gather: &impl Gather<E>) {
        let mut state = self.lock();
        while state.queues[block].busy || !state.queues[block].waiting.is_empty() {
            state = self.help(block, state, gather);
        }
    }
}

/// A block in work: whatever happens to it, nobody waits for it for ever.
struct Open<'a, E: Element>(&'a Relay<E>);

impl<E: Element> Drop for Open<'_, E> {
    fn drop(&mut self) {
        let mut state = self.0.lock();
        state.open -= 1;
        self.0.tell(&mut state);
    }
}

/// A segment that somebody works on: whatever happens to it, its block does not wait for it for ever.
struct Taken<'a, E: Element> {
    relay: &'a Relay<E>,
    block: usize,
    segment: Segment<E>,
}

impl<E: Element> Drop for Taken<'_, E> {
    fn drop(&mut self) {
        let deltas = std::mem::replace(&mut self.segment.deltas, AVec::new(64));
        let mut state = self.relay.lock();
        let queue = &mut state.queues[self.block];
        queue.free.push(deltas);
        queue.busy = false;
        self.relay.tell(&mut state);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::{Engine, InstructionSet};

    /// Blocks that hand over segments of one value, which the gradient takes up as 10 times what it was plus the value.
    fn gradients(threads: usize, follows: bool) -> Vec<f64> {
        let blocks = 3;
        let mut relay = Relay::<f64>::new();
        for _ in 0..2 {
            relay.prepare(blocks, follows.then_some(3));
            (0..blocks).for_each(|block| relay.total(block).resize(1));
            (0..blocks).for_each(|block| relay.total(block).sum[0] = 0.0);
            let gather = |block: usize, segment: &Segment<f64>, states: &[f64], total: &mut Total<f64>| {
                assert_eq!(states[0], block as f64);
                total.add(|gradient| gradient[0] = 10.0 * gradient[0] + segment.deltas[0]);
            };
            let run = |block: usize| {
                let mut states = AVec::from_iter(64, [block as f64]);
                let mut deltas = AVec::from_iter(64, [0.0; 3]);
                relay.exchange(block, &mut states);
                for k in 0..8 {
                    // What was handed over before is where the next segment ends.
                    assert!(k == 0 || deltas[2] == f64::from(k - 1));
                    deltas[0] = f64::from(k);
                    relay.hand_over(block, 0..1, 0, &mut deltas, (1, 2), &gather);
                }
                relay.finish(block, &gather);
                relay.exchange(block, &mut states);
                assert_eq!(states[0], block as f64);
            };
            let engine = Engine::new(threads, InstructionSet::best()).unwrap();
            engine.for_each(&mut vec![(); threads], |()| relay.work(run, gather));
        }
        (0..blocks).map(|block| relay.total(block).sum[0]).collect()
    }

    #[test]
    fn segments_are_taken_up_in_order_by_any_number_of_threads() {
        for threads in [1, 2, 3, 4, 6, 9] {
            for follows in [false, true] {
                assert_eq!(gradients(threads, follows), [1_234_567.0; 3], "{threads} threads");
            }
        }
    }

    #[cfg(feature = "rayon")]
    #[test]
    fn a_panic_in_a_follower_ends_the_evaluation_and_does_not_hang_it() {
        let mut relay = Relay::<f64>::new();
        relay.prepare(1, Some(1));
        relay.total(0).resize(1);
        let gather = |_: usize, _: &Segment<f64>, _: &[f64], _: &mut Total<f64>| panic!("in a segment");
        let run = |block: usize| {
            let mut deltas = AVec::from_iter(64, [0.0]);
            for _ in 0..8 {
                relay.hand_over(block, 0..1, 0, &mut deltas, (1, 0), &gather);
            }
            relay.finish(block, &gather);
        };
        let engine = Engine::new(2, InstructionSet::best()).unwrap();
        let ended = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            engine.for_each(&mut [(); 2], |()| relay.work(run, gather));
        }));
        assert!(ended.is_err());
    }
}
