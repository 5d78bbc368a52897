//! tanh and exp over slices.
//!
//! Both reduce the argument by multiples of ln 2, evaluate a near-minimax polynomial of expm1 (Chebyshev, degree 11),
//! and put the power of two back through the exponent's bits. tanh x = expm1(2x) / (expm1(2x) + 2) keeps small
//! arguments exact to the last bits. NaN stays NaN.

use pulp::Simd;

/// 1.5 * 2^52: added and taken off again, it rounds to the nearest integer.
const ROUND: f64 = 6_755_399_441_055_744.0;
/// 1.5 * 2^20 plus the exponent's bias: puts an integer where a shift by 20 bits of the upper half makes it an exponent.
const EXPONENT: f64 = 1_572_864.0 + 1023.0;

const LN2_HIGH: f64 = 0.693_147_180_369_123_8;
const LN2_LOW: f64 = 1.908_214_929_270_587_7e-10;
const HALF_LN2_HIGH: f64 = 0.346_573_590_184_561_9;
const HALF_LN2_LOW: f64 = 9.541_074_646_352_939e-11;

/// Coefficients of (expm1(2h) - 2h) / h^2 on |h| <= ln 2 / 4; error below 5e-16.
const EXPM1_TWICE: [f64; 10] = [
    2.000_000_000_000_000_4,
    1.333_333_333_333_333_4,
    0.666_666_666_665_986,
    0.266_666_666_666_562,
    0.088_888_889_070_167_78,
    0.025_396_825_424_708_63,
    0.006_349_189_451_764_32,
    0.001_410_932_145_151_85,
    0.000_282_829_705_680_995_8,
    0.000_051_405_589_494_805_13,
];

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

/// tanh of one vector, within 4 units in the last place.
#[inline(always)]
pub fn tanh<S: Simd>(simd: S, x: S::f64s) -> S::f64s {
    // Beyond 20 the result is 1 to the last bit. The bound comes first in both, so that NaN passes on x86.
    let bounded = simd.min_f64s(simd.splat_f64s(20.0), x);
    let x = simd.max_f64s(simd.splat_f64s(-20.0), bounded);
    let round = simd.splat_f64s(ROUND);
    let n = simd.sub_f64s(simd.mul_add_f64s(x, simd.splat_f64s(2.0 * std::f64::consts::LOG2_E), round), round);
    let h = simd.mul_add_f64s(n, simd.splat_f64s(-HALF_LN2_HIGH), x);
    let h = simd.mul_add_f64s(n, simd.splat_f64s(-HALF_LN2_LOW), h);
    let h2 = simd.mul_f64s(h, h);
    let p = simd.mul_add_f64s(polynomial(simd, h, &EXPM1_TWICE), h2, simd.add_f64s(h, h));
    let s = power_of_two(simd, n);
    let e = simd.mul_add_f64s(s, p, simd.sub_f64s(s, simd.splat_f64s(1.0)));
    simd.div_f64s(e, simd.add_f64s(e, simd.splat_f64s(2.0)))
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
                let (vectors, rest) = S::as_mut_simd_f64s(self.values);
                assert!(rest.is_empty());
                for value in vectors {
                    *value = tanh(simd, *value);
                }
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
    fn tanh_is_within_four_units_in_the_last_place() {
        for set in InstructionSet::available() {
            for x in [grid(-25.0, 25.0), grid(-1.0, 1.0), grid(-1e-3, 1e-3), grid(1e-300, 1e-290)] {
                let mut y = x.clone();
                set.run(Apply { values: &mut y, hyperbolic: true });

                assert!(worst(&x, &y, f64::tanh) <= 4.0, "{set}: {}", worst(&x, &y, f64::tanh));
                assert!(x.iter().zip(&y).all(|(x, y)| (y - x.tanh()).abs() <= 3.4e-16));
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

    #[test]
    fn extremes_saturate_and_nan_stays() {
        for set in InstructionSet::available() {
            let mut y = [f64::INFINITY, f64::NEG_INFINITY, f64::NAN, 0.0, 1e9, -1e9, 40.0, -40.0];
            set.run(Apply { values: &mut y, hyperbolic: true });
            assert_eq!((y[0], y[1], y[3], y[4], y[5], y[6], y[7]), (1.0, -1.0, 0.0, 1.0, -1.0, 1.0, -1.0));
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
