//! tanh in float32.
//!
//! ```text
//! x = n ln 2 / 2 + h,  s = 2^n,  t = tanh h:    tanh x = ((s - 1) + (s + 1) t) / ((s + 1) + (s - 1) t)
//! ```
//!
//! with a minimax polynomial of tanh h / h in h^2. In float32 a division is as fast as a few products, so that each vector
//! has its own.

use pulp::Simd;

/// 1.5 * 2^23: added and taken off again, it rounds to the nearest integer, which the lowest bits hold.
const ROUND: f32 = 12_582_912.0;
/// ln 2 / 2, and what its rounding leaves over.
const HALF_LN2: (f32, f32) = (0.346_573_6, -9.523_271e-10);
/// (tanh h / h - 1) / h^2 in h^2, on |h| <= ln 2 / 4; error below 2e-10 of tanh h / h.
const TANH: [f32; 3] = [-0.333_333_22, 0.133_311_6, -0.052_721_415];
/// From here on tanh is 1 in float32.
const LAST: f32 = 10.0;

/// tanh of one vector; NaN stays NaN.
#[inline(always)]
fn tanh<S: Simd>(simd: S, x: S::f32s) -> S::f32s {
    let (one, round) = (simd.splat_f32s(1.0), simd.splat_f32s(ROUND));
    // The bound comes first in both, so that NaN passes on x86.
    let bounded = simd.max_f32s(simd.splat_f32s(-LAST), simd.min_f32s(simd.splat_f32s(LAST), x));
    let rounded = simd.mul_add_f32s(bounded, simd.splat_f32s(2.0 * std::f32::consts::LOG2_E), round);
    let n = simd.sub_f32s(rounded, round);
    let h = simd.negate_mul_add_f32s(n, simd.splat_f32s(HALF_LN2.0), bounded);
    let h = simd.negate_mul_add_f32s(n, simd.splat_f32s(HALF_LN2.1), h);
    let z = simd.mul_f32s(h, h);
    let p = simd.mul_add_f32s(simd.splat_f32s(TANH[2]), z, simd.splat_f32s(TANH[1]));
    let p = simd.mul_add_f32s(p, z, simd.splat_f32s(TANH[0]));
    let t = simd.mul_add_f32s(simd.mul_f32s(p, z), h, h);
    let s = power_of_two(simd, rounded);
    let (less, more) = (simd.sub_f32s(s, one), simd.add_f32s(s, one));
    let y = simd.div_f32s(simd.mul_add_f32s(more, t, less), simd.mul_add_f32s(less, t, more));
    simd.max_f32s(simd.splat_f32s(-1.0), simd.min_f32s(one, y))
}

/// 2^n, where n is what [`ROUND`] was added to.
#[inline(always)]
fn power_of_two<S: Simd>(simd: S, rounded: S::f32s) -> S::f32s {
    let bits: S::u32s = pulp::bytemuck::cast(simd.add_f32s(rounded, simd.splat_f32s(127.0)));
    pulp::bytemuck::cast(simd.wrapping_dyn_shl_u32s(bits, simd.splat_u32s(23)))
}

/// `c <- tanh u` of whole vectors, within 3 units in the last place.
#[inline(always)]
pub fn tanh_rows<S: Simd>(simd: S, u: &[f32], c: &mut [f32]) {
    for (c, u) in S::as_mut_simd_f32s(c).0.iter_mut().zip(S::as_simd_f32s(u).0) {
        *c = tanh(simd, *u);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::{InstructionSet, Run};
    use pulp::WithSimd;

    struct Apply<'a>(&'a [f32], &'a mut [f32]);

    impl WithSimd for Apply<'_> {
        type Output = ();

        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) {
            tanh_rows(simd, self.0, self.1);
        }
    }

    fn grid(low: f32, high: f32) -> Vec<f32> {
        (0..64_000_u16).map(|k| low + (high - low) * f32::from(k) / 63_999.0).collect()
    }

    fn on(set: InstructionSet, x: &[f32]) -> Vec<f32> {
        let mut y = vec![0.0; x.len()];
        set.run(Apply(x, &mut y));
        y
    }

    #[test]
    fn it_is_within_three_units_in_the_last_place_and_the_same_on_every_instruction_set() {
        for x in [grid(-12.0, 12.0), grid(-1.0, 1.0), grid(-1e-3, 1e-3), grid(1e-30, 1e-29)] {
            let plain = on(InstructionSet::Portable, &x);
            for (x, y) in x.iter().zip(&plain) {
                let truth = f64::from(*x).tanh();
                let unit = f64::from(f32::from_bits((truth as f32).abs().to_bits() + 1)) - (truth as f32).abs() as f64;
                assert!((f64::from(*y) - truth).abs() <= 3.0 * unit && y.abs() <= 1.0, "tanh {x} = {truth}, not {y}");
            }
            for set in InstructionSet::available() {
                assert!(on(set, &x).iter().zip(&plain).all(|(a, b)| a.to_bits() == b.to_bits()), "{set}");
            }
        }
    }

    #[test]
    fn extremes_saturate_and_nan_stays() {
        let mut x = [0.0; 16];
        x[..6].copy_from_slice(&[f32::INFINITY, f32::NEG_INFINITY, f32::NAN, 0.0, 1e30, -1e30]);
        for set in InstructionSet::available() {
            let y = on(set, &x);
            assert_eq!((y[0], y[1], y[3], y[4], y[5]), (1.0, -1.0, 0.0, 1.0, -1.0));
            assert!(set == InstructionSet::Portable || y[2].is_nan(), "{set}");
        }
    }
}
