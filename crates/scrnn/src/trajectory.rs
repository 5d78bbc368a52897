//! Preallocated records of a run through a block.
//!
//! A record grows to the largest block it has met and then allocates no more. Steps are cut into segments that fit the
//! second-level cache; with recomputation only one span of about sqrt(T) steps is kept at a time, and the internal state
//! at the start of each.

use aligned_vec::AVec;

use crate::batch::Block;
use crate::kernels::element::Element;
use crate::packed::Packed;

/// Bytes of states and deltas that a segment may take.
const SEGMENT_BYTES: usize = 448 << 10;
/// Fewest rows that make a product over a segment worth its while.
const SEGMENT_ROWS: usize = 64;

/// How the steps of a block are cut.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Cut {
    /// Products: steps + 1, see [`crate::packed`].
    pub products: usize,
    /// Products a segment.
    pub segment: usize,
    /// Products a span; all of them unless recomputing.
    pub span: usize,
}

impl Cut {
    pub fn new<E: Element>(packed: &Packed<E>, block: &Block, recompute: bool) -> Self {
        let row = (packed.state_stride + packed.delta_stride) * size_of::<E>();
        let rows = (SEGMENT_BYTES / row).max(SEGMENT_ROWS);
        let products = block.steps() + 1;
        let segment = (rows / block.columns()).clamp(1, products);
        let span = if recompute {
            let root = (products as f64).sqrt().ceil() as usize;
            root.next_multiple_of(segment).min(products)
        } else {
            products
        };
        Self { products, segment, span }
    }

    /// Values of the deltas of a segment of `columns` columns.
    pub fn deltas<E: Element>(self, packed: &Packed<E>, columns: usize) -> usize {
        ((self.segment + 1) * columns + 1) * packed.delta_stride
    }

    pub fn spans(self) -> usize {
        self.products.div_ceil(self.span)
    }

    /// Products of span `index`.
    pub fn span_range(self, index: usize) -> std::ops::Range<usize> {
        index * self.span..((index + 1) * self.span).min(self.products)
    }
}

/// The record.
#[derive(Debug)]
pub(crate) struct Trajectory<E: Element = f64> {
    /// [product - span start][column][state_stride]: c_k, x_k, 1.
    pub states: AVec<E>,
    /// [column][rows]: the running internal states.
    pub internal: AVec<E>,
    /// [span][column][rows]: internal states where spans start.
    pub span_starts: AVec<E>,
    /// [step][column][channel]: y, then d ln L / d u of the mean units.
    pub mean: AVec<f64>,
    /// [step][column][channel]: u of the variance units, then d ln L / d u of them.
    pub variance: AVec<f64>,
    /// [product - segment start + 1][column][delta_stride].
    pub deltas: AVec<E>,
    /// Of one segment: targets, terms of ln L, squared errors, precisions; [step][column][channel].
    pub targets: AVec<f64>,
    pub terms: AVec<f64>,
    pub squares: AVec<f64>,
    pub precisions: AVec<f64>,
}

impl<E: Element> Trajectory<E> {
    pub fn new() -> Self {
        let (own, scores) = (|| AVec::new(64), || AVec::new(64));
        Self {
            states: own(),
            internal: own(),
            span_starts: own(),
            mean: scores(),
            variance: scores(),
            deltas: own(),
            targets: scores(),
            terms: scores(),
            squares: scores(),
            precisions: scores(),
        }
    }

    /// Makes room for a block.
    pub fn fit(&mut self, packed: &Packed<E>, block: &Block, cut: Cut) {
        let n = block.columns();
        let channels = if packed.n_out > packed.n_y { packed.n_y } else { 0 };
        // One more row than is read, for products that read shifted rows.
        grow(&mut self.states, ((cut.span + 1) * n + 1) * packed.state_stride);
        grow(&mut self.internal, n * packed.rows);
        grow(&mut self.span_starts, cut.spans() * n * packed.rows);
        grow(&mut self.mean, block.steps() * n * packed.n_y);
        grow(&mut self.variance, block.steps() * n * channels);
        grow(&mut self.deltas, cut.deltas(packed, n));
        for scratch in [&mut self.targets, &mut self.terms, &mut self.squares, &mut self.precisions] {
            grow(scratch, cut.segment * n * packed.n_y);
        }
    }
}

/// Makes a list at least so long.
fn grow<T: Element>(list: &mut AVec<T>, len: usize) {
    if list.len() < len {
        list.reserve_exact(len - list.len());
        list.resize(len, T::ZERO);
    }
}
