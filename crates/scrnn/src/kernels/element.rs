//! The numbers that the products compute with: float64, which everything else is in, or float32.
//!
//! A kernel that is written over [`Element`] is the same sequence of operations for both. Sums that run over a whole
//! sequence are float64 in any case, see [`crate::objective`].

use std::fmt::Debug;
use std::ops::AddAssign;

use pulp::Simd;

use super::{activation, copy_few};

/// A float, its vectors, and what the kernels do with them. Each operation is pulp's of the same name.
pub trait Element: Copy + Debug + PartialEq + AddAssign + Send + Sync + 'static {
    /// As many as a register of the instruction set holds.
    type Vector<S: Simd>: Copy + Debug;
    /// Rows are padded to a multiple of this: the widest vector, a cache line.
    const ROWS: usize;
    /// 0.
    const ZERO: Self;
    /// 1.
    const ONE: Self;

    /// The nearest one.
    fn from_f64(value: f64) -> Self;
    /// The same value.
    fn to_f64(self) -> f64;
    /// Whether it is neither infinite nor NaN.
    fn is_finite(self) -> bool {
        self.to_f64().is_finite()
    }
    /// Takes over a few values, rounded.
    fn take(to: &mut [Self], from: &[f64]);
    /// Gives a few values away.
    fn give(from: &[Self], to: &mut [f64]);
    /// A list that is of this type already.
    fn own(list: &mut [f64]) -> Option<&mut [Self]>;
    /// The whole vectors of a list.
    fn vectors<S: Simd>(list: &[Self]) -> &[Self::Vector<S>];
    /// The whole vectors of a list, to be written.
    fn vectors_mut<S: Simd>(list: &mut [Self]) -> &mut [Self::Vector<S>];
    /// One value in all places.
    fn splat<S: Simd>(simd: S, value: Self) -> Self::Vector<S>;
    /// a + b.
    fn add<S: Simd>(simd: S, a: Self::Vector<S>, b: Self::Vector<S>) -> Self::Vector<S>;
    /// a b.
    fn mul<S: Simd>(simd: S, a: Self::Vector<S>, b: Self::Vector<S>) -> Self::Vector<S>;
    /// a b + c, rounded once.
    fn mul_add<S: Simd>(simd: S, a: Self::Vector<S>, b: Self::Vector<S>, c: Self::Vector<S>) -> Self::Vector<S>;
    /// c - a b, rounded once.
    fn negate_mul_add<S: Simd>(simd: S, a: Self::Vector<S>, b: Self::Vector<S>, c: Self::Vector<S>) -> Self::Vector<S>;
    /// `c <- tanh u` of a multiple of [`Element::ROWS`] values.
    fn tanh_rows<S: Simd>(simd: S, u: &[Self], c: &mut [Self]);

    /// `count` rounded up to whole vectors.
    #[must_use]
    fn padded(count: usize) -> usize {
        count.next_multiple_of(Self::ROWS)
    }

    /// A row stride for `count` values: whole vectors, and an odd number of cache lines, so that rows far apart do not
    /// fall into the same cache set.
    #[must_use]
    fn stride(count: usize) -> usize {
        (count.div_ceil(Self::ROWS) | 1) * Self::ROWS
    }
}

/// Values in a vector.
pub(crate) const fn lanes<S: Simd, E: Element>() -> usize {
    size_of::<E::Vector<S>>() / size_of::<E>()
}

/// The operations of one type, by pulp's names for it.
macro_rules! operations {
    ($float:ty, $vector:ident, $split:ident, $split_mut:ident, $splat:ident, $add:ident, $mul:ident, $mul_add:ident, $negate_mul_add:ident) => {
        type Vector<S: Simd> = S::$vector;
        const ROWS: usize = 64 / size_of::<$float>();
        const ZERO: Self = 0.0;
        const ONE: Self = 1.0;

        #[inline(always)]
        fn vectors<S: Simd>(list: &[Self]) -> &[S::$vector] {
            S::$split(list).0
        }

        #[inline(always)]
        fn vectors_mut<S: Simd>(list: &mut [Self]) -> &mut [S::$vector] {
            S::$split_mut(list).0
        }

        #[inline(always)]
        fn splat<S: Simd>(simd: S, value: Self) -> S::$vector {
            simd.$splat(value)
        }

        #[inline(always)]
        fn add<S: Simd>(simd: S, a: S::$vector, b: S::$vector) -> S::$vector {
            simd.$add(a, b)
        }

        #[inline(always)]
        fn mul<S: Simd>(simd: S, a: S::$vector, b: S::$vector) -> S::$vector {
            simd.$mul(a, b)
        }

        #[inline(always)]
        fn mul_add<S: Simd>(simd: S, a: S::$vector, b: S::$vector, c: S::$vector) -> S::$vector {
            simd.$mul_add(a, b, c)
        }

        #[inline(always)]
        fn negate_mul_add<S: Simd>(simd: S, a: S::$vector, b: S::$vector, c: S::$vector) -> S::$vector {
            simd.$negate_mul_add(a, b, c)
        }
    };
}

#[rustfmt::skip]
impl Element for f64 {
    operations!(
        f64, f64s, as_simd_f64s, as_mut_simd_f64s, splat_f64s, add_f64s, mul_f64s, mul_add_f64s, negate_mul_add_f64s
    );

    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        value
    }

    #[inline(always)]
    fn to_f64(self) -> f64 {
        self
    }

    #[inline(always)]
    fn take(to: &mut [Self], from: &[f64]) {
        copy_few(to, from);
    }

    #[inline(always)]
    fn give(from: &[Self], to: &mut [f64]) {
        copy_few(to, from);
    }

    #[inline(always)]
    fn own(list: &mut [f64]) -> Option<&mut [Self]> {
        Some(list)
    }

    #[inline(always)]
    fn tanh_rows<S: Simd>(simd: S, u: &[Self], c: &mut [Self]) {
        activation::tanh_rows(simd, u, c);
    }
}

#[rustfmt::skip]
impl Element for f32 {
    operations!(
        f32, f32s, as_simd_f32s, as_mut_simd_f32s, splat_f32s, add_f32s, mul_f32s, mul_add_f32s, negate_mul_add_f32s
    );

    #[inline(always)]
    #[allow(clippy::cast_possible_truncation, reason = "rounding is what is asked for")]
    fn from_f64(value: f64) -> Self {
        value as f32
    }

    #[inline(always)]
    fn to_f64(self) -> f64 {
        f64::from(self)
    }

    #[inline(always)]
    fn take(to: &mut [Self], from: &[f64]) {
        to.iter_mut().zip(from).for_each(|(to, from)| *to = Self::from_f64(*from));
    }

    #[inline(always)]
    fn give(from: &[Self], to: &mut [f64]) {
        to.iter_mut().zip(from).for_each(|(to, from)| *to = from.to_f64());
    }

    #[inline(always)]
    fn own(_: &mut [f64]) -> Option<&mut [Self]> {
        None
    }

    #[inline(always)]
    fn tanh_rows<S: Simd>(simd: S, u: &[Self], c: &mut [Self]) {
        activation::single::tanh_rows(simd, u, c);
    }
}
