//! Headers of motion capture: Vicon's groups of columns below a rate, Qualisys' list of markers above the samples.
//!
//! ```text
//! Trajectories                          MARKER_NAMES <tab> hip <tab> knee
//! 100                                   1.0 <tab> 2.0 <tab> 3.0 <tab> ...
//! ,,Anna:hip,,,Anna:knee,,
//! Frame,Sub Frame,X,Y,Z,X,Y,Z
//! ,,mm,mm,mm,mm,mm,mm
//! ```

use super::fields::Field;
use super::lines::Line;
use super::roles::{Role, role};

type Above<'a> = [(Line<'a>, Vec<Field<'a>>)];

/// Rates that a camera may have, in images a second.
const RATES: std::ops::RangeInclusive<f64> = 1.0..=1e5;

/// Names of `count` columns, three for each marker that a line above the samples lists.
pub fn names(above: &Above<'_>, count: usize) -> Option<Vec<String>> {
    let (_, listed) = above.iter().find(|(_, fields)| is(fields, "MARKER_NAMES"))?;
    let markers: Vec<&str> =
        listed[1..].iter().map(|field| field.text.as_ref()).filter(|name| !name.is_empty()).collect();
    let coordinates = markers.iter().flat_map(|name| ["X", "Y", "Z"].map(|axis| format!("{name}.{axis}")));
    let counters = match count.checked_sub(3 * markers.len())? {
        0 => &[][..],
        2 => &["Frame", "Time"],
        _ => return None,
    };
    (!markers.is_empty()).then(|| counters.iter().map(|&name| name.to_owned()).chain(coordinates).collect())
}

/// Images a second, where the lines above the samples tell it: `FREQUENCY`, or a number alone above columns of frames.
pub fn rate(above: &Above<'_>) -> Option<f64> {
    let number = |field: &Field<'_>| field.text.trim().parse().ok().filter(|rate: &f64| RATES.contains(rate));
    if above.iter().any(|(_, fields)| is(fields, "MARKER_NAMES")) {
        let told = above.iter().find(|(_, fields)| is(fields, "FREQUENCY"))?;
        return told.1.get(1).and_then(number);
    }
    let counts = |(_, fields): &(Line<'_>, Vec<Field<'_>>)| {
        let frames = |field: &Field<'_>| matches!(role(1, &field.text), Some(Role::Counter { .. }));
        fields.len() > 2 && fields.iter().take(2).filter(|field| frames(field)).count() == 2
    };
    let header = above.iter().position(counts)?;
    let alone = |(_, fields): &&(Line<'_>, Vec<Field<'_>>)| fields[1..].iter().all(|field| field.text.is_empty());
    above[..header].iter().filter(alone).find_map(|(_, fields)| fields.first().and_then(number))
}

fn is(fields: &[Field<'_>], key: &str) -> bool {
    fields.len() > 1 && fields[0].text == key
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::{Reading, Selection, inspect_bytes};

    fn read(path: &str, text: &str) -> Reading {
        inspect_bytes(Path::new(path), text.as_bytes(), &Selection::default()).unwrap_or_else(|error| panic!("{error}"))
    }

    fn rows(count: usize, row: impl Fn(usize) -> String) -> String {
        (0..count).map(row).collect()
    }

    #[test]
    fn a_table_of_vicon_has_markers_units_and_a_rate() {
        let samples = rows(12, |k| format!("{},0,{k}.5,2,3,{k}.25,5,6.5\n", k + 1));
        // Commas at the end of the names are there or not.
        for end in ["", ",,"] {
            let text = format!(
                "Trajectories\n100\n,,Anna:hip,,,Anna:knee{end}\nFrame,Sub Frame,X,Y,Z,X,Y,Z\n,,mm,mm,mm,mm,mm,mm\n{samples}"
            );
            let reading = read("walk.csv", &text);
            let names = ["Anna:hip.X", "Anna:hip.Y", "Anna:hip.Z", "Anna:knee.X", "Anna:knee.Y", "Anna:knee.Z"];
            assert_eq!(reading.data.channels(), names);
            assert_eq!(reading.period, Some(0.01));
            assert_eq!(reading.facts.units[4].as_deref(), Some("mm"));
            assert_eq!(reading.data.sequences()[0].len(), 12);
            assert_eq!(reading.data.sequences()[0].sample(3), [3.5, 2.0, 3.0, 3.25, 5.0, 6.5]);
        }
    }

    #[test]
    fn a_table_of_qualisys_has_its_markers_in_a_line_above() {
        let head = "NO_OF_FRAMES\t12\nNO_OF_CAMERAS\t8\nNO_OF_MARKERS\t2\nFREQUENCY\t50\nNO_OF_ANALOG\t0\nANALOG_FREQUENCY\t0\n\
                    DESCRIPTION\t--\nTIME_STAMP\t2024-05-06, 10:11:12.345\t1234.5\nDATA_INCLUDED\t3D\nMARKER_NAMES\thip\tknee\n";
        let names = ["hip.X", "hip.Y", "hip.Z", "knee.X", "knee.Y", "knee.Z"];
        let plain = rows(12, |k| format!("{k}.5\t2.0\t3.0\t{k}.25\t5.0\t6.5\n"));
        let reading = read("walk.tsv", &format!("{head}{plain}"));
        assert_eq!((reading.data.channels(), reading.period), (&names.map(str::to_owned)[..], Some(0.02)));
        assert_eq!(reading.data.sequences()[0].sample(3), [3.5, 2.0, 3.0, 3.25, 5.0, 6.5]);
        // With a header of its own, and with frames and times but none.
        let timed = rows(12, |k| format!("{}\t{:.5}\t{k}.5\t2.0\t3.0\t{k}.25\t5.0\t6.5\n", k + 1, 0.02 * k as f64));
        let header = "Frame\tTime\thip X\thip Y\thip Z\tknee X\tknee Y\tknee Z\n";
        for text in [format!("{head}{header}{timed}"), format!("{head}{timed}")] {
            let reading = read("walk.tsv", &text);
            assert_eq!(
                (reading.data.channels().len(), reading.period),
                (6, Some(0.02)),
                "{:?}",
                reading.data.channels()
            );
            assert!(reading.data.channels()[3].starts_with("knee"), "{:?}", reading.data.channels());
            assert_eq!(reading.data.sequences()[0].sample(3), [3.5, 2.0, 3.0, 3.25, 5.0, 6.5]);
        }
    }
}
