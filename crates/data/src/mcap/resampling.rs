//! Samples at even times from messages at any times.

/// Most samples that one message may be turned into, on average.
const MOST_PER_MESSAGE: u64 = 100;
/// Times by which neighbouring messages may be further apart than they are in the middle, or than the period.
const WIDEST_GAP: u64 = 10;
/// Share of the middle interval by which intervals may differ and still count as even.
const EVEN: f64 = 0.1;

/// Messages of one sequence, by their times.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Series {
    /// Nanoseconds, never falling.
    pub times: Vec<u64>,
    /// Messages x channels.
    pub values: Vec<f64>,
}

impl Series {
    /// The samples at every `period` nanoseconds from the first message on: where a message stands at that time its values,
    /// else on the straight line between its neighbours.
    ///
    /// # Errors
    /// What stands against it, as a sentence.
    pub fn resampled(&self, period: u64, channels: usize) -> Result<Vec<f64>, String> {
        let (Some(&first), Some(&last)) = (self.times.first(), self.times.last()) else { return Ok(Vec::new()) };
        let middle = middle_interval(&self.times).unwrap_or(period);
        let widest = WIDEST_GAP.saturating_mul(middle.max(period));
        if let Some(pair) = self.times.windows(2).find(|pair| pair[1] - pair[0] > widest) {
            return Err(format!(
                "no message came between {} s and {} s, which is too long to be bridged",
                seconds(pair[0]),
                seconds(pair[1])
            ));
        }
        let samples = (last - first) / period + 1;
        let most = MOST_PER_MESSAGE.saturating_mul(self.times.len() as u64);
        if samples > most {
            return Err(format!(
                "{} messages would become {samples} samples; needed: at most {most}",
                self.times.len()
            ));
        }
        let mut samples_at = Vec::with_capacity(usize::try_from(samples).unwrap_or(0).saturating_mul(channels));
        let mut after = 0;
        for k in 0..samples {
            // No more than `last`: it does not overflow.
            let time = first + k * period;
            // The last of all messages up to this time.
            while self.times.get(after + 1).is_some_and(|&next| next <= time) {
                after += 1;
            }
            let row = |index: usize| &self.values[index * channels..(index + 1) * channels];
            match self.times.get(after + 1) {
                Some(&next) if time > self.times[after] => {
                    let share = (time - self.times[after]) as f64 / (next - self.times[after]) as f64;
                    let between = row(after).iter().zip(row(after + 1)).map(|(a, b)| a + share * (b - a));
                    samples_at.extend(between);
                }
                _ => samples_at.extend(row(after)),
            }
        }
        Ok(samples_at)
    }

    /// Checks that the messages come at even times, as they must where they are taken as they are.
    ///
    /// # Errors
    /// What was found instead, as a sentence.
    pub fn check_even(&self) -> Result<(), String> {
        let Some(middle) = middle_interval(&self.times) else { return Ok(()) };
        let off = |interval: u64| (interval as f64 - middle as f64).abs() > EVEN * middle as f64;
        match self.times.windows(2).find(|pair| off(pair[1] - pair[0])) {
            Some(pair) => Err(format!(
                "messages come every {} s in the middle, but {} s apart at {} s",
                seconds(middle),
                seconds(pair[1] - pair[0]),
                seconds(pair[0])
            )),
            None => Ok(()),
        }
    }
}

/// The median of the intervals.
fn middle_interval(times: &[u64]) -> Option<u64> {
    let mut intervals: Vec<u64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let middle = intervals.len() / 2;
    (!intervals.is_empty()).then(|| *intervals.select_nth_unstable(middle).1)
}

/// Nanoseconds as seconds, without losing any.
pub fn seconds(nanoseconds: u64) -> String {
    let (whole, rest) = (nanoseconds / 1_000_000_000, nanoseconds % 1_000_000_000);
    let text = format!("{whole}.{rest:09}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_lie_on_the_lines_between_messages() {
        let series = Series { times: vec![100, 110, 130, 130, 140], values: vec![0., 1., 3., 5., 6.] };
        assert_eq!(series.resampled(10, 1).unwrap(), [0., 1., 2., 5., 6.]);
        assert_eq!(series.resampled(5, 1).unwrap(), [0., 0.5, 1., 1.5, 2., 2.5, 5., 5.5, 6.]);
        assert_eq!(series.resampled(15, 1).unwrap(), [0., 1.5, 5.]);
        let two = Series { times: vec![0, 10], values: vec![0., 1., 10., -1.] };
        assert_eq!(two.resampled(5, 2).unwrap(), [0., 1., 5., 0., 10., -1.]);
        assert_eq!(Series { times: vec![7], values: vec![4.0] }.resampled(1, 1).unwrap(), [4.0]);
        let late = Series { times: vec![u64::MAX - 10, u64::MAX], values: vec![0., 1.] };
        assert_eq!(late.resampled(10, 1).unwrap(), [0., 1.]);
    }

    #[test]
    fn gaps_and_senseless_periods_are_refused() {
        let gap = Series { times: vec![0, 10, 20, 30, 200, 210], values: vec![0.; 6] };
        assert!(gap.resampled(10, 1).unwrap_err().contains("between 0.00000003 s and 0.0000002 s"));
        assert!(gap.resampled(20, 1).is_ok());
        let two = Series { times: vec![0, 1_000_000_000], values: vec![0., 1.] };
        assert!(two.resampled(1, 1).unwrap_err().contains("would become 1000000001 samples"));
    }

    #[test]
    fn even_times_may_waver_a_little() {
        let series = |times: &[u64]| Series { times: times.to_vec(), values: vec![0.; times.len()] };
        assert!(series(&[0, 100, 205, 300]).check_even().is_ok());
        assert!(series(&[5]).check_even().is_ok());
        let said = series(&[0, 100_000_000, 200_000_000, 350_000_000]).check_even().unwrap_err();
        assert_eq!(said, "messages come every 0.1 s in the middle, but 0.15 s apart at 0.2 s");
        assert_eq!(seconds(1_500_000_000), "1.5");
        assert_eq!(seconds(20_000_000_000), "20");
    }
}
