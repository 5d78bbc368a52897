//! Each kernel once more in plain loops: slow, short, and what the fast versions are tested against.

/// `out[column, row] = start[row] + sum_k matrix[row, k] * source[column, k]`; `matrix` row-major, columns contiguous.
#[must_use]
pub fn multiply(matrix: &[f64], source: &[f64], inner: usize, start: &[f64]) -> Vec<f64> {
    let mut out = Vec::new();
    for column in source.chunks_exact(inner) {
        for (row, start) in matrix.chunks_exact(inner).zip(start) {
            out.push(row.iter().zip(column).fold(*start, |sum, (w, x)| sum + w * x));
        }
    }
    out
}

/// `out[row, k] = sum_n delta[n, row] * state[n, k]`; both row-major over n.
#[must_use]
pub fn accumulate(delta: &[f64], rows: usize, state: &[f64], inner: usize) -> Vec<f64> {
    let mut out = vec![0.0; rows * inner];
    for (delta, state) in delta.chunks_exact(rows).zip(state.chunks_exact(inner)) {
        for (out, d) in out.chunks_exact_mut(inner).zip(delta) {
            for (out, x) in out.iter_mut().zip(state) {
                *out += d * x;
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::outer::{self, Rows, Taken};
    use super::super::panels::{self, Columns, Panels, Product, Way};
    use super::super::{padded, stride};
    use crate::engine::{InstructionSet, Run};
    use proptest::prelude::*;
    use pulp::{Simd, WithSimd};

    struct Multiply<'a> {
        matrix: &'a Panels,
        source: Columns<'a>,
        columns: usize,
        start: &'a [f64],
        way: Way<'a>,
        out: &'a mut [f64],
    }

    impl WithSimd for Multiply<'_> {
        type Output = ();

        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) {
            let (matrices, sources) = ([self.matrix], [self.source]);
            let product = Product { matrices, sources, columns: self.columns, start: self.start, ahead: &[] };
            panels::multiply_into(simd, product, self.way, self.out);
        }
    }

    struct Accumulate<'a>(Rows<'a>, Rows<'a>, Taken, usize, (usize, usize), &'a mut [f64]);

    impl WithSimd for Accumulate<'_> {
        type Output = ();

        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) {
            outer::accumulate(simd, self.0, self.1, self.2, self.3, self.4, self.5);
        }
    }

    fn values(count: usize, seed: u64) -> Vec<f64> {
        let mut x = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
        let mut next = || {
            x ^= x << 13;
            x ^= x >> 7;
            x ^= x << 17;
            (x >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        };
        (0..count).map(|_| next()).collect()
    }

    fn multiply_fast(
        set: InstructionSet,
        rows: usize,
        inner: usize,
        columns: usize,
        chains: usize,
    ) -> (Vec<f64>, Vec<f64>) {
        let (matrix, source, start) = (values(rows * inner, 1), values(columns * inner, 2), values(rows, 3));
        let mut packed = Panels::zeros(rows, inner, chains, set);
        packed.fill(rows, |row, k| matrix[row * inner + k]);
        let mut padded_start = start.clone();
        padded_start.resize(padded(rows), 0.0);
        let mut out = vec![f64::NAN; columns * padded(rows)];
        let source_columns = Columns { values: &source, stride: inner };
        let run = |way: Way<'_>, out: &mut [f64]| {
            set.run(Multiply { matrix: &packed, source: source_columns, columns, start: &padded_start, way, out });
        };
        run(Way::default(), &mut out);
        // Walked the other way, and with a half of what is there, which is then added.
        let mut again = out.clone();
        run(Way { backwards: true, keep: Some(&vec![0.5; padded(rows)]) }, &mut again);
        assert!(out.iter().zip(&again).all(|(once, more)| *more == 0.5_f64.mul_add(*once, *once)));
        let fast = out.chunks_exact(padded(rows)).flat_map(|column| column[..rows].to_vec()).collect();
        (fast, super::multiply(&matrix, &source, inner, &start))
    }

    fn close(fast: &[f64], plain: &[f64], terms: usize) -> bool {
        fast.len() == plain.len() && fast.iter().zip(plain).all(|(a, b)| (a - b).abs() <= 1e-15 * (terms + 2) as f64)
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn products_agree_with_plain_loops(rows in 1usize..150, inner in 1usize..80, columns in 1usize..20) {
            for set in InstructionSet::available() {
                let chains = panels::chains_for(rows);
                let (fast, plain) = multiply_fast(set, rows, inner, columns, chains);
                prop_assert!(close(&fast, &plain, inner), "{set} {rows}x{inner}x{columns}");
            }
        }

        #[test]
        fn gradients_agree_with_plain_loops(rows in 1usize..150, inner in 1usize..40, count in 0usize..50) {
            let (rows_padded, ds, zs) = (padded(rows), stride(rows), stride(inner));
            let mut delta = values((count + 1) * ds, 5);
            for row in delta.chunks_exact_mut(ds) {
                row[rows..].fill(0.0);
            }
            let state = values((count + 1) * zs, 6);
            let plain_delta: Vec<f64> = delta.chunks_exact(ds).take(count).flat_map(|d| d[..rows].to_vec()).collect();
            let plain_state: Vec<f64> = state.chunks_exact(zs).take(count).flat_map(|z| z[..inner].to_vec()).collect();
            let plain = super::accumulate(&plain_delta, rows, &plain_state, inner);
            for set in InstructionSet::available() {
                let mut out = vec![0.0; inner * rows_padded];
                let delta = Rows { values: &delta, stride: ds };
                let state = Rows { values: &state, stride: zs };
                set.run(Accumulate(delta, state, count.into(), rows_padded, (0, inner), &mut out));
                let fast: Vec<f64> = (0..rows * inner).map(|i| out[i % inner * rows_padded + i / inner]).collect();
                prop_assert!(close(&fast, &plain, count), "{set} {rows}x{inner}x{count}");
            }
        }
    }

    #[test]
    fn rows_that_are_left_out_change_no_bit_of_a_gradient() {
        let (rows, inner, groups, period) = (40, 23, 7, 6);
        let (ds, zs) = (stride(rows), stride(inner));
        let (delta, state) = (values((groups * period + 1) * ds, 5), values((groups * period + 1) * zs, 6));
        for set in InstructionSet::available() {
            let gradient = |first: usize, taken: Taken, out: &mut [f64]| {
                let delta = Rows { values: &delta[first * ds..], stride: ds };
                let state = Rows { values: &state[first * zs..], stride: zs };
                set.run(Accumulate(delta, state, taken, rows, (0, inner), out));
            };
            for width in 0..=period {
                let (mut at_once, mut one_by_one) = (vec![0.0; inner * rows], vec![0.0; inner * rows]);
                gradient(0, Taken { groups, width, period }, &mut at_once);
                for group in 0..groups {
                    gradient(group * period, width.into(), &mut one_by_one);
                }
                assert!(at_once == one_by_one, "{set}: {width} of {period}");
            }
        }
    }

    #[test]
    fn a_sum_does_not_depend_on_columns_or_instruction_set() {
        // One column is summed in tiles that span panels: all numbers of panels, high and low.
        let spanned = (1..=20).map(|groups| (8 * groups - 3, 9));
        for (rows, inner) in [(12, 13), (36, 34), (64, 62), (200, 77)].into_iter().chain(spanned) {
            let chains = panels::chains_for(rows);
            let (many, _) = multiply_fast(InstructionSet::Portable, rows, inner, 13, chains);
            for set in InstructionSet::available() {
                for columns in 1..13 {
                    let (few, _) = multiply_fast(set, rows, inner, columns, chains);
                    assert!(few == many[..few.len()], "{set}: {rows} x {inner}, {columns} columns");
                }
            }
        }
    }
}
