//! New data beside the range of what a network learned: what lies far outside it cannot predict.

use std::fmt;

use scrnn::dataset::Dataset;

use crate::trained::Trained;

/// How far outside of what was learned, in its width, a value is another matter than the usual spread.
const FAR: f64 = 0.5;
/// How many degrees a radian has, and how far from that the ratio of two movements may be.
const DEGREES: (f64, f64) = (40.0, 82.0);

/// From the least value to the greatest.
pub type Range = (f64, f64);

/// A channel of new data that a network does not know so.
#[derive(Debug, Clone, PartialEq)]
pub struct Unfamiliar {
    /// Its name.
    pub channel: String,
    /// The range that was learned.
    pub learned: Range,
    /// The range that was found.
    pub found: Range,
    /// Whether the two are as far from each other as degrees and radians.
    pub units: bool,
}

impl fmt::Display for Unfamiliar {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { channel, learned, found, units } = self;
        let (a, b) = (shown(*learned), shown(*found));
        match units {
            true => write!(
                f,
                "channel {channel} reaches {b}, and {a} was learned: degrees and radians? the network does not know such \
                 movements"
            ),
            false => write!(
                f,
                "channel {channel} reaches {b}, and {a} was learned: the network does not know such values (other units, \
                 another offset?)"
            ),
        }
    }
}

/// `-1.5 to 2`, in four digits.
fn shown((low, high): Range) -> String {
    if low == high {
        return number(low);
    }
    format!("{} to {}", number(low), number(high))
}

fn number(value: f64) -> String {
    let size = value.abs();
    if size != 0.0 && !(1e-3..1e6).contains(&size) {
        return format!("{value:.3e}");
    }
    let digits = if size == 0.0 { 0 } else { (3 - size.log10().floor() as i32).max(0) as usize };
    let text = format!("{value:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// The least and the greatest sample of each channel; none where nothing was observed.
#[must_use]
pub fn ranges(data: &Dataset) -> Vec<Option<Range>> {
    let n = data.channels().len();
    let mut ranges: Vec<Option<Range>> = vec![None; n];
    for sample in data.sequences().iter().flat_map(|sequence| sequence.values().chunks_exact(n)) {
        for (range, &value) in ranges.iter_mut().zip(sample).filter(|(_, value)| value.is_finite()) {
            let (low, high) = range.unwrap_or((value, value));
            *range = Some((low.min(value), high.max(value)));
        }
    }
    ranges
}

/// The range of each channel that a network learned; of networks of earlier versions, which did not note it, what their
/// predictions reach.
#[must_use]
pub fn learned(trained: &Trained) -> Vec<Range> {
    let scaling = &trained.checkpoint.scaling;
    let n = trained.checkpoint.channels.len();
    match trained.notes.as_ref().map(|notes| &notes.data.ranges).filter(|ranges| ranges.len() == n) {
        Some(ranges) => ranges.clone(),
        None => {
            let ends = |i: usize| (scaling.to_raw(i, -1.0), scaling.to_raw(i, 1.0));
            (0..n).map(ends).map(|(a, b)| (a.min(b), a.max(b))).collect()
        }
    }
}

/// Whether a value lies far outside of a range. One of no width knows nothing else than its value.
#[must_use]
pub fn is_far((low, high): Range, value: f64) -> bool {
    let width = if high > low { high - low } else { low.abs().max(f64::MIN_POSITIVE) };
    value < low - FAR * width || value > high + FAR * width
}

/// The channels of `data`, which are those that were learned and in their order, that lie far outside of what the network
/// knows, or move by another unit.
#[must_use]
pub fn unfamiliar(trained: &Trained, data: &Dataset) -> Vec<Unfamiliar> {
    among(&learned(trained), data)
}

fn among(learned: &[Range], data: &Dataset) -> Vec<Unfamiliar> {
    let found = ranges(data);
    let width = |(low, high): Range| high - low;
    let ratio = |learned: Range, found: Range| (width(learned) / width(found)).max(width(found) / width(learned));
    let pairs = || learned.iter().zip(&found).filter_map(|(learned, found)| Some((*learned, (*found)?)));
    let moving = pairs().filter(|(a, b)| width(*a) > 0.0 && width(*b) > 0.0).count();
    let as_units = |(a, b): &(Range, Range)| (DEGREES.0..DEGREES.1).contains(&ratio(*a, *b));
    // One joint may rest; that all do so by this factor is no chance.
    let units = moving > 0 && 2 * pairs().filter(as_units).count() > moving;
    let of = |(channel, (learned, found)): (&String, (&Range, &Option<Range>))| {
        let (learned, found) = (*learned, (*found)?);
        let far = is_far(learned, found.0) || is_far(learned, found.1);
        let by_unit = units && as_units(&(learned, found));
        (far || by_unit).then(|| Unfamiliar { channel: channel.clone(), learned, found, units: by_unit })
    };
    data.channels().iter().zip(learned.iter().zip(&found)).filter_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use scrnn::dataset::Sequence;

    fn told(learned: &[Range], values: &[f64]) -> Vec<String> {
        let n = learned.len();
        let sequence = Sequence::new("", n, values.to_vec()).unwrap();
        let data = Dataset::new(Dataset::numbered_channels(n), vec![sequence]).unwrap();
        among(learned, &data).iter().map(ToString::to_string).collect()
    }

    #[test]
    fn what_is_far_outside_is_named_with_both_ranges() {
        assert_eq!(told(&[(-1.0, 1.0)], &[-1.5, 1.9]), [""; 0]);
        let far = told(&[(-1.0, 1.0), (0.0, 5.0)], &[0.25, 3.0, 2.5, 4.0]);
        assert_eq!(far.len(), 1);
        assert!(
            far[0].starts_with("channel y1 reaches 0.25 to 2.5, and -1 to 1 was learned: the network does not"),
            "{far:?}"
        );
        assert!(told(&[(-1.0, 1.0)], &[-120.0, 100.0])[0].contains("-120 to 100"));
        // A channel that stood still.
        assert!(told(&[(2.0, 2.0)], &[2.5, 2.6]).is_empty());
        assert_eq!(told(&[(2.0, 2.0)], &[3.5, 2.6]).len(), 1);
    }

    #[test]
    fn degrees_and_radians_are_told_both_ways() {
        let degrees = [(-60.0, 60.0), (10.0, 50.0)];
        let radians: Vec<f64> = [-60.0, 10.0, 60.0, 50.0].map(f64::to_radians).to_vec();
        let found = told(&degrees, &radians);
        assert_eq!(found.len(), 2);
        assert!(found[0].contains("degrees and radians?") && found[0].contains("-1.047 to 1.047"), "{found:?}");
        assert_eq!(told(&[(-1.047, 1.047)], &[-60.0, 60.0]).len(), 1);
        // One of two channels that rests.
        assert!(told(&degrees, &[0.0, 10.0, 2.0, 50.0]).is_empty());
    }
}
