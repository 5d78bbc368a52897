//! Several files as one data set: patterns, folders, the order people mean, and channels that are matched by name.

use std::cmp::Ordering;
use std::path::{Path, PathBuf};

use crate::FileError;
use crate::format::Format;

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

/// The files that `pattern` names: itself, all that match its `*`, `?` and `[...]`, or all data files of a folder that is
/// no data set by itself. In natural order.
///
/// # Errors
/// [`FileError::NoMatch`], [`FileError::Disk`].
pub fn expand(pattern: &Path) -> Result<Vec<PathBuf>, FileError> {
    let mut found = if pattern.exists() { vec![pattern.to_owned()] } else { matches(pattern)? };
    if let [only] = found.as_slice()
        && only.is_dir()
        && !Format::knows(only)
    {
        let folder = only.clone();
        found = entries(&folder)?.into_iter().filter(|path| is_visible(path) && Format::knows(path)).collect();
        if found.is_empty() {
            return Err(FileError::NoMatch {
                pattern: folder.display().to_string(),
                what: "no data file is in this folder",
            });
        }
    }
    found.sort_by(|a, b| natural(&a.to_string_lossy(), &b.to_string_lossy()));
    Ok(found)
}

fn is_visible(path: &Path) -> bool {
    path.file_name().is_some_and(|name| !name.to_string_lossy().starts_with('.'))
}

fn entries(folder: &Path) -> Result<Vec<PathBuf>, FileError> {
    let disk = |source| FileError::disk("read", folder, source);
    std::fs::read_dir(folder).map_err(disk)?.map(|entry| entry.map(|entry| entry.path()).map_err(disk)).collect()
}

/// Paths that match, part by part.
fn matches(pattern: &Path) -> Result<Vec<PathBuf>, FileError> {
    let is_pattern = |part: &str| part.contains(['*', '?', '[']);
    if !is_pattern(&pattern.to_string_lossy()) {
        // The system's own words about what is not there.
        return Ok(vec![pattern.to_owned()]);
    }
    let mut found = vec![PathBuf::new()];
    for part in pattern.components() {
        let text = part.as_os_str().to_string_lossy();
        if !is_pattern(&text) {
            found.iter_mut().for_each(|path| path.push(part));
            continue;
        }
        let mut next = Vec::new();
        for folder in &found {
            let here = if folder.as_os_str().is_empty() { Path::new(".") } else { folder.as_path() };
            for entry in entries(here).unwrap_or_default() {
                let name = entry.file_name().unwrap_or_default().to_string_lossy().into_owned();
                let hidden = name.starts_with('.') && !text.starts_with('.');
                if !hidden && fits(&text, &name) {
                    next.push(folder.join(entry.file_name().unwrap_or_default()));
                }
            }
        }
        found = next;
    }
    found.retain(|path| path.exists());
    if found.is_empty() {
        return Err(FileError::NoMatch { pattern: pattern.display().to_string(), what: "no file matches" });
    }
    Ok(found)
}

/// Whether a name fits a pattern of `*` (anything), `?` (one character), `[a-c]`, `[!a-c]`.
///
/// The latest star alone is tried again, so the time is that of both lengths multiplied, not more.
fn fits(pattern: &str, name: &str) -> bool {
    let (pattern, name): (Vec<char>, Vec<char>) = (pattern.chars().collect(), name.chars().collect());
    let (mut p, mut n) = (0, 0);
    let mut star: Option<(usize, usize)> = None;
    while n < name.len() {
        match pattern.get(p) {
            Some('*') => {
                star = Some((p + 1, n));
                p += 1;
                continue;
            }
            Some('?') => {
                (p, n) = (p + 1, n + 1);
                continue;
            }
            Some('[') if let Some((fits, after)) = one_of(&pattern[p + 1..], name[n]) => {
                if fits {
                    (p, n) = (p + 1 + after, n + 1);
                    continue;
                }
            }
            Some(c) if *c == name[n] => {
                (p, n) = (p + 1, n + 1);
                continue;
            }
            _ => {}
        }
        let Some((after, from)) = star else { return false };
        star = Some((after, from + 1));
        (p, n) = (after, from + 1);
    }
    pattern[p..].iter().all(|c| *c == '*')
}

/// Whether `c` is in the set whose inside begins here, and how long it is with its bracket. None without a bracket.
fn one_of(set: &[char], c: char) -> Option<(bool, usize)> {
    let negated = set.first().is_some_and(|first| *first == '!' || *first == '^');
    let start = usize::from(negated);
    // A bracket right at the beginning stands for itself.
    let end = start + 1 + set.get(start + 1..)?.iter().position(|c| *c == ']')?;
    let (inside, mut at, mut found) = (&set[start..end], 0, false);
    while at < inside.len() {
        if inside.get(at + 1) == Some(&'-')
            && let Some(last) = inside.get(at + 2)
        {
            found |= (inside[at]..=*last).contains(&c);
            at += 3;
        } else {
            found |= inside[at] == c;
            at += 1;
        }
    }
    Some((found != negated, end + 1))
}
