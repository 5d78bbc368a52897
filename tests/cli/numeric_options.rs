//! Every option that is a number, by the program's own definition of its command line: its range, and its rows in the table.

use std::any::TypeId;

use clap::CommandFactory;

use super::*;

/// Command, name and help of each option that is a number, and whether it is a whole one.
fn numeric(command: &clap::Command, path: &str, found: &mut Vec<(String, String, String, bool)>) {
    let whole = [TypeId::of::<u32>(), TypeId::of::<u64>(), TypeId::of::<usize>()];
    for option in command.get_opts() {
        let id = option.get_value_parser().type_id();
        let is_whole = whole.iter().any(|number| id == *number);
        if is_whole || id == TypeId::of::<f64>() {
            let help = option.get_help().map(ToString::to_string).unwrap_or_default();
            found.push((path.to_owned(), option.get_long().unwrap_or_default().to_owned(), help, is_whole));
        }
    }
    for inner in command.get_subcommands() {
        let path = if path == "scrnn" { inner.get_name().to_owned() } else { format!("{path} {}", inner.get_name()) };
        numeric(inner, &path, found);
    }
}

#[test]
fn every_numeric_option_has_its_rows_in_the_table_of_numbers() {
    let mut found = Vec::new();
    numeric(&Cli::command(), "scrnn", &mut found);
    let mut found: Vec<_> = found.into_iter().map(|(command, option, ..)| (command, option)).collect();
    let mut listed: Vec<(String, String)> =
        numbers_table::OPTIONS.iter().map(|(command, option, _)| ((*command).into(), (*option).into())).collect();
    found.sort();
    listed.sort();
    assert_eq!(found, listed);
}

/// The range in a help text, as it is written: `1 to 10`, or `more than 0, at most 10`; and whether the first is excluded.
fn range(help: &str) -> Option<(String, String, bool)> {
    let words: Vec<&str> = help.split_whitespace().map(|word| word.trim_end_matches([',', ';', ':', '.'])).collect();
    let is_number = |word: &str| word.parse::<f64>().is_ok();
    let owned = |low: &str, high: &str, excluded| Some((low.to_owned(), high.to_owned(), excluded));
    let excluding = words.windows(6).find_map(|words| match words {
        ["more", "than", low, "at", "most", high] => owned(low, high, true),
        _ => None,
    });
    let including = words.windows(3).find_map(|words| match words {
        [low, "to", high] if is_number(low) && is_number(high) => owned(low, high, false),
        _ => None,
    });
    excluding.or(including)
}

#[test]
fn the_help_of_every_numeric_option_states_the_range_that_holds() {
    let mut found = Vec::new();
    numeric(&Cli::command(), "scrnn", &mut found);
    for (command, option, help, is_whole) in found {
        let (_, _, line) =
            numbers_table::OPTIONS.iter().find(|row| (row.0, row.1) == (command.as_str(), option.as_str())).unwrap();
        let taken = |value: &str| {
            let value = format!("--{option}={value}");
            Cli::try_parse_from(["scrnn"].into_iter().chain(line.split_whitespace()).chain([value.as_str()])).is_ok()
        };
        let (low, high, excluded) =
            range(&help).unwrap_or_else(|| panic!("{command} --{option} states no range: {help}"));
        assert!(taken(&high) && taken(&low) != excluded, "{command} --{option}: {help}");
        let (below, above) = match is_whole {
            true => {
                let (low, high): (i128, i128) = (low.parse().unwrap(), high.parse().unwrap());
                ((low - 1).to_string(), (high + 1).to_string())
            }
            false => {
                let (low, high): (f64, f64) = (low.parse().unwrap(), high.parse().unwrap());
                ((low - 1e-12).to_string(), (high * 1.000_001).to_string())
            }
        };
        for value in [below.as_str(), above.as_str(), "NaN", "inf", "1e", ""] {
            assert!(!taken(value), "{command} --{option}={value} is taken: {help}");
        }
    }
}
