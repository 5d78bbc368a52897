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
    use super::super::element::Element;
    use super::super::outer::{self, Rows, Taken};
    use super::super::panels::{self, Columns, End, Panels, Product, Way};
    use crate::engine::{InstructionSet, Run};
    use proptest::prelude::*;
    use pulp::{Simd, WithSimd};

    struct Multiply<'a, E> {
        matrix: &'a Panels<E>,
        source: Columns<'a, E>,
        columns: usize,
        start: &'a [E],
        way: Way<'a, E>,
        out: &'a mut [E],
    }

    impl<E: Element> WithSimd for Multiply<'_, E> {
        type Output = ();

        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) {
            let (matrices, sources) = ([self.matrix], [self.source]);
            let (columns, start) = (self.columns, self.start);
            // What is ahead changes nothing.
            let product = Product { matrices, sources, columns, start, ahead: self.source.values };
            panels::multiply_into(simd, product, self.way, self.out);
        }
    }

    struct Accumulate<'a, E>(Rows<'a, E>, Rows<'a, E>, Taken, usize, (usize, usize), &'a mut [E]);

    impl<E: Element> WithSimd for Accumulate<'_, E> {
        type Output = ();

        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) {
            outer::accumulate(simd, self.0, self.1, self.2, self.3, self.4, self.5);
        }
    }

    fn values<E: Element>(count: usize, seed: u64) -> Vec<E> {
        let mut x = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
        let mut next = || {
            x ^= x << 13;
            x ^= x >> 7;
            x ^= x << 17;
            E::from_f64((x >> 11) as f64 / (1u64 << 52) as f64 - 1.0)
        };
        (0..count).map(|_| next()).collect()
    }

    /// The same values in float64.
    fn wide<E: Element>(list: &[E]) -> Vec<f64> {
        list.iter().map(|value| value.to_f64()).collect()
    }

    fn multiply_fast<E: Element>(
        set: InstructionSet,
        rows: usize,
        inner: usize,
        columns: usize,
    ) -> (Vec<f64>, Vec<f64>) {
        let (matrix, source, start): (Vec<E>, Vec<E>, Vec<E>) =
            (values(rows * inner, 1), values(columns * inner, 2), values(rows, 3));
        let mut packed = Panels::zeros(rows, inner, panels::chains_for::<E>(rows), set);
        packed.fill(rows, |row, k| matrix[row * inner + k].to_f64());
        let mut padded_start = start.clone();
        padded_start.resize(E::padded(rows), E::ZERO);
        let mut out = vec![E::from_f64(f64::NAN); columns * E::padded(rows)];
        let source_columns = Columns { values: &source, stride: inner };
        let run = |way: Way<'_, E>, out: &mut [E]| {
            set.run(Multiply { matrix: &packed, source: source_columns, columns, start: &padded_start, way, out });
        };
        run(Way::default(), &mut out);
        // Walked the other way, and with a half of what is there, which is then added.
        let mut again = out.clone();
        let half = vec![E::from_f64(0.5); columns * E::padded(rows)];
        run(Way { backwards: true, end: End::Keep(&half) }, &mut again);
        let blended = |once: &E| E::from_f64(0.5_f64.mul_add(once.to_f64(), once.to_f64()));
        assert!(out.iter().zip(&again).all(|(once, more)| *more == blended(once)));
        // Back through tanh, where it is 1/2: three quarters, and a half of what is there.
        let columns_of = |values| Columns { values, stride: E::padded(rows) };
        run(
            Way { backwards: true, end: End::Slope { keep: &half, c: columns_of(&half), after: columns_of(&out) } },
            &mut again,
        );
        let sloped = |once: &E| E::from_f64(0.75_f64.mul_add(once.to_f64(), 0.5 * once.to_f64()));
        assert!(out.iter().zip(&again).all(|(once, more)| *more == sloped(once)));
        let fast = out.chunks_exact(E::padded(rows)).flat_map(|column| wide(&column[..rows])).collect();
        (fast, super::multiply(&wide(&matrix), &wide(&source), inner, &wide(&start)))
    }

    /// Whether sums of so many terms agree, but for rounding.
    fn close<E: Element>(fast: &[f64], plain: &[f64], terms: usize) -> bool {
        let rounding = if size_of::<E>() == 8 { 1e-15 } else { 5e-7 };
        fast.len() == plain.len() && fast.iter().zip(plain).all(|(a, b)| (a - b).abs() <= rounding * (terms + 2) as f64)
    }

    fn products_agree<E: Element>(rows: usize, inner: usize, columns: usize) -> Result<(), TestCaseError> {
        for set in InstructionSet::available() {
            let (fast, plain) = multiply_fast::<E>(set, rows, inner, columns);
            prop_assert!(close::<E>(&fast, &plain, inner), "{set} {rows}x{inner}x{columns}");
        }
        Ok(())
    }

    fn gradients_agree<E: Element>(rows: usize, inner: usize, count: usize) -> Result<(), TestCaseError> {
        let (rows_padded, ds, zs) = (E::padded(rows), E::stride(rows), E::stride(inner));
        let mut delta: Vec<E> = values((count + 1) * ds, 5);
        for row in delta.chunks_exact_mut(ds) {
            row[rows..].fill(E::ZERO);
        }
        let state: Vec<E> = values((count + 1) * zs, 6);
        let plain_delta: Vec<f64> = delta.chunks_exact(ds).take(count).flat_map(|d| wide(&d[..rows])).collect();
        let plain_state: Vec<f64> = state.chunks_exact(zs).take(count).flat_map(|z| wide(&z[..inner])).collect();
        let plain = super::accumulate(&plain_delta, rows, &plain_state, inner);
        for set in InstructionSet::available() {
            let mut out = vec![E::ZERO; inner * rows_padded];
            let delta = Rows { values: &delta, stride: ds };
            let state = Rows { values: &state, stride: zs };
            set.run(Accumulate(delta, state, count.into(), rows_padded, (0, inner), &mut out));
            let out = wide(&out);
            let fast: Vec<f64> = (0..rows * inner).map(|i| out[i % inner * rows_padded + i / inner]).collect();
            prop_assert!(close::<E>(&fast, &plain, count), "{set} {rows}x{inner}x{count}");
        }
        Ok(())
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn products_agree_with_plain_loops(rows in 1usize..150, inner in 1usize..80, columns in 1usize..20) {
            products_agree::<f64>(rows, inner, columns)?;
            products_agree::<f32>(rows, inner, columns)?;
        }

        #[test]
        fn gradients_agree_with_plain_loops(rows in 1usize..150, inner in 1usize..40, count in 0usize..50) {
            gradients_agree::<f64>(rows, inner, count)?;
            gradients_agree::<f32>(rows, inner, count)?;
        }
    }

    fn left_out_rows_change_no_bit<E: Element>() {
        let (rows, inner, groups, period) = (48, 23, 7, 6);
        let (ds, zs) = (E::stride(rows), E::stride(inner));
        let (delta, state): (Vec<E>, Vec<E>) =
            (values((groups * period + 1) * ds, 5), values((groups * period + 1) * zs, 6));
        for set in InstructionSet::available() {
            let gradient = |first: usize, taken: Taken, out: &mut [E]| {
                let delta = Rows { values: &delta[first * ds..], stride: ds };
                let state = Rows { values: &state[first * zs..], stride: zs };
                set.run(Accumulate(delta, state, taken, rows, (0, inner), out));
            };
            for width in 0..=period {
                let (mut at_once, mut one_by_one) = (vec![E::ZERO; inner * rows], vec![E::ZERO; inner * rows]);
                gradient(0, Taken { groups, width, period }, &mut at_once);
                for group in 0..groups {
                    gradient(group * period, width.into(), &mut one_by_one);
                }
                assert!(at_once == one_by_one, "{set}: {width} of {period}");
            }
        }
    }

    #[test]
    fn rows_that_are_left_out_change_no_bit_of_a_gradient() {
        left_out_rows_change_no_bit::<f64>();
        left_out_rows_change_no_bit::<f32>();
    }

    fn sums_are_the_same_everywhere<E: Element>() {
        // One column is summed in tiles that span panels: all numbers of panels, high and low.
        let spanned = (1..=20).map(|groups| (E::ROWS * groups - 3, 9));
        for (rows, inner) in [(12, 13), (36, 34), (64, 62), (200, 77)].into_iter().chain(spanned) {
            let (many, _) = multiply_fast::<E>(InstructionSet::Portable, rows, inner, 13);
            for set in InstructionSet::available() {
                for columns in 1..13 {
                    let (few, _) = multiply_fast::<E>(set, rows, inner, columns);
                    assert!(few == many[..few.len()], "{set}: {rows} x {inner}, {columns} columns");
                }
            }
        }
    }

    #[test]
    fn a_sum_does_not_depend_on_columns_or_instruction_set() {
        sums_are_the_same_everywhere::<f64>();
        sums_are_the_same_everywhere::<f32>();
    }
}
