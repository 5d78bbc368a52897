//! Labelled series: `.ts` files of sktime and the time series archives.
//!
//! ```text
//! @dimensions 2
//! @classLabel true walk wave
//! @data
//! 1.0,2.0,3.0:0.5,0.4,0.3:walk        one series: its dimensions, then its label
//! (0,1.0),(2,2.0):walk                with @timeStamps true: times and values
//! ```
//!
//! Each line is a sequence, called by its number and label. `?` is a missing value. Lines that begin with `#` or `%` are
//! comments.

use crate::problem::FormatProblem;
use crate::samples::{Samples, Track};
use crate::source::Source;
use crate::{FileError, Remark, Selection};

/// Reads a file.
///
/// # Errors
/// [`FileError`].
pub fn read(source: &Source<'_>, _: &Selection) -> Result<Samples, FileError> {
    let bytes = source.bytes()?;
    let at = |problem: FormatProblem| problem.at(source.name());
    let text = std::str::from_utf8(&bytes);
    let text = text.map_err(|_| at(FormatProblem::NotThis { kind: ".ts", why: "it is not text in UTF-8" }))?;
    // Sixteen bytes of memory, and a bit more, for each value of two characters.
    source.budget().take(bytes.len().saturating_mul(12)).map_err(|problem| at(problem.into()))?;
    parse(text.strip_prefix('\u{feff}').unwrap_or(text)).map_err(at)
}

/// What stands above the data.
#[derive(Debug, Default)]
struct Head {
    labelled: bool,
    times: bool,
    dimensions: Option<usize>,
}

fn parse(text: &str) -> Result<Samples, FormatProblem> {
    let mut head = Head::default();
    let mut lines =
        (1..).zip(text.lines().map(str::trim)).filter(|(_, line)| !line.is_empty() && !line.starts_with(['#', '%']));
    loop {
        let none = || FormatProblem::NotThis { kind: ".ts", why: "there is no line `@data` in it" };
        let (number, line) = lines.next().ok_or_else(none)?;
        let Some(rest) = line.strip_prefix('@') else {
            return Err(FormatProblem::Line {
                line: number,
                found: "a line above `@data` does not begin with `@`".to_owned(),
                needed: "the header of a .ts file, as sktime writes it".to_owned(),
            });
        };
        let mut words = rest.split_whitespace();
        let (key, value) = (words.next().unwrap_or_default().to_ascii_lowercase(), words.next().unwrap_or_default());
        let yes = value.eq_ignore_ascii_case("true");
        match key.as_str() {
            "data" => break,
            "classlabel" | "targetlabel" => head.labelled |= yes,
            "timestamps" => head.times = yes,
            "dimension" | "dimensions" => head.dimensions = value.parse().ok(),
            _ => {}
        }
    }
    let mut channels = head.dimensions.filter(|&count| count > 0);
    let mut tracks: Vec<Track> = Vec::new();
    let mut labels: Vec<&str> = Vec::new();
    for (number, line) in lines {
        let wrong =
            |found: String, needed: &str| FormatProblem::Line { line: number, found, needed: needed.to_owned() };
        let (data, label) = match line.rsplit_once(':').filter(|_| head.labelled) {
            Some((data, label)) => (data, label.trim()),
            None if head.labelled => {
                return Err(wrong("the line has no label".to_owned(), "`:` and a label at its end"));
            }
            None => (line, ""),
        };
        let dimensions: Vec<&str> = data.split(':').collect();
        let needed = *channels.get_or_insert(dimensions.len());
        if dimensions.len() != needed {
            return Err(wrong(
                format!("the line has {} dimensions", dimensions.len()),
                &format!("{needed}, as the header or the first line has"),
            ));
        }
        let mut columns = Vec::with_capacity(needed);
        let mut times: Vec<f64> = Vec::new();
        for dimension in dimensions {
            let (stamps, values) =
                if head.times { stamped(dimension) } else { plain(dimension).map(|values| (Vec::new(), values)) }
                    .map_err(|found| {
                        wrong(format!("`{}` is no value", crate::excerpt::shortened(found)), "numbers between commas")
                    })?;
            if !columns.is_empty() && stamps != times {
                return Err(wrong(
                    "the dimensions have different times".to_owned(),
                    "all dimensions at the same times",
                ));
            }
            times = stamps;
            columns.push(values);
        }
        let length = columns[0].len();
        if let Some(other) = columns.iter().find(|column| column.len() != length) {
            return Err(wrong(
                format!("the dimensions have {length} and {} values", other.len()),
                "dimensions of one length",
            ));
        }
        let values = (0..length).flat_map(|t| columns.iter().map(move |column| column[t])).collect();
        let count = tracks.len() + 1;
        let name = if label.is_empty() { count.to_string() } else { format!("{count} {label}") };
        if !label.is_empty() && !labels.contains(&label) && labels.len() < 100 {
            labels.push(label);
        }
        tracks.push(Track { name, values, times: nanoseconds(&times) });
    }
    let count = tracks.len();
    let mut samples = Samples::numbered(channels.unwrap_or(1), Vec::new());
    samples.tracks = tracks;
    if !labels.is_empty() {
        labels.sort_by(|a, b| crate::natural(a, b));
        let what = format!(
            "the {count} series have labels ({}), which stand in their names and are not learned",
            labels.join(", ")
        );
        samples.remarks.push(Remark::Understood { what });
    }
    Ok(samples)
}

fn value(text: &str) -> Result<f64, &str> {
    match text.trim() {
        "?" | "NaN" | "nan" => Ok(f64::NAN),
        number => number.parse().ok().filter(|number: &f64| number.is_finite()).ok_or(text),
    }
}

fn plain(dimension: &str) -> Result<Vec<f64>, &str> {
    dimension.split(',').map(value).collect()
}

/// `(0,1.0),(2,2.0)` as times and values.
fn stamped(dimension: &str) -> Result<(Vec<f64>, Vec<f64>), &str> {
    let pair = |pair: &'_ str| -> Option<(f64, f64)> {
        let (time, number) = pair.split_once(',')?;
        Some((time.trim().parse().ok().filter(|time: &f64| time.is_finite())?, value(number).ok()?))
    };
    let inside = dimension.trim().strip_prefix('(').and_then(|rest| rest.strip_suffix(')')).ok_or(dimension)?;
    inside
        .split("),(")
        .map(|text| pair(text).ok_or(text))
        .collect::<Result<Vec<_>, _>>()
        .map(|pairs| pairs.into_iter().unzip())
}

/// Times of series are counts or seconds.
fn nanoseconds(times: &[f64]) -> Vec<i64> {
    let first = times.first().copied().unwrap_or(0.0);
    times.iter().map(|time| ((time - first) * 1e9).round() as i64).collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::{Reading, inspect_bytes};

    fn read(text: &str) -> Result<Reading, FileError> {
        inspect_bytes(Path::new("x.ts"), text.as_bytes(), &Selection::default())
    }

    const HEAD: &str = "# made by hand\n@problemName waves\n@timeStamps false\n@univariate false\n@dimensions 2\n@classLabel true a b\n@data\n";

    #[test]
    fn series_of_several_dimensions_may_differ_in_length() {
        let reading = read(&format!("{HEAD}1,2,3:-1,-2,-3:a\n\n4,5:0.5,1e-1:b\n")).unwrap();
        let sequences = reading.data.sequences();
        assert_eq!((sequences[0].name.as_str(), sequences[1].name.as_str()), ("1 a", "2 b"));
        assert_eq!(sequences[0].values(), [1., -1., 2., -2., 3., -3.]);
        assert_eq!(sequences[1].values(), [4., 0.5, 5., 0.1]);
        assert!(reading.remarks.iter().any(|remark| remark.to_string().contains("labels (a, b)")));
    }

    #[test]
    fn labels_and_times_are_told_by_the_header() {
        let reading = read("@timestamps true\n@classlabel false\n@data\n(0,1.5),(0.5,2.5),(1,3.5)\n").unwrap();
        assert_eq!((reading.period, reading.data.sequences()[0].values()), (Some(0.5), [1.5, 2.5, 3.5].as_slice()));
        assert_eq!(reading.data.sequences()[0].name, "1");
    }

    /// What tests/python/write_series.py wrote with sktime.
    #[test]
    fn what_sktime_writes_is_read() {
        for (name, text) in [
            ("panel", include_str!("../tests/fixtures/series/panel.ts")),
            ("array", include_str!("../tests/fixtures/series/array.ts")),
        ] {
            assert!(text.starts_with("# Written by sktime"), "{name}");
            let reading = read(text).unwrap();
            let names: Vec<&str> = reading.data.sequences().iter().map(|one| one.name.as_str()).collect();
            assert_eq!(names, ["1 wave", "2 rest", "3 wave"], "{name}");
            for (e, sequence) in reading.data.sequences().iter().enumerate() {
                assert_eq!(sequence.len(), 6, "{name}");
                for t in 0..6 {
                    let expected = [0.0, 1.0].map(|c| 16.0 * e as f64 + t as f64 / 4.0 + c / 32.0);
                    let missing = name == "array" && (e, t) == (1, 2);
                    assert_eq!(sequence.sample(t)[1], expected[1], "{name}");
                    assert!(
                        sequence.sample(t)[0] == expected[0] || missing && sequence.sample(t)[0].is_nan(),
                        "{name}"
                    );
                }
            }
        }
    }

    #[test]
    fn times_at_the_end_of_all_numbers_are_refused_and_overflow_nothing() {
        for times in ["1,16666666666666666,20.5", "-9e9,9e9,-9e9", "9.2e9,-9.2e9,9.2e9", "0,1e300,2e300"] {
            let rows: Vec<String> = times.split(',').map(|time| format!("({time},1)")).collect();
            let error = read(&format!("@timeStamps true\n@classLabel false\n@data\n{}\n", rows.join(",")));
            assert!(error.is_err() || times.contains("1e300"), "{times}");
        }
    }

    #[test]
    fn what_is_wrong_is_said_with_its_line() {
        let says = |text: &str, part: &str| {
            let error = read(text).unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        };
        says(&format!("{HEAD}1,2:3,4:a\n1,x:3,4:b\n"), "line 9: `x` is no value");
        says(&format!("{HEAD}1,2:3:a\n"), "line 8: the dimensions have 2 and 1 values");
        says(&format!("{HEAD}1,2:a\n"), "line 8: the line has 1 dimensions; needed: 2");
        says("1,2,3\n", "line 1: a line above `@data`");
        says("@problemName x\n", "there is no line `@data`");
        says("@timestamps true\n@data\n(0,1),(1\n", "is no value");
        assert!(matches!(read("@data\n"), Err(FileError::Empty { .. })));
        assert!(matches!(read("@classLabel true a\n@data\n1,?,3:a\n"), Err(FileError::NotFinite { .. }) | Ok(_)));
    }

    #[test]
    fn damaged_bytes_never_panic() {
        crate::tests_random::damage(
            format!("{HEAD}1,2,3:-1,-2,?:a\n4,5:0.5,1e-1:b\n").as_bytes(),
            2000,
            16 << 20,
            |bytes| {
                let _ = inspect_bytes(Path::new("x.ts"), bytes, &Selection::default());
            },
        );
    }
}
