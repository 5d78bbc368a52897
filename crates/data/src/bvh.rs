//! BVH: motion capture as a skeleton and its angles.
//!
//! ```text
//! HIERARCHY
//! ROOT Hips { OFFSET 0 0 0 CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation JOINT ... }
//! MOTION
//! Frames: 120
//! Frame Time: 0.008333
//! one line of numbers for each frame, in the order of the channels above
//! ```
//!
//! The channel `Zrotation` of the joint `Hips` is called `Hips.Zrotation`. Rotations are in degrees; positions are in
//! whatever unit the skeleton has.

use std::collections::HashMap;

use crate::budget::Budget;
use crate::problem::FormatProblem;
use crate::reading::Facts;
use crate::samples::{Samples, Track};
use crate::source::Source;
use crate::{FileError, Remark, Selection};

const KIND: &str = "BVH";

/// Reads a file.
///
/// # Errors
/// [`FileError`].
pub fn read(source: &Source<'_>, _: &Selection) -> Result<Samples, FileError> {
    let bytes = source.bytes()?;
    let at = |problem: FormatProblem| problem.at(source.name());
    parse(&String::from_utf8_lossy(&bytes), source.budget()).map_err(at)
}

fn parse(text: &str, budget: &Budget) -> Result<Samples, FormatProblem> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    if !text.trim_start().starts_with("HIERARCHY") {
        return Err(FormatProblem::NotThis { kind: KIND, why: "it does not begin with HIERARCHY" });
    }
    let lines = |(_, line): &(usize, &str)| !line.is_empty();
    let mut lines = (1..).zip(text.lines().map(str::trim)).filter(lines).peekable();
    let (channels, units) = skeleton(&mut lines, budget)?;
    let mut told = |name: &str| -> Result<(usize, f64), FormatProblem> {
        let (line, text) =
            lines.next().ok_or(FormatProblem::Damaged { kind: KIND, what: "it ends before its motion" })?;
        let number = text.strip_prefix(name).and_then(|rest| rest.trim_start().strip_prefix(':')).map(str::trim);
        let number =
            number.and_then(|number| number.parse().ok()).filter(|number: &f64| number.is_finite() && *number >= 0.0);
        number.map(|number| (line, number)).ok_or_else(|| FormatProblem::Line {
            line,
            found: format!("`{}`", crate::excerpt::shortened(text)),
            needed: format!("`{name}:` and a number"),
        })
    };
    let (_, promised) = told("Frames")?;
    let (line, period) = told("Frame Time")?;
    if period == 0.0 {
        return Err(FormatProblem::Line {
            line,
            found: "no time passes between frames".to_owned(),
            needed: "the seconds between them".to_owned(),
        });
    }
    budget.take(text.len().saturating_mul(8))?;
    let mut values: Vec<f64> = Vec::new();
    for (line, text) in lines {
        let before = values.len();
        for word in text.split_ascii_whitespace() {
            let number = word.parse::<f64>().ok().filter(|number| number.is_finite());
            values.push(number.ok_or_else(|| FormatProblem::Line {
                line,
                found: format!("`{}`", crate::excerpt::shortened(word)),
                needed: "a number".to_owned(),
            })?);
        }
        if values.len() - before != channels.len() {
            return Err(FormatProblem::Line {
                line,
                found: format!("{} numbers", values.len() - before),
                needed: format!("{}, one for each channel of the skeleton", channels.len()),
            });
        }
    }
    let frames = values.len() / channels.len().max(1);
    let mut samples = Samples {
        tracks: vec![Track { name: "1".to_owned(), values, times: Vec::new() }],
        period: Some(period),
        facts: Facts { named: true, units, clock: Some("Frame Time".to_owned()), ..Facts::default() },
        channels,
        ..Samples::default()
    };
    if promised != frames as f64 {
        let what = format!("{promised} frames are promised, {frames} are there");
        samples.remarks.push(Remark::Understood { what });
    }
    Ok(samples)
}

/// Names of the channels, and their units.
type Channels = (Vec<String>, Vec<Option<String>>);

/// Reads the skeleton, up to the line MOTION.
fn skeleton<'a>(
    lines: &mut impl Iterator<Item = (usize, &'a str)>,
    budget: &Budget,
) -> Result<Channels, FormatProblem> {
    let (mut channels, mut units) = (Vec::new(), Vec::new());
    let (mut joint, mut seen) = (String::new(), HashMap::<String, usize>::new());
    let mut words: Vec<(usize, &str)> = Vec::new();
    loop {
        let Some((line, text)) = lines.next() else {
            return Err(FormatProblem::Damaged { kind: KIND, what: "there is no line MOTION" });
        };
        if text.starts_with("MOTION") {
            break;
        }
        budget.take(text.len() / 2 * size_of::<(usize, &str)>() + 32)?;
        // A name may hold spaces: it ends with the line or a brace.
        if let Some(name) = ["ROOT", "JOINT"]
            .iter()
            .find_map(|word| text.strip_prefix(word))
            .filter(|rest| rest.starts_with([' ', '\t']))
        {
            let (name, rest) = name.split_once('{').unwrap_or((name, ""));
            joint = budget.text(name.trim())?;
            let count = seen.entry(joint.clone()).or_default();
            *count += 1;
            if *count > 1 {
                joint = format!("{joint}_{count}");
            }
            words.extend(rest.split_whitespace().map(|word| (line, word)));
        } else {
            words.extend(text.split_whitespace().map(|word| (line, word)));
        }
        let mut at = 0;
        while at < words.len() {
            if words[at].1 != "CHANNELS" {
                at += 1;
                continue;
            }
            let wrong = |line| FormatProblem::Line {
                line,
                found: "CHANNELS without as many names as it says".to_owned(),
                needed: "a number and that many names".to_owned(),
            };
            let count: usize =
                words.get(at + 1).and_then(|(_, count)| count.parse().ok()).ok_or_else(|| wrong(line))?;
            let names = at
                .checked_add(2)
                .and_then(|from| words.get(from..from.checked_add(count)?))
                .ok_or_else(|| wrong(line))?;
            for (_, name) in names {
                budget.take(joint.len() + name.len() + 64)?;
                channels.push(format!("{joint}.{name}"));
                units.push(name.ends_with("rotation").then(|| "deg".to_owned()));
            }
            at += 2 + count;
        }
        words.clear();
    }
    if channels.is_empty() {
        return Err(FormatProblem::NoSamples { why: "its skeleton has no channels".to_owned() });
    }
    Ok((channels, units))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::{Reading, inspect_bytes};

    const ARM: &str = "HIERARCHY
ROOT Hips
{
\tOFFSET 0.0 0.0 0.0
\tCHANNELS 4 Xposition Zrotation Xrotation Yrotation
\tJOINT Left Arm
\t{
\t\tOFFSET 1 2 3
\t\tCHANNELS 1 Zrotation
\t\tEnd Site
\t\t{
\t\t\tOFFSET 0 1 0
\t\t}
\t}
}
MOTION
Frames: 3
Frame Time: 0.0333333
1 2 3 4 5
1.5 2.5 3.5 4.5 5.5 
-1e-2 0 0 0 180
";

    fn read(text: &str) -> Result<Reading, FileError> {
        inspect_bytes(Path::new("x.bvh"), text.as_bytes(), &Selection::default())
    }

    #[test]
    fn channels_are_called_by_their_joints() {
        let reading = read(ARM).unwrap();
        assert_eq!(
            reading.data.channels(),
            ["Hips.Xposition", "Hips.Zrotation", "Hips.Xrotation", "Hips.Yrotation", "Left Arm.Zrotation"]
        );
        assert_eq!((reading.period, reading.data.sequences()[0].len()), (Some(0.033_333_3), 3));
        assert_eq!(reading.data.sequences()[0].sample(2), [-0.01, 0., 0., 0., 180.]);
        assert_eq!((&reading.facts.units[0], &reading.facts.units[4]), (&None, &Some("deg".to_owned())));
        let windows = ARM.replace('\n', "\r\n");
        assert_eq!(read(&windows).unwrap().data, reading.data);
    }

    #[test]
    fn what_is_wrong_is_said_with_its_line() {
        let says = |text: &str, part: &str| {
            let error = read(text).unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        };
        says(&ARM.replace("1 2 3 4 5\n", "1 2 3 4\n"), "line 19: 4 numbers; needed: 5");
        says(&ARM.replace("2.5", "x"), "line 20: `x`; needed: a number");
        says(&ARM.replace("CHANNELS 1", "CHANNELS 99999999999999999999"), "line 9: CHANNELS without");
        says(&ARM.replace("CHANNELS 1", "CHANNELS 18446744073709551615"), "line 9: CHANNELS without");
        says(&ARM.replace("Frame Time: 0.0333333", "Frame Time: fast"), "line 18: ");
        says(&ARM[..100], "no line MOTION");
        says("x", "HIERARCHY");
        let fewer = read(&ARM.replace("Frames: 3", "Frames: 9")).unwrap();
        assert!(fewer.remarks[0].to_string().contains("9 frames are promised, 3 are there"));
    }

    #[test]
    fn damaged_bytes_never_panic() {
        crate::tests_random::damage(ARM.as_bytes(), 2000, 16 << 20, |bytes| {
            let _ = inspect_bytes(Path::new("x.bvh"), bytes, &Selection::default());
        });
    }
}
