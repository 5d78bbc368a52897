//! Several files as one data set: patterns, folders, the order people mean, and channels that are matched by name.

use std::path::{Path, PathBuf};

use crate::FileError;
use crate::format::Format;
use crate::natural::natural;

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
        found = entries(&folder)?
            .into_iter()
            .filter(|path| is_visible(path) && ends(path) && Format::knows(path))
            .collect();
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

/// Whether a path leads to a file or a folder. Nobody means a pipe or a device, which may have no end, by a folder it is in.
fn ends(path: &Path) -> bool {
    path.is_file() || path.is_dir()
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
    found.retain(|path| ends(path));
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
            Some('[') => match one_of(&pattern[p + 1..], name[n]) {
                Some((true, after)) => {
                    (p, n) = (p + 1 + after, n + 1);
                    continue;
                }
                Some((false, _)) => {}
                // A bracket that nothing closes stands for itself.
                None if name[n] == '[' => {
                    (p, n) = (p + 1, n + 1);
                    continue;
                }
                None => {}
            },
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::cmp::Ordering;

    #[test]
    fn names_are_in_the_order_people_mean() {
        let mut names = ["demo_10", "demo_2", "demo_1", "b", "demo_02", "a10b1", "a9", "demo_", "\u{e9}2", "\u{e9}10"];
        names.sort_by(|a, b| natural(a, b));
        assert_eq!(
            names,
            ["a9", "a10b1", "b", "demo_", "demo_1", "demo_02", "demo_2", "demo_10", "\u{e9}2", "\u{e9}10"]
        );
        assert_eq!(natural("9", "99999999999999999999999"), Ordering::Less);
    }

    #[test]
    fn patterns_fit_as_in_a_shell() {
        for (pattern, name) in [
            ("demo_*.csv", "demo_1.csv"),
            ("*", "a"),
            ("a?c", "abc"),
            ("[a-c]x", "bx"),
            ("[!a]x", "bx"),
            ("*a*b", "aaab"),
            ("[]]", "]"),
            ("[", "["),
        ] {
            assert!(fits(pattern, name), "{pattern} {name}");
        }
        for (pattern, name) in
            [("demo_*.csv", "demo_1.txt"), ("a?c", "ac"), ("[a-c]x", "dx"), ("[!a]x", "ax"), ("", "a"), ("*a", "ab")]
        {
            assert!(!fits(pattern, name), "{pattern} {name}");
        }
        // Not exponential.
        assert!(!fits(&"*a".repeat(200), &"a".repeat(150)));
    }

    #[test]
    fn folders_and_patterns_name_their_files() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["demo_10.csv", "demo_2.csv", "notes.md", ".hidden.csv", "other.npy"] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        let names = |pattern: &str| {
            let found = expand(&folder.path().join(pattern)).unwrap();
            found.iter().map(|path| path.file_name().unwrap().to_string_lossy().into_owned()).collect::<Vec<_>>()
        };
        assert_eq!(names("demo_*"), ["demo_2.csv", "demo_10.csv"]);
        assert_eq!(names(""), ["demo_2.csv", "demo_10.csv", "other.npy"]);
        for sub in ["part_1", "part_10", "part_9"] {
            std::fs::create_dir(folder.path().join(sub)).unwrap();
            std::fs::write(folder.path().join(sub).join(format!("{sub}.npz")), "").unwrap();
        }
        assert_eq!(names("part_*/*.np[xz]"), ["part_1.npz", "part_9.npz", "part_10.npz"]);
        assert_eq!(names("none.csv"), ["none.csv"]);
        assert!(matches!(expand(&folder.path().join("none*")), Err(FileError::NoMatch { .. })));
        std::fs::create_dir(folder.path().join("empty")).unwrap();
        assert!(
            expand(&folder.path().join("empty")).unwrap_err().to_string().starts_with("no data file is in this folder")
        );
    }
}
