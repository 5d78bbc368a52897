//! The order that people mean: `demo_2` before `demo_10`.

use std::cmp::Ordering;

/// Compares names as people do: digits by the number they make (`demo_2` before `demo_10`).
#[must_use]
pub fn natural(a: &str, b: &str) -> Ordering {
    let (mut a_rest, mut b_rest) = (a, b);
    loop {
        let (a_digits, b_digits) = (digits(a_rest), digits(b_rest));
        let order = if !a_digits.is_empty() && !b_digits.is_empty() {
            let (x, y) = (a_digits.trim_start_matches('0'), b_digits.trim_start_matches('0'));
            x.len().cmp(&y.len()).then_with(|| x.cmp(y))
        } else {
            match (a_rest.chars().next(), b_rest.chars().next()) {
                (None, None) => return a.cmp(b),
                (x, y) => x.cmp(&y),
            }
        };
        if order != Ordering::Equal {
            return order;
        }
        let skip = |rest: &str, digits: &str| digits.len().max(rest.chars().next().map_or(0, char::len_utf8));
        (a_rest, b_rest) = (&a_rest[skip(a_rest, a_digits)..], &b_rest[skip(b_rest, b_digits)..]);
    }
}

fn digits(text: &str) -> &str {
    &text[..text.len() - text.trim_start_matches(|c: char| c.is_ascii_digit()).len()]
}
