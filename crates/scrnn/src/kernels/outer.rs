//! The weight gradient as one product over all steps and columns of a block.
//!
//! ```text
//! gradient[k, row] += sum_n delta[n, row] * state[n, k]
//! ```
//!
//! n runs over (step, column) in memory order; of columns that have ended, rows are left out. Tiles of a few vectors of rows
//! and six k stay in registers while n runs. Of many k, a block at a time: all bands of rows take it up before the next one.

#![allow(clippy::needless_range_loop, reason = "loops over the constant sides of a tile unroll; indices say which")]

use pulp::{Simd, WithSimd};

use super::element::{Element, lanes};
use super::{accumulators, fetch, is_used, tallest};

/// Rows of values at equal distance. There must be one row more than is read, or as much memory behind the last.
#[derive(Debug, Clone, Copy)]
pub struct Rows<'a, E = f64> {
    /// All rows.
    pub values: &'a [E],
    /// Distance between rows.
    pub stride: usize,
}

/// From so many k on, tall tiles take them in blocks: from one band of rows to the next, the states and the gradient of all
/// of them would leave the second-level cache and its table of pages.
const MANY: usize = 768;
/// Values of k in a block.
const BLOCK: usize = 96;

/// Bytes of deltas that the first-level cache still has when the next tile reads them.
const NEAR: usize = 24 << 10;
/// How many rows before they are read their lines are fetched.
const AHEAD: usize = 8;

/// Which rows are taken up: the first `width` of every `period`, `groups` times.
#[derive(Debug, Clone, Copy)]
pub struct Taken {
    /// How many groups.
    pub groups: usize,
    /// Rows of a group that are taken.
    pub width: usize,
    /// All rows of a group.
    pub period: usize,
}

impl From<usize> for Taken {
    /// The first `count` rows.
    fn from(count: usize) -> Self {
        Self { groups: 1, width: count, period: count }
    }
}

/// Accumulates the outer products of the rows `taken`, in their order. `gradient` holds one row of `rows` values (a multiple of [`Element::ROWS`]) for each k in
/// `from..to`, in that order.
#[inline(always)]
pub fn accumulate<S: Simd, E: Element>(
    simd: S,
    delta: Rows<'_, E>,
    state: Rows<'_, E>,
    taken: impl Into<Taken>,
    rows: usize,
    (from, to): (usize, usize),
    gradient: &mut [E],
) {
    debug_assert!(rows.is_multiple_of(E::ROWS) && gradient.len() >= (to - from) * rows);
    let taken = taken.into();
    let block = if is_tall::<S, E>() && to - from >= MANY { BLOCK } else { to - from };
    for first in (from..to).step_by(block.max(1)) {
        let is_part = block < to - from;
        let job = Job { delta, state, taken, rows, row: 0, from: first, to: to.min(first + block), is_part };
        bands(simd, job, &mut gradient[(first - from) * rows..]);
    }
}

/// Whether a band is taller than the rows that any tile has: then there are few of them, and k are taken in blocks.
const fn is_tall<S: Simd, E: Element>() -> bool {
    tallest::<S>() * lanes::<S, E>() > E::ROWS
}

#[inline(always)]
fn bands<S: Simd, E: Element>(simd: S, job: Job<'_, E>, gradient: &mut [E]) {
    let vectors = job.rows / lanes::<S, E>();
    let bands = vectors.div_ceil(tallest::<S>()).max(1);
    let mut first = 0;
    for band in 0..bands {
        let height = vectors / bands + usize::from(band < vectors % bands);
        let job = Job { row: first * lanes::<S, E>(), ..job };
        match height {
            4 => tiles::<S, E, 4>(simd, &job, gradient),
            3 => tiles::<S, E, 3>(simd, &job, gradient),
            2 => tiles::<S, E, 2>(simd, &job, gradient),
            1 => tiles::<S, E, 1>(simd, &job, gradient),
            _ => {}
        }
        first += height;
    }
}

#[derive(Clone, Copy)]
struct Job<'a, E> {
    delta: Rows<'a, E>,
    state: Rows<'a, E>,
    taken: Taken,
    rows: usize,
    row: usize,
    from: usize,
    to: usize,
    /// Whether the k are a block of many, and so the gradient is far away.
    is_part: bool,
}

#[inline(always)]
fn tiles<S: Simd, E: Element, const M: usize>(simd: S, job: &Job<'_, E>, gradient: &mut [E]) {
    let widest = (accumulators::<S>() / M).clamp(1, 6);
    let columns = job.to - job.from;
    let tiles = columns.div_ceil(widest);
    let mut first = 0;
    for tile in 0..tiles {
        let width = columns / tiles + usize::from(tile < columns % tiles);
        match width {
            6 => enter::<S, E, M, 6>(simd, job, first, gradient),
            5 => enter::<S, E, M, 5>(simd, job, first, gradient),
            4 => enter::<S, E, M, 4>(simd, job, first, gradient),
            3 => enter::<S, E, M, 3>(simd, job, first, gradient),
            2 => enter::<S, E, M, 2>(simd, job, first, gradient),
            1 => enter::<S, E, M, 1>(simd, job, first, gradient),
            _ => {}
        }
        first += width;
    }
}

/// A function of its own, see [`super::panels`].
#[inline(never)]
fn enter<S: Simd, E: Element, const M: usize, const N: usize>(
    simd: S,
    job: &Job<'_, E>,
    first: usize,
    gradient: &mut [E],
) {
    if is_used::<S, E>(M, N, 1) {
        simd.vectorize(Tile::<E, M, N> { job, first, gradient });
    }
}

/// M vectors of rows by N values of k.
struct Tile<'a, E, const M: usize, const N: usize> {
    job: &'a Job<'a, E>,
    first: usize,
    gradient: &'a mut [E],
}

impl<E: Element, const M: usize, const N: usize> WithSimd for Tile<'_, E, M, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { job, first, gradient } = self;
        let lanes = lanes::<S, E>();
        let mut sums = [[E::splat(simd, E::ZERO); N]; M];
        for n in 0..N {
            let out = E::vectors::<S>(&gradient[(first + n) * job.rows + job.row..][..M * lanes]);
            for m in 0..M {
                sums[m][n] = out[m];
            }
        }
        let (height, k) = (M * lanes, job.from + first);
        let Taken { groups, width, period } = job.taken;
        // Where the next tile begins: below this one, at the top of the next band, or in the next block. A vector is a line here.
        let (below, right, count) = (first + N, job.row + height, job.to - job.from);
        let (next_k, next_row) = match (below < count, right < job.rows) {
            (true, _) => (below, job.row),
            (false, true) => (0, right),
            (false, false) => (count, 0),
        };
        let next = gradient.as_ptr().wrapping_add(next_k * job.rows + next_row);
        let lines = if is_tall::<S, E>() && job.is_part { M * N } else { 0 };
        let mut fetched = 0;
        let is_far = groups * width * height * size_of::<E>() > NEAR;
        for group in 0..groups {
            let first = group * period;
            let deltas = &job.delta.values[first * job.delta.stride + job.row..][..width * job.delta.stride];
            let states = &job.state.values[first * job.state.stride + k..][..width * job.state.stride];
            for (delta, state) in deltas.chunks_exact(job.delta.stride).zip(states.chunks_exact(job.state.stride)) {
                if is_far {
                    for line in 0..height.div_ceil(E::ROWS) {
                        fetch(simd, delta.as_ptr().wrapping_add(AHEAD * job.delta.stride + line * E::ROWS));
                    }
                    fetch(simd, state.as_ptr().wrapping_add(AHEAD * job.state.stride));
                }
                if fetched < lines {
                    fetch(simd, next.wrapping_add(fetched / M * job.rows + fetched % M * lanes));
                    fetched += 1;
                }
                let delta = E::vectors::<S>(&delta[..height]);
                let state = &state[..N];
                for n in 0..N {
                    let x = E::splat(simd, state[n]);
                    for m in 0..M {
                        sums[m][n] = E::mul_add(simd, delta[m], x, sums[m][n]);
                    }
                }
            }
        }
        for n in 0..N {
            let out = E::vectors_mut::<S>(&mut gradient[(first + n) * job.rows + job.row..][..M * lanes]);
            for m in 0..M {
                out[m] = sums[m][n];
            }
        }
    }
}
