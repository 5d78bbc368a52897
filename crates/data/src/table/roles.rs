//! What a column may be besides a channel, by its name. Its values decide ([`super::assembly`]): a name alone never does.

/// What a name says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Role {
    /// The time. `sure` where nothing else is ever called so.
    Clock {
        /// Whether the name is used for clocks only.
        sure: bool,
    },
    /// Whole seconds, beside a column of nanoseconds of the same stem.
    Seconds(String),
    /// Nanoseconds within the second.
    Nanoseconds(String),
    /// A number of the row.
    Counter {
        /// Whether the name is used for counters only.
        sure: bool,
    },
    /// What tells the sequences apart.
    Label {
        /// Whether the name is used for labels only.
        sure: bool,
    },
}

const CLOCKS: &[&str] = &[
    "t",
    "ts",
    "date",
    "date_time",
    "zeit",
    "temps",
    "tiempo",
    "tempo",
    "datum",
    "datetime",
    "utc",
    "clock",
    "epoch",
    "elapsed",
    "sec",
    "secs",
    "seconds",
    "millis",
    "milliseconds",
    "ms",
    "microseconds",
    "nanoseconds",
    "nsecs",
];
const COUNTERS: &[&str] = &[
    "frame",
    "sub_frame",
    "subframe",
    "frames",
    "frame_index",
    "frame_id",
    "frame_number",
    "frame_num",
    "frame_no",
    "frame_nr",
    "frameindex",
    "framenumber",
    "index",
    "idx",
    "seq",
    "sequence_number",
    "sample",
    "sample_index",
    "sample_number",
    "row",
    "row_id",
    "row_number",
    "count",
    "counter",
    "id",
    "no",
    "nr",
    "number",
    "packet",
    "packet_number",
    "iteration",
    "iter",
    "n",
    "timestep",
    "time_step",
    "step_index",
    "step_id",
    "scan",
    "line",
];
const LABELS: &[&str] = &[
    "episode",
    "episode_index",
    "episode_id",
    "episode_number",
    "trial",
    "trial_id",
    "trial_index",
    "trial_number",
    "trial_no",
    "demo",
    "demo_id",
    "demo_index",
    "demonstration",
    "traj",
    "traj_id",
    "trajectory",
    "trajectory_id",
    "trajectory_index",
    "run",
    "run_id",
    "session",
    "session_id",
    "take",
    "rep",
    "repetition",
    "recording",
    "recording_id",
    "rec_id",
    "seq_id",
    "sequence_id",
    "sequence_index",
    "sequence_name",
    "seq_name",
    "sequences",
    "segment",
    "segment_id",
    "subject",
    "subject_id",
    "participant",
    "task",
    "task_index",
    "task_id",
    "clip",
    "clip_id",
    "motion",
    "motion_id",
    "file",
    "filename",
    "bag",
    "series",
    "series_id",
    "case",
    "case_id",
    "group",
    "experiment",
    "rollout",
    "rollout_id",
    "bout",
];

/// What the column at `index` called `name` may be.
pub fn role(index: usize, name: &str) -> Option<Role> {
    let name = name.trim();
    // An index that pandas wrote, and one that it wrote, read and wrote again.
    if index == 0 && (name.is_empty() || name == "Unnamed: 0") {
        return Some(Role::Counter { sure: true });
    }
    let (bare, _) = without_unit(name);
    let path = bare.trim_start_matches(['%', '#', '_', '/', '.']).to_lowercase().replace([' ', '-'], "_");
    let (stem, last) = match path.rfind(['.', '/', ':']) {
        Some(at) => (&path[..=at], &path[at + 1..]),
        None => ("", path.as_str()),
    };
    let whole = last.trim_end_matches("_utc");
    match whole {
        "sequence" => return Some(Role::Label { sure: true }),
        "step" => return Some(Role::Counter { sure: true }),
        "time" | "timestamp" | "timestamps" | "stamp" | "time_stamp" => return Some(Role::Clock { sure: true }),
        _ => {}
    }
    // `stamp.sec` and `stamp.nanosec`, `secs` and `nsecs`, `timestamp_sec` and `timestamp_nsec`.
    for (ending, is_seconds) in [
        ("nanoseconds", false),
        ("nanosec", false),
        ("nsecs", false),
        ("nsec", false),
        ("seconds", true),
        ("secs", true),
        ("sec", true),
    ] {
        if let Some(front) = last.strip_suffix(ending)
            && (front.is_empty() || front.ends_with('_'))
        {
            let stem = format!("{stem}{front}");
            return Some(if is_seconds { Role::Seconds(stem) } else { Role::Nanoseconds(stem) });
        }
    }
    let is_clock = CLOCKS.contains(&whole)
        || ["_time", "_elapsed", "timestamp", "_stamp", "time_since_start", "_datetime"]
            .iter()
            .any(|ending| whole.ends_with(ending))
        || whole.starts_with("time_") && ["s", "ms", "us", "ns", "sec", "secs", "seconds"].contains(&&whole[5..])
        || [
            "t_s",
            "t_ms",
            "t_us",
            "t_ns",
            "ts_ns",
            "timestamp_s",
            "timestamp_ms",
            "timestamp_us",
            "timestamp_ns",
            "simtime",
            "walltime",
            "unixtime",
        ]
        .contains(&whole);
    if is_clock {
        return Some(Role::Clock { sure: false });
    }
    if LABELS.contains(&whole) {
        return Some(Role::Label { sure: false });
    }
    COUNTERS.contains(&whole).then_some(Role::Counter { sure: false })
}

/// A name without the unit that stands in brackets at its end, and the unit.
pub fn without_unit(name: &str) -> (&str, Option<&str>) {
    let name = name.trim();
    for (open, close) in [('[', ']'), ('(', ')')] {
        if let Some(front) = name.strip_suffix(close)
            && let Some(at) = front.rfind(open)
            && at > 0
        {
            return (front[..at].trim_end(), Some(front[at + 1..].trim()));
        }
    }
    (name, None)
}

/// Nanoseconds in a unit of time, by its name or by the end of a column's name.
pub fn nanoseconds_in(unit: &str) -> Option<i128> {
    Some(match unit.trim().to_lowercase().as_str() {
        "s" | "sec" | "secs" | "second" | "seconds" => 1_000_000_000,
        "ms" | "msec" | "msecs" | "millis" | "millisecond" | "milliseconds" => 1_000_000,
        "us" | "\u{b5}s" | "\u{3bc}s" | "usec" | "usecs" | "micros" | "microsecond" | "microseconds" => 1000,
        "ns" | "nsec" | "nsecs" | "nanosec" | "nanos" | "nanosecond" | "nanoseconds" => 1,
        "min" | "minutes" => 60_000_000_000,
        _ => return None,
    })
}

/// Whether a cell of a row of units is one.
pub fn is_unit(text: &str) -> bool {
    const UNITS: &[&str] = &[
        "deg", "degree", "degrees", "rad", "radian", "radians", "\u{b0}", "m", "mm", "cm", "km", "inch", "in", "n",
        "nm", "n*m", "n.m", "n m", "mnm", "v", "mv", "volt", "volts", "a", "ma", "w", "kg", "g", "hz", "%", "-", "1",
        "px", "pixel", "pixels", "k", "c", "\u{b0}c", "rpm", "bar", "pa", "kpa", "count", "counts", "ticks", "bool",
        "none", "au", "a.u.",
    ];
    let bare = text.trim().trim_matches(['[', ']', '(', ')']).to_lowercase();
    // `rad/s`, `m/s^2`, `deg/s2`.
    let per_time = bare.split_once("/s").filter(|(_, power)| ["", "^2", "2", "\u{b2}", "ec", "^3"].contains(power));
    nanoseconds_in(&bare).is_some() || UNITS.contains(&per_time.map_or(bare.as_str(), |(front, _)| front))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_loggers_are_known() {
        for name in [
            "time",
            "TIME",
            "timestamp",
            "Time [s]",
            "Time (Seconds)",
            "%time",
            "__time",
            "field.header.stamp",
            "/arm/header/stamp",
        ] {
            assert_eq!(role(1, name), Some(Role::Clock { sure: true }), "{name}");
        }
        for name in [
            "t",
            "sim_time",
            "time_ms",
            "timestamp_ns",
            "log time",
            "Elapsed [ms]",
            "unix_timestamp",
            "seconds_elapsed",
            "Zeit [s]",
        ] {
            assert_eq!(role(1, name), Some(Role::Clock { sure: false }), "{name}");
        }
        for name in ["frame", "Frame", "frame_index", "index", "field.header.seq", "Sample #".trim_end_matches(" #")] {
            assert_eq!(role(1, name), Some(Role::Counter { sure: false }), "{name}");
        }
        for name in ["episode_index", "episode", "trial", "demo", "traj_id", "Subject"] {
            assert_eq!(role(1, name), Some(Role::Label { sure: false }), "{name}");
        }
        assert_eq!(role(3, "Sequence"), Some(Role::Label { sure: true }));
        assert_eq!(role(0, ""), Some(Role::Counter { sure: true }));
        assert_eq!(role(1, "header.stamp.secs"), Some(Role::Seconds("header.stamp.".into())));
        assert_eq!(role(1, "header.stamp.nsecs"), Some(Role::Nanoseconds("header.stamp.".into())));
        for name in
            ["shoulder", "", "stampede", "x", "elbow [deg]", "observation.state.shoulder", "steps_per_second.x", "0"]
        {
            assert_eq!(role(1, name), None, "{name}");
        }
    }

    #[test]
    fn units_are_known() {
        assert_eq!(without_unit("elbow [deg]"), ("elbow", Some("deg")));
        assert_eq!(without_unit("q[0]"), ("q", Some("0")));
        assert_eq!(without_unit("[0]"), ("[0]", None));
        for unit in ["deg", "rad/s", "[m]", "m/s^2", "ms", "(Nm)", "%"] {
            assert!(is_unit(unit), "{unit}");
        }
        for word in ["x", "hand", "shoulder", "", "s/x"] {
            assert!(!is_unit(word), "{word}");
        }
        assert_eq!(nanoseconds_in("Seconds"), Some(1_000_000_000));
    }
}
