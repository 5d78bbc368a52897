//! Runs side by side, in blocks of a few columns.
//!
//! A block is what one thread works on: its columns share every load of a weight. Runs are ordered by length, so
//! that at any step the columns that still run are the first ones. A single block that is more than half full and has
//! enough work is split in two, so that a second thread has something to do. (Two blocks of three columns cost one
//! thread as much as one block of six.) The split depends on the network's size and on the lengths only, never on the
//! number of threads.

use std::ops::Range;

use crate::objective::Run;
use crate::topology::Topology;

/// A few runs in lockstep.
#[derive(Debug, Default)]
pub(crate) struct Block {
    /// Which run each column is, as an index into the list that was split.
    pub runs: Vec<usize>,
    /// The sequence that each column sees.
    pub sequences: Vec<usize>,
    /// Steps T of each column, longest first.
    pub lengths: Vec<usize>,
}

/// Columns of a block for networks whose weights stay in the second-level cache.
const NARROW: usize = 6;
/// Columns where weights come from further away and must serve more of them.
const WIDE: usize = 24;
/// Bytes of recurrent weights up to which blocks stay narrow.
const NEAR: usize = 512 << 10;
/// Recurrent weights times steps of all columns from which on two blocks pay: at least 0.5 ms of one thread, ten times what it
/// takes to wake another.
const WORTH_TWO: usize = 1 << 22;

impl Block {
    /// Takes over the columns `own`, ordered by length, of `runs`.
    pub fn fill(&mut self, runs: &[Run], own: &[usize]) {
        self.runs.clear();
        self.runs.extend_from_slice(own);
        self.sequences.clear();
        self.sequences.extend(own.iter().map(|&run| runs[run].sequence));
        self.lengths.clear();
        self.lengths.extend(own.iter().map(|&run| runs[run].steps));
    }

    /// Number of columns.
    pub fn columns(&self) -> usize {
        self.lengths.len()
    }

    /// Steps of the longest column.
    pub fn steps(&self) -> usize {
        self.lengths[0]
    }

    /// How many columns have at least `steps` steps.
    pub fn active(&self, steps: usize) -> usize {
        match self.lengths[self.lengths.len() - 1] >= steps {
            true => self.lengths.len(),
            false => self.lengths.partition_point(|&length| length >= steps),
        }
    }

    /// Cuts `range` where columns end: each part with the number of columns that have as many steps as any number in it.
    pub fn stretches(&self, range: Range<usize>) -> impl Iterator<Item = (Range<usize>, usize)> {
        let mut start = range.start;
        std::iter::from_fn(move || {
            let active = self.active(start);
            if start >= range.end || active == 0 {
                return None;
            }
            let part = start..range.end.min(self.lengths[active - 1] + 1);
            start = part.end;
            Some((part, active))
        })
    }
}

/// Recurrent weights times steps of all columns.
fn work(topology: &Topology, runs: &[Run]) -> usize {
    runs.iter().map(|run| run.steps).sum::<usize>().saturating_mul(topology.context_units().pow(2))
}

/// Whether there is so much to do that threads without a block should follow the others: 2 ms of one thread. A follower is woken in the
/// middle, and takes a quarter of the work at most.
pub(crate) fn is_worth_following(topology: &Topology, runs: &[Run]) -> bool {
    work(topology, runs) >= 4 * WORTH_TWO
}

/// Splits runs into blocks and gives each block's columns, with the number of the block, to `take`. `order` is scratch.
pub(crate) fn split(topology: &Topology, runs: &[Run], order: &mut Vec<usize>, mut take: impl FnMut(usize, &[usize])) {
    let weights = topology.context_units().pow(2);
    let width = if weights * size_of::<f64>() <= NEAR { NARROW } else { WIDE };
    // An even number of blocks lets two workers finish together.
    let count = match runs.len().div_ceil(width) {
        1 if 2 * runs.len() <= width || work(topology, runs) < WORTH_TWO => 1,
        count => count.next_multiple_of(2),
    };
    order.clear();
    order.extend(0..runs.len());
    order.sort_unstable_by_key(|&run| (std::cmp::Reverse(runs[run].steps), run));
    let mut rest = order.as_slice();
    for index in 0..count {
        let columns = runs.len() / count + usize::from(index < runs.len() % count);
        let (own, others) = rest.split_at(columns);
        rest = others;
        if !own.is_empty() {
            take(index, own);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn blocks(topology: &Topology, runs: &[Run]) -> Vec<Block> {
        let mut blocks = Vec::new();
        split(topology, runs, &mut Vec::new(), |index, own| {
            assert_eq!(index, blocks.len());
            let mut block = Block::default();
            block.fill(runs, own);
            blocks.push(block);
        });
        blocks
    }

    #[test]
    fn every_run_has_one_column_and_lengths_fall() {
        let topology = Topology::s_ctrnn(1, 4, 2.0).unwrap();
        for count in [1, 5, 6, 7, 12, 30, 32, 256] {
            let runs: Vec<_> = (0..count).map(|i| Run::new(count - i, 1 + (i * 7) % 30)).collect();
            let blocks = blocks(&topology, &runs);
            let mut seen: Vec<usize> = blocks.iter().flat_map(|block| block.runs.clone()).collect();
            seen.sort_unstable();
            assert_eq!(seen, (0..count).collect::<Vec<_>>());
            for block in &blocks {
                assert!(block.columns() <= NARROW && block.lengths.is_sorted_by(|a, b| a >= b));
                assert_eq!((block.active(0), block.active(block.steps() + 1)), (block.columns(), 0));
                for (column, &run) in block.runs.iter().enumerate() {
                    assert_eq!(Run::new(block.sequences[column], block.lengths[column]), runs[run]);
                }
            }
            assert!(blocks.len() == 1 || blocks.len().is_multiple_of(2));
        }
    }

    #[test]
    fn a_block_that_is_more_than_half_full_is_split_where_its_work_pays() {
        let columns = |units: usize, count: usize, steps: usize| {
            let topology = Topology::s_ctrnn(1, units, 2.0).unwrap();
            let runs: Vec<_> = (0..count).map(|sequence| Run::new(sequence, steps)).collect();
            blocks(&topology, &runs).iter().map(Block::columns).collect::<Vec<_>>()
        };
        assert_eq!(columns(60, 6, 1000), [3, 3]);
        assert_eq!(columns(60, 5, 1000), [3, 2]);
        assert_eq!(columns(60, 4, 1000), [2, 2]);
        assert_eq!(columns(60, 3, 1000), [3]);
        assert_eq!(columns(60, 7, 10), [4, 3]);
        // 3600 weights: 6 columns of 194 steps are 4 190 400, of 195 steps 4 212 000; the bound is 4 194 304.
        assert_eq!((columns(60, 6, 194), columns(60, 6, 195)), (vec![6], vec![3, 3]));
        assert_eq!((columns(300, 12, 1000), columns(300, 13, 1000)), (vec![12], vec![7, 6]));
    }

    #[test]
    fn stretches_end_where_columns_end() {
        let block = Block { lengths: vec![9, 4, 4, 1], ..Block::default() };
        let stretches = |range| block.stretches(range).collect::<Vec<_>>();
        assert_eq!(stretches(0..10), [(0..2, 4), (2..5, 3), (5..10, 1)]);
        assert_eq!(stretches(3..5), [(3..5, 3)]);
        assert_eq!(stretches(4..7), [(4..5, 3), (5..7, 1)]);
        assert_eq!(stretches(7..7), []);
        for (part, active) in block.stretches(0..10) {
            assert!(part.into_iter().all(|steps| block.active(steps) == active));
        }
    }
}
