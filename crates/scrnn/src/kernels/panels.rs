//! Products of a matrix with a few columns: the recurrence, where a block's sequences are the columns.
//!
//! ```text
//! out[row, column] = start[row] + sum_p sum_k matrix_p[row, k] * source_p[column, k]
//! ```
//!
//! The matrix is cut into panels as tall as a tile of the instruction set; within a panel the values of one k lie side
//! by side, so a product reads it front to back. A tile of a panel and a few columns keeps all of its sums in registers.
//! One column leaves too few sums in flight to hide their latency: then a tile spans several panels, a band. Sums run over
//! k in ascending order; few rows are summed in two interleaved chains, because a short sum would otherwise wait for its
//! own latency. Neither depends on the number of columns.

#![allow(clippy::needless_range_loop, reason = "loops over the constant sides of a tile unroll; indices say which")]

use aligned_vec::AVec;
use pulp::{Simd, WithSimd};

use super::element::{Element, lanes};
use super::{accumulators, fetch, is_used};
use crate::engine::InstructionSet;

/// A matrix in panels, zero-padded to whole vectors of rows.
#[derive(Debug, Clone)]
pub struct Panels<E = f64> {
    rows: usize,
    inner: usize,
    chains: usize,
    /// A band for each panel.
    single: Vec<Band>,
    /// The panels that a tile of one column spans.
    bands: Vec<Band>,
    values: AVec<E>,
}

/// Panels that one tile spans.
#[derive(Debug, Clone, Copy)]
struct Band {
    /// The first row.
    row: usize,
    /// Rows of the first panel.
    height: usize,
    /// How many panels are as high.
    tall: usize,
    /// How many follow that are a group shorter.
    short: usize,
}

/// First row and height of the panels of a matrix of `rows` rows (a multiple of `group`), at most `tallest` high: as
/// even as can be.
fn panels(rows: usize, tallest: usize, group: usize) -> Vec<(usize, usize)> {
    let groups = rows / group;
    let count = rows.div_ceil(tallest).max(1);
    let mut start = 0;
    let next = |p: usize| {
        let height = (groups / count + usize::from(p < groups % count)) * group;
        start += height;
        (start - height, height)
    };
    (0..count).map(next).collect()
}

/// How many panels a tile of one column spans at most: enough for 8 to 12 sums in flight.
const fn span(set: InstructionSet, chains: usize) -> usize {
    match (set, chains) {
        (InstructionSet::Avx2, 1) => 4,
        (InstructionSet::Avx512 | InstructionSet::Neon, 1) | (InstructionSet::Avx2, _) => 3,
        (InstructionSet::Avx512, _) => 2,
        (InstructionSet::Neon | InstructionSet::Portable, _) => 1,
    }
}

/// As few bands of up to `span` panels as can be, as even as can be.
fn bands(panels: &[(usize, usize)], span: usize) -> Vec<Band> {
    let count = panels.len().div_ceil(span);
    let mut rest = panels;
    let next = |b: usize| {
        let (own, later) = rest.split_at(panels.len() / count + usize::from(b < panels.len() % count));
        rest = later;
        let (row, height) = own[0];
        let tall = own.iter().filter(|panel| panel.1 == height).count();
        Band { row, height, tall, short: own.len() - tall }
    };
    (0..count).map(next).collect()
}

/// Interleaved chains for a matrix of `rows` rows: up to six vectors of rows are too few to hide a sum's latency.
#[must_use]
pub fn chains_for<E: Element>(rows: usize) -> usize {
    if E::padded(rows) <= 6 * E::ROWS { 2 } else { 1 }
}

impl<E: Element> Panels<E> {
    /// Room for `rows` x `inner`, all zeros, in panels for an instruction set.
    #[must_use]
    pub fn zeros(rows: usize, inner: usize, chains: usize, set: InstructionSet) -> Self {
        let rows = E::padded(rows);
        let tallest = match set {
            InstructionSet::Avx512 => 4 * E::ROWS,
            InstructionSet::Avx2 | InstructionSet::Neon | InstructionSet::Portable => E::ROWS,
        };
        let values = AVec::from_iter(64, std::iter::repeat_n(E::ZERO, rows * inner));
        let panels = panels(rows, tallest, E::ROWS);
        let [single, bands] = [1, span(set, chains)].map(|span| bands(&panels, span));
        Self { rows, inner, chains, single, bands, values }
    }

    /// Writes `value(row, k)` everywhere; rows beyond `rows` stay 0.
    pub fn fill(&mut self, rows: usize, value: impl Fn(usize, usize) -> f64) {
        for &Band { row: start, height, .. } in &self.single {
            let panel = &mut self.values[start * self.inner..(start + height) * self.inner];
            for (k, out) in panel.chunks_exact_mut(height).enumerate() {
                for (r, out) in out.iter_mut().enumerate().take(rows.saturating_sub(start)) {
                    *out = E::from_f64(value(start + r, k));
                }
            }
        }
    }

    /// Rows, padded.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.rows
    }
}

/// Columns of a factor: column `c` is `values[c * stride..][..inner]`.
#[derive(Debug, Clone, Copy)]
pub struct Columns<'a, E = f64> {
    /// All columns.
    pub values: &'a [E],
    /// Distance between columns.
    pub stride: usize,
}

/// What is multiplied; all matrices have the same rows. `start` holds one value a row.
#[derive(Clone, Copy)]
pub struct Product<'a, const P: usize, E = f64> {
    /// The matrices.
    pub matrices: [&'a Panels<E>; P],
    /// The columns that each is multiplied with.
    pub sources: [Columns<'a, E>; P],
    /// How many columns.
    pub columns: usize,
    /// What the sums start from.
    pub start: &'a [E],
    /// What will be needed next and may be far away: the product fetches it while it computes.
    pub ahead: &'a [E],
}

/// What happens to sums, and in which order the matrices are walked.
#[derive(Debug, Clone, Copy)]
pub struct Way<'a, E = f64> {
    /// From the last panel to the first. Walked forwards and backwards in turn, a cache that is a little too small still holds the
    /// panels that were read last.
    pub backwards: bool,
    /// What becomes of the sums.
    pub end: End<'a, E>,
}

/// What becomes of a sum, as long as it is in a register. `keep` holds one value a row.
#[derive(Debug, Clone, Copy)]
pub enum End<'a, E = f64> {
    /// `out <- sums`.
    Sums,
    /// `out <- keep out + sums`.
    Keep(&'a [E]),
    /// `out <- (1 - c^2) sums + keep after`: back through tanh. The columns of `out` are as far apart as those of `after`.
    Slope {
        /// What share of `after` is added.
        keep: &'a [E],
        /// The values of tanh.
        c: Columns<'a, E>,
        /// What is added.
        after: Columns<'a, E>,
    },
}

impl<E> Default for Way<'_, E> {
    /// Forwards, and the sums alone.
    fn default() -> Self {
        Self { backwards: false, end: End::Sums }
    }
}

/// Multiplies: `out` holds one row of as many values as the matrices have rows for each column, see [`End`].
#[inline(always)]
pub fn multiply<S: Simd, E: Element, const P: usize>(simd: S, product: Product<'_, P, E>, out: &mut [E]) {
    multiply_into(simd, product, Way::default(), out);
}

/// Multiplies in a way of the caller's.
#[inline(always)]
pub fn multiply_into<S: Simd, E: Element, const P: usize>(
    simd: S,
    product: Product<'_, P, E>,
    way: Way<'_, E>,
    out: &mut [E],
) {
    let lines = match product.ahead.len() {
        0 => 0,
        len => len.div_ceil(product.matrices[0].rows),
    };
    match product.matrices[0].chains {
        2 => walk::<S, E, P, 2>(simd, &Job { product, way, lines }, out),
        _ => walk::<S, E, P, 1>(simd, &Job { product, way, lines }, out),
    }
}

/// What all tiles of a product share.
struct Job<'a, E, const P: usize> {
    product: Product<'a, P, E>,
    way: Way<'a, E>,
    /// How many cache lines of what is ahead are fetched for each cache line of rows.
    lines: usize,
}

#[inline(always)]
fn walk<S: Simd, E: Element, const P: usize, const K: usize>(simd: S, job: &Job<'_, E, P>, out: &mut [E]) {
    let matrix = job.product.matrices[0];
    let bands = if job.product.columns == 1 { &matrix.bands } else { &matrix.single };
    for nth in 0..bands.len() {
        let band = bands[if job.way.backwards { bands.len() - 1 - nth } else { nth }];
        match (band.tall + band.short, band.height / lanes::<S, E>()) {
            (2.., _) => spanning::<S, E, P, K>(simd, job, band, out),
            (_, 4) => tiles::<S, E, P, 4, K>(simd, job, band.row, out),
            (_, 3) => tiles::<S, E, P, 3, K>(simd, job, band.row, out),
            (_, 2) => tiles::<S, E, P, 2, K>(simd, job, band.row, out),
            _ => tiles::<S, E, P, 1, K>(simd, job, band.row, out),
        }
    }
}

/// The band that a single tile spans.
#[inline(always)]
fn spanning<S: Simd, E: Element, const P: usize, const K: usize>(
    simd: S,
    job: &Job<'_, E, P>,
    band: Band,
    out: &mut [E],
) {
    let row = band.row;
    match (band.height / lanes::<S, E>(), band.tall, band.short) {
        (4, 3, _) => enter::<S, E, P, 4, 3, 1, 0, 1, K>(simd, job, row, 0, out),
        (4, 2, 1) => enter::<S, E, P, 4, 2, 3, 1, 1, K>(simd, job, row, 0, out),
        (4, 1, 2) => enter::<S, E, P, 4, 1, 3, 2, 1, K>(simd, job, row, 0, out),
        (4, 2, _) => enter::<S, E, P, 4, 2, 1, 0, 1, K>(simd, job, row, 0, out),
        (4, 1, 1) => enter::<S, E, P, 4, 1, 3, 1, 1, K>(simd, job, row, 0, out),
        (3, 3, _) => enter::<S, E, P, 3, 3, 1, 0, 1, K>(simd, job, row, 0, out),
        (3, 2, _) => enter::<S, E, P, 3, 2, 1, 0, 1, K>(simd, job, row, 0, out),
        (3, 1, 1) => enter::<S, E, P, 3, 1, 2, 1, 1, K>(simd, job, row, 0, out),
        (2, 4, _) => enter::<S, E, P, 2, 4, 1, 0, 1, K>(simd, job, row, 0, out),
        (2, 3, _) => enter::<S, E, P, 2, 3, 1, 0, 1, K>(simd, job, row, 0, out),
        (2, 2, _) => enter::<S, E, P, 2, 2, 1, 0, 1, K>(simd, job, row, 0, out),
        _ => {}
    }
}

/// The panel that starts at `row`: as few and as even tiles as the registers allow.
#[inline(always)]
fn tiles<S: Simd, E: Element, const P: usize, const M: usize, const K: usize>(
    simd: S,
    job: &Job<'_, E, P>,
    row: usize,
    out: &mut [E],
) {
    let columns = job.product.columns;
    let widest = (accumulators::<S>() / (M * K)).clamp(1, 6);
    let tiles = columns.div_ceil(widest);
    let mut first = 0;
    for tile in 0..tiles {
        // No division where there is one tile: it would take longer than a small tile does.
        let width = match tiles {
            1 => columns,
            _ => columns / tiles + usize::from(tile < columns % tiles),
        };
        match width {
            6 => enter::<S, E, P, M, 1, 1, 0, 6, K>(simd, job, row, first, out),
            5 => enter::<S, E, P, M, 1, 1, 0, 5, K>(simd, job, row, first, out),
            4 => enter::<S, E, P, M, 1, 1, 0, 4, K>(simd, job, row, first, out),
            3 => enter::<S, E, P, M, 1, 1, 0, 3, K>(simd, job, row, first, out),
            2 => enter::<S, E, P, M, 1, 1, 0, 2, K>(simd, job, row, first, out),
            1 => enter::<S, E, P, M, 1, 1, 0, 1, K>(simd, job, row, first, out),
            _ => {}
        }
        first += width;
    }
}

/// Each tile is a function of its own: inlined into one, the many shapes would take minutes to compile.
#[inline(never)]
fn enter<
    S: Simd,
    E: Element,
    const P: usize,
    const A: usize,
    const T: usize,
    const B: usize,
    const U: usize,
    const N: usize,
    const K: usize,
>(
    simd: S,
    job: &Job<'_, E, P>,
    row: usize,
    first: usize,
    out: &mut [E],
) {
    // A single chain is for seven vectors and more, which split into panels of three and four.
    let split = K == 2 || A >= 3 || lanes::<S, E>() < E::ROWS || S::REGISTER_COUNT < 16;
    if is_used::<S, E>(A, N, K) && split && spans::<S, E>(A, T, U, K) {
        simd.vectorize(Tile::<E, P, A, T, B, U, N, K> { job, row, first, out });
    }
}

/// Whether a tile of `tall` panels of so many vectors and `short` lower ones is ever asked for, see [`span`]; all others need
/// not be compiled.
const fn spans<S: Simd, E: Element>(vectors: usize, tall: usize, short: usize, chains: usize) -> bool {
    let panels = tall + short;
    match (S::REGISTER_COUNT, E::ROWS / lanes::<S, E>()) {
        _ if panels == 1 => true,
        (32.., 1) => panels == 2 && (chains == 1 || vectors == 3) || panels == 3 && chains == 1,
        (32.., 4) => chains == 1 && short == 0,
        (16..32, 2) => vectors == 2 && short == 0,
        _ => false,
    }
}

/// T panels of A vectors of rows, and U of B vectors, by N columns, in K interleaved chains.
struct Tile<
    'a,
    E,
    const P: usize,
    const A: usize,
    const T: usize,
    const B: usize,
    const U: usize,
    const N: usize,
    const K: usize,
> {
    job: &'a Job<'a, E, P>,
    row: usize,
    first: usize,
    out: &'a mut [E],
}

/// H vectors.
type Vectors<S, E, const H: usize> = [<E as Element>::Vector<S>; H];
/// H vectors by N columns.
type Block<S, E, const H: usize, const N: usize> = [Vectors<S, E, N>; H];

/// The sums of C panels of H vectors, by N columns in K chains: in registers, once all loops are unrolled.
struct Sums<S: Simd, E: Element, const H: usize, const C: usize, const N: usize, const K: usize>(
    [[Block<S, E, H, N>; C]; K],
);

impl<S: Simd, E: Element, const H: usize, const C: usize, const N: usize, const K: usize> Sums<S, E, H, C, N, K> {
    #[inline(always)]
    fn start(simd: S, starts: &[E::Vector<S>]) -> Self {
        let mut sums = [[[[E::splat(simd, E::ZERO); N]; H]; C]; K];
        for c in 0..C {
            for h in 0..H {
                sums[0][c][h] = [starts[c * H + h]; N];
            }
        }
        Self(sums)
    }

    /// Adds the products of one value of column `n` with the weights of its k.
    #[inline(always)]
    fn add(&mut self, simd: S, chain: usize, n: usize, weights: [&Vectors<S, E, H>; C], x: E::Vector<S>) {
        for c in 0..C {
            for h in 0..H {
                let sum = &mut self.0[chain][c][h][n];
                *sum = E::mul_add(simd, weights[c][h], x, *sum);
            }
        }
    }

    #[inline(always)]
    fn sum(&self, simd: S, c: usize, h: usize, n: usize) -> E::Vector<S> {
        let sum = self.0[0][c][h][n];
        if K == 2 { E::add(simd, sum, self.0[K - 1][c][h][n]) } else { sum }
    }

    /// `out <- sums` of column `n`.
    #[inline(always)]
    fn store(&self, simd: S, n: usize, out: &mut [E::Vector<S>]) {
        let out = &mut out[..C * H];
        for c in 0..C {
            for h in 0..H {
                out[c * H + h] = self.sum(simd, c, h, n);
            }
        }
    }

    /// `out <- keep out + sums` of column `n`.
    #[inline(always)]
    fn blend(&self, simd: S, n: usize, keep: &[E::Vector<S>], out: &mut [E::Vector<S>]) {
        let (keep, out) = (&keep[..C * H], &mut out[..C * H]);
        for c in 0..C {
            for h in 0..H {
                let at = c * H + h;
                out[at] = E::mul_add(simd, keep[at], out[at], self.sum(simd, c, h, n));
            }
        }
    }

    /// `out <- (1 - c^2) sums + keep after` of column `n`.
    #[inline(always)]
    fn slope(&self, simd: S, n: usize, [keep, c, after]: [&[E::Vector<S>]; 3], out: &mut [E::Vector<S>]) {
        let (keep, c, after, out) = (&keep[..C * H], &c[..C * H], &after[..C * H], &mut out[..C * H]);
        let one = E::splat(simd, E::ONE);
        for panel in 0..C {
            for h in 0..H {
                let at = panel * H + h;
                let slope = E::negate_mul_add(simd, c[at], c[at], one);
                let kept = E::mul(simd, keep[at], after[at]);
                out[at] = E::mul_add(simd, slope, self.sum(simd, panel, h, n), kept);
            }
        }
    }
}

/// The columns of a tile one after the other, written out: a loop as long as this would not be unrolled, and the sums would be in memory.
macro_rules! for_each_column {
    ($columns:ident, $n:ident, $body:block) => {
        for_each_column!($columns, $n, $body, 0, 1, 2, 3, 4, 5);
    };
    ($columns:ident, $n:ident, $body:block, $($each:literal),*) => {
        $(if $each < $columns {
            let $n = $each;
            $body
        })*
    };
}

/// C panels of H vectors for each k: two k at a time, then the last k of an odd number.
struct Weights<'a, S: Simd, E: Element, const H: usize, const C: usize> {
    pairs: [&'a [[Vectors<S, E, H>; 2]]; C],
    last: [&'a [Vectors<S, E, H>]; C],
}

impl<'a, S: Simd, E: Element, const H: usize, const C: usize> Weights<'a, S, E, H, C> {
    /// Takes them off the front of `values`.
    #[inline(always)]
    fn take(values: &mut &'a [E], inner: usize) -> Self {
        let (mut pairs, mut last) = ([[].as_slice(); C], [[].as_slice(); C]);
        for c in 0..C {
            let (panel, rest) = values.split_at(H * lanes::<S, E>() * inner);
            let (whole, odd) = E::vectors::<S>(panel).as_chunks::<H>().0.as_chunks::<2>();
            (pairs[c], last[c], *values) = (&whole[..inner / 2], odd, rest);
        }
        Self { pairs, last }
    }

    #[inline(always)]
    fn at(&self, k: usize, half: usize) -> [&'a Vectors<S, E, H>; C] {
        std::array::from_fn(|c| &self.pairs[c][k][half])
    }

    #[inline(always)]
    fn last(&self) -> [&'a Vectors<S, E, H>; C] {
        std::array::from_fn(|c| &self.last[c][0])
    }
}

impl<
    'a,
    E: Element,
    const P: usize,
    const A: usize,
    const T: usize,
    const B: usize,
    const U: usize,
    const N: usize,
    const K: usize,
> WithSimd for Tile<'a, E, P, A, T, B, U, N, K>
{
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { job, row, first, out } = self;
        let Job { product, way, lines } = job;
        let height = (T * A + U * B) * lanes::<S, E>();
        // Each tile fetches its share.
        let mut ahead = product.ahead.as_ptr().wrapping_add(row * lines);
        let last = ahead.wrapping_add(height * lines);
        let starts = E::vectors::<S>(&product.start[row..row + height]);
        let mut tall = Sums::<S, E, A, T, N, K>::start(simd, starts);
        let mut short = Sums::<S, E, B, U, N, K>::start(simd, &starts[T * A..]);
        for p in 0..P {
            let inner = product.matrices[p].inner;
            let mut panels = &product.matrices[p].values[row * inner..(row + height) * inner];
            let higher = Weights::<S, E, A, T>::take(&mut panels, inner);
            let lower = Weights::<S, E, B, U>::take(&mut panels, inner);
            let source = product.sources[p];
            let (mut column, mut paired) = ([[].as_slice(); N], [[].as_slice(); N]);
            for n in 0..N {
                column[n] = &source.values[(first + n) * source.stride..][..inner];
                paired[n] = &column[n].as_chunks::<2>().0[..inner / 2];
            }
            for k in 0..inner / 2 {
                if ahead < last {
                    fetch(simd, ahead);
                    ahead = ahead.wrapping_add(E::ROWS);
                }
                for half in 0..2 {
                    for n in 0..N {
                        let x = E::splat(simd, paired[n][k][half]);
                        tall.add(simd, half % K, n, higher.at(k, half), x);
                        short.add(simd, half % K, n, lower.at(k, half), x);
                    }
                }
            }
            if inner % 2 == 1 {
                for n in 0..N {
                    let x = E::splat(simd, column[n][inner - 1]);
                    tall.add(simd, 0, n, higher.last(), x);
                    short.add(simd, 0, n, lower.last(), x);
                }
            }
        }
        let rows = product.matrices[0].rows;
        // A loop for each end: in one loop for all, the compiler would leave the sums in memory.
        match way.end {
            End::Sums => {
                for n in 0..N {
                    let out = E::vectors_mut::<S>(&mut out[(first + n) * rows + row..][..height]);
                    let (higher, lower) = out.split_at_mut(T * A);
                    tall.store(simd, n, higher);
                    short.store(simd, n, lower);
                }
            }
            End::Keep(keep) => {
                let (keep, keep_lower) = E::vectors::<S>(&keep[row..row + height]).split_at(T * A);
                for n in 0..N {
                    let out = E::vectors_mut::<S>(&mut out[(first + n) * rows + row..][..height]);
                    let (higher, lower) = out.split_at_mut(T * A);
                    tall.blend(simd, n, keep, higher);
                    short.blend(simd, n, keep_lower, lower);
                }
            }
            End::Slope { keep, c, after } => {
                let (keep, keep_lower) = E::vectors::<S>(&keep[row..row + height]).split_at(T * A);
                for_each_column!(N, n, {
                    let at = |it: Columns<'a, E>| &it.values[(first + n) * it.stride + row..][..height];
                    let (c, c_lower) = E::vectors::<S>(at(c)).split_at(T * A);
                    let (own, own_lower) = E::vectors::<S>(at(after)).split_at(T * A);
                    let out = E::vectors_mut::<S>(&mut out[(first + n) * after.stride + row..][..height]);
                    let (higher, lower) = out.split_at_mut(T * A);
                    tall.slope(simd, n, [keep, c, own], higher);
                    short.slope(simd, n, [keep_lower, c_lower, own_lower], lower);
                });
            }
        }
    }
}
