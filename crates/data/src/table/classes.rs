//! Tables with a series in each row, its class before it, as the UCR archive has them.
//!
//! ```text
//! 1 <tab> -0.64 <tab> -0.62 <tab> ...      a sequence of one channel, of class 1
//! 2 <tab>  0.13 <tab>  0.09 <tab> ...
//! ```
//!
//! They are told by how their values behave: whole numbers of a few kinds in the first column, and rows along which values go on
//! smoothly while they jump from row to row.

use crate::natural;
use crate::remark::Remark;
use crate::samples::{Samples, Track};

/// Fewest values of a series.
const SHORTEST: usize = 10;
/// Most classes.
const CLASSES: usize = 100;
/// How rough rows may be: of noise the mean squared step is twice the variance.
const SMOOTH: f64 = 0.5;

/// The rows of a table without a header as sequences, if that is what they are. Values missing at the end of a row are none.
pub fn by_rows(samples: &Samples) -> Option<Samples> {
    let [track] = samples.tracks.as_slice() else { return None };
    let width = samples.channels.len();
    if samples.facts.named || !track.times.is_empty() || width <= SHORTEST {
        return None;
    }
    let rows: Vec<&[f64]> = track.values.chunks_exact(width).collect();
    let mut classes: Vec<i64> = Vec::new();
    for row in &rows {
        let class = row[0];
        if class.fract() != 0.0 || class.abs() > 1e6 {
            return None;
        }
        if !classes.contains(&(class as i64)) {
            classes.push(class as i64);
        }
        if classes.len() > CLASSES {
            return None;
        }
    }
    if rows.len() < 2 || 2 * classes.len() > rows.len() || !goes_on_along_rows(&rows) {
        return None;
    }
    let tracks = rows.iter().enumerate().map(|(index, row)| {
        let end = row.iter().rposition(|value| !value.is_nan()).unwrap_or(0);
        Track { name: format!("{} {}", index + 1, row[0] as i64), values: row[1..=end].to_vec(), times: Vec::new() }
    });
    let mut turned = Samples::numbered(1, Vec::new());
    turned.tracks = tracks.collect();
    let mut labels: Vec<String> = classes.iter().map(i64::to_string).collect();
    labels.sort_by(|a, b| natural(a, b));
    let what = format!(
        "each of the {} rows was taken as a sequence: its first number ({}) as its class, which stands in its name",
        rows.len(),
        labels.join(", ")
    );
    turned.remarks = vec![Remark::Understood { what }];
    Some(turned)
}

/// Whether values go on along rows, and more so than down the columns.
fn goes_on_along_rows(rows: &[&[f64]]) -> bool {
    let along = roughness(rows.iter().map(|row| row[1..].iter().copied().filter(|value| value.is_finite())));
    let width = rows[0].len();
    let down =
        roughness((1..width).map(|column| rows.iter().map(move |row| row[column]).filter(|value| value.is_finite())));
    along < SMOOTH && along < 0.5 * down
}

/// The mean square of steps over the variance, of all lines together.
fn roughness<L: Iterator<Item = f64> + Clone>(lines: impl Iterator<Item = L>) -> f64 {
    let (mut squares, mut steps, mut spread, mut count) = (0.0, 0_usize, 0.0, 0_usize);
    for line in lines {
        let (sum, here) = line.clone().fold((0.0, 0_usize), |(sum, count), value| (sum + value, count + 1));
        let mean = sum / here.max(1) as f64;
        spread += line.clone().map(|value| (value - mean).powi(2)).sum::<f64>();
        count += here;
        squares += line.clone().zip(line.skip(1)).map(|(a, b)| (b - a).powi(2)).sum::<f64>();
        steps += here.saturating_sub(1);
    }
    (squares / steps.max(1) as f64) / (spread / count.max(1) as f64)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use scrnn::dataset::Dataset;

    use crate::{Selection, inspect_bytes};

    fn read(text: &str) -> Dataset {
        inspect_bytes(Path::new("x.tsv"), text.as_bytes(), &Selection::default()).unwrap().data
    }

    fn table(rows: usize, columns: usize, value: impl Fn(usize, usize) -> String) -> String {
        let row = |r| (0..columns).map(|c| value(r, c)).collect::<Vec<_>>().join("\t") + "\n";
        (0..rows).map(row).collect()
    }

    /// A wave of another phase in each row.
    fn wave(row: usize, column: usize) -> f64 {
        (column as f64 * 0.3 + row as f64 * 2.1).sin()
    }

    #[test]
    fn rows_behind_their_class_are_sequences() {
        let class = |r: usize| if r.is_multiple_of(3) { 2 } else { -1 };
        let data = read(&table(9, 31, |r, c| if c == 0 { class(r).to_string() } else { wave(r, c).to_string() }));
        assert_eq!((data.channels(), data.sequences().len()), (&["y1".to_owned()][..], 9));
        assert_eq!((data.sequences()[0].name.as_str(), data.sequences()[8].name.as_str()), ("1 2", "9 -1"));
        assert_eq!((data.sequences()[8].len(), data.sequences()[8].values()[29]), (30, wave(8, 30)));
        // Shorter ones are filled with NaN, and classes may be written as decimals.
        let data = read(&table(9, 31, |r, c| match c {
            0 => format!("{}.0000e+00", r % 2 + 1),
            c if r == 4 && c > 20 => "NaN".to_owned(),
            c => wave(r, c).to_string(),
        }));
        assert_eq!((data.sequences()[4].len(), data.sequences()[4].name.as_str()), (20, "5 1"));
    }

    #[test]
    fn samples_of_many_channels_stay_what_they_are() {
        // Joints that move together in time; the first is on or off.
        let joints = table(200, 14, |r, c| match c {
            0 => usize::from(r % 40 > 20).to_string(),
            c => (wave(c, 0) + (r as f64 * 0.05 + c as f64).sin() * 0.3).to_string(),
        });
        assert_eq!(read(&joints).channels().len(), 14);
        // A sensor's row of cells, smooth in space and in time.
        let cells = table(200, 33, |r, c| match c {
            0 => (r % 2).to_string(),
            c => ((c as f64 - 16.0 - (r as f64 * 0.05).sin()) / 8.0).sin().to_string(),
        });
        assert_eq!(read(&cells).channels().len(), 33);
    }
}
