//! An axis: the numbers that it spans, where its ticks are, and how they are written.

/// Numbers farther from 0 than this are drawn here: ticks have to be found between them.
const FARTHEST: f64 = 1e100;

/// A range of numbers on paper.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Axis {
    pub low: f64,
    pub high: f64,
}

impl Axis {
    /// A range that an axis can have: its ends are finite, and far enough apart that numbers lie between them.
    pub fn of((low, high): (f64, f64)) -> Self {
        let near = |end: f64| if end.is_nan() { 0.0 } else { end.clamp(-FARTHEST, FARTHEST) };
        let (low, high) = (near(low), near(high));
        let least = (1e-9 * low.abs().max(high.abs())).max(1.0 / FARTHEST);
        let middle = f64::midpoint(low, high);
        match high - low >= least {
            true => Self { low, high },
            false => Self { low: middle - least, high: middle + least },
        }
    }

    pub fn span(self) -> f64 {
        self.high - self.low
    }

    /// The same middle, so much longer.
    pub fn longer(self, factor: f64) -> Self {
        let (middle, half) = (f64::midpoint(self.low, self.high), 0.5 * self.span() * factor);
        Self { low: middle - half, high: middle + half }
    }

    /// Where a number lies, 0 at the low end and 1 at the high one; what lies outside is at an end.
    pub fn share(self, value: f64) -> f64 {
        ((value.clamp(self.low, self.high) - self.low) / self.span()).clamp(0.0, 1.0)
    }

    /// Round numbers at even distances: two or more, and about `most`.
    pub fn ticks(self, most: usize) -> Vec<f64> {
        let step = self.step(most);
        let (first, count) = ((self.low / step - 1e-9).ceil(), self.count(step));
        (0..count).map(|k| (first + k as f64) * step).filter(|tick| tick.is_finite()).collect()
    }

    fn count(self, step: f64) -> usize {
        ((self.high / step + 1e-9).floor() - (self.low / step - 1e-9).ceil() + 1.0).max(0.0) as usize
    }

    fn step(self, most: usize) -> f64 {
        let most = most.max(2);
        let power = 10_f64.powi((self.span() / most as f64).log10().floor() as i32);
        let steps = [0.5, 1.0, 2.0, 5.0, 10.0, 20.0].map(|of| of * power);
        let at = steps.iter().position(|step| self.count(*step) <= most).unwrap_or(steps.len() - 1);
        // One number alone tells no scale.
        let at = if self.count(steps[at]) < 2 { at.saturating_sub(1) } else { at };
        steps[at]
    }

    /// A number with as many digits as its neighbours need to differ, of about `most`.
    pub fn shown(self, value: f64, most: usize) -> String {
        shown(value, self.step(most))
    }
}

/// A number on an axis whose numbers are so far apart.
fn shown(value: f64, step: f64) -> String {
    if value != 0.0 && !(1e-3..1e6).contains(&step) {
        // 2.2e-3 and 2.6e-3, not 2e-3 and 3e-3.
        let place = |value: f64| (value.abs().log10() + 1e-9).floor();
        let digits = (place(value) - place(step)).clamp(0.0, 6.0) as usize;
        return format!("{value:.digits$e}");
    }
    let digits = (-step.log10() - 1e-9).ceil().clamp(0.0, 6.0) as usize;
    let text = format!("{value:.digits$}");
    // No "-0.0".
    if text.trim_start_matches('-').chars().all(|c| matches!(c, '0' | '.')) { "0".to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_on_axes_are_short() {
        let all = [
            shown(5e-4, 5e-4),
            shown(0.25, 0.05),
            shown(-0.0, 2.0),
            shown(500.0, 100.0),
            shown(0.01, 0.01),
            shown(1.0, 0.5),
            shown(2.2e-3, 2e-4),
            shown(-2.5e-3, 5e-4),
            shown(1e-3, 1e-3),
            shown(3e7, 1e6),
        ];
        assert_eq!(all, ["5e-4", "0.25", "0", "500", "0.01", "1.0", "2.2e-3", "-2.5e-3", "0.001", "3.0e7"]);
    }

    #[test]
    fn ticks_are_round_and_within_the_axis() {
        assert_eq!(Axis::of((-1.1, 1.1)).ticks(5), [-1.0, -0.5, 0.0, 0.5, 1.0]);
        assert_eq!(Axis::of((-1.1, 1.1)).ticks(3), [-1.0, 0.0, 1.0]);
        assert_eq!(Axis::of((0.0, 300.0)).ticks(7), [0.0, 50.0, 100.0, 150.0, 200.0, 250.0, 300.0]);
        for (low, high) in [(0.0, 1e-12), (-1e100, 1e100), (3.0, 3.0), (1e9, 1e9 + 10.0), (f64::NAN, 2.0), (-7e-3, 0.9)]
        {
            for most in 2..9 {
                let axis = Axis::of((low, high));
                let ticks = axis.ticks(most);
                assert!(ticks.len() >= 2 && ticks.len() <= most.max(4) + 1, "{axis:?} {most} {ticks:?}");
                let slack = 1e-8 * axis.span();
                assert!(
                    ticks.iter().all(|tick| (axis.low - slack..=axis.high + slack).contains(tick)),
                    "{axis:?} {ticks:?}"
                );
            }
        }
    }

    #[test]
    fn what_lies_outside_is_at_an_end() {
        let axis = Axis::of((0.0, 2.0));
        assert_eq!([-1.0, 0.5, 7.0].map(|value| axis.share(value)), [0.0, 0.25, 1.0]);
        assert_eq!(axis.longer(2.0), Axis { low: -1.0, high: 3.0 });
    }
}
