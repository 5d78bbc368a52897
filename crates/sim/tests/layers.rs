//! Which folder may use which: robot, world, recording, then the two experiments. The compiler does not look at this.

use std::fs;
use std::path::{Path, PathBuf};

/// Each folder or file with what it may use of the crate.
const MAY_USE: [(&str, &[&str]); 6] = [
    ("error.rs", &[]),
    ("robot", &["error"]),
    ("world", &["error", "robot"]),
    ("recording", &["error", "robot", "world"]),
    ("reach", &["error", "robot", "world", "recording"]),
    ("interact", &["error", "robot", "world", "recording"]),
];

fn sources(path: &Path) -> Vec<PathBuf> {
    if path.is_file() {
        return vec![path.to_owned()];
    }
    let entries = fs::read_dir(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    entries.flat_map(|entry| sources(&entry.unwrap().path())).collect()
}

/// The first names behind `crate::`, without what stands in tests.
fn used(text: &str) -> Vec<&str> {
    let code = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
    let name = |after: &'_ str| after.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(after.len());
    code.split("crate::").skip(1).map(|after| &after[..name(after)]).collect()
}

#[test]
fn folders_use_only_those_that_they_stand_on() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let (mut problems, mut count) = (Vec::new(), 0);
    for (folder, allowed) in MAY_USE {
        let own = folder.trim_end_matches(".rs");
        for file in sources(&source.join(folder)) {
            let name = file.display().to_string();
            if name.ends_with("tests.rs") {
                continue;
            }
            for other in used(&fs::read_to_string(&file).unwrap()) {
                count += 1;
                if other != own && !allowed.contains(&other) {
                    problems.push(format!("{name}: uses `{other}`, which `{folder}` does not stand on"));
                }
            }
        }
    }
    assert!(problems.is_empty(), "\n{}\n", problems.join("\n"));
    assert!(count > 40, "only {count} uses were found");
    // A folder that is new belongs into the table.
    for entry in fs::read_dir(&source).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        assert!(name == "lib.rs" || MAY_USE.iter().any(|(known, _)| *known == name), "`{name}` is not in the table");
    }
}
