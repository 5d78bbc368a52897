//! tanh, exp and ln of whole vectors.
//!
//! tanh and exp reduce the argument by multiples of ln 2 and put the power of two back through the exponent's bits. exp uses a
//! near-minimax polynomial of expm1. tanh uses a minimax quotient t = h P(h^2) / Q(h^2) of tanh h on what is left, and
//!
//! ```text
//! x = n ln 2 / 2 + h,  s = 2^n:    tanh x = ((s - 1) Q + (s + 1) h P) / ((s + 1) Q + (s - 1) h P)
//! ```
//!
//! which keeps small arguments exact to the last bits. A division takes a processor as long as all the rest, so two
//! values share one: a / b and c / d are a d r and c b r with r = 1 / (b d). ln takes
//! the exponent's bits off and leaves m in [sqrt(1/2), sqrt(2)), ln m = 2 artanh s with s = (m - 1) / (m + 1). NaN stays NaN.

#![allow(clippy::needless_range_loop, reason = "loops over the constant size of a group unroll; indices say which")]

use pulp::Simd;

use super::ROWS;

pub mod single;

/// 1.5 * 2^52: added and taken off again, it rounds to the nearest integer.
const ROUND: f64 = 6_755_399_441_055_744.0;
/// 1.5 * 2^20 plus the exponent's bias: puts an integer where a shift by 20 bits of the upper half makes it an exponent.
const EXPONENT: f64 = 1_572_864.0 + 1023.0;

const LN2_HIGH: f64 = 0.693_147_180_369_123_8;
const LN2_LOW: f64 = 1.908_214_929_270_587_7e-10;
const HALF_LN2: f64 = 0.5 * std::f64::consts::LN_2;

/// P and Q without their leading 1: tanh h = h P(h^2) / Q(h^2) on |h| <= ln 2 / 4, error below 5e-18 of the value.
const TANH_P: [f64; 2] = [0.111_099_078_639_442_28, 0.001_057_399_494_925_639_5];
const TANH_Q: [f64; 2] = [0.444_432_411_972_767_57, 0.015_868_203_487_996_47];

/// Coefficients of (expm1(r) - r) / r^2 on |r| <= ln 2 / 2; error below 2e-16.
const EXPM1: [f64; 10] = [
    0.500_000_000_000_000_1,
    0.166_666_666_666_666_67,
    0.041_666_666_666_624_13,
    0.008_333_333_333_330_061,
    0.001_388_888_891_721_371_6,
    0.000_198_412_698_630_536_16,
    0.000_024_801_521_295_954_37,
    2.755_726_845_999_706e-6,
    2.762_008_844_540_975e-7,
    2.510_038_549_551_032e-8,
];

/// c_0 + c_1 h + ... + c_9 h^9 as two interleaved chains: half the latency of Horner's rule for one multiplication more.
#[inline(always)]
fn polynomial<S: Simd>(simd: S, h: S::f64s, c: &[f64; 10]) -> S::f64s {
    let h2 = simd.mul_f64s(h, h);
    let mut even = simd.splat_f64s(c[8]);
    let mut odd = simd.splat_f64s(c[9]);
    for k in [6, 4, 2, 0] {
        even = simd.mul_add_f64s(even, h2, simd.splat_f64s(c[k]));
        odd = simd.mul_add_f64s(odd, h2, simd.splat_f64s(c[k + 1]));
    }
    simd.mul_add_f64s(odd, h, even)
}

/// 2^n for an integer n in [-1023, 1024] that is held as a float.
#[inline(always)]
fn power_of_two<S: Simd>(simd: S, n: S::f64s) -> S::f64s {
    let bits: S::u32s = pulp::bytemuck::cast(simd.add_f64s(n, simd.splat_f64s(EXPONENT)));
    pulp::bytemuck::cast(simd.wrapping_dyn_shl_u32s(bits, simd.splat_u32s(20)))
}

/// tanh of N vectors, within 5 units in the last place. Elements [`ROWS`] apart share a division, the first group of
/// [`ROWS`] with the second, the third with the fourth; N vectors are one group, or an even number of them. Steps of all
/// vectors alternate, so that none waits for its own latency.
#[inline(always)]
pub fn tanh<S: Simd, const N: usize>(simd: S, x: [S::f64s; N]) -> [S::f64s; N] {
    let (one, round) = (simd.splat_f64s(1.0), simd.splat_f64s(ROUND));
    let (p0, p1) = (simd.splat_f64s(TANH_P[0]), simd.splat_f64s(TANH_P[1]));
    let (q0, q1) = (simd.splat_f64s(TANH_Q[0]), simd.splat_f64s(TANH_Q[1]));
    let (twice_log2_e, half_ln2) = (simd.splat_f64s(2.0 * std::f64::consts::LOG2_E), simd.splat_f64s(HALF_LN2));
    let (low, high) = (simd.splat_f64s(-20.0), simd.splat_f64s(20.0));
    let [mut n, mut h, mut p, mut q] = [x; 4];
    for i in 0..N {
        // Beyond 20 the result is 1. The bound comes first in both, so that NaN passes on x86.
        let bounded = simd.max_f64s(low, simd.min_f64s(high, x[i]));
        let rounded = simd.mul_add_f64s(bounded, twice_log2_e, round);
        n[i] = simd.sub_f64s(rounded, round);
        h[i] = simd.negate_mul_add_f64s(n[i], half_ln2, bounded);
    }
    for i in 0..N {
        let z = simd.mul_f64s(h[i], h[i]);
        p[i] = simd.mul_add_f64s(simd.mul_add_f64s(p1, z, p0), z, one);
        q[i] = simd.mul_add_f64s(simd.mul_add_f64s(q1, z, q0), z, one);
    }
    let [mut above, mut below] = [x; 2];
    for i in 0..N {
        let s = power_of_two(simd, n[i]);
        let (less, more) = (simd.sub_f64s(s, one), simd.add_f64s(s, one));
        let hp = simd.mul_f64s(h[i], p[i]);
        above[i] = simd.mul_add_f64s(less, q[i], simd.mul_f64s(more, hp));
        below[i] = simd.mul_add_f64s(less, hp, simd.mul_f64s(more, q[i]));
    }
    let group = ROWS / S::F64_LANES;
    let mut y = x;
    for i in 0..N {
        let partner = i + group;
        if (i / group).is_multiple_of(2) && partner < N {
            let r = simd.div_f64s(one, simd.mul_f64s(below[i], below[partner]));
            let (own, other) = (simd.mul_f64s(below[partner], r), simd.mul_f64s(below[i], r));
            // Rounded three times, a quotient next to 1 could come out above it.
            y[i] = within_one(simd, simd.mul_f64s(above[i], own));
            y[partner] = within_one(simd, simd.mul_f64s(above[partner], other));
        } else if N == group {
            y[i] = simd.div_f64s(above[i], below[i]);
        }
    }
    y
}

#[inline(always)]
fn within_one<S: Simd>(simd: S, y: S::f64s) -> S::f64s {
    simd.max_f64s(simd.splat_f64s(-1.0), simd.min_f64s(simd.splat_f64s(1.0), y))
}

/// `c <- tanh u` of rows, a multiple of [`ROWS`] values. The last bits of an element depend on the one that it shares a
/// division with, and it is NaN if that one is.
#[inline(always)]
pub fn tanh_rows<S: Simd>(simd: S, u: &[f64], c: &mut [f64]) {
    match S::F64_LANES {
        // Without vector registers, groups of many vectors are only code to compile. Who shares a division is the same.
        8 if S::REGISTER_COUNT < 16 => groups::<S, 2, 2, 1>(simd, u, c),
        8 => groups::<S, 8, 2, 1>(simd, u, c),
        4 => groups::<S, 4, 4, 2>(simd, u, c),
        _ => groups::<S, 8, 8, 4>(simd, u, c),
    }
}

/// Groups of MANY vectors, then of TWO times [`ROWS`] elements, then of ONE.
#[inline(always)]
fn groups<S: Simd, const MANY: usize, const TWO: usize, const ONE: usize>(simd: S, u: &[f64], c: &mut [f64]) {
    let (u, c) = (S::as_simd_f64s(u).0, S::as_mut_simd_f64s(c).0);
    let ((many, u), (to, c)) = (u.as_chunks::<MANY>(), c.as_chunks_mut::<MANY>());
    for (c, u) in to.iter_mut().zip(many) {
        *c = tanh(simd, *u);
    }
    let ((two, u), (to, c)) = (u.as_chunks::<TWO>(), c.as_chunks_mut::<TWO>());
    for (c, u) in to.iter_mut().zip(two) {
        *c = tanh(simd, *u);
    }
    for (c, u) in c.as_chunks_mut::<ONE>().0.iter_mut().zip(u.as_chunks::<ONE>().0) {
        *c = tanh(simd, *u);
    }
}

/// exp of one vector, within 4 units in the last place for |x| < 708; above 709.8 infinite, below -708 about 3e-308.
#[inline(always)]
pub fn exp<S: Simd>(simd: S, x: S::f64s) -> S::f64s {
    let bounded = simd.min_f64s(simd.splat_f64s(710.0), x);
    let x = simd.max_f64s(simd.splat_f64s(-708.0), bounded);
    let round = simd.splat_f64s(ROUND);
    let n = simd.sub_f64s(simd.mul_add_f64s(x, simd.splat_f64s(std::f64::consts::LOG2_E), round), round);
    let r = simd.mul_add_f64s(n, simd.splat_f64s(-LN2_HIGH), x);
    let r = simd.mul_add_f64s(n, simd.splat_f64s(-LN2_LOW), r);
    let r2 = simd.mul_f64s(r, r);
    let p = simd.mul_add_f64s(polynomial(simd, r, &EXPM1), r2, r);
    let s = power_of_two(simd, n);
    simd.mul_add_f64s(s, p, s)
}

/// `values[k] <- exp(sign * values[k])`; any length.
#[inline(always)]
pub fn exp_slice<S: Simd>(simd: S, sign: f64, values: &mut [f64]) {
    let (vectors, rest) = S::as_mut_simd_f64s(values);
    let sign = simd.splat_f64s(sign);
    for value in vectors {
        *value = exp(simd, simd.mul_f64s(sign, *value));
    }
    let last = exp(simd, simd.mul_f64s(sign, simd.partial_load_f64s(rest)));
    simd.partial_store_f64s(rest, last);
}

/// The bits of sqrt(1/2).
const HALF_ROOT: u64 = 0x3fe6_a09e_667f_3bcd;
/// The bits of an exponent that makes a float of the lowest 52: 2^52 plus these.
const INTEGER: u64 = 0x4330_0000_0000_0000;
/// Added to exponents, so that they are not negative.
const BIAS: u64 = 1024;
/// Coefficients of (2 artanh s - 2 s) / s^3 in s^2 on |s| <= (sqrt(2) - 1) / (sqrt(2) + 1); error below 2^-58 of ln m.
const ARTANH: [f64; 7] = [
    0.666_666_666_666_673_5,
    0.399_999_999_994_094_2,
    0.285_714_287_436_623_9,
    0.222_221_984_321_497_84,
    0.181_835_721_616_180_5,
    0.153_138_376_992_093_73,
    0.147_981_986_051_165_86,
];

/// ln x, within a unit in the last place, of a normal positive x; infinity and NaN stay. No branch and no fused operation, so that
/// loops over it become vectors, and all instruction sets come to the same bits.
#[inline(always)]
fn ln(x: f64) -> f64 {
    let above = x.to_bits().wrapping_sub(HALF_ROOT);
    let exponent = above.wrapping_add(BIAS << 52) >> 52;
    let n = f64::from_bits(INTEGER | exponent) - (f64::from_bits(INTEGER) + BIAS as f64);
    let f = f64::from_bits((above & ((1 << 52) - 1)) + HALF_ROOT) - 1.0;
    let s = f / (2.0 + f);
    let z = s * s;
    let w = z * z;
    let even = w * (ARTANH[1] + w * (ARTANH[3] + w * ARTANH[5]));
    let odd = z * (ARTANH[0] + w * (ARTANH[2] + w * (ARTANH[4] + w * ARTANH[6])));
    let half = 0.5 * f * f;
    let y = n * LN2_HIGH - ((half - (s * (half + (even + odd)) + n * LN2_LOW)) - f);
    if x < f64::INFINITY { y } else { x }
}

/// `out[k] <- ln values[k]` of normal positive values; infinity and NaN stay.
#[inline(always)]
pub fn ln_slice(values: &[f64], out: &mut [f64]) {
    for (out, value) in out.iter_mut().zip(values) {
        *out = ln(*value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::{InstructionSet, Run};
    use pulp::WithSimd;

    struct Apply<'a> {
        values: &'a mut [f64],
        hyperbolic: bool,
    }

    impl WithSimd for Apply<'_> {
        type Output = ();

        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) {
            if self.hyperbolic {
                let x = self.values.to_vec();
                tanh_rows(simd, &x, self.values);
            } else {
                exp_slice(simd, 1.0, self.values);
            }
        }
    }

    fn grid(low: f64, high: f64) -> Vec<f64> {
        (0..80_000).map(|k| low + (high - low) * f64::from(k) / 79_999.0).collect()
    }

    /// Largest error in units in the last place of the true value.
    fn worst(x: &[f64], y: &[f64], truth: impl Fn(f64) -> f64) -> f64 {
        let ulps = |(&x, &y): (&f64, &f64)| {
            let t = truth(x);
            (y - t).abs() / (f64::from_bits(t.abs().to_bits() + 1) - t.abs())
        };
        x.iter().zip(y).map(ulps).fold(0.0, f64::max)
    }

    #[test]
    fn tanh_is_within_five_units_in_the_last_place() {
        for set in InstructionSet::available() {
            for x in [grid(-25.0, 25.0), grid(-1.0, 1.0), grid(-1e-3, 1e-3), grid(1e-300, 1e-290)] {
                let mut y = x.clone();
                set.run(Apply { values: &mut y, hyperbolic: true });

                assert!(worst(&x, &y, f64::tanh) <= 5.0, "{set}: {}", worst(&x, &y, f64::tanh));
                assert!(x.iter().zip(&y).all(|(x, y)| (y - x.tanh()).abs() <= 4.5e-16));
            }
        }
    }

    #[test]
    fn exp_is_within_four_units_in_the_last_place() {
        for set in InstructionSet::available() {
            for x in [grid(-700.0, 700.0), grid(-2.0, 2.0)] {
                let mut y = x[..79_999].to_vec();
                set.run(Apply { values: &mut y, hyperbolic: false });
                assert!(worst(&x[..79_999], &y, f64::exp) <= 4.0, "{set}: {}", worst(&x, &y, f64::exp));
            }
        }
    }

    struct Ln<'a>(&'a mut [f64]);

    impl WithSimd for Ln<'_> {
        type Output = ();

        #[inline(always)]
        fn with_simd<S: Simd>(self, _: S) {
            let x = self.0.to_vec();
            ln_slice(&x, self.0);
        }
    }

    #[test]
    fn ln_is_within_a_unit_in_the_last_place_on_every_instruction_set() {
        let powers = |low: i32, high: i32| -> Vec<f64> {
            (low..high).flat_map(|n| (0..200).map(move |k| 2f64.powi(n) * (1.0 + f64::from(k) / 200.0))).collect()
        };
        for x in [powers(-1022, 1023), grid(1e-5, 1e-3), grid(0.5, 2.0), grid(1.0 - 1e-9, 1.0 + 1e-9)] {
            let on = |set: InstructionSet| {
                let mut y = x.clone();
                set.run(Ln(&mut y));
                y
            };
            let plain = on(InstructionSet::Portable);
            assert!(worst(&x, &plain, f64::ln) <= 1.0, "{}", worst(&x, &plain, f64::ln));
            for set in InstructionSet::available() {
                assert!(on(set).iter().zip(&plain).all(|(a, b)| a.to_bits() == b.to_bits()), "{set}");
            }
        }
        let mut extremes = [f64::INFINITY, f64::NAN, f64::MAX, f64::MIN_POSITIVE, 1.0];
        let expected = extremes.map(f64::ln);
        InstructionSet::Portable.run(Ln(&mut extremes));
        assert!(extremes[1].is_nan() && extremes[0] == expected[0] && extremes[4] == 0.0);
        assert!((2..4).all(|k| (extremes[k] - expected[k]).abs() < 2e-13), "{extremes:?}");
    }

    #[test]
    fn extremes_saturate_and_nan_stays() {
        for set in InstructionSet::available() {
            let mut y = [f64::INFINITY, f64::NEG_INFINITY, f64::NAN, 0.0, 1e9, -1e9, 40.0, -40.0];
            set.run(Apply { values: &mut y, hyperbolic: true });
            assert_eq!((y[0], y[1], y[3], y[4], y[5], y[6], y[7]), (1.0, -1.0, 0.0, 1.0, -1.0, 1.0, -1.0));
            // With partners of all kinds: 64 values are two groups that share divisions, four times.
            let partner = |k: usize| if k % 16 < 8 { 25.0 + k as f64 } else { 0.37 * (k as f64 - 30.0) };
            let x: Vec<f64> = (0..64).map(partner).collect();
            let mut shared = x.clone();
            set.run(Apply { values: &mut shared, hyperbolic: true });
            for (x, y) in x.iter().zip(&shared) {
                assert!(y.abs() <= 1.0 && (y - x.tanh()).abs() <= 4.5e-16, "{set}: {x} to {y}");
            }
            let mut z = [f64::INFINITY, -1e9, f64::NAN, 0.0, 710.0];
            set.run(Apply { values: &mut z, hyperbolic: false });
            assert_eq!((z[0], z[3], z[4]), (f64::INFINITY, 1.0, f64::INFINITY));
            assert!(z[1] < 1e-307 && z[1] > 0.0);
            if set != InstructionSet::Portable {
                assert!(y[2].is_nan() && z[2].is_nan(), "{set}");
            }
        }
    }

    #[test]
    fn every_instruction_set_gives_the_same_bits() {
        let x = grid(-30.0, 30.0);
        let run = |set: InstructionSet, hyperbolic| {
            let mut y = x.clone();
            set.run(Apply { values: &mut y, hyperbolic });
            y.iter().map(|y| y.to_bits()).collect::<Vec<_>>()
        };
        for set in InstructionSet::available() {
            for hyperbolic in [true, false] {
                assert!(run(set, hyperbolic) == run(InstructionSet::Portable, hyperbolic), "{set}");
            }
        }
    }
}
