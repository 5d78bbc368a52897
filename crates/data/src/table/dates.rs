//! Dates and times of day as loggers write them (ISO 8601 and what is near it), in nanoseconds.

const DAY: i128 = 86_400 * 1_000_000_000;

/// Something of the calendar.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Moment {
    /// A day with a time: nanoseconds since the year 1970 began.
    Stamp(i128),
    /// A day: nanoseconds since then.
    Day(i128),
    /// A time of day: nanoseconds since midnight.
    Clock(i128),
}

/// Reads `2024-05-01T10:00:00.25Z`, `2024-05-01 10:00:00,25 +02:00`, `2024/05/01`, `10:00:00.25`.
pub fn moment(text: &str) -> Option<Moment> {
    // Cheap, and nearly always the answer.
    if text.len() < 5 || !text.as_bytes()[0].is_ascii_digit() || !text.bytes().any(|b| b":-/.".contains(&b)) {
        return None;
    }
    let Some((days, rest)) = day(text) else {
        return clock(text).map(Moment::Clock);
    };
    let date = days.checked_mul(DAY)?;
    if rest.is_empty() {
        return Some(Moment::Day(date));
    }
    let rest = rest.strip_prefix(['T', 't', ' ', '_'])?.trim_start();
    let (rest, offset) = zone(rest)?;
    Some(Moment::Stamp(date + clock(rest.trim_end())? - offset))
}

/// Days since 1970, and what stands behind the date.
fn day(text: &str) -> Option<(i128, &str)> {
    let Some((year, rest)) = number(text, 4, 4) else { return day_first(text) };
    let separator = rest.chars().next().filter(|c| matches!(c, '-' | '/'))?;
    let (month, rest) = number(&rest[1..], 1, 2)?;
    let (day, rest) = number(rest.strip_prefix(separator)?, 1, 2)?;
    let valid = (1..=12).contains(&month) && (1..=31).contains(&day);
    valid.then(|| (days(year, month, day), rest))
}

/// `31.12.2024`; `12/31/2024`, or `31/12/2024` where the first number can be no month.
fn day_first(text: &str) -> Option<(i128, &str)> {
    let (first, rest) = number(text, 1, 2)?;
    let separator = rest.chars().next().filter(|c| matches!(c, '.' | '/'))?;
    let (second, rest) = number(&rest[1..], 1, 2)?;
    let (year, rest) = number(rest.strip_prefix(separator)?, 4, 4)?;
    let (day, month) = if separator == '.' || first > 12 { (first, second) } else { (second, first) };
    let valid = (1..=12).contains(&month) && (1..=31).contains(&day);
    valid.then(|| (days(year, month, day), rest))
}

/// Days from 1970-01-01 in the Gregorian calendar: 400 years have 146097 days; years begin in March, so that the day that
/// some years have more is their last.
fn days(year: i128, month: i128, day: i128) -> i128 {
    let from_march = (month + 9) % 12;
    let year = year - i128::from(month < 3);
    let of_year = (153 * from_march + 2) / 5 + day - 1;
    365 * year + year.div_euclid(4) - year.div_euclid(100) + year.div_euclid(400) + of_year - 719_468
}

/// Nanoseconds since midnight of `10:00`, `10:00:00`, `10:00:00.25`.
fn clock(text: &str) -> Option<i128> {
    let (hour, rest) = number(text, 1, 2)?;
    let (minute, rest) = number(rest.strip_prefix(':')?, 2, 2)?;
    let (second, rest) = match rest.strip_prefix(':') {
        Some(rest) => number(rest, 2, 2)?,
        None => (0, rest),
    };
    let nanoseconds = match rest.strip_prefix(['.', ',']) {
        Some(digits) if !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit()) => {
            let nine: String = digits.chars().chain("000000000".chars()).take(9).collect();
            nine.parse().ok()?
        }
        None if rest.is_empty() => 0,
        _ => return None,
    };
    let valid = hour < 24 && minute < 60 && second < 61;
    valid.then(|| ((hour * 60 + minute) * 60 + second) * 1_000_000_000 + nanoseconds)
}

/// What stands before the zone, and the zone in nanoseconds east of Greenwich.
fn zone(text: &str) -> Option<(&str, i128)> {
    if let Some(rest) = text.strip_suffix(['Z', 'z']).or_else(|| text.strip_suffix("UTC")) {
        return Some((rest, 0));
    }
    let Some(at) = text.rfind(['+', '-']) else { return Some((text, 0)) };
    let (hours, rest) = number(&text[at + 1..], 2, 2)?;
    let rest = rest.strip_prefix(':').unwrap_or(rest);
    let (minutes, rest) = if rest.is_empty() { (0, rest) } else { number(rest, 2, 2)? };
    let offset = (hours * 60 + minutes) * 60 * 1_000_000_000;
    rest.is_empty().then(|| (&text[..at], if text[at..].starts_with('-') { -offset } else { offset }))
}

/// A number of so many digits, and what follows it.
fn number(text: &str, least: usize, most: usize) -> Option<(i128, &str)> {
    let digits = text.bytes().take(most).take_while(u8::is_ascii_digit).count();
    let (number, rest) = text.split_at(digits);
    (digits >= least).then(|| Some((number.parse().ok()?, rest)))?
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_are_counted_from_1970() {
        let stamp = |text: &str| match moment(text) {
            Some(Moment::Stamp(time)) => time,
            other => panic!("{text}: {other:?}"),
        };
        let second = 1_000_000_000_i128;
        assert_eq!(stamp("1970-01-01T00:00:00Z"), 0);
        // As `date -u -d 2024-05-01T10:00:00 +%s` has it.
        assert_eq!(stamp("2024-05-01T10:00:00.020000Z"), 1_714_557_600 * second + 20_000_000);
        assert_eq!(stamp("2024-05-01 12:00:00,02 +02:00"), 1_714_557_600 * second + 20_000_000);
        assert_eq!(stamp("2024/02/29 00:00"), 1_709_164_800 * second);
        assert_eq!(stamp("1969-12-31T23:59:59"), -second);
        assert_eq!(moment("2024-03-01"), Some(Moment::Day(1_709_251_200 * second)));
        for text in ["01.03.2024", "3/1/2024"] {
            assert_eq!(moment(text), Some(Moment::Day(1_709_251_200 * second)), "{text}");
        }
        assert_eq!(moment("31/12/1969 23:59"), Some(Moment::Stamp(-60 * second)));
        assert_eq!(moment("10:30:00.5"), Some(Moment::Clock(37_800 * second + 500_000_000)));
    }

    #[test]
    fn what_is_no_time_is_none() {
        for text in [
            "",
            "1.5",
            "-0.5",
            "2024-13-01",
            "2024-05",
            "10:61:00",
            "1:2",
            "2024-05-01T",
            "10:00:00.",
            "1e-5",
            "12-34-56",
            "a:bc:de",
        ] {
            assert_eq!(moment(text), None, "{text}");
        }
    }
}
