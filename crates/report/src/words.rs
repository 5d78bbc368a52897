//! Numbers as people say them.

use std::time::Duration;

/// A duration as people say it: `59 s`, `1 min 15 s`, `1 h 02 min`.
#[must_use]
pub fn in_words(duration: Duration) -> String {
    let seconds = duration.as_secs_f64().round().min(9e15) as u64;
    match seconds {
        0..60 => format!("{seconds} s"),
        60..3600 => format!("{} min {:02} s", seconds / 60, seconds % 60),
        _ => format!("{} h {:02} min", seconds / 3600, seconds % 3600 / 60),
    }
}

/// Whether a cell is a number, with or without its spread or a percent sign, or a dash in the place of one.
pub(super) fn is_number(cell: &str) -> bool {
    let number = cell.trim_end_matches([' ', '%']).split(" \u{b1} ").next().unwrap_or(cell);
    !number.is_empty() && number.parse::<f64>().is_ok() || cell == "\u{2013}"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_read_as_people_say_them() {
        let words = [0.4, 59.0, 75.0, 3723.0].map(|seconds| in_words(Duration::from_secs_f64(seconds)));
        assert_eq!(words, ["0 s", "59 s", "1 min 15 s", "1 h 02 min"]);
    }
}
