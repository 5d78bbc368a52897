//! Sequences side by side, in blocks of a few columns.
//!
//! A block is what one thread works on: its columns share every load of a weight. Sequences are ordered by length, so
//! that at any step the columns that still run are the first ones. The split depends on the network's size and on the
//! lengths only, never on the number of threads.

use aligned_vec::AVec;

use crate::topology::Topology;

/// A few sequences in lockstep.
#[derive(Debug)]
pub(crate) struct Block {
    /// Which item each column shows.
    pub items: Vec<usize>,
    /// Steps T of each column, longest first.
    pub lengths: Vec<usize>,
    /// [sample][column][channel]: the input of step k is row k, its target row k + xi.
    pub samples: AVec<f64>,
    channels: usize,
    /// xi.
    pub delay: usize,
}

/// One sequence to run: its samples, row-major, of which `steps` + xi are used.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Item<'a> {
    pub samples: &'a [f64],
    pub steps: usize,
}

/// Columns of a block for networks whose weights stay in the second-level cache.
const NARROW: usize = 6;
/// Columns where weights come from further away and must serve more of them.
const WIDE: usize = 24;
/// Bytes of recurrent weights up to which blocks stay narrow.
const NEAR: usize = 512 << 10;

impl Block {
    /// Number of columns.
    pub fn columns(&self) -> usize {
        self.items.len()
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

    /// Row `row` of the samples: [column][channel].
    pub fn sample_row(&self, row: usize) -> &[f64] {
        let width = self.columns() * self.channels;
        &self.samples[row * width..(row + 1) * width]
    }
}

/// Splits items into blocks.
pub(crate) fn blocks(topology: &Topology, items: &[Item<'_>]) -> Vec<Block> {
    let weights = topology.context_units().pow(2) * size_of::<f64>();
    let width = if weights <= NEAR { NARROW } else { WIDE };
    // An even number of blocks lets two workers finish together.
    let count = match items.len().div_ceil(width) {
        1 => 1,
        count => count.next_multiple_of(2),
    };
    let mut order: Vec<usize> = (0..items.len()).collect();
    order.sort_by_key(|&item| std::cmp::Reverse(items[item].steps));
    let mut rest = order.as_slice();
    let mut blocks = Vec::with_capacity(count);
    for index in 0..count {
        let columns = items.len() / count + usize::from(index < items.len() % count);
        let (own, others) = rest.split_at(columns);
        rest = others;
        if !own.is_empty() {
            blocks.push(block(topology, items, own));
        }
    }
    blocks
}

fn block(topology: &Topology, items: &[Item<'_>], own: &[usize]) -> Block {
    let (n, channels) = (own.len(), topology.channels());
    let lengths: Vec<usize> = own.iter().map(|&item| items[item].steps).collect();
    let rows = lengths[0] + topology.delay();
    let mut samples = AVec::from_iter(64, std::iter::repeat_n(0.0, rows * n * channels));
    for (column, &item) in own.iter().enumerate() {
        for (row, sample) in items[item].samples.chunks_exact(channels).take(rows).enumerate() {
            samples[(row * n + column) * channels..][..channels].copy_from_slice(sample);
        }
    }
    Block { items: own.to_vec(), lengths, samples, channels, delay: topology.delay() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_item_has_one_column_and_lengths_fall() {
        let topology = Topology::s_ctrnn(1, 4, 2.0).unwrap();
        for count in [1, 5, 6, 7, 12, 30, 32, 256] {
            let samples: Vec<f64> = (0..40).map(f64::from).collect();
            let items: Vec<_> = (0..count).map(|i| Item { samples: &samples, steps: 1 + (i * 7) % 30 }).collect();
            let blocks = blocks(&topology, &items);
            let mut seen: Vec<usize> = blocks.iter().flat_map(|block| block.items.clone()).collect();
            seen.sort_unstable();
            assert_eq!(seen, (0..count).collect::<Vec<_>>());
            for block in &blocks {
                assert!(block.columns() <= NARROW && block.lengths.is_sorted_by(|a, b| a >= b));
                assert_eq!((block.active(0), block.active(block.steps() + 1)), (block.columns(), 0));
                assert!(block.sample_row(1).iter().all(|&x| x == 1.0));
            }
            assert!(blocks.len() == 1 || blocks.len().is_multiple_of(2));
        }
    }
}
