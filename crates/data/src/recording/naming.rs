//! Names of channels out of several topics, and where each column goes.

use std::collections::HashMap;

use super::RecordingProblem;
use super::topics::Lane;

/// Names that a message lists.
const LISTED: usize = 60;

/// The channels.
#[derive(Debug, PartialEq)]
pub struct Named {
    /// Their names.
    pub names: Vec<String>,
    /// For each lane and each of its columns, which channel it is.
    pub places: Vec<Vec<Option<usize>>>,
    /// What could be had besides.
    pub available: Vec<String>,
}

/// Names all columns; if some are wanted, these in their order.
///
/// Names that are in several topics get the topic in front. A number that is called `data` is called as its topic, where
/// there are several topics.
///
/// # Errors
/// [`RecordingProblem::NoChannel`], [`RecordingProblem::Ambiguous`].
pub fn names(lanes: &[Lane], wanted: Option<&[String]>) -> Result<Named, RecordingProblem> {
    let Some(wanted) = wanted else { return Ok(all(lanes)) };
    let mut found: HashMap<&str, Vec<(usize, usize)>> = HashMap::new();
    for (index, lane) in lanes.iter().enumerate() {
        for (column, known) in lane.collecting.columns.iter().enumerate() {
            found.entry(&known.name).or_default().push((index, column));
        }
    }
    let mut places: Vec<Vec<Option<usize>>> =
        lanes.iter().map(|lane| vec![None; lane.collecting.columns.len()]).collect();
    let mut names: Vec<String> = Vec::new();
    for name in wanted {
        match found.get(name.as_str()).map(Vec::as_slice) {
            // Named twice; the one way from samples to data sets makes two of it.
            Some([(lane, column)]) if places[*lane][*column].is_some() => {}
            Some([(lane, column)]) => {
                places[*lane][*column] = Some(names.len());
                names.push(name.clone());
            }
            Some(several) => {
                let ways: Vec<_> = several.iter().map(|(lane, _)| format!("`{}.{name}`", lanes[*lane].label)).collect();
                return Err(RecordingProblem::Ambiguous { found: name.clone(), channels: ways.join(" or ") });
            }
            None => {
                let there = lanes.iter().flat_map(|lane| &lane.collecting.available);
                let mut channels: Vec<&str> = there.take(LISTED).map(String::as_str).collect();
                if lanes.iter().map(|lane| lane.collecting.available.len()).sum::<usize>() > LISTED {
                    channels.push("...");
                }
                let channels = crate::excerpt::printable(&channels.join(", "));
                return Err(RecordingProblem::NoChannel { found: name.clone(), channels });
            }
        }
    }
    let available = lanes.iter().flat_map(|lane| lane.collecting.available.iter().cloned()).collect();
    Ok(Named { names, places, available })
}

fn all(lanes: &[Lane]) -> Named {
    let several = lanes.len() > 1;
    let short = |lane: &Lane, name: &str| match name.strip_prefix("data") {
        Some(rest) if several && (rest.is_empty() || rest.starts_with(['[', '.'])) => {
            format!("{}{rest}", lane.label.rsplit('/').next().unwrap_or_default())
        }
        _ => name.to_owned(),
    };
    let columns = lanes.iter().flat_map(|lane| lane.collecting.columns.iter().map(move |column| (lane, column)));
    let mut count: HashMap<String, usize> = HashMap::new();
    for (lane, column) in columns {
        *count.entry(short(lane, &column.name)).or_default() += 1;
    }
    let (mut names, mut places) = (Vec::new(), Vec::new());
    for lane in lanes {
        let mut here = Vec::with_capacity(lane.collecting.columns.len());
        for column in &lane.collecting.columns {
            let short = short(lane, &column.name);
            here.push(Some(names.len()));
            names.push(if count[&short] > 1 { format!("{}.{}", lane.label, column.name) } else { short });
        }
        places.push(here);
    }
    Named { names, places, available: Vec::new() }
}
