//! House rules that no compiler checks: what documents name exists, layers stay apart, nothing is left undone.
//!
//! A citation is a comment's `(2.22)`, `(2.17)-(2.19)`, `(3.1-3.3, C.1)` and the like. Each needs a row in
//! docs/equations.md. Brackets that hold the word "thesis" name sections, and so do numbers of three parts.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// A text of the project, with its path from the root.
struct Text {
    path: String,
    text: String,
}

impl Text {
    fn read(path: &str) -> Self {
        let text = std::fs::read_to_string(root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"));
        Self { path: path.to_owned(), text }
    }

    /// Line numbers from 1, with code and comment of each line.
    fn lines(&self) -> impl Iterator<Item = (usize, &str, &str)> {
        self.text.lines().enumerate().map(|(index, line)| {
            let (code, comment) = line.split_once("//").unwrap_or((line, ""));
            (index + 1, code, comment)
        })
    }

    fn is_test(&self) -> bool {
        self.path.starts_with("tests/") || self.path.ends_with("tests.rs")
    }
}

/// Adds the files below `folder` whose names end with `ending`, but none of what is built or hidden.
fn collect(folder: &str, ending: &str, found: &mut Vec<Text>) {
    let Ok(entries) = std::fs::read_dir(root().join(folder)) else { return };
    let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    for name in names.iter().filter(|name| !name.starts_with('.') && *name != "target" && *name != "runs") {
        let path = if folder.is_empty() { name.clone() } else { format!("{folder}/{name}") };
        if root().join(&path).is_dir() {
            collect(&path, ending, found);
        } else if name.ends_with(ending) {
            found.push(Text::read(&path));
        }
    }
}

fn sources() -> Vec<Text> {
    let mut found = Vec::new();
    for folder in ["crates", "tests", "benches"] {
        collect(folder, ".rs", &mut found);
    }
    assert!(found.len() > 30, "the sources are not where they were");
    found
}

fn documents() -> Vec<Text> {
    let mut found = Vec::new();
    collect("", ".md", &mut found);
    found
}

fn report(problems: &[String]) {
    assert!(problems.is_empty(), "\n{}\n", problems.join("\n"));
}

/// The number of an equation.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
struct Equation {
    chapter: char,
    number: u32,
    part: &'static str,
}

impl fmt::Display for Equation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "({}.{}{})", self.chapter, self.number, self.part)
    }
}

impl Equation {
    /// `2.22`, `2.25a`, `C.1`; chapters 2 to 5 and appendices have equations.
    fn parse(text: &str) -> Option<Self> {
        let (chapter, number) = text.trim().split_once('.')?;
        let (number, part) = match number.chars().last()? {
            'a' => (&number[..number.len() - 1], "a"),
            'b' => (&number[..number.len() - 1], "b"),
            _ => (number, ""),
        };
        let starts = number.starts_with(|c: char| matches!(c, '1'..='9'));
        let number = number.parse().ok().filter(|_| starts)?;
        let mut letters = chapter.chars();
        match (letters.next(), letters.next()) {
            (Some(chapter @ ('2'..='5' | 'A'..='D')), None) => Some(Self { chapter, number, part }),
            _ => None,
        }
    }

    /// All equations from this one to `last`.
    fn up_to(&self, last: &Self) -> Vec<Self> {
        (self.number..=last.number).map(|number| Self { number, ..self.clone() }).collect()
    }
}

/// The equations in one pair of brackets: a list of numbers and ranges.
fn listed(inside: &str) -> Vec<Equation> {
    if inside.contains("thesis") {
        return Vec::new();
    }
    let item = |item: &str| match item.split_once('-') {
        Some((first, last)) => match (Equation::parse(first), Equation::parse(last)) {
            (Some(first), Some(last)) => first.up_to(&last),
            _ => Vec::new(),
        },
        None => Equation::parse(item).into_iter().collect(),
    };
    inside.split(',').flat_map(item).collect()
}

/// All equations that a line cites.
fn citations(line: &str) -> Vec<Equation> {
    let mut found: Vec<Equation> = Vec::new();
    let mut rest = line;
    // Ends in a dash after a citation: the next one ends a range.
    let mut open = false;
    while let Some((before, after)) = rest.split_once('(') {
        let Some((inside, after)) = after.split_once(')') else { break };
        let equations = listed(inside);
        let is_range = open && before.trim() == "-" && !equations.is_empty();
        if is_range && let Some(first) = found.last().cloned() {
            found.extend(first.up_to(&equations[0]));
        }
        open = !equations.is_empty();
        found.extend(equations);
        rest = if inside.contains('(') { &rest[before.len() + 1..] } else { after };
    }
    found
}

/// A row of docs/equations.md.
struct Row {
    line: usize,
    equations: Vec<Equation>,
    functions: Vec<String>,
    tests: Vec<String>,
}

/// What stands between backticks.
fn quoted(cell: &str) -> Vec<String> {
    cell.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

fn table() -> Vec<Row> {
    let document = Text::read("docs/equations.md");
    let mut rows = Vec::new();
    for (index, line) in document.text.lines().enumerate().filter(|(_, line)| line.starts_with("| (")) {
        let cells: Vec<&str> = line.trim_matches('|').split(" | ").collect();
        assert_eq!(cells.len(), 4, "docs/equations.md:{}: equation, meaning, function, test", index + 1);
        rows.push(Row {
            line: index + 1,
            equations: citations(cells[0]),
            functions: quoted(cells[2]),
            tests: quoted(cells[3]),
        });
    }
    rows
}

/// The names of all tests.
fn tests(sources: &[Text]) -> BTreeSet<&str> {
    let mut found = BTreeSet::new();
    for source in sources {
        let mut marked = false;
        for (_, code, _) in source.lines() {
            let code = code.trim();
            marked |= code == "#[test]";
            if let Some((_, after)) = code.split_once("fn ") {
                if marked {
                    found.extend(after.split('(').next());
                }
                marked = false;
            }
        }
    }
    found
}

/// Whether `name`, e.g. `kernels::panels::multiply` or `forward::Plain::step`, is defined in the file of its module.
/// A name that begins with that of a folder of crates/, e.g. `tasks::`, is of that crate.
fn is_defined(name: &str, sources: &[Text]) -> bool {
    let elsewhere = ["cli", "data", "pages", "report", "reproduce", "run", "sim", "sweep", "tasks"];
    let (folder, name) = match name.split_once("::") {
        Some((place, name)) if elsewhere.contains(&place) => (format!("crates/{place}/src"), name),
        _ => ("crates/scrnn/src".to_owned(), name),
    };
    let mut parts: Vec<&str> = name.split("::").collect();
    let function = parts.pop().unwrap_or_default();
    let kind = parts.pop_if(|part| part.starts_with(char::is_uppercase));
    let module = format!("{folder}/{}", parts.join("/"));
    let files = [format!("{module}.rs"), format!("{module}/mod.rs")];
    sources.iter().filter(|source| files.contains(&source.path)).any(|source| {
        let has = |wanted: &str| source.text.contains(wanted);
        let defined = ["(", "<"].iter().any(|end| has(&format!("fn {function}{end}")));
        defined && kind.is_none_or(|kind| ["struct", "enum"].iter().any(|word| has(&format!("{word} {kind}"))))
    })
}

#[test]
fn citations_are_read_in_every_form() {
    let read = |line: &str| citations(line).iter().map(ToString::to_string).collect::<Vec<_>>().join("");
    assert_eq!(read("u_t (2.2), (2.27); c_t (2.3)"), "(2.2)(2.27)(2.3)");
    assert_eq!(read("open loop (2.25a)"), "(2.25a)");
    for range in ["(2.17)-(2.19)", "(2.17) - (2.19)", "(2.17-2.19)"] {
        let read: BTreeSet<String> = citations(range).iter().map(ToString::to_string).collect();
        assert_eq!(read.into_iter().collect::<String>(), "(2.17)(2.18)(2.19)", "{range}");
    }
    assert_eq!(read("(3.6, 3.7), (C.11-C.12)"), "(3.6)(3.7)(C.11)(C.12)");
    assert_eq!(read("f(x (2.11))"), "(2.11)");
    assert_eq!(read("(thesis 4.2, 5.2), (2.10.1), (1.5 * 2^52), (2.0), (0.3), (7.1), (C.{s + 1}), (2)"), "");
}

#[test]
fn every_equation_that_the_code_cites_has_a_row() {
    let rows: BTreeSet<Equation> = table().into_iter().flat_map(|row| row.equations).collect();
    let (mut problems, mut count) = (Vec::new(), 0);
    for source in sources().iter().filter(|source| source.path.contains("/src/")) {
        for (line, _, comment) in source.lines() {
            for equation in citations(comment) {
                count += 1;
                if !rows.contains(&equation) {
                    problems.push(format!("{}:{line}: {equation} has no row in docs/equations.md", source.path));
                }
            }
        }
    }
    report(&problems);
    assert!(count > 50, "only {count} citations were found");
}

#[test]
fn every_function_and_test_of_the_table_exists() {
    let sources = sources();
    let tests = tests(&sources);
    let mut problems = Vec::new();
    let mut seen = BTreeMap::new();
    for row in table() {
        let at = format!("docs/equations.md:{}", row.line);
        for equation in row.equations.iter().collect::<BTreeSet<_>>() {
            if let Some(other) = seen.insert(equation.clone(), row.line) {
                problems.push(format!("{at}: {equation} stands in line {other} already"));
            }
        }
        for function in row.functions.iter().filter(|name| !is_defined(name, &sources)) {
            problems.push(format!("{at}: there is no function `{function}`"));
        }
        for test in row.tests.iter().filter(|name| !tests.contains(name.as_str())) {
            problems.push(format!("{at}: there is no test `{test}`"));
        }
        if row.functions.is_empty() != row.tests.is_empty() {
            problems.push(format!("{at}: a function needs a test, and a test a function"));
        }
    }
    report(&problems);
    assert!(seen.len() > 30, "only {} equations have a row", seen.len());
}

#[test]
fn tests_that_the_documents_name_exist() {
    let sources = sources();
    let tests = tests(&sources);
    let is_sentence =
        |name: &str| name.matches('_').count() >= 4 && name.chars().all(|c| matches!(c, 'a'..='z' | '0'..='9' | '_'));
    let mut problems = Vec::new();
    for document in documents() {
        for name in document.text.lines().flat_map(quoted).filter(|name| is_sentence(name)) {
            if !tests.contains(name.as_str()) {
                problems.push(format!("{}: there is no test `{name}`", document.path));
            }
        }
    }
    report(&problems);
}

#[test]
fn the_library_opens_no_file_prints_nothing_and_reads_no_clock() {
    let forbidden = ["println!", "print!", "std::fs", "std::time", "std::env", "std::process", "dbg!"];
    let mut problems = Vec::new();
    for source in sources().iter().filter(|source| source.path.starts_with("crates/scrnn/src/") && !source.is_test()) {
        for (line, code, _) in source.lines() {
            for word in forbidden.iter().filter(|word| code.contains(*word)) {
                problems.push(format!("{}:{line}: {word}", source.path));
            }
        }
    }
    report(&problems);
}

/// The modules of a crate: path to file, e.g. `learning::adam` to `learning/adam.rs`.
fn modules<'a>(sources: &'a [Text], folder: &str) -> BTreeMap<Vec<String>, &'a Text> {
    let own = sources.iter().filter_map(|text| Some((text.path.strip_prefix(folder)?.strip_suffix(".rs")?, text)));
    let own = own.filter(|(_, text)| !text.is_test());
    let path =
        |name: &str| -> Vec<String> { name.split('/').filter(|part| *part != "mod").map(str::to_owned).collect() };
    own.map(|(name, text)| (path(name), text)).collect()
}

/// The paths in a tree of `use`.
fn leaves(tree: &syn::UseTree, before: &[String], found: &mut Vec<Vec<String>>) {
    let with = |name: &syn::Ident| [before, &[name.to_string()]].concat();
    match tree {
        syn::UseTree::Path(path) => leaves(&path.tree, &with(&path.ident), found),
        syn::UseTree::Name(name) => found.push(with(&name.ident)),
        syn::UseTree::Rename(name) => found.push(with(&name.ident)),
        syn::UseTree::Glob(_) => found.push(before.to_vec()),
        syn::UseTree::Group(group) => group.items.iter().for_each(|tree| leaves(tree, before, found)),
    }
}

/// Which modules of its crate the module `own` imports. What is handed on by `pub use` is not used, and a module with those
/// below it is one.
fn imports(own: &[String], text: &Text, modules: &BTreeMap<Vec<String>, &Text>) -> BTreeSet<Vec<String>> {
    let file = syn::parse_file(&text.text).unwrap_or_else(|error| panic!("{}: {error}", text.path));
    let mut paths = Vec::new();
    for item in &file.items {
        if let syn::Item::Use(item) = item
            && !matches!(item.vis, syn::Visibility::Public(_))
        {
            leaves(&item.tree, &[], &mut paths);
        }
    }
    let above = own.split_last().map_or(own, |(_, above)| above);
    let whole = |path: &Vec<String>| match path.first()?.as_str() {
        "crate" => Some(path[1..].to_vec()),
        "super" => Some([above, &path[1..]].concat()),
        _ => None,
    };
    let deepest =
        |path: Vec<String>| (1..=path.len()).rev().map(|n| path[..n].to_vec()).find(|p| modules.contains_key(p));
    let found = paths.iter().filter_map(whole).filter_map(deepest);
    found.filter(|other| !other.starts_with(own) && !own.starts_with(other)).collect()
}

/// Files that import each other in a ring of three or more cannot be read one after the other.
#[test]
fn no_more_than_two_files_import_each_other_in_a_ring() {
    let sources = sources();
    let crates: BTreeSet<_> =
        sources.iter().filter_map(|text| text.path.split_once("/src/")).map(|(at, _)| at).collect();
    let mut problems = Vec::new();
    for folder in crates {
        let modules = modules(&sources, &format!("{folder}/src/"));
        let imports: BTreeMap<_, _> =
            modules.iter().map(|(own, text)| (own.clone(), imports(own, text, &modules))).collect();
        let reached = |from: &Vec<String>| {
            let (mut seen, mut open) = (BTreeSet::new(), vec![from.clone()]);
            while let Some(next) = open.pop() {
                open.extend(imports[&next].iter().filter(|other| seen.insert((*other).clone())).cloned());
            }
            seen
        };
        let all: BTreeMap<_, _> = imports.keys().map(|own| (own.clone(), reached(own))).collect();
        for (own, far) in &all {
            let ring: Vec<_> = far.iter().filter(|other| all[*other].contains(own)).map(|p| p.join("::")).collect();
            if ring.len() > 2 && ring[0] == own.join("::") {
                problems.push(format!("{folder}: {}", ring.join(", ")));
            }
        }
    }
    report(&problems);
}

#[test]
fn only_one_file_of_the_program_prints() {
    let words = ["println!", "print!", "io::stdout()", "io::stderr()", "dbg!"];
    let one = "crates/cli/src/output.rs";
    let mut problems = Vec::new();
    for source in sources().iter().filter(|source| source.path.contains("/src/") && source.path != one) {
        let program = source.text.split("#[cfg(test)]").next().unwrap_or_default().lines().count();
        for (line, code, _) in source.lines().take(program).filter(|_| !source.is_test()) {
            // Whether it is a terminal may be asked.
            let code = code.replace("io::stderr().is_terminal()", "");
            for word in words.iter().filter(|word| code.contains(*word)) {
                problems.push(format!("{}:{line}: {word}", source.path));
            }
        }
    }
    report(&problems);
}

#[test]
fn one_file_of_the_library_names_rayon() {
    let sources = sources();
    let names = |source: &&Text| source.path.starts_with("crates/scrnn/src/") && source.text.contains("rayon::");
    let files: Vec<&str> = sources.iter().filter(names).map(|source| source.path.as_str()).collect();
    assert_eq!(files, ["crates/scrnn/src/engine.rs"]);
}

/// Crates whose random numbers all come from `scrnn::streams`. What stands in a file's tests may draw as it likes.
const FROM_STREAMS: [&str; 5] =
    ["crates/scrnn/src/", "crates/tasks/src/", "crates/sim/src/", "crates/reproduce/src/", "crates/sweep/src/"];

#[test]
fn one_file_makes_generators_of_random_numbers() {
    let makes = |source: &&Text| {
        let code = source.text.split("#[cfg(test)]").next().unwrap_or_default();
        let own = FROM_STREAMS.iter().any(|folder| source.path.starts_with(folder)) && !source.is_test();
        own && ["seed_from_u64(", "from_seed(", "set_stream(", "from_rng("].iter().any(|call| code.contains(call))
    };
    let sources = sources();
    let files: Vec<&str> = sources.iter().filter(makes).map(|source| source.path.as_str()).collect();
    assert_eq!(files, ["crates/scrnn/src/streams.rs"]);
}

/// Only the crate whose lint table lets the macros of pyo3 write `unsafe` needs to be looked at: all others forbid it.
#[test]
fn nobody_writes_unsafe_where_only_macros_may() {
    let mut manifests = Vec::new();
    collect("crates", "Cargo.toml", &mut manifests);
    let free: Vec<&str> = manifests
        .iter()
        .filter(|one| !one.text.contains("[lints]\nworkspace = true"))
        .map(|one| one.path.as_str())
        .collect();
    assert_eq!(free, ["crates/python/Cargo.toml"], "crates with a lint table of their own");
    let mut problems = Vec::new();
    for source in sources().iter().filter(|source| source.path.starts_with("crates/python/")) {
        for (line, code, _) in source.lines().filter(|(_, code, _)| code.contains("unsafe")) {
            problems.push(format!("{}:{line}: {code}", source.path));
        }
    }
    report(&problems);
}

#[test]
fn nothing_is_left_undone() {
    let mut problems = Vec::new();
    for source in sources().iter().filter(|source| source.path != "tests/tidy.rs") {
        for (index, line) in source.text.lines().enumerate() {
            for word in ["todo!", "unimplemented!", "TODO", "FIXME", "#[ignore"] {
                if line.contains(word) {
                    problems.push(format!("{}:{}: {word}", source.path, index + 1));
                }
            }
        }
    }
    report(&problems);
}

#[test]
fn every_source_begins_with_what_it_is() {
    let silent = |source: &&Text| !source.text.starts_with("//! ");
    let problems: Vec<String> = sources().iter().filter(silent).map(|source| source.path.clone()).collect();
    report(&problems);
}

/// The part of a link behind `#` that leads to a heading.
fn anchor(heading: &str) -> String {
    let kept = heading.trim().to_lowercase().replace(' ', "-");
    kept.chars().filter(|c| c.is_alphanumeric() || matches!(c, '-' | '_')).collect()
}

#[test]
fn links_in_the_documents_lead_somewhere() {
    let documents = documents();
    let (mut problems, mut count) = (Vec::new(), 0);
    for document in &documents {
        let folder = document.path.rsplit_once('/').map_or("", |(folder, _)| folder);
        for target in document.text.split("](").skip(1).filter_map(|after| after.split(')').next()) {
            if target.contains("://") {
                continue;
            }
            count += 1;
            let (file, heading) = target.split_once('#').unwrap_or((target, ""));
            let path = if file.is_empty() { root().join(&document.path) } else { root().join(folder).join(file) };
            let headings = || {
                let text = std::fs::read_to_string(&path).unwrap_or_default();
                text.lines()
                    .filter(|line| line.starts_with('#'))
                    .map(|line| anchor(line.trim_start_matches('#')))
                    .collect::<Vec<_>>()
            };
            if !path.exists() || !heading.is_empty() && !headings().iter().any(|other| other == heading) {
                problems.push(format!("{}: {target} leads nowhere", document.path));
            }
        }
    }
    report(&problems);
    assert!(count > 10, "only {count} links were found");
}

#[test]
fn the_library_example_in_the_book_is_the_tested_one() {
    let (page, library) = (Text::read("docs/book/src/library.md"), Text::read("crates/scrnn/src/lib.rs"));
    let shown =
        page.text.split("```rust\n# extern crate scrnn;\n").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
    let comments = library.text.lines().filter_map(|line| line.strip_prefix("//!"));
    let tested: String = comments.map(|line| format!("{}\n", line.strip_prefix(' ').unwrap_or(line))).collect();
    assert!(shown.lines().count() > 10 && tested.contains(shown), "{shown}");
}
