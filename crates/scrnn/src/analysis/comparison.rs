//! Do two lists of numbers differ? t-tests, and the test for being equal.
//!
//! ```text
//! paired:  t = mean(d) / sqrt(var(d) / n),                      n - 1 degrees of freedom
//! Welch:   t = (mean(a) - mean(b)) / sqrt(s_a + s_b),  s = var / n,
//!          (s_a + s_b)^2 / (s_a^2 / (n_a - 1) + s_b^2 / (n_b - 1)) degrees of freedom
//! equal:   both t-tests against -margin and +margin reject (two one-sided tests, Schuirmann 1987)
//! Holm:    of m tests, in the order of their p, the k-th is taken as max over j <= k of (m - j + 1) p_j   (Holm 1979)
//! ```
//!
//! Student's distribution comes from the incomplete beta function, which is that of the crate `statrs`.

use serde::Serialize;
use statrs::function::beta::checked_beta_reg;

use crate::evaluation::mean_and_deviation;

/// What a t-test found.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TTest {
    /// Mean of the first list minus mean of the second.
    pub difference: f64,
    /// t; infinite where all values of each list are the same and the means differ.
    pub t: f64,
    /// Degrees of freedom.
    pub degrees: f64,
    /// Two-sided: how likely a |t| at least this large is if there is no difference.
    pub p: f64,
    /// Standard error of the difference.
    #[serde(skip)]
    error: f64,
}

impl TTest {
    /// For values that belong together in pairs. None for lists of different lengths or without two pairs.
    #[must_use]
    pub fn paired(a: &[f64], b: &[f64]) -> Option<Self> {
        if a.len() != b.len() || a.len() < 2 {
            return None;
        }
        let differences: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
        let (mean, deviation) = mean_and_deviation(&differences);
        let n = a.len() as f64;
        Some(Self::new(mean, deviation / n.sqrt(), n - 1.0))
    }

    /// For independent values whose variances may differ (Welch 1947). None where a list has fewer than two.
    #[must_use]
    pub fn welch(a: &[f64], b: &[f64]) -> Option<Self> {
        if a.len() < 2 || b.len() < 2 {
            return None;
        }
        let part = |list: &[f64]| {
            let (mean, deviation) = mean_and_deviation(list);
            (mean, deviation * deviation / list.len() as f64, list.len() as f64 - 1.0)
        };
        let ((mean_a, a, n_a), (mean_b, b, n_b)) = (part(a), part(b));
        let degrees = match a + b {
            0.0 => n_a + n_b,
            sum => sum * sum / (a * a / n_a + b * b / n_b),
        };
        Some(Self::new(mean_a - mean_b, (a + b).sqrt(), degrees))
    }

    fn new(difference: f64, error: f64, degrees: f64) -> Self {
        let t = against(difference, error);
        Self { difference, t, degrees, p: 2.0 * upper_tail(t.abs(), degrees), error }
    }

    /// How likely means that differ by `margin` or more would look as equal as these, or more so: small if they are
    /// equal for practical purposes.
    #[must_use]
    pub fn p_of_equivalence(&self, margin: f64) -> f64 {
        let above = against(self.difference + margin, self.error);
        let below = against(margin - self.difference, self.error);
        upper_tail(above, self.degrees).max(upper_tail(below, self.degrees))
    }
}

/// The p of several tests, each as large as it has to be so that one of them is below 0.05 by chance in 5 % of all cases at most. NaN
/// stays NaN, and does not count.
#[must_use]
pub fn holm(p: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p.len()).filter(|&k| !p[k].is_nan()).collect();
    order.sort_by(|&a, &b| p[a].total_cmp(&p[b]));
    let mut corrected = vec![f64::NAN; p.len()];
    let mut largest = 0.0_f64;
    for (rank, &k) in order.iter().enumerate() {
        largest = largest.max((order.len() - rank) as f64 * p[k]).min(1.0);
        corrected[k] = largest;
    }
    corrected
}

/// A distance in standard errors.
fn against(distance: f64, error: f64) -> f64 {
    if distance == 0.0 { 0.0 } else { distance / error }
}

/// P(T >= t) of Student's distribution. NaN where t is, or where there are no degrees of freedom.
///
/// ```text
/// P(T >= t) = I_x(n / 2, 1 / 2) / 2,   x = n / (n + t^2),   for t >= 0 and n degrees of freedom
/// ```
#[must_use]
pub fn upper_tail(t: f64, degrees: f64) -> f64 {
    let x = if t.is_infinite() { 0.0 } else { degrees / (degrees + t * t) };
    let half = 0.5 * checked_beta_reg(0.5 * degrees, 0.5, x).unwrap_or(f64::NAN);
    if t >= 0.0 { half } else { 1.0 - half }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tails_agree_with_closed_forms_and_tables() {
        // One degree of freedom is Cauchy's distribution, two have an algebraic one.
        for t in [0.0, 0.3, 1.0, 4.0, 50.0, 1e4] {
            let cauchy = 0.5 - f64::atan(t) / std::f64::consts::PI;
            assert!((upper_tail(t, 1.0) - cauchy).abs() < 1e-13, "{t}: {} {cauchy}", upper_tail(t, 1.0));
            let two = 0.5 - 0.5 * t / (2.0 + t * t).sqrt();
            assert!((upper_tail(t, 2.0) - two).abs() < 1e-13, "{t}: {} {two}", upper_tail(t, 2.0));
            assert!((upper_tail(t, 7.5) + upper_tail(-t, 7.5) - 1.0).abs() < 1e-15);
        }
        // Upper 2.5 % and 0.05 % points from tables of the distribution, to their last digit.
        for (degrees, t, p) in
            [(18.0, 2.1009, 0.025), (9.0, 2.2622, 0.025), (18.0, 3.9216, 0.0005), (30.0, 3.6460, 0.0005)]
        {
            assert!((upper_tail(t, degrees) / p - 1.0).abs() < 2e-4, "{degrees} {t}: {}", upper_tail(t, degrees));
        }
        assert_eq!(upper_tail(f64::INFINITY, 3.0), 0.0);
        assert!(upper_tail(f64::NAN, 3.0).is_nan() && upper_tail(1.0, 0.0).is_nan() && upper_tail(1.0, -2.0).is_nan());
        // With many degrees of freedom it is the normal distribution, whose upper 2.5 % point is 1.959964.
        for degrees in [1e4, 1e6, 1e8] {
            let p = upper_tail(1.959_963_984_540_054, degrees);
            assert!((p / 0.025 - 1.0).abs() < 6.0 / degrees + 1e-9, "{degrees}: {p}");
        }
    }

    #[test]
    fn tests_by_hand() {
        // Differences 1, 2, 3: mean 2, deviation 1.
        let paired = TTest::paired(&[2.0, 4.0, 6.0], &[1.0, 2.0, 3.0]).unwrap();
        assert!((paired.t - 12_f64.sqrt()).abs() < 1e-12 && paired.degrees == 2.0, "{paired:?}");
        assert!((paired.p - 2.0 * (0.5 - 0.5 * paired.t / (2.0 + paired.t * paired.t).sqrt())).abs() < 1e-12);
        // Variances 1 and 4, three values each: s = 1/3 and 4/3.
        let welch = TTest::welch(&[1.0, 2.0, 3.0], &[6.0, 8.0, 10.0]).unwrap();
        assert!((welch.t + 6.0 / (5.0_f64 / 3.0).sqrt()).abs() < 1e-12, "{welch:?}");
        assert!((welch.degrees - 25.0 / 8.5).abs() < 1e-12, "{welch:?}");
        assert_eq!(TTest::paired(&[1.0], &[2.0]), None);
        assert_eq!(TTest::paired(&[1.0, 2.0], &[2.0]), None);
        assert_eq!(TTest::welch(&[1.0], &[2.0, 3.0]), None);
    }

    #[test]
    fn several_tests_are_corrected_by_hand() {
        // 4 x 0.01, 3 x 0.02, 2 x 0.04, and 0.03 may not be below its forerunner.
        let corrected = holm(&[0.04, 0.01, f64::NAN, 0.02, 0.03]);
        let expected = [0.06, 0.04, f64::NAN, 0.06, 0.06];
        for (found, expected) in corrected.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-15 || found.is_nan() && expected.is_nan(), "{corrected:?}");
        }
        assert_eq!((holm(&[0.9, 0.8]), holm(&[])), (vec![1.0, 1.0], vec![]));
    }

    #[test]
    fn lists_without_spread_differ_or_do_not() {
        let same = TTest::paired(&[1.0, 1.0], &[1.0, 1.0]).unwrap();
        assert_eq!((same.t, same.p, same.p_of_equivalence(0.5)), (0.0, 1.0, 0.0));
        let other = TTest::welch(&[2.0, 2.0], &[1.0, 1.0]).unwrap();
        assert_eq!((other.t, other.p, other.p_of_equivalence(0.5)), (f64::INFINITY, 0.0, 1.0));
    }

    #[test]
    fn equivalence_needs_a_margin_that_the_spread_allows() {
        let a = [10.1, 9.9, 10.2, 9.8, 10.0];
        let b = [10.0, 10.0, 10.1, 9.9, 10.0];
        let found = TTest::paired(&a, &b).unwrap();
        assert!(found.p > 0.9, "{found:?}");
        assert!(found.p_of_equivalence(0.5) < 0.001, "{}", found.p_of_equivalence(0.5));
        assert!(found.p_of_equivalence(0.02) > 0.2, "{}", found.p_of_equivalence(0.02));
        assert!(TTest::paired(&[1.0, 2.0, 3.1], &[0.0, 1.0, 2.0]).unwrap().p_of_equivalence(0.5) > 0.99);
    }
}
